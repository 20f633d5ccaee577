# SPDX-License-Identifier: BSD-3-Clause
"""Walls between the samples of a shadow map: where they stand, and what they are worth."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.methods.light_volumes.jump_search import _JUMP, with_walls
from realtime.methods.light_volumes.texel_walls import PLACES
from realtime.scene.read_scene import read_scene
from realtime.shadow_maps.inverse_depth_field import inverse_depth_field
from realtime.shadow_maps.shadow_map import cast_shadow_map
from tests.helpers.frames import render
from tests.helpers.light_frames import lamp, loaded_scene
from tests.helpers.scenes import tiny_scene
from validation.estimates.quadrature import reference_image

LAMP = (0.13, -0.07, 2.9)
FLAT = {"ball": None, "lamp": lamp(*LAMP)}


def walled(loaded, size, precision="single"):
    """Return the heights of a scene's first light with walls, and the walls' places by face, row, column and side."""
    scene = read_scene(loaded, precision)
    heights = inverse_depth_field(cast_shadow_map(scene.geometry, scene.lights[0], size))
    walled_field = with_walls(heights, scene.geometry, scene.lights[0])
    number = (
        np.array(walled_field.walls).reshape(heights.faces, size, size, 1) >> np.arange(0, 32, 8, dtype=np.uint32)
        & 0xFF
    )
    return walled_field, np.where(number > 0, (number - 0.5) / PLACES, np.nan)


def plate(x, y, z=1.1, half=0.6):
    """Return a level square whose sides have the given distances from the lamp's axis on the low side."""
    place = mi.ScalarTransform4f().translate([LAMP[0] + x + half, LAMP[1] + y + half, z])
    return {"type": "rectangle", "to_world": place.scale([half, half, 1])}


@pytest.mark.claim("upright-walls", tolerance="half of a 64th of a texel")
@pytest.mark.parametrize(("size", "precision"), [(16, "double"), (64, "single")])
def test_walls_stand_where_the_edges_of_a_plate_are(variant, size, precision):
    """They are lines of constant u and v in the face below: known to half a place."""
    x, y, z, half = -0.31, -0.47, 1.1, 0.6
    _, places = walled(loaded_scene(**FLAT, plate=plate(x, y, z, half)), size, precision)
    depth = LAMP[2] - z
    below = places[5]  # looks along -z; u goes along x, v along y
    for low, across in ((x, 0), (y, 1)):
        for edge in (low, low + 2 * half):
            texel = 0.5 * size * (edge / depth + 1)
            column = int(texel)
            # Sides that the edge cuts across: the bottoms of a column, or the left sides of a row, along the plate.
            line = below[:, column, 0] if across == 0 else below[column, :, 2]
            other = (y, x)[across]
            first, last = (int(0.5 * size * (end / depth + 1)) for end in (other, other + 2 * half))
            walls = line[first + 2 : last - 1]
            assert len(walls) >= size // 8
            assert np.all(np.abs(walls - (texel - column)) <= 0.5 / PLACES + 1e-6)


@pytest.mark.claim("upright-walls")
def test_slopes_are_no_walls(variant):
    """A floor that rays meet at a grazing angle is as steep as a jump between two samples, and bends nowhere."""
    ground = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([400, 400, 1])}
    heights, places = walled(loaded_scene(ball=None, floor=ground, lamp=lamp(*LAMP)), 32)
    s00, s10, s01, s11 = np.array(heights.texels).reshape(-1, 4).T
    steep = np.abs(s01 - s00) > _JUMP * np.maximum(s00, s01)
    assert np.sum(steep) > 100
    # The rim of the floor is a jump; it lies within a texel of the horizon, whose samples have no height.
    assert np.all(np.isnan(places.reshape(-1, 4)[np.min([s00, s10, s01, s11], axis=0) > 0]))


@pytest.mark.claim("upright-walls")
def test_a_shadow_of_straight_edges_is_known_to_a_fraction_of_a_texel(variant):
    """The frame against the reference: what is left are the corners, and a 64th of a texel."""
    description = tiny_scene(size=(40, 30), **FLAT, plate=plate(-0.31, -0.47))
    reference = reference_image(mi.load_dict(description)).airlight
    loaded = mi.load_dict(description)

    def error(walls):
        airlight = render(loaded, "light-volumes", map=16, walls=walls).airlight
        return np.sqrt(np.mean((airlight - reference) ** 2)) / np.mean(reference)

    assert error("upright") < 0.15 * error("slanted")
