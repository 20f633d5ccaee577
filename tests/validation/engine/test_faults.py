# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the faults of single lights and classes of lights are said of those lights, in words that agree with them."""

from collections import defaultdict
from types import SimpleNamespace

import mitsuba as mi

from reference.scene.read import read_reference
from tests.helpers.scenes import bounded_medium, spot, tiny_scene
from validation.engine import faults
from validation.engine.faults import FAULTS, faults_of


def test_faults_of_lights_have_their_names_and_numbers(variant, monkeypatch):
    monkeypatch.setattr(faults, "traits", lambda predictor: defaultdict(lambda: True))
    sun = {"type": "directional", "direction": [0.3, 0.2, -1.0], "irradiance": 2.0}
    camera = {name: value for name, value in tiny_scene()["sensor"].items() if name != "medium"}
    body = bounded_medium({"type": "cube"}, 0.3, (0.9, 0.9, 0.9))
    bounded = tiny_scene(lamp2=spot(beam=11.0), sun=sun, fog=None, sensor=camera, body=body)
    scene = read_reference(mi.load_dict(bounded))

    def words_of(reference):
        return [fault.words.format(1.5) for fault in faults_of(SimpleNamespace(reference=reference))[len(FAULTS) :]]

    words = words_of(scene)
    assert "point and spot lights are 1.5 times as bright as they should be" in words
    for name in ("lamp", "lamp2", "sun"):
        assert f"the light '{name}' is 1.5 times as bright as it should be" in words
        assert f"the fog of the light '{name}' is 1.5 times as bright as it should be" in words
        assert f"nothing casts a shadow in the light of the light '{name}'" in words
        assert f"nothing casts a shadow in the light of the light '{name}' in the fog, on surfaces it does" in words
    assert len(words) == 4 * 4  # the sun is the only directional light: it has its name and is looked at once
    assert words_of(read_reference(mi.load_dict(tiny_scene()))) == []  # one light: the brightness of the whole
    monkeypatch.setattr(faults, "_MANY_LIGHTS", 2)
    among_many = words_of(scene)
    assert len(among_many) == 4 * 2
    assert {words for words in among_many if "'" in words} == {words for words in words if "'sun'" in words}


def test_faults_that_a_scene_cannot_have_are_left_out(variant, monkeypatch):
    monkeypatch.setattr(faults, "traits", lambda predictor: defaultdict(lambda: False))
    scene = read_reference(mi.load_dict(tiny_scene()))
    found = faults_of(SimpleNamespace(reference=scene))
    assert found == tuple(fault for fault in FAULTS if not fault.needs)
    assert 0 < len(found) < len(FAULTS)
