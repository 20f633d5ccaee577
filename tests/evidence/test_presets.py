# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the reference of every engine's equation is that of a plain march in NumPy."""

import numpy as np
import pytest

from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.models import PRESETS, model_of
from tests.helpers.model_march import marched

#: Parameters that must be given, and ends that are felt in scenes of this size.
GIVEN = {
    "playcanvas": ":extinction=0.5,range=9,maxDistance=12,ambientIntensity=0.1",
    "three": ":distance=12",
    "babylon": ":enableExtinction=1",
    "godot": ":range=9,volumetric_fog_length=14",
    "bevy": ":bounding_radius=6",
    "eevee": ":shadow_soft_size=0.7,cutoff_distance=11,volumetric_end=13",
    "hdrp": ":range=9,depthExtent=12",
    "unreal": ":froxel=0.4,VolumetricFogDistance=15",
    "filament": ":color=0.3,0.4,0.5,inScatteringSize=8,inScatteringStart=2",
    "flax": ":cell=0.3,VolumetricFogDistance=15",
}
#: Lamps, spots with shadows in height fog, and a sun with shadows in height fog.
SCENES = ("open-fog", "street", "meadow")


def agree(preset, scene, steps, size):
    """Return whether the scene has light of the equation; it is within 0.1 % of the march."""
    model = model_of(preset + GIVEN.get(preset, ""))
    loaded = load_scene(scene, size)
    reference = read_reference(loaded.scene, model)
    image = quadrature_image(reference, checks=0)
    expected = marched(reference, image.distance.ravel(), steps)
    found = image.airlight.reshape(-1, 3)
    assert np.abs(found - expected).max() <= 1e-3 * np.abs(expected).max()
    return bool(expected.max() > 0)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.claim("models", tolerance="0.1 % of the largest: shadow edges between 4096 steps")
def test_presets_without_shadows(variant, preset):
    lit = agree(preset, "open-fog", 4096, (8, 6))
    assert lit or preset == "babylon"  # which has suns alone


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("scene", SCENES[1:])
@pytest.mark.claim("models", tolerance="0.1 % of the largest: shadow edges between 16384 steps")
def test_presets_among_shadows_in_height_fog(variant, preset, scene):
    lit = agree(preset, scene, 16384, (8, 6))
    # Babylon.js has no lamps, and no sun lights fog of three.js.
    assert lit or (scene, preset) in {("street", "babylon"), ("meadow", "three")}
