# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report on engines judges each image by physics and by the equation that it names, says why
an engine has no image, and tells which numbers moved.
"""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.reports.commands.main import run
from airlight.reports.machine.environment import MissingError

ROOT = Path(__file__).resolve().parents[3]

MODEL = "light-path=off,law=softened:1"
SIZE = (48, 36)
#: An engine that copies an image that lies beside it, or does what its own name says.
ENGINE = """#!{python}
import json, pathlib, shutil, sys

here = pathlib.Path(__file__)
scene, glb, out, *words = sys.argv[1:]
name = json.load(open(scene))["scene"]
if here.stem == "picky" or any(word.startswith("odd=") for word in words):
    sys.exit(print(here.stem + ": it has no fog", file=sys.stderr) or 2)
if here.stem == "broken":
    sys.exit(print("the sky fell", file=sys.stderr) or 1)
image = here.with_name(name + ".exr")
if not image.exists():
    sys.exit(print(here.stem + ": it has no " + name, file=sys.stderr) or 2)
shutil.copy(image, out)
print(json.dumps({{"engine": "Fake", "version": "1.2", "settings": dict(w.split("=") for w in words),
                   "seconds": 1, "problems": [], "model": "{model}", "pixel": "centre", "device": "abacus"}}))
"""


@pytest.fixture(scope="module")
def adapters(tmp_path_factory):
    """Adapters: one whose images solve the model to half a per cent, one that refuses, one that
    fails, one without its program.
    """
    made = tmp_path_factory.mktemp("adapters")
    for name in ("fake", "picky", "broken"):
        (made / f"{name}.py").write_text(ENGINE.format(python=sys.executable, model=MODEL))
    (made / "lost.xyz").write_text("#!/usr/bin/env nowhere-to-be-found\n")
    for scene in ("open-fog", "sphere-spot"):
        own = airlight.reference(scene, size=SIZE, model=MODEL)
        layers = {"airlight": 1.005 * own.airlight, "surface": 0.5 * own.surface}
        write_exr(made / f"{scene}.exr", Image(layers))
    return made


@pytest.fixture(scope="module")
def written(variant, adapters, tmp_path_factory):
    """The folder of a report on all of them."""
    folder = tmp_path_factory.mktemp("report")
    scenes = ["open-fog", "sphere-spot", "mist"]
    made = airlight.report(scenes, engines="all", size=SIZE, adapters=adapters, output=folder)
    return folder, made


@pytest.mark.claim("engines-judged", tolerance="1e-4 of the mean: files hold float32")
def test_each_image_is_judged_by_physics_and_by_its_own_equation(written):
    _, made = written
    cells = {(cell.scene, cell.engine): cell for cell in made.data.cells}
    for scene in ("open-fog", "sphere-spot"):
        airlight_layer = cells[scene, "fake"].layer("airlight")
        physical = airlight.reference(scene, size=SIZE).airlight
        own = airlight.reference(scene, size=SIZE, model=MODEL).airlight
        errors = airlight_layer.errors
        # The image is 1.005 times that of its equation: its bias and its blocks are 0.5 %, and the
        # parts of the bias add up. EXR files have float32.
        assert errors.image.mean == pytest.approx(0.005, abs=1e-5)
        assert errors.image.blocks == pytest.approx(0.005, abs=1e-4)
        assert errors.against_physics.mean == pytest.approx(
            own.mean() / physical.mean() - 1, abs=1e-5
        )
        assert errors.total.mean == pytest.approx(
            1.005 * own.mean() / physical.mean() - 1, abs=1e-5
        )
        assert airlight_layer.right
    surface = cells["sphere-spot", "fake"].layer("surface")
    assert surface.errors.image.mean == pytest.approx(-0.5, abs=1e-5)
    assert not surface.right
    assert cells["open-fog", "fake"].layer("surface") is None
    captured = cells["open-fog", "fake"].captured
    assert (captured.engine, captured.version, captured.device) == ("Fake", "1.2", "abacus")


@pytest.mark.claim("engines-judged")
def test_an_engine_without_an_image_has_a_reason(written):
    folder, made = written
    cells = {(cell.scene, cell.engine): (cell.status, cell.reason) for cell in made.data.cells}
    assert cells["mist", "fake"] == ("cannot", "fake: it has no mist")
    assert cells["open-fog", "picky"] == ("cannot", "picky: it has no fog")
    assert cells["open-fog", "broken"][0] == "failed"
    assert "the sky fell" in cells["open-fog", "broken"][1]
    assert cells["open-fog", "lost"][0] == "missing"
    assert "nowhere-to-be-found" in cells["open-fog", "lost"][1]
    # A failed adapter fails the report, and nothing else does.
    assert len(made.failures) == 3
    assert made.status == 1
    page = (folder / "engines.html").read_text(encoding="utf-8")
    assert "It has no mist" in page or "it has no mist" in page
    assert "the sky fell" in page


def test_the_page_and_the_table_have_the_numbers_of_the_data(written):
    folder, made = written
    data = json.loads((folder / "engines.json").read_text(encoding="utf-8"))
    cell = data["cells"][1]
    assert (cell["scene"], cell["engine"]) == ("open-fog", "fake")
    errors = cell["layers"][0]["errors"]
    table = made.tables[0]
    row = next(row for row in table.rows if row.values["engine"] == "Fake 1.2")
    assert row.values["equation"] == errors["against_physics"]["blocks"]
    assert row.values["algorithm"] == errors["image"]["blocks"]
    assert row.values["total"] == errors["total"]["blocks"]
    for name in ("picture", "error", "algorithm", "image"):
        assert (folder / cell["files"][name]).is_file()
    assert (folder / "strip.png").stat().st_size > 1000
    # The sentence on the engine is of both scenes.
    assert made.claims[0].startswith("Fake 1.2 in 2 scenes: its equation is ")
    assert "and 2 of 2 right by it; 1 more it does not have." in made.claims[0]
    assert "--size 48x36" in data["command"]  # that a shell takes


@pytest.mark.claim("engines-moved")
def test_kept_images_are_judged_alike_and_a_change_is_seen(written, tmp_path, capsys):
    folder, _ = written
    kept = tmp_path / "kept"
    kept.mkdir()
    for path in (*folder.glob("*.*.exr"), folder / "engines.json"):
        shutil.copy(path, kept)
    # The images of a folder, with the reasons of engines.json: nothing moves.
    words = ["report", "--engines", "all", "--images", str(kept), "-o", str(tmp_path / "again")]
    assert run(words) == 1  # the adapter that failed then
    assert run(["diff", str(folder), str(tmp_path / "again")]) == 0
    assert "0 worse, 0 better, 9 errors compared" in capsys.readouterr().out
    # An image that is 3 % brighter is another number and another verdict.
    image = read_exr(kept / "open-fog.fake.exr")
    layers = {name: 1.03 * image.layers[name] for name in ("airlight", "surface")}
    write_exr(kept / "open-fog.fake.exr", Image(layers, attributes=image.attributes))
    run(words)
    assert run(["diff", str(folder), str(tmp_path / "again"), "--json"]) == 1
    said = json.loads(capsys.readouterr().out.partition("\n{")[2].join(("{", "")))
    worse = {each["what"] for each in said["result"]["findings"] if each["verdict"] == "worse"}
    assert "airlight no longer right by its equation" in worse
    assert "airlight algorithm" in worse


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--engines", "fka"],
            "engines: got 'fka', expected all or some of broken, fake, lost, picky",
        ),
        (
            ["--engines", "fake", "--set", "steps=3"],
            "set: got 'steps=3', expected ENGINE.NAME=VALUE",
        ),
        (
            ["--engines", "fake", "--set", "fka.steps=3"],
            "engines: got 'fka', expected all or some of ",
        ),
        (["--engines", "fake", "--set", "fake.odd=3"], "fake: it has no fog"),
        (
            ["--engines", "fake", "--set", "picky.steps=3"],
            "set: got a setting of picky, expected one of fake",
        ),
        (
            ["--engines", "fake", "--method", "all"],
            "engines: no method is measured; leave out method",
        ),
        (
            ["--engines", "fake", "--images", "x"],
            "images: the engines are not run; leave out adapters",
        ),
        (["--diagnose"], "report: they belong to --engines; leave out diagnose, adapters"),
        (["--limit", "9"], "report: they belong to --engines; leave out adapters, limit"),
        (["--engines", "fake", "--limit", "nan"], "limit: got nan, expected a time above 0"),
    ],
)
def test_mistakes_are_one_line(variant, words, said, adapters, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ["report", "open-fog", *words, "--adapters", str(adapters), "-o", str(out)]
    assert run(asked) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith(f"airlight: error: {said}")
    assert not list(out.rglob("*")) if out.exists() else True


def test_an_engine_that_was_named_must_be_there(variant, adapters, tmp_path):
    with pytest.raises(MissingError, match="nowhere-to-be-found"):
        airlight.report("open-fog", engines="lost", adapters=adapters, output=tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))


def test_scenes_of_users_have_images_too(variant, adapters, tmp_path):
    scene = ROOT / "docs" / "examples" / "lobe-fog.xml"
    own = airlight.reference(str(scene), size=SIZE, model=MODEL)
    place = adapters / f"{scene.stem}.exr"
    write_exr(place, Image({"airlight": own.airlight, "surface": own.surface}))
    try:
        made = airlight.report(
            str(scene), engines="fake", size=SIZE, adapters=adapters, output=tmp_path / "out"
        )
    finally:
        place.unlink()
    (cell,) = made.data.cells
    assert cell.layer("airlight").errors.image.blocks < 1e-5
    assert np.isfinite(cell.layer("airlight").errors.total.blocks)
    # Judged again from its folder, which knows the path of the scene.
    again = airlight.report(engines="all", images=tmp_path / "out", output=tmp_path / "again")
    assert again.data.cells[0].layers == cell.layers


SUN = """<scene version="3.0.0">
<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="0.1"/><rgb name="albedo" value="0.8"/>
</medium><emitter type="directional"><vector name="direction" value="0.2,0.1,-1"/>
<rgb name="irradiance" value="1"/></emitter><sensor type="perspective"><ref name="medium" id="fog"/>
<film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="18"/></film>
</sensor></scene>"""


@pytest.mark.claim("engines-judged")
def test_what_has_no_physical_image_is_told_so_and_not_taken_for_physics(variant, tmp_path):
    """A sun in fog without bounds; its capture lies in a folder without engines.json."""
    scene, images = tmp_path / "sun.xml", tmp_path / "images"
    scene.write_text(SUN)
    own = airlight.reference(str(scene), model="light-path=off")
    images.mkdir()
    attributes = {"airlight:engine": "Fake", "airlight:model": "light-path=off"}
    layers = {"airlight": own.airlight, "surface": own.surface}
    write_exr(images / "sun.fake.exr", Image(layers, attributes=attributes))
    made = airlight.report(
        str(scene), engines="all", images=images, diagnose=True, output=tmp_path / "out"
    )
    (said,) = made.claims
    assert "how far its equation is off physics is not known" in said
    assert "1 of 1 right by it" in said
    (cell,) = made.data.cells
    assert "nothing of it arrives" in cell.headline


@pytest.mark.claim("engines-judged")
def test_an_equation_that_nobody_told_is_not_taken_for_that_of_physics(variant, tmp_path):
    """An adapter tells none for settings that no term says."""
    own, out = tmp_path / "adapters", tmp_path / "out"
    own.mkdir()
    text = ENGINE.format(python=sys.executable, model="").replace('"model": ""', '"model": None')
    (own / "mute.py").write_text(text)
    exact = airlight.reference("open-fog", size=SIZE)
    layers = {"airlight": 1.03 * exact.airlight, "surface": exact.surface}
    write_exr(own / "open-fog.exr", Image(layers))
    made = airlight.report("open-fog", engines="mute", size=SIZE, adapters=own, output=out)
    (said,), (cell,) = made.claims, made.data.cells
    assert said.endswith("its equation is not known, and its images are 3 % off physics.")
    assert cell.layer("airlight").blocks == {
        "equation": None,
        "algorithm": None,
        "total": pytest.approx(0.03, abs=1e-4),
    }
    assert "Equation: not known" in (out / "engines.html").read_text(encoding="utf-8")


def test_a_strip_goes_with_the_images_that_it_showed(written, adapters, tmp_path):
    """A report of no image into the folder of one with images."""
    out = shutil.copytree(written[0], tmp_path / "out")
    made = airlight.report(
        "mist", engines="fake", size=SIZE, adapters=adapters, limit=9, output=out
    )
    assert sorted(path.name for path in out.glob("*.png")) == ["mist.png"]
    assert made.data.command.endswith(" --limit 9")


def test_data_of_another_version_are_refused(tmp_path):
    (tmp_path / "engines.json").write_text('{"schema": "airlight-engines/0"}')
    with pytest.raises(InputError, match="airlight-engines/1; make it again"):
        airlight.diff(tmp_path, tmp_path)
    with pytest.raises(InputError, match="no times; leave out time_tolerance"):
        airlight.diff(tmp_path, tmp_path, time_tolerance=0.1)
