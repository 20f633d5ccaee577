# SPDX-License-Identifier: BSD-3-Clause
"""Frames of light volumes, walked and drawn, against the float64 twin with the very map
that they used; their walls.
"""

from dataclasses import replace
from functools import cache

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlight.errors import InputError
from airlight.realtime.frame.image import image_frame
from airlight.realtime.frame.renderer import run_stages
from airlight.realtime.methods.light_volumes.jump_search import _JUMP, with_walls
from airlight.realtime.methods.light_volumes.texel_walls import PLACES, walled_heights
from airlight.realtime.methods.published.billeter2010.mesh import volume_mesh
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.realtime.shadow_maps.inverse_depth_field import inverse_depth_field
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map, inverse_depth
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.evidence.oracles.light_volume import oracle_airlight
from tests.helpers.frames import render, renderer
from tests.helpers.light_frames import (
    GRID,
    SCENES,
    VOLUMES,
    camera,
    differ,
    lamp,
    loaded_scene,
    render_both,
    twin_of,
)
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene

#: One of a kind; beside the view the faces of the cube that a tile passes count.
FEW = ("light beside the view", "light in view", "fence", "spot in view")

#: Fraction of the pixels that must be within 1e-4 of their own value. Where many rays graze the rim
#: of a cone, some millimetres of 3 m are lit, of which float32 holds 1e-4, or at the rim of a soft
#: one what is lit is as dim.
FRACTIONS = {"soft spot": 0.994, "three lights": 0.998}


@pytest.mark.claim("exact-for-its-map", tolerance="float32: 1e-5 of the largest")
@pytest.mark.parametrize("walls", ["slanted", "upright"])
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in FEW else pytest.mark.slow) for name in SCENES]
)
def test_frames_are_exact_with_respect_to_the_map(variant, name, walls):
    """Walked and drawn; with walls over a texel, or with those that the rays of the map
    found, which are walked.
    """
    loaded, size = loaded_scene(name), SCENES[name][1]
    frames = (
        render_both(loaded, "single", map=size)
        if walls == "slanted"
        else [render(loaded, "light-volumes", map=size)]
    )
    wanted = twin_of(loaded, frames[0], size, "single", walls=walls)
    assert np.max(wanted) > 5e-4
    for frame in frames:
        error = np.abs(frame.airlight - wanted)
        # The kernel's 5e-6 of the value, and room for the rounding of some terms.
        assert np.max(error) < 1e-5 * np.max(wanted)
        assert np.mean(error <= 1e-4 * wanted) > FRACTIONS.get(name, 0.999)


@pytest.mark.parametrize("size", [(1, 1), (18, 13)])
def test_any_size_of_image(variant, size):
    """Tiles of 4 x 4 pixels are squares in few of them."""
    loaded = loaded_scene(size=size)
    frames = render_both(loaded, map=64)
    wanted = twin_of(loaded, frames[0], 64)
    for frame in frames:
        assert frame.airlight.shape == (size[1], size[0], 3)
        assert differ(frame.airlight, wanted) < 1e-5


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("method", VOLUMES)
def test_rays_on_the_border_of_two_faces_are_lit_once(variant, axis, method):
    """The plane of the border holds the camera, and a column, a row or a diagonal of its pixels."""
    origin, target, up, light = (
        np.roll(vector, axis) for vector in ((1, -4, 1.5), (1, 4, 1.5), (0, 0, 1), (0, 0, 2.5))
    )
    # falls between the rays of the map
    speck = {"type": "sphere", "center": [0.3, 0.2, -90.0], "radius": 1e-3}
    changes = camera(origin, target, size=GRID, up=up) | {
        "lamp": lamp(*light),
        "ball": speck,
        "floor": None,
    }
    loaded = loaded_scene(**changes)
    wanted = render(loaded, "unshadowed").airlight
    # Three faces have nodes of their own: within the kernel's 5e-6.
    assert render(loaded, method, map=64).airlight == pytest.approx(wanted, rel=1e-5)


HEIGHTS = (0.0, 0.15, 0.4, 0.7, 1.9)  # inverse depths [1/m]; few, so that many texels are flat
VIEWS = (
    ((0.2, -4.1, 1.3), (0.1, 0.0, 0.6)),
    ((0.31, -1.2, 1.13), (0.9, 0.6, 1.7)),
    ((1.3, 0.4, 2.1), (5, 4, 2.7)),
)
SMALL = 4  # texels


@cache
def renderers(kind, view):
    """Return a scene, its renderers in float64, and a map to replace the values of."""
    changes = camera(*VIEWS[view], size=(13, 9)) | (
        {"lamp": spot(cutoff=50.0, beam=50.0)} if kind == "spot" else {}
    )
    loaded = loaded_scene(**changes)
    both = [
        renderer(loaded, method, precision="double", map=SMALL, **parameters)
        for method, parameters in VOLUMES.items()
    ]
    scene = both[0].scene
    return loaded, both, cast_shadow_map(scene.geometry, scene.lights[0], SMALL)


