# SPDX-License-Identifier: BSD-3-Clause
"""Walls between the samples of a shadow map: where they stand, and what they are worth."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.light_frames import camera, lamp, loaded_scene, render
from tests.helpers.scenes import spot, tiny_scene

LAMP = (0.13, -0.07, 2.9)
FLAT = {"ball": None, "lamp": lamp(*LAMP)}


def walled(loaded, size, precision="single"):
    """Return the heights of a scene's first light with walls, and the walls' places by face, row, column and side."""
    from realtime.methods.light_volumes.jump_search import with_walls
    from realtime.methods.light_volumes.texel_walls import PLACES
    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.inverse_depth_field import inverse_depth_field
    from realtime.shadow_maps.shadow_map import cast_shadow_map

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
    import mitsuba as mi

    place = mi.ScalarTransform4f().translate([LAMP[0] + x + half, LAMP[1] + y + half, z])
    return {"type": "rectangle", "to_world": place.scale([half, half, 1])}


@pytest.mark.claim("upright-walls", tolerance="half of a 64th of a texel")
@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("size", [16, 64])
def test_walls_stand_where_the_edges_of_a_plate_are(variant, size, precision):
    """They are lines of constant u and v in the face below: known to half a place."""
    from realtime.methods.light_volumes.texel_walls import PLACES

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


def test_both_texels_of_a_side_see_the_same_wall(variant):
    _, places = walled(loaded_scene(), 32)
    bottom, top, left, right = np.moveaxis(places, -1, 0)
    assert np.array_equal(top[:, :-1], bottom[:, 1:], equal_nan=True)
    assert np.array_equal(right[:, :, :-1], left[:, :, 1:], equal_nan=True)
    assert np.sum(np.isfinite(places)) > 100


@pytest.mark.claim("upright-walls")
def test_slopes_are_no_walls(variant):
    """A floor that rays meet at a grazing angle is as steep as a jump between two samples, and bends nowhere."""
    import mitsuba as mi

    from realtime.methods.light_volumes.jump_search import _JUMP

    ground = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([400, 400, 1])}
    heights, places = walled(loaded_scene(ball=None, floor=ground, lamp=lamp(*LAMP)), 32)
    s00, s10, s01, s11 = np.array(heights.texels).reshape(-1, 4).T
    steep = np.abs(s01 - s00) > _JUMP * np.maximum(s00, s01)
    assert np.sum(steep) > 100
    # The rim of the floor is a jump; it lies within a texel of the horizon, whose samples have no height.
    assert np.all(np.isnan(places.reshape(-1, 4)[np.min([s00, s10, s01, s11], axis=0) > 0]))


def test_nothing_in_the_map_has_no_walls(variant):
    speck = {"type": "sphere", "center": [0.3, 0.2, -90.0], "radius": 1e-3}
    for light in (lamp(*LAMP), spot()):
        _, places = walled(loaded_scene(ball=speck, floor=None, lamp=light), 16)
        assert np.all(np.isnan(places))


@pytest.mark.claim("upright-walls")
@pytest.mark.parametrize("size", [16, 64])
def test_a_shadow_of_straight_edges_is_known_to_a_fraction_of_a_texel(variant, size):
    """The frame against the truth: what is left are the corners, and a 64th of a texel."""
    import mitsuba as mi

    from validation.estimates.quadrature import truth_image

    description = tiny_scene(size=(40, 30), **FLAT, plate=plate(-0.31, -0.47))
    truth = truth_image(mi.load_dict(description)).airlight
    loaded = mi.load_dict(description)

    def error(walls):
        airlight = render(loaded, map=size, walls=walls).airlight
        return np.sqrt(np.mean((airlight - truth) ** 2)) / np.mean(truth)

    assert error("upright") < 0.15 * error("slanted")


def test_shadows_on_surfaces_end_where_walls_stand(variant):
    """The lit part of the floor, seen from above: pixels that are wrong are a fraction of a texel wide."""
    loaded = loaded_scene(
        **FLAT, plate=plate(-0.31, -0.47), **camera((0.4, 0.2, 8.0), (0.4, 0.21, 0), size=(96, 72), up=(0, 1, 0))
    )
    exact = render(loaded, surface="ray", map=32).surface
    wrong = {
        walls: np.sum(np.abs(render(loaded, map=32, walls=walls).surface - exact) > 1e-3 * np.max(exact)) / 3
        for walls in ("slanted", "upright")
    }
    assert wrong["slanted"] > 60
    assert wrong["upright"] < 0.2 * wrong["slanted"]


@pytest.mark.claim("lists-in-any-room", tolerance="2e-6 of the largest")
def test_lists_that_overflow_change_nothing_beside_walls(variant, monkeypatch):
    """Squares of many texels are gone through one after the other, from wherever the line enters them."""
    import realtime.methods.light_volumes.tile_lists

    loaded = loaded_scene()
    wanted = render(loaded, map=64).airlight
    for rooms in ((6, 1), (8, 3)):
        monkeypatch.setattr(realtime.methods.light_volumes.tile_lists, "_TILE_ROOM", rooms[0])
        monkeypatch.setattr(realtime.methods.light_volumes.tile_lists, "_BLOCK_ROOM", rooms[1])
        assert np.max(np.abs(render(loaded, map=64).airlight - wanted)) < 2e-6 * np.max(wanted)


@pytest.mark.parametrize("corner", range(4))
def test_parts_of_a_texel_with_a_corner_cut_off(variant, corner):
    """Beyond the line between the walls there is the corner's height, on this side the plane of the other three."""
    import mitsuba as mi

    from realtime.methods.light_volumes.texel_walls import BOTTOM, LEFT, PLACES, RIGHT, TOP, height_in, parts_of

    right, above = corner % 2, corner // 2
    along, up = 11, 40  # numbers of the intervals of the walls
    walls = (along + 1) << 8 * (TOP if above else BOTTOM) | (up + 1) << 8 * (RIGHT if right else LEFT)
    plane = {(x, y): 0.2 + 0.01 * x + 0.03 * y for x in (0, 1) for y in (0, 1)}
    four = [plane[x, y] if (x, y) != (right, above) else 1.7 for y in (0, 1) for x in (0, 1)]
    rng = np.random.default_rng(4)
    x, y = rng.random((2, 1000))
    parts = parts_of(mi.Vector4f(*four), mi.UInt32(walls), mi.Float)
    heights = np.array(height_in(parts, mi.Float(x), mi.Float(y)))
    place_x, place_y = (along + 0.5) / PLACES, (up + 0.5) / PLACES
    cut = np.abs(x - right) / np.abs(place_x - right) + np.abs(y - above) / np.abs(place_y - above) < 1
    assert 0.01 < np.mean(cut) < 0.5
    expected = np.where(cut, 1.7, 0.2 + 0.01 * x + 0.03 * y)
    assert heights == pytest.approx(expected, rel=1e-6)


def test_a_moved_light_finds_its_walls_anew(variant):
    import drjit as dr
    import mitsuba as mi

    from realtime.frame.renderer import image_frame, run_stages
    from tests.helpers.light_frames import renderer_of

    renderer = renderer_of(loaded_scene(), map=64)
    light = replace(renderer.scene.lights[0], position=mi.Vector3f(0.7, 0.9, 2.3))
    dr.make_opaque(light.position)
    moved = replace(renderer, scene=replace(renderer.scene, lights=(light,)))
    airlight = image_frame(moved, run_stages(moved, moved.prepare(moved.scene))).airlight
    wanted = render(loaded_scene(lamp=lamp(0.7, 0.9, 2.3)), map=64).airlight
    assert np.max(np.abs(airlight - wanted)) < 1e-6 * np.max(wanted)
