# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `capture` runs the adapter of an engine by its contract alone, ends it in time, and writes
whole images; engines of the browser are judged right by the equation that their settings mean.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.reports.commands.main import run
from airlight.reports.machine import engine_adapter
from airlight.reports.machine.environment import MissingError
from tests.helpers.scenes import tiny_scene

ROOT = Path(__file__).resolve().parents[3]
ADAPTERS = ROOT / "docs" / "adapters"
MODEL = "light-path=off,law=softened:1"
#: An engine that copies an image, and does what its setting `do` says.
FAKE = """#!{python}
import json, os, pathlib, shutil, struct, sys, time

here = pathlib.Path(__file__).parent
scene, glb, out, *words = sys.argv[1:]
settings = dict(word.split("=", 1) for word in words)
do = settings.get("do", "")
told = {{"engine": "Fake", "version": "1.2", "settings": settings, "seconds": 0.25, "problems": ["a lamp blew"],
        "model": "{model}", "pixel": "centre", "device": os.environ["AIRLIGHT_LIMIT"]}}
(here / "given.json").write_text(json.dumps(
    {{"scene": json.load(open(scene)), "magic": open(glb, "rb").read(4).decode(), "words": words,
      "cache": os.environ["AIRLIGHT_CACHE_DIR"], "temporary": os.environ["TMPDIR"]}}))
if do == "refuse":
    sys.exit(print("Fake: it has no fog", file=sys.stderr) or 2)
if do == "miss":
    sys.exit(print("a browser is missing: `get a browser`", file=sys.stderr) or 3)
if do == "raise":
    raise ValueError("the sky fell")
if do == "hang":
    (here / "pid").write_text(str(os.getpid()))
    time.sleep(600)
if do == "image-named.exr":
    told["layers"] = {{"airlight": "fog", "total": "everything"}}
image = here / (do[6:] if do.startswith("image-") else "whole.exr")
if do != "no-image":
    shutil.copy(image, out)
print("starting")
print({{"no-json": "done", "number": "3", "lacks": '{{"engine": "Fake"}}'}}.get(do) or json.dumps(told))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the adapter of an engine, and what that copies."""
    made = tmp_path_factory.mktemp("adapters")
    text = FAKE.format(python=sys.executable, model=MODEL)
    (made / "fake.py").write_text(text)
    (made / "odd.py").write_text(text.replace(MODEL, "light-path=sideways"))
    (made / "lost.xyz").write_text("#!/usr/bin/env nowhere-to-be-found\n")
    (made / "README.md").write_text("# no adapter\n")
    fog, wall = np.full((12, 16, 3), 0.5), np.full((12, 16, 3), 0.25)
    write_exr(made / "whole.exr", Image({"airlight": fog, "surface": wall}))
    write_exr(made / "lacks.exr", Image({"airlight": fog}))
    write_exr(made / "small.exr", Image({"airlight": fog[1:], "surface": wall[1:]}))
    write_exr(made / "named.exr", Image({"fog": fog, "everything": fog + wall}))
    fog[3, 4, 1] = np.nan
    write_exr(made / "nan.exr", Image({"airlight": fog, "surface": wall}), finite=False)
    (made / "text.exr").write_text("no image")
    return made


@pytest.fixture
def words(folder, tmp_path):
    """The words of a capture by that adapter."""
    out = str(tmp_path / "out.exr")
    return ["capture", "fake", "open-fog", "--size", "16x12", "-o", out, "--adapters", str(folder)]