def vertices_of(shadow_map):
    """Return for each corner of the texels the number of its vertex: faces of a
    cube meet in the same ones.
    """
    size = shadow_map.size
    face, row, column = np.indices((shadow_map.faces, size + 1, size + 1)).reshape(3, -1)
    place = np.stack([np.where(face % 2, -size, size), 2 * column - size, 2 * row - size])
    lattice = np.empty_like(place)
    for axis in range(3):
        lattice[(face // 2 + axis) % 3, np.arange(len(face))] = place[axis]
    return np.unique(lattice, axis=1, return_inverse=True)[1].ravel()


def with_heights(shadow_map, heights):
    """Return a map that has these inverse depths at its corners."""
    length = np.array(
        inverse_depth(replace(shadow_map, distance=mi.Float64(np.ones(len(heights)))))
    )
    with np.errstate(divide="ignore"):
        return replace(shadow_map, distance=mi.Float64(length / heights))


@pytest.mark.claim("exact-for-its-map", tolerance="1e-7 of the largest")
@pytest.mark.parametrize("kind", ["point", pytest.param("spot", marks=pytest.mark.slow)])
@settings(max_examples=20, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_any_map(variant, kind, data):
    """Whatever the heights: three routes to the same volume."""
    loaded, (walk, mesh), shadow_map = renderers(kind, data.draw(st.integers(0, len(VIEWS) - 1)))
    vertex = vertices_of(shadow_map)
    count = int(np.max(vertex)) + 1
    heights = data.draw(st.lists(st.sampled_from(HEIGHTS), min_size=count, max_size=count))
    drawn_map = with_heights(shadow_map, np.array(heights)[vertex])
    walked = image_frame(walk, run_stages(walk, ((inverse_depth_field(drawn_map),),)))
    drawn = image_frame(mesh, run_stages(mesh, ((volume_mesh(drawn_map, walk.scene.lights[0]),),)))
    wanted = oracle_airlight(read_reference(loaded), [drawn_map], distance=walked.distance)
    # As in the frames above; what is lit may be next to nothing, so the scale is the light's.
    scale = np.max(np.array(walk.scene.lights[0].intensity))
    assert np.max(np.abs(walked.airlight - drawn.airlight)) < 1e-13 * scale
    assert np.max(np.abs(walked.airlight - wanted)) < 1e-7 * scale


def any_walls(rng, faces, fraction):
    """Return the numbers of walls of texels of which a fraction of the sides has one, anywhere."""
    level, upright = rng.integers(1, PLACES + 1, (2, faces, SMALL + 1, SMALL + 1), dtype=np.uint32)
    level[rng.random(level.shape) >= fraction] = 0
    upright[rng.random(upright.shape) >= fraction] = 0
    sides = level[:, :-1, :-1], level[:, 1:, :-1], upright[:, :-1, :-1], upright[:, :-1, 1:]
    return sum(side << np.uint32(8 * k) for k, side in enumerate(sides)).ravel()


@pytest.mark.claim("exact-for-its-map", tolerance="1e-7 of the largest")
@pytest.mark.parametrize("kind", ["point", pytest.param("spot", marks=pytest.mark.slow)])
@settings(max_examples=20, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_any_walls_in_any_map(variant, kind, data):
    """Wherever walls stand, on any number of a texel's sides, between
    heights that jump or do not.
    """
    loaded, (walk, _), shadow_map = renderers(kind, data.draw(st.integers(0, len(VIEWS) - 1)))
    vertex = vertices_of(shadow_map)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    # Heights of no two corners are the same, so that no ray lies in the height field over a length.
    heights = (rng.choice(HEIGHTS[1:], vertex.max() + 1) * rng.uniform(0.9, 1.1, vertex.max() + 1))[
        vertex
    ]
    drawn_map = with_heights(shadow_map, heights)
    walls = any_walls(rng, drawn_map.faces, data.draw(st.sampled_from([0.0, 0.2, 0.5, 1.0])))
    field = walled_heights(
        inverse_depth_field(drawn_map), mi.UInt32(walls), mi.UInt32(np.flatnonzero(walls))
    )
    walked = image_frame(walk, run_stages(walk, ((field,),)))
    wanted = oracle_airlight(
        read_reference(loaded), [drawn_map], distance=walked.distance, walls=[walls]
    )
    scale = np.max(np.array(walk.scene.lights[0].intensity))
    assert np.max(np.abs(walked.airlight - wanted)) < 1e-7 * scale


@pytest.mark.claim("enclosed-light")
@pytest.mark.parametrize(("shape", "kind"), [("sphere", "point"), ("cube", "spot")])
def test_a_light_inside_a_closed_occluder_lights_nothing_outside(variant, shape, kind):
    place = (
        mi.ScalarTransform4f().translate([0.11, 0.13, 0.72]).rotate([0.3, 1, 0.2], 17).scale(0.39)
    )
    inside = [0.173, 0.052, 0.781]
    light = {"to_world": mi.ScalarTransform4f().look_at(inside, [0, 1, 2], [1, 0, 0])}
    lights = {"lamp": lamp(*inside) if kind == "point" else spot() | light}
    loaded = loaded_scene(ball={"type": shape, "to_world": place}, **lights)
    assert np.max(render(loaded, "unshadowed").airlight) > 0.01
    # Before a wall that the camera sees, 0.3 m from the light and 3 m away,
    # rounding leaves 1e-6 m at most.
    at_wall = 0.31 * 9 / (4 * np.pi * 0.3**2)
    for frame in render_both(loaded, map=32):
        assert np.max(np.abs(frame.airlight)) < 1e-6 * at_wall


# Walls between the samples of a map: where they stand, and what they are worth --------------------


LAMP = (0.13, -0.07, 2.9)
FLAT = {"ball": None, "lamp": lamp(*LAMP)}


def walled(loaded, size, precision="single"):
    """Return the heights of a scene's first light with walls, and the walls' places by
    face, row, column and side.
    """
    scene = read_scene(loaded, precision)
    heights = inverse_depth_field(cast_shadow_map(scene.geometry, scene.lights[0], size))
    walled_field = with_walls(heights, scene.geometry, scene.lights[0])
    number = (
        np.array(walled_field.walls).reshape(heights.faces, size, size, 1)
        >> np.arange(0, 32, 8, dtype=np.uint32)
        & 0xFF
    )
    return walled_field, np.where(number > 0, (number - 0.5) / PLACES, np.nan)


def plate(x, y, z=1.1, half=0.6):
    """Return a level square whose sides have the given distances from the
    lamp's axis on the low side.
    """
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
            # Sides that the edge cuts across: the bottoms of a column, or the left sides
            # of a row, along the plate.
            line = below[:, column, 0] if across == 0 else below[column, :, 2]
            other = (y, x)[across]
            first, last = (int(0.5 * size * (end / depth + 1)) for end in (other, other + 2 * half))
            walls = line[first + 2 : last - 1]
            assert len(walls) >= size // 8
            assert np.all(np.abs(walls - (texel - column)) <= 0.5 / PLACES + 1e-6)


@pytest.mark.claim("upright-walls")
def test_slopes_are_no_walls(variant):
    """A floor that rays meet at a grazing angle is as steep as a jump between two
    samples, and bends nowhere.
    """
    ground = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([400, 400, 1])}
    heights, places = walled(loaded_scene(ball=None, floor=ground, lamp=lamp(*LAMP)), 32)
    s00, s10, s01, s11 = np.array(heights.texels).reshape(-1, 4).T
    steep = np.abs(s01 - s00) > _JUMP * np.maximum(s00, s01)
    assert np.sum(steep) > 100
    # The rim of the floor is a jump; it lies within a texel of the horizon,
    # whose samples have no height.
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


# Refusals and memory ------------------------------------------------------------------------------


def test_a_mesh_is_for_one_homogeneous_medium_without_bounds(variant):
    smoke = bounded_medium(
        {"type": "sphere", "center": [0.1, 0.2, 0.9], "radius": 0.4}, 0.7, (0.9, 0.8, 0.7)
    )
    loaded = mi.load_dict(clear_scene(cloud=smoke))
    for other in (loaded, load_scene("street", (4, 3)).scene):  # height fog
        with pytest.raises(
            InputError, match=r"light-volumes-2010: expected one homog.*use light-volumes"
        ):
            renderer(other, "light-volumes-2010")
    assert np.max(render(loaded, "light-volumes", map=16).airlight) > 0


@pytest.mark.claim("memory-before-it-is-taken")
@pytest.mark.parametrize("method", VOLUMES)
def test_memory_is_counted_before_it_is_taken(variant, monkeypatch, method):
    import airlight.realtime.memory

    def never(*args):
        raise AssertionError("a map was cast")

    loaded = loaded_scene(size=(4, 4))
    monkeypatch.setattr(
        airlight.realtime.memory,
        "usable_memory",
        lambda: airlight.realtime.memory.Memory(10**9, "this machine has"),
    )
    with monkeypatch.context() as patch:
        patch.setattr(f"{METHODS[method].__module__}.cast_shadow_map", never)
        message = r"map: 4096 texels for 1 light\(s\): needs [0-9.]+ GB of memory, this machine has 1 GB; use a smaller"
        with pytest.raises(InputError, match=message):
            renderer(loaded, method, map=4096)
    render(loaded, method, map=64)
