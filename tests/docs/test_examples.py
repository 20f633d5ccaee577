# SPDX-License-Identifier: BSD-3-Clause
"""Claims: the examples of README and documentation run as they stand, and do what the page says."""

import ast
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import types
from pathlib import Path
from unittest.mock import MagicMock

import mitsuba as mi
import numpy as np
import pytest

import airlight
from airlight.reports.commands.main import run
from airlight.validation.study.configuration import configuration
from tests.helpers.scenes import tiny_scene
from tests.helpers.shaders import need_opengl

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
#: By renderer: its module, and the variable that names a Python that has it.
RENDERERS = {
    "cycles": ("bpy", "AIRLIGHT_CYCLES_PYTHON"),
    "luxcore": ("pyluxcore", "AIRLIGHT_LUXCORE_PYTHON"),
}


def blocks(page, language, after=""):
    text = (
        page.read_text(encoding="utf-8").partition(after)[2]
        if after
        else page.read_text(encoding="utf-8")
    )
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


@pytest.mark.claim("snippet-of-the-readme")
def test_python_of_the_readme(variant, monkeypatch):
    method, program = blocks(ROOT / "README.md", "python")
    module = types.ModuleType("fog_of_the_readme")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(method, "README.md", "exec"), vars(module))
    whole, half = (
        airlight.render("open-fog", each, size=(16, 12)) for each in ("unshadowed", module.faded)
    )
    np.testing.assert_allclose(half.airlight, 0.5 * whole.airlight, rtol=1e-6)
    ran = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    printed = re.fullmatch(r"relative RMSE (\S+), (\S+) ms a frame\n", ran.stdout)
    assert printed, ran.stdout
    assert 0 < float(printed[1]) < 0.02  # 64 equi-angular steps against shadow edges
    assert float(printed[2]) > 0


def run_commands(page, capfd):
    """Run every command of a page in its order; status 1 is a check of the reference that
    --quick had no time for.
    """
    for line in "".join(blocks(page, "sh")).splitlines():
        program, *words = shlex.split(line)
        assert program == "airlight"
        status = run(words)
        assert status in ((0, 1) if words[0] == "report" else (0,)), (line, capfd.readouterr().err)