@pytest.mark.claim("capture-contract")
def test_an_adapter_gets_the_scene_and_the_settings(variant, words, folder, tmp_path, capsys):
    more = ["--set", "steps=7", "--set", "law=a=b", "--edit", "chunk~x + 1~", "--limit", "77"]
    assert run([*words, *more, "--change", "medium.sigma_t=0.1", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    given = json.loads((folder / "given.json").read_text())
    assert given["words"] == ["steps=7", "law=a=b", "edit=chunk~x + 1~"]
    assert given["magic"] == "glTF"
    assert given["scene"]["result"]["camera"]["size"] == [16, 12]
    assert given["scene"]["result"]["medium"]["sigma_t"] == [0.1, 0.1, 0.1]
    assert given["cache"] == os.environ["AIRLIGHT_CACHE_DIR"]
    assert not Path(given["temporary"]).exists()
    result = said["result"]
    assert (result["engine"], result["version"], result["seconds"]) == ("Fake", "1.2", 0.25)
    assert result["settings"] == {"steps": "7", "law": "a=b", "edit": "chunk~x + 1~"}
    assert (result["device"], result["edits"]) == ("77", ["chunk~x + 1~"])
    assert (result["model"], result["problems"]) == (MODEL, ["a lamp blew"])
    out = tmp_path / "out.exr"
    assert result["judge"] == (
        f"airlight compare open-fog {out} --change medium.sigma_t=0.1 --pixel centre "
        f"--model {MODEL}"
    )
    # The layers are those of the adapter, and the header says what made them.
    image = read_exr(out)
    assert {name: values.mean() for name, values in image.layers.items()} == {
        "airlight": 0.5,
        "surface": 0.25,
        "total": 0.75,
    }
    header = {name: image.attributes[f"airlight:{name}"] for name in ("engine", "engine-version")}
    assert header == {"engine": "Fake", "engine-version": "1.2"}
    assert json.loads(str(image.attributes["airlight:settings"]))["steps"] == "7"
    assert str(image.attributes["airlight:model"]).startswith("light-path=off,law=softened:1")


def test_the_text_has_the_command_that_judges_the_image(variant, words, folder, tmp_path, capsys):
    assert run(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "open-fog in Fake 1.2, 16 x 12"
    assert "the engine said: a lamp blew" in lines
    judge = f"airlight compare open-fog {tmp_path / 'out.exr'} --pixel centre --model {MODEL}"
    assert lines[-1] == f"to judge it: {judge}"
    # From Python: the same, with settings by name.
    made = airlight.capture(
        "fake",
        "open-fog",
        size=(16, 12),
        output=tmp_path / "out.exr",
        adapters=folder,
        settings={"steps": 3},
    )
    assert (made.command, made.settings) == (judge, {"steps": "3"})
    assert repr(made) == "Capture(open-fog in Fake 1.2, 16 x 12)"
    # An engine may call its layers otherwise, and have the surfaces in its whole light alone.
    named = airlight.capture(
        "fake",
        "open-fog",
        size=(16, 12),
        output=tmp_path / "out.exr",
        adapters=folder,
        settings=["do=image-named.exr"],
    )
    layers = read_exr(named.path).layers
    assert {name: values.mean() for name, values in layers.items()} == {
        "airlight": 0.5,
        "surface": 0.25,
        "total": 0.75,
    }


@pytest.mark.claim("capture-contract")
@pytest.mark.parametrize(
    ("do", "status", "why"),
    [
        ("refuse", 2, "error: Fake: it has no fog"),
        ("miss", 3, "error: a browser is missing: `get a browser`"),
        ("raise", 2, "its adapter failed with the status 1: ValueError: the sky fell"),
        ("hang", 2, "fake: no answer within 2 s; its process was ended; --limit 4 allows more"),
        ("no-json", 2, "fake: its adapter printed 'done', expected one line of JSON"),
        ("number", 2, "fake: its adapter printed '3', expected one line of JSON"),
        ("lacks", 2, "missing required field `version`"),
        ("no-image", 2, "fake: its adapter wrote no image"),
        ("image-lacks.exr", 2, "fake: its image has no layer 'surface'; it has airlight, total"),
        ("image-small.exr", 2, "fake: its image has 16 x 11 pixels; expected 16 x 12"),
        ("image-nan.exr", 2, "fake: 1 pixels of its layer airlight are not finite"),
        ("image-text.exr", 2, "fake: its image is not"),
    ],
)
def test_an_adapter_that_fails_is_told_in_one_line(
    variant, words, tmp_path, capsys, do, status, why
):
    assert run([*words, "--limit", "2" if do == "hang" else "60", "--set", f"do={do}"]) == status
    printed = capsys.readouterr()
    assert why in printed.err
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert not list(tmp_path.iterdir())


def test_a_model_that_nobody_knows_is_refused(variant, words, tmp_path):
    words[1] = "odd"
    assert run(words) == 2
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"output": None}, "output: expected a file to write, such as -o fake.exr"),
        ({"output": "x.png"}, "expected a name that ends in .exr"),
        ({"limit": 0}, "limit: got 0, expected a time above 0"),
        ({"edit": "chunk~from"}, "edit: got 'chunk~from', expected CHUNK~FROM~TO"),
        ({"edit": ["~from~to"]}, "edit: got '~from~to', expected CHUNK~FROM~TO"),
        ({"settings": "steps"}, "--set: got 'steps', expected NAME=VALUE"),
        ({"settings": {"edit": "a~b~c"}}, "settings: edit is an option of its own"),
        ({"engine": "fak"}, "fake, lost, odd; did you mean 'fake'?"),
        ({"adapters": "nowhere"}, "adapters: nowhere is no folder"),
        ({"scene": "opn-fog"}, "did you mean 'open-fog'?"),
    ],
)
def test_mistakes_are_refused_before_anything_starts(folder, tmp_path, monkeypatch, changed, why):
    monkeypatch.chdir(tmp_path)
    given = {"engine": "fake", "scene": "open-fog", "output": "x.exr", "adapters": folder}
    with pytest.raises(InputError) as caught:
        airlight.capture(**(given | changed))
    assert why in str(caught.value)


