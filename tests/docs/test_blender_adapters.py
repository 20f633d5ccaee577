# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the adapters of Blender's engines refuse what these cannot have, find the Python that has
`bpy`, and name the equation that settings mean; Cycles is right by physics.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.storage.exr import read_exr
from airlight.validation.scenes.models import model_of

ROOT = Path(__file__).resolve().parents[2]
ADAPTERS = ROOT / "docs" / "adapters"
ENGINES = ("cycles", "eevee")
VARIABLE = "AIRLIGHT_CYCLES_PYTHON"


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


@pytest.fixture
def ran(engine, tmp_path, monkeypatch):
    """A function that runs an adapter on a machine where `import bpy` raises an error, and returns
    its status and its one line.
    """
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.delenv(VARIABLE, raising=False)

    def run(*words, error="ModuleNotFoundError(\"No module named 'bpy'\")"):
        (tmp_path / "bpy.py").write_text(f"raise {error}\n")
        command = [sys.executable, str(ADAPTERS / f"{engine}.py"), *words]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert ended.stdout == ""
        assert ended.stderr.count("\n") == 1
        return ended.returncode, ended.stderr.strip()

    return run


FILES = ("scene.json", "scene.glb", "out.exr")


@pytest.mark.claim("capture-contract")
@pytest.mark.parametrize(
    ("word", "of", "why"),
    [
        ("shiny=3", "", " has no setting 'shiny' here; it has "),
        ("edit=a~b~c", "", ": its shaders cannot be edited"),
        ("samples=many", "cycles", "samples: got 'many', expected a whole number"),
        ("samples=1e3", "cycles", "samples: got '1e3', expected a whole number"),
        ("filter_width=nan", "cycles", "filter_width: got 'nan', expected a number"),
        ("use_shadows=yes", "eevee", "use_shadows: got 'yes', expected true or false"),
        ("volumetric_end=far", "eevee", "volumetric_end: got 'far', expected a number"),
    ],
)
def test_a_wrong_setting_is_told_before_anything_is_looked_for(ran, engine, word, of, why):
    if of in ("", engine):
        status, line = ran(*FILES, word)
        assert status == 2
        assert why in line
    else:
        assert f" has no setting '{word.partition('=')[0]}' here" in ran(*FILES, word)[1]


def test_an_adapter_without_files_says_how_it_is_called(ran, engine):
    expected = f"expected {engine}.py SCENE.json SCENE.glb OUT.exr NAME=VALUE..."
    assert ran("scene.json") == (2, expected)


@pytest.mark.claim("capture-contract")
def test_a_missing_module_is_told_with_the_line_to_type(ran, tmp_path, monkeypatch):
    status, line = ran(*FILES)
    place = tmp_path / "cache" / "adapters-bpy-5.0.1"
    install = f"python3.11 -m venv {place} && {place}/bin/python -m pip install bpy==5.0.1"
    assert status == 3
    assert line.endswith(f": the module bpy is missing: `{install}`, which takes 1 GB")
    # The variable names no program, or a Python without the module under another name.
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    status, line = ran(*FILES)
    assert (status, f"which is no program: `unset {VARIABLE} && {install}`" in line) == (3, True)
    python = tmp_path / "a python"
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    monkeypatch.setenv(VARIABLE, str(python))
    status, line = ran(*FILES)
    assert status == 3
    assert line.endswith(f"which has no module bpy: `'{python}' -m pip install bpy==5.0.1`")
    # The module is there, and a library of the system is not.
    status, line = ran(*FILES, error='ImportError("libSM.so.6: cannot open")')
    assert status == 3
    assert "bpy does not load: libSM.so.6: cannot open: `apt-get install -y libgl1 libsm6" in line


@pytest.mark.claim("capture-contract")
@pytest.mark.parametrize("place", ["named", "cache"])
def test_the_python_that_has_the_module_is_started(engine, place, tmp_path, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "bpy.py").write_text("raise ModuleNotFoundError('bpy')\n")
    python = tmp_path / "adapters-bpy-5.0.1" / "bin" / "python"
    monkeypatch.delenv(VARIABLE, raising=False)
    if place == "named":
        python = tmp_path / "python"
        monkeypatch.setenv(VARIABLE, str(python))
    python.parent.mkdir(parents=True, exist_ok=True)
    python.write_text('#!/bin/sh\necho "$0" "$@"\n')
    python.chmod(0o755)
    command = [str(ADAPTERS / f"{engine}.py"), *FILES]
    started = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True)
    assert started.stdout.split() == [str(python), *command]