@pytest.mark.claim("tutorial", "own-scene")
@pytest.mark.slow
def test_the_tutorial_ends_with_a_figure(variant, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    page = DOCS / "scene-to-figure.md"
    (tmp_path / "gate.xml").write_text(blocks(page, "xml")[0], encoding="utf-8")
    run_commands(page, capfd)
    for name in ("gate.png", "reference.exr", "gate-report/report.html", "gate-report/strip.pdf"):
        assert (tmp_path / name).stat().st_size > 1000, name
    # Several per cent with 32 steps, as the page says.
    (relative,) = re.findall(
        r"^rmse .* relative ([\d.]+) %$", capfd.readouterr().out, flags=re.MULTILINE
    )
    assert 1 < float(relative) < 10


@pytest.mark.claim("own-method", "engine-pixels")
@pytest.mark.slow
def test_a_method_and_an_image_are_validated_as_the_page_says(
    variant, tmp_path, monkeypatch, capfd
):
    """Both end in a report and a chart: the function with its point, the image without a time."""
    monkeypatch.chdir(tmp_path)
    page = DOCS / "validate-your-method.md"

    def methods_of(folder):
        return json.loads((tmp_path / folder / "report.json").read_text(encoding="utf-8"))[
            "scenes"
        ][0]["methods"]

    need_opengl()
    shutil.copy(DOCS / "examples" / "marcher.glsl", tmp_path / "fog.glsl")
    (tmp_path / "fog.py").write_text(blocks(page, "python")[0], encoding="utf-8")
    run_commands(page, capfd)
    assert (tmp_path / "validation/frame-speed.pdf").stat().st_size > 1000
    assert "fog.py:marched" in (tmp_path / "validation/methods-table.tex").read_text(
        encoding="utf-8"
    )
    (marched,) = (
        entry for entry in methods_of("validation") if entry["label"].startswith("fog.py:marched")
    )
    assert marched["times"]["frame"]["median_ms"] > 0
    assert marched["error"]["relative_rmse"] > 0
    (shader,) = (entry for entry in methods_of("shader") if entry["method"] == "fog.glsl")
    assert shader["device"]
    assert shader["error"]["relative_rmse"] < 0.05
    measured = methods_of("engine")
    (image,) = (entry for entry in measured if entry["kind"] == "image")
    assert image["error"]["relative_rmse"] > 0
    assert image["times"] is None


@pytest.mark.slow
def test_a_method_that_makes_an_array_is_judged_as_the_page_says(variant, tmp_path, capsys):
    page = DOCS / "validate-your-method.md"
    (code,) = (each for each in blocks(page, "python") if "airlight.rays" in each)
    exec(compile(code, str(page), "exec"), {})
    bias, rmse = re.findall(r"[+-]?\d+\.\d(?=%)", capsys.readouterr().out)
    assert abs(float(bias)) <= 0.1
    assert float(rmse) <= 0.5


@pytest.mark.claim("notebook-cells")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "engine", "fit", "sweep", "clouds"])
def test_a_notebook_runs_and_prints_what_it_says(variant, tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    if name == "sweep":
        pytest.importorskip("distributed", reason="the extra `sweep` is not installed")
    path = DOCS / f"notebooks/{name}.ipynb"
    notebook = types.ModuleType("notebook_of_the_docs")
    # methods are functions at the top of a module
    monkeypatch.setitem(sys.modules, notebook.__name__, notebook)
    displayed = 0
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    for cell in (each for each in cells if each["cell_type"] == "code"):
        capsys.readouterr()
        shown = _run_cell("".join(cell["source"]), vars(notebook))
        printed = "".join(line for o in cell["outputs"] for line in o.get("text", ()))
        now = capsys.readouterr().out
        assert _without_numbers(now) == _without_numbers(printed)
        # Nothing here depends on the machine but rounding, and what samples and kernels make of it.
        np.testing.assert_allclose(_numbers(now), _numbers(printed), rtol=0.5, atol=2e-3)
        for data in (o["data"] for o in cell["outputs"] if "data" in o):
            displayed += 1
            kept, drawn = "".join(data["text/html"]), shown._repr_html_()
            assert ("<img" in drawn, "<table" in drawn) == ("<img" in kept, "<table" in kept)
    assert displayed or name == "sweep"


def _run_cell(code, space):
    """Run a cell of a notebook, and return the value of its last expression, if it ends in one."""
    body = ast.parse(code).body
    last = body.pop() if isinstance(body[-1], ast.Expr) and not code.endswith(";") else None
    exec(compile(ast.Module(body, []), "cell", "exec"), space)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), space) if last else None


_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]\d+)?"


def _without_numbers(text):
    return re.sub(_NUMBER, "#", text)


def _numbers(text):
    return [float(digits) for digits in re.findall(_NUMBER, text)]


@pytest.fixture
def fog(tmp_path):
    """The examples of docs/your-method.md as files; the first one's path."""
    names = ("fog", "plain", "veil", "kernel")
    for name, block in zip(names, blocks(DOCS / "your-method.md", "python"), strict=True):
        (tmp_path / f"{name}.py").write_text(block, encoding="utf-8")
    return tmp_path / "fog.py"


@pytest.mark.claim("own-method")
def test_the_worked_method_is_measured_like_a_built_in_one(fog, variant):
    """Steps in the angle without shifts are `ray-march`; twice as many come
    closer to the reference.
    """

    from airlight.realtime.scene.read_scene import read_scene
    from airlight.reference.quadrature.reference import reference_image
    from airlight.validation.study.reference import of_image
    from airlight.validation.study.run import run
    from airlight.validation.study.study import Cell, Measure

    loaded = mi.load_dict(tiny_scene())
    scene, reference = read_scene(loaded), of_image(reference_image(loaded))
    size = scene.camera.width, scene.camera.height

    def measured(method, **parameters):
        cell = Cell(
            "tiny", size, (), configuration(method, None, parameters), Measure("stages", 0.01)
        )
        row, frame = run(cell, scene, reference)
        assert (row.reason, row.note) == (None, None)
        return row.error.relative_rmse, frame.airlight

    own, built_in = (
        measured(f"{fog}:interleaved", steps=16, jitter="no"),
        measured("ray-march", steps=16),
    )
    # The same sum in another order, in float32.
    np.testing.assert_allclose(own[1], built_in[1], rtol=2e-5)
    shifted, finer = (measured(f"{fog}:interleaved", steps=steps)[0] for steps in (16, 64))
    assert finer < 0.5 * shifted < 0.05