def test_the_first_line_of_an_adapter_may_have_several_words_behind_env(tmp_path):
    (tmp_path / "one.py").write_text(f"#!/usr/bin/env -S {sys.executable} -P\n")
    (tmp_path / "two.py").write_text("#!/bin/sh don't\n")  # a quote without an end
    assert engine_adapter.adapter_names(tmp_path) == ["one"]
    command = engine_adapter.adapter_command("one", tmp_path)
    assert command == [sys.executable, "-P", str(tmp_path / "one.py")]


def test_what_is_missing_is_named_with_the_line_to_type(folder, tmp_path, monkeypatch):
    with pytest.raises(MissingError, match=r"runs by nowhere-to-be-found, which is missing. To"):
        airlight.capture("lost", "open-fog", output=tmp_path / "x.exr", adapters=folder)
    # Node has another name in Debian.
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingError, match=r"apt-get install -y nodejs npm` on Debian"):
        airlight.capture("three", "open-fog", output=tmp_path / "x.exr")
    # An installed package has no adapters.
    monkeypatch.setattr(engine_adapter, "__file__", str(tmp_path / "reports" / "machine" / "x.py"))
    with pytest.raises(MissingError, match=r"docs/adapters of a clone of airlight"):
        airlight.capture("three", "open-fog", output=tmp_path / "x.exr")