@pytest.fixture
def adapter(monkeypatch):
    """A function that returns the module of an adapter by its name."""
    monkeypatch.setattr(sys, "path", list(sys.path))

    def module(name):
        found = importlib.util.spec_from_file_location(f"adapter_{name}", ADAPTERS / f"{name}.py")
        made = importlib.util.module_from_spec(found)
        found.loader.exec_module(made)
        return made

    yield module
    sys.modules.pop("blender", None)


BOTH, EEVEE = ENGINES, ("eevee",)


@pytest.mark.parametrize(
    ("scene", "changed", "by", "why"),
    [
        ("open-fog", {}, (), ""),
        ("windows", {}, (), ""),
        ("mist", {}, BOTH, "height fog and grids were not tried in Cycles"),
        ("penumbra-plane", {}, BOTH, "area lights were not tried in Cycles"),
        ("open-fog", {"sky": {"sun": [1, 1, 1]}}, BOTH, "the light of a sky was not tried"),
        ("sphere-spot", {"beam_angle": 10}, BOTH, "the edge of Blender's spots is another funct"),
        ("three-media", {}, EEVEE, "EEVEE: it has no phase function rayleigh"),
        ("open-fog", {"phase": {"name": "rayleigh"}}, EEVEE, "it has no phase function rayleigh"),
        ("open-fog", {"phase": {"name": "draine"}}, BOTH, "Cycles has no draine phase function"),
    ],
)
def test_a_scene_that_an_engine_cannot_have_is_refused(
    variant, adapter, monkeypatch, scene, changed, by, why
):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "examples"))
    from cycles_properties import cycles_properties

    described = airlight.describe(scene).enveloped("airlight describe")["result"]
    for name, value in changed.items():
        places = {"beam_angle": described["lights"][0], "phase": described["medium"]}
        places.get(name, described)[name] = value
    for name in ENGINES:
        engine = adapter(name).ENGINE
        refusal = sys.modules["blender"].refusal
        said = refusal(engine, described, cycles_properties(described))
        if name in by:
            assert said.startswith(engine.name)
            assert why in said
        else:
            assert said is None


@pytest.mark.parametrize(
    ("settings", "model", "pixel"),
    [
        ({}, "physical", "centre"),
        ({"max_bounces": 4, "volume_bounces": 2}, None, "centre"),
        ({"max_bounces": 4, "diffuse_bounces": 2}, None, "centre"),
        ({"max_bounces": 4}, "physical", "centre"),
        ({"volume_bounces": 4}, "physical", "centre"),
        ({"sample_clamp_direct": 1.0}, None, "centre"),
        ({"pixel_filter_type": "BOX"}, "physical", "area"),
        ({"filter_width": 1.5}, "physical", None),
    ],
)
def test_cycles_is_physical_with_one_scattering(adapter, settings, model, pixel):
    engine = adapter("cycles").ENGINE
    made = engine.settings | settings
    assert (engine.model(made), engine.pixel(made)) == (model, pixel)
    assert model is None or model_of(model).is_physical


@pytest.mark.parametrize(
    ("settings", "path"),
    [
        ({}, ""),
        ({"use_volumetric_shadows": False}, "light-path=off,"),
        ({"use_shadows": False}, None),
        ({"use_raytracing": True}, None),
        ({"use_volume_custom_range": False}, None),
        ({"clamp_volume_direct": 3.0}, None),
        ({"clamp_surface_direct": 3.0}, None),
    ],
)
def test_the_equation_of_eevee_is_that_of_its_settings(adapter, settings, path):
    engine = adapter("eevee").ENGINE
    made = engine.settings | {"volumetric_end": 20.5, "cutoff_distance": 205.0} | settings
    model = engine.model(made)
    assert engine.pixel(made) == "centre"
    if path is None:
        assert model is None
        return
    lamps = "range=quartic:205,spot=cosine-smooth"
    assert model == f"{path}{lamps},ends=planes:0.02:20.5,surface.light-path=off"
    assert not model_of(model).is_physical


