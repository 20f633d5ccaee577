# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of a challenge follow from its seed, and their files say them exactly."""

import json
from dataclasses import replace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reports.challenge.seed import KINDS, check_seed, seed_of_entry, seed_words
from tests.helpers.challenge import drawn


@pytest.mark.claim("challenge-bytes", tolerance="none: the bytes are equal")
def test_a_seed_has_its_scenes_and_another_one_others(small):
    from airlight.reports.challenge.draw import draw_scenes, scenes_digest

    first, again, other = (draw_scenes(seed) for seed in ("7", "7", "8"))
    assert [scene.kind for scene in first] == list(KINDS)
    assert [dict(scene.files) for scene in first] == [dict(scene.files) for scene in again]
    assert scenes_digest(first) == scenes_digest(again) != scenes_digest(other)
    for one, two in zip(first, other, strict=True):
        assert one.files[one.file] != two.files[two.file]


def test_the_digest_finds_one_changed_byte_of_a_mesh(small):
    from airlight.reports.challenge.draw import scenes_digest

    scenes = drawn("7")
    mesh = next(name for name in scenes[0].files if name.endswith(".ply"))
    data = bytearray(scenes[0].files[mesh])
    data[-30] ^= 1
    changed = replace(scenes[0], files=dict(scenes[0].files) | {mesh: bytes(data)})
    assert scenes_digest([changed, *scenes[1:]]) != scenes_digest(scenes)


class Unmoved:
    """Draws that leave a certified scene as it is."""

    def logarithmic(self, low, high):
        return 1.0

    def between(self, low, high):
        return 0.0 if low < 0 else 1.0


@pytest.mark.parametrize("name", ["box-floor", "needles", "camera-in-shadow", "soft-spot"])
def test_files_of_certified_scenes_have_the_certified_radiance(
    variant, data_folder, tmp_path, monkeypatch, name
):
    """Units, lights, media and meshes survive being written: 1e-6 is float32's of the inputs."""
    from airlight.reference.quadrature.image import quadrature_image
    from airlight.reference.scene.read import read_reference
    from airlight.reports.challenge import draw
    from airlight.reports.challenge.draw import load_drawn

    monkeypatch.setattr(draw, "_is_shown", lambda stage: True)
    scenes = json.loads((data_folder / "certified_fog.json").read_text())["scenes"]
    data = next(each for each in scenes if each["name"] == name)
    drawn = draw._scene("one", "certified", *draw._certified(data, Unmoved()))
    read = read_reference(load_drawn(tmp_path, drawn).scene)
    directions = np.array(data["camera"]["directions"])
    image = quadrature_image(replace(read, width=64, height=1, direction=directions))
    known = np.array([[float(word) for word in pixel["radiance"]] for pixel in data["pixels"]])
    assert np.abs(image.airlight[0] - known).max() <= 2e-6 * known.max()


def test_engines_fog_is_written_by_the_parameters_of_the_engine(small, tmp_path):
    from airlight.reference.scene.read import read_reference
    from airlight.reports.challenge.draw import load_drawn
    from airlight.validation.scenes.engine_fog import fog_of_engine

    scene = drawn("7")[2]
    loaded = load_drawn(tmp_path, scene)
    assert loaded.fog_engine == "unreal"
    text = scene.files[scene.file].decode()
    named = {
        line.split('"')[1]: float(line.split('"')[3]) for line in text.splitlines() if "Fog" in line
    }
    assert set(named) == {"FogDensity", "FogHeightFalloff", "FogHeight"}
    expected = fog_of_engine("unreal", named).layers[0]
    assert read_reference(loaded.scene).medium.layers[0] == pytest.approx(expected, rel=1e-6)


def test_a_seed_of_an_entry_follows_from_its_words_alone():
    assert seed_of_entry("My method, commit abc") == seed_of_entry("  My  method, commit abc\n")
    assert seed_of_entry("My method, commit abc") != seed_of_entry("My method, commit abd")
    check_seed(seed_of_entry("a b"), "a b", "here")
    with pytest.raises(InputError, match="has the seed"):
        check_seed("7", "a b", "here")


@pytest.mark.parametrize("word", ["", "a b", "-3", "x" * 65, "../7"])
def test_what_is_no_seed_is_refused(word):
    with pytest.raises(InputError, match="whole number or a word"):
        seed_words(word)


@pytest.mark.slow
def test_every_scene_has_a_reference_far_below_the_floor(variant, tmp_path):
    """The scenes of the public seed at full size, in half a minute."""
    from airlight.reports.challenge.draw import draw_scenes
    from airlight.reports.challenge.number import FLOOR, scene_error
    from airlight.reports.challenge.score import scene_reference

    for scene in draw_scenes("2026"):
        reference, judged = scene_reference(tmp_path, scene)
        values = reference.airlight[judged]
        known = scene_error(values, reference.airlight_error[judged], values)
        assert known.high < 1e-3 * FLOOR, scene.name
        assert judged.mean() > 0.99, scene.name