@pytest.mark.claim("capture-contract")
@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGKILL])
def test_an_adapter_ends_with_the_command(words, folder, tmp_path, sign):
    (folder / "pid").unlink(missing_ok=True)
    command = subprocess.Popen(
        [sys.executable, "-P", "-m", "airlight", *words, "--set", "do=hang"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src"), "TMPDIR": str(tmp_path)},
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 120
    while not (folder / "pid").exists() or not (folder / "pid").read_text():
        assert command.poll() is None, command.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    adapter = int((folder / "pid").read_text())
    command.send_signal(sign)
    _, errors = command.communicate(timeout=120)
    assert command.returncode == -sign
    assert b"Traceback" not in errors
    while _runs(adapter):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _runs(number):
    """Whether a process is there and no zombie, which a container without an init keeps."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_the_packages_of_the_adapters_are_exact_and_name_no_host():
    wanted = json.loads((ADAPTERS / "package.json").read_text())["dependencies"]
    text = (ADAPTERS / "package-lock.json").read_text()
    assert "://" not in text
    locked = {
        name.removeprefix("node_modules/"): each
        for name, each in json.loads(text)["packages"].items()
        if name
    }
    assert {name: locked[name]["version"] for name in wanted} == wanted
    assert all(each["integrity"].startswith("sha512-") for each in locked.values())
    assert not (ADAPTERS / "node_modules").exists()


# Real engines, in a browser.


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache with the packages of the engines; a test is skipped where there is no browser."""
    for name, package in (("node", "nodejs"), ("npm", "npm"), ("chromium", "chromium")):
        if shutil.which(name) is None:
            pytest.skip(f"no {name} on this machine; Debian's package is {package}")
    made = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AIRLIGHT_CACHE_DIR", str(made))
        try:
            airlight.capture("three", "open-fog", size=(16, 12), output=made / "x.exr")
        except MissingError as missing:
            pytest.skip(f"the packages of the engines cannot be had here: {missing}")
    return made


@pytest.fixture
def engines(variant, cache, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(cache))


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
@pytest.mark.claim("capture-judged", tolerance="blocks within 1 %, which `compare` calls right")
@pytest.mark.parametrize(
    ("engine", "scene"),
    [
        ("playcanvas", "open-fog"),
        ("playcanvas", "sphere-spot"),
        ("three", "open-fog"),
        ("three", "sphere-spot"),
    ],
)
def test_an_image_of_an_engine_is_right_by_its_own_equation(engine, scene, tmp_path):
    out = tmp_path / "out.exr"
    made = airlight.capture(engine, scene, size=(64, 48), output=out)
    assert made.problems == ()
    judged = airlight.compare(scene, out, model=made.model, pixel=made.pixel)
    assert judged.verdict.right, judged.text()
    # The equation is what is wrong with it: by that of physics it is far off.
    assert not airlight.compare(scene, out, pixel=made.pixel).verdict.right


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
@pytest.mark.claim("capture-judged", tolerance="none: the files are equal")
@pytest.mark.parametrize("engine", ["playcanvas", "three"])
def test_captures_repeat_bit_by_bit(engine, tmp_path):
    for name in ("one.exr", "two.exr"):
        airlight.capture(engine, "sphere-spot", size=(64, 48), output=tmp_path / name)
    assert (tmp_path / "one.exr").read_bytes() == (tmp_path / "two.exr").read_bytes()


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
def test_two_edits_of_a_shader_make_an_engine_right(tmp_path):
    edits = [
        "falloffInvSquaredPS~1.0 / (sqrDist + 1.0)~1.0 / sqrDist",
        "volumetricFogLocalPS~exp(-volFogOpticalDepth(t, rayDir.y))~exp(-volFogOpticalDepth(t, "
        "rayDir.y) - uVolMarchParams.w * uVolFogParams.x * length(lightVec))",
    ]
    out = tmp_path / "out.exr"
    made = airlight.capture("playcanvas", "sphere-spot", size=(64, 48), output=out, edit=edits)
    assert made.model is None
    assert "airlight:model" not in read_exr(out).attributes
    assert airlight.compare("sphere-spot", out, pixel="centre").verdict.right


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("playcanvas", "windows"), "PlayCanvas: its fog has no bounds"),
        (("three", "windows"), "three.js: its fog has no suns"),
        (("playcanvas", "street"), "PlayCanvas: its height fog cannot be that of the scene: "),
        (("three", "street"), "three.js: the adapter brings homogeneous fog alone"),
        (("playcanvas", "smoke"), "PlayCanvas: its fog is a density grid"),
        (("three", "penumbra-plane"), "three.js: its fog has no area lights"),
        (("three", "three-media"), "three.js: the adapter brings one medium, and the scene has"),
        (("playcanvas", "open-fog", "--set", "step=3"), "has no setting 'step' here; it has steps"),
        (("playcanvas", "open-fog", "--set", "steps=many"), "steps: got 'many', expected a number"),
        (
            ("playcanvas", "open-fog", "--edit", "falloffInvSquaredPS~no such text~1"),
            "the shader chunk 'falloffInvSquaredPS' does not contain 'no such text'",
        ),
        (("three", "open-fog", "--edit", "a~b~c"), "three.js: it has no shader chunks to edit"),
    ],
)
def test_what_an_engine_cannot_have_is_refused(words, why, tmp_path, capsys):
    assert run(["capture", *words, "--size", "16x12", "-o", str(tmp_path / "out.exr")]) == 2
    printed = capsys.readouterr().err
    assert why in printed
    assert printed.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