@pytest.mark.claim("own-method")
def test_the_plain_method_returns_what_the_page_says(fog, variant):
    from airlight.realtime.frame.image import render_frame
    from airlight.realtime.scene.read_scene import read_scene
    from airlight.validation.study.configuration import prepared

    scene = read_scene(mi.load_dict(tiny_scene()))
    frame = render_frame(prepared(scene, configuration(f"{fog.parent / 'plain.py'}:uniform_fog")))
    wanted = 0.1 * (1 - np.exp(-0.31 * frame.distance[..., None])) * np.array([0.9, 0.8, 0.7])
    np.testing.assert_allclose(frame.airlight, wanted, rtol=1e-5)  # float32


@pytest.mark.claim("kernel-of-the-page")
@pytest.mark.slow
def test_the_kernel_of_the_page(variant, tmp_path, monkeypatch):
    """The snippet is what it says: `equiangular` with twelve steps."""
    from airlight.validation.kernels.case_files import read_cases
    from airlight.validation.kernels.cases import integrate_cases

    code = blocks(DOCS / "your-method.md", "python")[-1]
    (tmp_path / "twelve_steps_of_a_page.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    cases = read_cases(ROOT / "validation/certified/airlight_integral.csv")
    kernels = ("twelve_steps_of_a_page:midpoint", "equiangular-12")
    own, expected = (integrate_cases(cases, kernel, "double") for kernel in kernels)
    both = np.isfinite(own) & np.isfinite(expected)
    assert both.mean() > 0.9
    # Operations in another order; where theta nears pi/2 the tangent makes more of their rounding.
    difference = np.abs(own - expected)[both] / np.maximum(np.abs(expected[both]), 1e-300)
    assert np.percentile(difference, 90) < 1e-9


def interpreter(renderer):
    """Return the Python that an environment variable names, or this one if it has the module."""
    module, variable = RENDERERS[renderer]
    if named := os.environ.get(variable):
        return named
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"no {module} here; {variable} can name a Python that has it")
    return sys.executable


def test_scripts_of_engines_refuse_what_they_leave_out(monkeypatch):
    """A sky, height fog and a texture: the image would lack them, or the script would end."""
    monkeypatch.syspath_prepend(str(DOCS / "examples"))
    monkeypatch.setitem(
        sys.modules, "pyluxcore", types.SimpleNamespace(Properties=object, Scene=object)
    )
    luxcore, cycles = map(importlib.import_module, ("render_luxcore", "cycles_properties"))
    fog = {"sigma_s": [0.1] * 3, "sigma_a": [0.0] * 3, "phase": {"name": "isotropic"}}
    fog |= {"sigma_t": [0.1] * 3}
    floor = {"name": "floor", "reflectance": [0.5] * 3, "two_sided": True, "diffuse": True}
    plain = {"sky": None, "medium": fog, "surfaces": [floor | {"textured": False}]}
    luxcore.check(plain)
    for change, words in (
        ({"sky": {"radiance": [1.0] * 3}}, "no sky"),
        ({"medium": {"layers": [], "phase": {"name": "isotropic"}}}, "homogeneous media alone"),
        ({"surfaces": [floor | {"textured": True}]}, "surface floor has a texture"),
    ):
        with pytest.raises(SystemExit, match=words):
            luxcore.check(plain | change)
    axes = {"right": [1, 0, 0], "up": [0, 0, 1], "forward": [0, 1, 0], "position": [0, 0, 0]}
    scene = plain | {"up": "z", "lights": [], "bounded_media": []}
    scene |= {"camera": axes | {"size": [4, 3], "fov_horizontal": 50.0}}
    assert "phase" in cycles.cycles_properties(scene)["world"]
    assert "sky" in cycles.cycles_properties(scene | {"sky": {}})["world"]["cannot"]
    # Volumes of Blender add up: the image would have the fog around inside of bounded media too.
    scene |= {"bounded_media": [fog | {"name": "body"}]}
    assert "add up" in cycles.cycles_properties(scene)["world"]["cannot"]
    clear = fog | {"sigma_t": [0.0] * 3, "sigma_s": [0.0] * 3}
    for around in (None, clear):
        made = cycles.cycles_properties(scene | {"medium": around})
        assert "cannot" not in (made["world"] or {})
        assert made["media"]["body"]["inputs"]["Scatter Coefficients"] == [0.1] * 3


