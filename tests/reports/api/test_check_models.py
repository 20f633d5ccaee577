# SPDX-License-Identifier: BSD-3-Clause
"""Claim: relations without a reference tell which of an engine's equations break them."""

import pytest

import airlight
from airlight.errors import InputError

#: By model, the relations that its equation breaks in a scene of one spot, by reading it: a law or
#: a path of a constant length, no light path, planar depth, density that is lit.
BROKEN = {
    "physical": set(),
    "diligent": set(),
    "hdrp:range=none": set(),
    "playcanvas:range=none": {"units", "reciprocity"},
    "eevee": {"units", "reciprocity"},
    "flax:cell=0.3,Radius=none": {"units", "reciprocity"},
    "bevy:bounding_radius=5,range=none": {"units", "pan", "reciprocity"},
    # Nothing is attenuated on either way, which camera and spot may exchange.
    "three": {"intensity", "sum", "albedo"},
    # A range of ten metres is the same in every scene.
    "hdrp:range=10": {"units", "reciprocity"},
}


def broken(model, **how):
    found = airlight.check("sphere-spot", model=model, **how)
    assert all(each.verdict != "cannot be told" for each in found.kept if each.name != "pan")
    return {each.name for each in found.kept if each.fails}


@pytest.mark.slow
@pytest.mark.parametrize("model", BROKEN)
def test_an_equation_breaks_the_relations_that_it_must(variant, model):
    assert broken(model) == BROKEN[model]


def test_a_light_path_alone_is_what_reciprocity_finds(variant):
    only = "intensity,units,reciprocity"
    assert broken("light-path=off", only=only, size="32x24") == {"reciprocity"}
    assert broken("lit=0.01,camera-path=off,light-path=off", only="intensity", size="32x24") == {
        "intensity"
    }


def test_the_camera_in_the_place_of_a_spot_has_its_rim(variant):
    """It had the rim of the power 1: with any other, `reciprocity` failed where nothing is wrong."""
    assert broken("spot=rim:3", only="reciprocity", size="16x12") == set()


def test_a_model_is_no_method(variant):
    with pytest.raises(InputError, match="model: is no method"):
        airlight.check("sphere-spot", "unshadowed", model="three")
    with pytest.raises(InputError, match="leave out precision"):
        airlight.check("sphere-spot", model="three", precision="single")
    with pytest.raises(InputError, match="no model is called"):
        airlight.check("sphere-spot", model="plycanvas")