def test_textures_and_other_phase_functions_are_refused(tmp_path):
    squares = {"type": "diffuse", "reflectance": {"type": "checkerboard"}}
    coloured = {"type": "rgb", "value": [0.1, 0.2, 0.3]}
    backward, rayleigh = {"type": "hg", "g": -0.3}, {"type": "rayleigh"}
    refused = {
        "'floor' is textured": ("floor", "bsdf", squares),
        "its fog has one extinction for all colours": ("fog", "sigma_t", coloured),
        "its phase function is Henyey-Greenstein's; got rayleigh": ("fog", "phase", rayleigh),
        "its anisotropy is from 0 to 0.95; got -0.3": ("fog", "phase", backward),
    }
    for why, (owner, part, value) in refused.items():
        scene = tiny_scene()
        scene[owner] |= (
            {part: value, "has_spectral_extinction": True} if owner == "fog" else {part: value}
        )
        with pytest.raises(InputError, match=f"^PlayCanvas: .*{why}"):
            airlight.capture("playcanvas", scene, output=tmp_path / "out.exr")


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
@pytest.mark.parametrize("engine", ["playcanvas", "three"])
def test_a_weak_lamp_and_surfaces_of_one_side_are_those_of_the_scene(engine, tmp_path):
    # The lamp is below 16 W/sr, where PlayCanvas decodes an intensity with its colour.
    scene = tiny_scene(size=(64, 48))
    made = airlight.capture(engine, scene, output=tmp_path / "out.exr")
    assert made.notes[-1] == "cut into triangles: ball"
    exact = airlight.reference(scene, model=made.model)
    image = read_exr(made.path)
    for name, allowed in (("airlight", 0.01), ("surface", 0.03)):  # edges of triangles
        ratio = image.layers[name].mean() / getattr(exact, name).mean()
        assert abs(ratio - 1) < allowed, (name, ratio)


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
@pytest.mark.parametrize(("half", "within"), [(8.0, True), (1.5, False)])
def test_three_has_bounds_where_the_camera_is_within_them(half, within, tmp_path):
    import mitsuba as mi

    scene = tiny_scene(size=(64, 48))
    place = mi.ScalarTransform4f().translate([0, 0, half]).scale(half)
    inside = {"type": "ref", "id": "fog"}
    scene["air"] = {"type": "cube", "to_world": place, "bsdf": {"type": "null"}, "interior": inside}
    if not within:
        scene["sensor"].pop("medium")
        with pytest.raises(InputError, match=r"^three\.js: its fog has bounds only where the cam"):
            airlight.capture("three", scene, output=tmp_path / "out.exr")
        return
    made = airlight.capture("three", scene, output=tmp_path / "out.exr")
    exact = airlight.reference(scene, model=made.model)
    assert "ends" not in made.model
    ratio = read_exr(made.path).layers["airlight"].mean() / exact.airlight.mean()
    assert abs(ratio - 1) < 0.01


