# SPDX-License-Identifier: BSD-3-Clause
"""Claim: exact methods keep all relations in float64; a folder of frames is judged as they are."""

import json
import sys

import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.commands.main import run


@pytest.mark.claim("relations")
@pytest.mark.parametrize(
    ("scene", "method"),
    [
        ("open-fog", "unshadowed"),
        pytest.param("sphere-spot", "ray-march", marks=pytest.mark.slow),
        pytest.param("sphere-spot", "light-volumes", marks=pytest.mark.slow),
        pytest.param("windows", "shadow-planes", marks=pytest.mark.slow),
        pytest.param("lanterns", "unshadowed", marks=pytest.mark.slow),
        pytest.param("meadow", "unshadowed", marks=pytest.mark.slow),
        pytest.param("smoke", "ray-march", marks=pytest.mark.slow),
    ],
)
def test_methods_keep_the_relations(variant, scene, method):
    # Faces of a map are looked up in single precision.
    margin = 1e-5 if method == "light-volumes" else None
    found = airlight.check(scene, method, size=(64, 48), margin=margin)
    assert found.passed, found.text()
    # The camera is close to lamps: what sampling explains is too much for `pan` and `size`.
    asked = {each.name for each in found.kept if each.verdict == "cannot be told"}
    assert asked <= {"pan", "size", "depths-multiply"}, found.text()


def fading(view, *, kernel=None):
    """Return airlight that a constant in metres dims."""
    rays = [view.lit_by(light, kernel) for light in view.lights]
    total = sum(each.radiance(each.gamma(view.distance)) for each in rays)
    return total / (1 + view.distance)


def test_a_method_with_a_length_of_its_own_is_found(variant):
    found = airlight.check("sphere-spot", fading, only="units,intensity")
    assert [(each.name, each.fails) for each in found.kept] == [
        ("again", False),
        ("intensity", False),
        ("units", True),
    ]
    assert "constant in metres" in found["units"].points_to
    assert found.status == 1


def without_spots(view, *, kernel=None):
    """Return the airlight of a method that knows lamps alone."""
    if any(light.kind == "spot" for light in view.lights):
        raise InputError("without_spots: needs lamps")
    return sum(view.lit_by(each, kernel).radiance(0.1) for each in view.lights)


def test_a_relation_whose_lights_a_method_refuses_is_left_out_and_named(variant):
    found = airlight.check("open-fog", without_spots, only="sum,reciprocity")
    assert [each.name for each in found.kept] == ["again", "sum"]
    (left_out,) = found.notes
    assert left_out.startswith("reciprocity is left out: ")
    assert left_out.endswith("needs lamps")
    assert left_out in found.text()


@pytest.fixture
def folder(tmp_path):
    """Frames whose surfaces are not twice as bright where the fog is."""
    fog, wall = np.full((16, 16, 3), 0.5), np.full((16, 16, 3), 0.25)
    write_exr(tmp_path / "base.exr", Image({"airlight": fog, "surface": wall}))
    write_exr(tmp_path / "twice.exr", Image({"airlight": 2 * fog, "surface": wall}))
    relations = [
        {"name": name, "frames": ["base.exr", "twice.exr"]} for name in ("intensity", "exposure")
    ]
    (tmp_path / "check.json").write_text(json.dumps({"relations": relations}))
    return tmp_path


def test_frames_of_a_folder_are_judged(folder, capsys):
    assert run(["check", str(folder)]) == 1
    printed = capsys.readouterr().out
    assert "1 of 2 relations hold, 1 fail." in printed
    assert run(["check", str(folder), "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    rows = said["result"]["relations"]
    assert [(row["name"], row["verdict"]) for row in rows] == [
        ("intensity", "holds"),
        ("exposure", "fails"),
    ]
    # All light is 0.75 and should become 1.5: it is 1.25.
    assert rows[1]["ratio"] == pytest.approx(1.25 / 1.5)
    assert len(said["failures"]) == 1
    assert run(["check", str(folder), "--only", "intensity"]) == 0


def test_the_same_frame_twice_can_be_asked_alone(folder):
    """Its name was offered in a refusal, and refused."""
    file = folder / "check.json"
    twice = {"again": ["base.exr", "base.exr"]}
    file.write_text(json.dumps(json.loads(file.read_text()) | twice))
    (kept,) = airlight.check(folder, only="again").kept
    assert (kept.name, kept.verdict) == ("again", "holds")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--only", "unitz"), "only: got 'unitz'"),
        (("--only", "pan"), "none of the relations that are asked for"),
        (("--only", "again"), "again is none of the relations that are asked for"),
        (("--only", "intensity,pan"), "pan is none of the relations that are asked for"),
        (("--margin", "2"), "margin: got 2"),
        (("--set", "kernel=exact", "--precision", "double"), "leave out kernel, precision"),
        (("--set", "steps=8"), "leave out steps"),
        (("--size", "32x24"), "leave out size"),
    ],
)
def test_what_a_folder_has_not_is_refused(folder, capsys, words, why):
    assert run(["check", str(folder), *words]) == 2
    assert why in capsys.readouterr().err