def test_luxcore_lights_a_surface_of_one_side_from_there_alone(monkeypatch):
    """It was lit from behind too: its own matte material has two sides."""
    monkeypatch.syspath_prepend(str(DOCS / "examples"))
    monkeypatch.setitem(
        sys.modules, "pyluxcore", types.SimpleNamespace(Properties=object, Scene=object)
    )
    luxcore = importlib.import_module("render_luxcore")
    wall = {"reflectance": [0.5, 0.4, 0.3]}
    for two_sided, back in ((True, [0.5, 0.4, 0.3]), (False, [0.0] * 3)):
        made = luxcore.material("wall", wall | {"two_sided": two_sided})
        assert made["scene.materials.wall.type"] == "twosided"
        for side, reflectance in (("front", [0.5, 0.4, 0.3]), ("back", back)):
            named = made[f"scene.materials.wall.{side}material"]
            assert made[f"scene.materials.{named}.kd"] == reflectance


def test_faults_of_colours_reach_bodies_in_a_vacuum(monkeypatch):
    """Red and blue changed places in the medium around, and without one the tool ended."""
    for folder in ("examples", "tools"):
        monkeypatch.syspath_prepend(str(DOCS / folder))
    for name in ("bpy", "mathutils"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    faults = importlib.import_module("cycles_faults")
    inputs = {"Scatter Coefficients": [1.0, 2.0, 3.0], "Absorption Coefficients": [4.0, 5.0, 6.0]}
    for around in (None, {"inputs": {name: list(value) for name, value in inputs.items()}}):
        body = {"inputs": {name: list(value) for name, value in inputs.items()}}
        faults.other_channels(
            {"world": around, "media": {"body": body}, "lights": [], "materials": {}}
        )
        for medium in (body, *([] if around is None else [around])):
            assert list(medium["inputs"].values()) == [[3.0, 2.0, 1.0], [6.0, 5.0, 4.0]]


@pytest.mark.slow
@pytest.mark.claim("engine-renderers", "engine-pixels", "engine-verdict")
@pytest.mark.parametrize(
    ("renderer", "scene", "options"),
    [
        ("cycles", "open-fog", ["--samples", "128"]),
        ("cycles", "sphere-spot", ["--samples", "128"]),
        ("cycles", "sphere-spot", ["--samples", "128", "--layers"]),
        ("luxcore", "open-fog", ["--samples", "1024"]),
    ],
)
def test_an_engine_that_knows_the_description_alone_is_called_right(
    renderer, scene, options, variant, tmp_path, capsys
):
    python = interpreter(renderer)
    described, gltf, image = (tmp_path / f"{scene}.{ending}" for ending in ("json", "glb", "exr"))
    assert run(["describe", scene, "--size", "80x60", "--json", "-o", str(gltf)]) == 0
    described.write_text(capsys.readouterr().out)
    script = str(DOCS / "examples" / f"render_{renderer}.py")
    command = [python, script, str(described), str(gltf), str(image), *options]
    subprocess.run(command, capture_output=True, text=True, check=True)
    layer = ["--layer", "ViewLayer.Volume Direct"] if "--layers" in options else []
    assert run(["compare", scene, str(image), *layer, "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)["result"]
    assert compared["verdict"]["right"], compared["verdict"]["reasons"]
    assert abs(compared["hints"]["factor"] - 1) < 0.005


@pytest.mark.slow
@pytest.mark.claim("diagnosis-cycles")
def test_what_is_set_wrong_in_cycles_is_named(variant, tmp_path, monkeypatch):
    """A right image, and faults of the medium, the light, the camera and the values."""
    from airlight.validation.engine.diagnose import diagnose_file

    injected = {
        "right": "right",
        "extinction-0.9": "extinction",
        "near-0.1": "near-plane",
        "spot-half": "spot-angle",
        "linear-falloff": "distance-law",
        "shift-1": "shift",
        "black-level": "black-level",
        "agx": "tone-map",
    }
    python = interpreter("cycles")
    monkeypatch.syspath_prepend(str(DOCS / "tools"))
    render_faults = importlib.import_module("cycles_round_trips").render_faults
    render_faults(
        python, "sphere-spot", tmp_path, samples=256, size=(80, 60), faults=list(injected)
    )
    images = {fault: tmp_path / f"{fault}.exr" for fault in injected}
    named = {
        fault: diagnose_file(image, "sphere-spot", pixel="area")[0].first
        for fault, image in images.items()
    }
    assert named == injected