SUN = """<scene version="3.0.0"><default name="airlight-model" value="light-path=off"/>
<sensor type="perspective"><float name="fov" value="41.7"/><ref id="fog" name="medium"/>
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/></film></sensor>
<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.1"/><float name="albedo" value="0.83"/></medium>
<shape type="sphere"><point name="center" x="0.3" y="0.2" z="5"/><float name="radius" value="0.9"/></shape>
<emitter type="directional"><vector name="direction" x="0.3" y="-0.9" z="0.4"/></emitter></scene>"""


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
def test_playcanvas_has_a_sun_that_physics_drowns(tmp_path):
    (tmp_path / "sun.xml").write_text(SUN)
    made = airlight.capture("playcanvas", tmp_path / "sun.xml", output=tmp_path / "out.exr")
    judged = airlight.compare(
        tmp_path / "sun.xml", tmp_path / "out.exr", model=made.model, pixel="centre"
    )
    assert judged.verdict.block_error < 0.03  # edges of its cascades of shadows


@pytest.mark.slow
def test_eevee_is_as_far_from_its_equation_as_its_froxels(variant, tmp_path):
    if not os.environ.get("AIRLIGHT_CYCLES_PYTHON"):
        pytest.skip("no bpy here; AIRLIGHT_CYCLES_PYTHON can name a Python that has it")
    out = tmp_path / "out.exr"
    made = airlight.capture("eevee", "sphere-spot", size=(64, 48), output=out)
    judged = airlight.compare("sphere-spot", out, model=made.model, pixel=made.pixel)
    # Half a slice, and floats of 11, 11 and 10 bits that are rounded down: it is too dark.
    assert 1.01 < judged.compared.hints.factor < 1.06
    # Its surfaces have no light path, as its equation says.
    surface = airlight.compare("sphere-spot", out, "surface", model=made.model, pixel=made.pixel)
    assert abs(surface.compared.hints.factor - 1) < 0.05


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
def test_a_browser_that_fails_is_told(tmp_path, monkeypatch):
    given = {"scene": "open-fog", "size": (16, 12), "output": tmp_path / "out.exr"}
    monkeypatch.setenv("AIRLIGHT_CHROMIUM", "/nowhere/chromium")
    with pytest.raises(MissingError, match=r"^/nowhere/chromium is missing: `.*chromium` on Debi"):
        airlight.capture("three", **given)
    monkeypatch.setenv("AIRLIGHT_CHROMIUM", shutil.which("false") or "")
    with pytest.raises(InputError, match=r"three\.js: Chromium ended with the status 1$"):
        airlight.capture("three", **given)
    monkeypatch.delenv("AIRLIGHT_CHROMIUM")
    # A page that asks for what is not there, and one that gives no answer.
    shutil.copytree(ADAPTERS, tmp_path / "adapters")
    text = (ADAPTERS / "three.mjs").read_text()
    (tmp_path / "adapters" / "lost.mjs").write_text(text.replace("three.tsl.js", "lost.js"))
    with pytest.raises(InputError, match=r"the page asked for /packages/three/build/lost.js, whi"):
        airlight.capture("lost", adapters=tmp_path / "adapters", **given)
    waiting = text.replace("const THREE =", "await new Promise(() => {});\n  const THREE =")
    (tmp_path / "adapters" / "idle.mjs").write_text(waiting)
    # On a busy machine the limit passes before the page is there.
    with pytest.raises(InputError, match=r"three.js: no result within \d+ s$|idle: no answer with"):
        airlight.capture("idle", adapters=tmp_path / "adapters", limit=20, **given)


@pytest.mark.slow
@pytest.mark.usefixtures("engines")
def test_packages_that_cannot_be_installed_are_told(tmp_path, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("npm_config_cache", str(tmp_path / "npm"))
    monkeypatch.setenv("npm_config_offline", "true")
    with pytest.raises(MissingError, match=r"cannot install them \(ENOTCACHED\)\. With a network"):
        airlight.capture("three", "open-fog", size=(16, 12), output=tmp_path / "out.exr")
    assert not list((tmp_path / "cache").glob("adapters-*"))