def test_a_folder_without_the_file_and_a_scene_with_clouds_are_refused(variant, tmp_path):
    refused = {
        r"expected the folder of a check\.json": (tmp_path,),
        "scatters many times": ("cloud-slab", "cloud-octaves"),
        "expected a built-in scene, which": (tmp_path / "own.xml", "unshadowed"),
    }
    for why, asked in refused.items():
        with pytest.raises(InputError, match=why):
            airlight.check(*asked)


def test_changed_scenes_are_written_with_the_file_that_names_their_frames(
    variant, tmp_path, capsys
):
    target = tmp_path / "variants"
    assert (
        run(["describe", "sphere-spot", "--variants", "all", "--size", "16x12", "-o", str(target)])
        == 0
    )
    asked = json.loads((target / "check.json").read_text())
    names = {name for each in asked["relations"] for name in each["frames"]} | {*asked["again"]}
    for name in names:
        path = target / name
        described = json.loads(path.with_suffix(".json").read_text())["result"]
        assert path.with_suffix(".glb").read_bytes()[:4] == b"glTF"
        # The sizes at which they are to be rendered.
        assert described["camera"]["size"] in ([16, 12], [32, 24], [128, 128])
    base, twice = (
        json.loads((target / f"{name}.json").read_text())["result"]["lights"][0]["intensity"]
        for name in ("base", "twice")
    )
    assert twice == pytest.approx([2 * value for value in base])
    # The frames of the reference keep them all.
    for name in ("base", "twice", "again"):
        loaded = airlight.reference("sphere-spot", size=(16, 12))
        factor = 2.0 if name == "twice" else 1.0
        layers = {
            key: factor * value
            for key, value in loaded.image.layers.items()
            if key in ("airlight", "surface")
        }
        write_exr(target / f"{name}.exr", Image(layers))
    capsys.readouterr()
    assert run(["check", str(target), "--only", "intensity"]) == 0
    assert "2 of 2 relations hold" in capsys.readouterr().out


# A renderer whose whole image is the sum of the lights, up to a cap; it takes one lamp.
FLAT = """#!{python}
import json, sys
import numpy as np
from airlight.reference.storage.exr import Image, write_exr

scene, _, out, *words = sys.argv[1:]
told = json.load(open(scene))["result"]
settings = {{"cap": 1e30, "seed": 7}} | {{
    name: float(value) for name, value in (word.split("=") for word in words)
}}
if len(told["lights"]) > 1:
    sys.exit(print("Flat: it takes one lamp", file=sys.stderr) or 2)
width, height = told["camera"]["size"]
light = np.sum([lamp["intensity"] for lamp in told["lights"]], axis=0)
fog = np.minimum(light, settings["cap"]) * np.ones((height, width, 3))
write_exr(out, Image({{"airlight": fog, "surface": 0 * fog}}))
told = {{"engine": "Flat", "version": "2", "settings": settings, "seconds": 0.0, "problems": [],
        "model": "physical", "pixel": "centre", "device": ""}}
print(json.dumps(told))
"""


@pytest.mark.claim("relations")
def test_an_engine_renders_the_frames(variant, tmp_path):
    (tmp_path / "flat.py").write_text(FLAT.format(python=sys.executable))
    how = {"engine": "flat", "adapters": tmp_path, "size": (16, 12)}
    linear = airlight.check("open-fog", only="intensity,sum", **how)
    assert linear.title == "open-fog by Flat 2"
    assert {each.name: each.verdict for each in linear.kept} == {
        "again": "holds",
        "intensity": "holds",
    }
    assert linear.notes == ("sum is left out: Flat: it takes one lamp",)
    assert airlight.check("open-fog", only="intensity", cap=1.0, **how)["intensity"].fails
    # An engine that tells no equation may have any edge of spots: no guess is judged.
    text = (tmp_path / "flat.py").read_text()
    (tmp_path / "flat.py").write_text(text.replace('"model": "physical", ', ""))
    (note,) = airlight.check("open-fog", only="intensity,reciprocity", **how).notes
    assert note.startswith("reciprocity is left out: the engine does not say which equation")