def test_a_channel_without_extinction_ends_no_fog_of_eevee(adapter, monkeypatch):
    nothing = SimpleNamespace(data=SimpleNamespace(objects=[]))
    monkeypatch.setitem(sys.modules, "bpy", nothing)
    monkeypatch.setitem(sys.modules, "mathutils", SimpleNamespace(Vector=tuple))
    described = {"camera": {"position": [0, 0, 0]}, "lights": []}
    far = adapter("eevee").farthest
    assert far(described | {"medium": {"sigma_t": [0.5, 0.0, 0.2]}}) == 101
    assert far(described | {"medium": {"sigma_t": [0.5, 0.1, 0.2]}}) == 80


# With Blender.


@pytest.fixture
def blender(variant, monkeypatch):
    if not os.environ.get(VARIABLE):
        if importlib.util.find_spec("bpy") is None:
            pytest.skip(f"no bpy here; {VARIABLE} can name a Python that has it")
        monkeypatch.setenv(VARIABLE, sys.executable)


@pytest.mark.slow
@pytest.mark.usefixtures("blender")
@pytest.mark.claim("capture-judged", tolerance="blocks within 1 %, which `compare` calls right")
@pytest.mark.parametrize("scene", ["open-fog", "sphere-spot"])
def test_cycles_is_right_by_physics_and_repeats_bit_by_bit(scene, tmp_path):
    out, again = tmp_path / "out.exr", tmp_path / "again.exr"
    given = {"size": (64, 48), "settings": {"samples": 256}}
    made = airlight.capture("cycles", scene, output=out, **given)
    assert (made.model, made.pixel, made.device) == ("physical", "centre", "CPU")
    assert (made.settings["samples"], made.settings["seed"]) == (256, 1)
    judged = airlight.compare(scene, out, model=made.model, pixel=made.pixel)
    assert judged.verdict.right, judged.text()
    assert judged.verdict.block_error < 0.002
    # The layers are the airlight and the rest, which is the surfaces.
    exact = airlight.reference(scene, size=(64, 48))
    layers = read_exr(out).layers
    assert abs(layers["surface"].mean() - np.mean(exact.surface)) < 0.02 * np.mean(exact.total)
    airlight.capture("cycles", scene, output=again, **given)
    assert out.read_bytes() == again.read_bytes()


@pytest.mark.slow
@pytest.mark.usefixtures("blender")
@pytest.mark.parametrize(
    ("engine", "scene", "word", "why"),
    [
        (
            "cycles",
            "open-fog",
            "filter_width=0.001",
            "filter_width: got '0.001', and Blender takes 0",
        ),
        (
            "cycles",
            "open-fog",
            "pixel_filter_type=TENT",
            "got 'TENT': enum \"TENT\" not found in ('B",
        ),
        ("cycles", "mist", "samples=1", "Cycles: height fog and grids were not tried in Cycles"),
        (
            "eevee",
            "open-fog",
            "volumetric_samples=1000",
            "got '1000', and Blender takes 256 in its",
        ),
        (
            "eevee",
            "open-fog",
            "volumetric_tile_size=3",
            "got '3': enum \"3\" not found in ('1', '2'",
        ),
    ],
)
def test_a_value_that_blender_changes_is_refused(engine, scene, word, why, tmp_path):
    given = {"size": (16, 12), "output": tmp_path / "out.exr", "settings": [word]}
    with pytest.raises(InputError) as caught:
        airlight.capture(engine, scene, **given)
    assert why in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("blender")
def test_things_close_to_a_lamp_cast_shadows_in_eevee(tmp_path):
    """The near end of a shadow map is 1/4000 of a lamp's range: too far a range lights these."""
    given = {"size": (64, 48), "output": tmp_path / "out.exr"}
    ratios = {}
    for name, settings in (("own", {}), ("far", {"cutoff_distance": 3000})):
        made = airlight.capture("eevee", "omni-box", settings=settings, **given)
        exact = airlight.reference("omni-box", size=(64, 48), model=made.model)
        ratios[name] = read_exr(made.path).layers["surface"].mean() / np.mean(exact.surface)
        assert made.device
    assert abs(ratios["own"] - 1) < 0.05, ratios
    assert ratios["far"] > 1.1, ratios
