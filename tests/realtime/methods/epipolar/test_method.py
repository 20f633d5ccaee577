# SPDX-License-Identifier: BSD-3-Clause
"""Slices, their height maps, trees and samples, against brute force; frames against the
reference and light volumes.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame.image import render_frame
from airlight.realtime.methods.epipolar.min_max_tree import slice_heights
from airlight.realtime.methods.epipolar.samples import between_samples, mark_samples
from airlight.realtime.methods.epipolar.slices import (
    image_slices,
    neighbour,
    pixel_number,
    slice_coordinate,
)
from airlight.realtime.methods.epipolar.walk import sum_lit_intervals
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.read_scene import read_scene
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map, inverse_depth
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import configuration, prepared
from tests.helpers.frames import frame, reference_of, relative_rmse
from tests.helpers.light_frames import SIZE as FRAME_SIZE
from tests.helpers.light_frames import camera, coloured_fog, lamp
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene

SIZE = (40, 30)
#: Where the light is, seen from a camera at the origin that looks along +y with +z up.
PLACES = {
    "in view": (0.3, 2.1, -0.2),
    "to the left": (-3.1, 1.7, 0.1),
    "above": (0.2, 1.1, 2.3),
    "beyond a corner": (2.9, 1.3, -2.2),
    "beside": (1.7, 0.0, 0.4),
    "behind": (0.1, -1.9, 0.3),
    "behind, to the right": (2.3, -0.7, -0.4),
    "at the camera": (0.0, 0.0, 0.0),
}


def read(position, *, kind="point", **changes):
    look = mi.ScalarTransform4f().look_at([0, 0, 0], [0, 1, 0], [0, 0, 1])
    lamp = {"type": "point", "position": list(position), "intensity": 1.0}
    if kind == "spot":
        aim = mi.ScalarTransform4f().look_at(list(position), [0.1, 2.4, -0.9], [1, 0, 0])
        lamp = {
            "type": "spot",
            "to_world": aim,
            "cutoff_angle": 37.0,
            "beam_width": 37.0,
            "intensity": 1.0,
        }
    sphere = {"type": "sphere", "center": [0.3, 1.6, 0.6], "radius": 0.41}
    floor = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, -1]).scale(6.3),
    }
    scene = tiny_scene(size=SIZE, **({"lamp": lamp, "ball": sphere, "floor": floor} | changes))
    scene["sensor"] = scene["sensor"] | {"to_world": look}
    return read_scene(mi.load_dict(scene))


def vectors(value):
    return np.array(value, dtype=float).T


def slices_of(scene, count=24):
    return image_slices(scene.camera, scene.lights[0], count)


@pytest.mark.claim("slices-by-the-border", tolerance="1e-4 relative")
@pytest.mark.parametrize("place", PLACES)
def test_slices_leave_at_equal_steps_and_reach_every_pixel(variant, place):
    scene = read(PLACES[place])
    slices, camera = slices_of(scene, 200), scene.camera
    ends = np.array(slices.ends, dtype=float).reshape(-1, 4)
    steps = np.abs(np.diff(ends[:, 2:], axis=0)).sum(axis=1)  # along the border, round corners too
    assert steps == pytest.approx(float(slices.length[0]) / 200, rel=1e-4)
    pixel = np.arange(SIZE[0] * SIZE[1])
    i, j = (SIZE[0] - 1) / 2 - pixel % SIZE[0], (SIZE[1] - 1) / 2 - pixel // SIZE[0]
    direction = camera.forward + camera.left * mi.Float(i) + camera.up * mi.Float(j)
    point = camera.project(direction)[:2]
    assert np.array(point[0]) == pytest.approx(i, abs=1e-4)
    assert np.array_equal(np.array(pixel_number(slices, *point)), pixel)
    number = neighbour(slices, mi.Int32(slice_coordinate(slices, *point) + 0.5))
    # No pixel is farther from the slice that stands for it than half a step between slices, except
    # for the few in whose square the epipole lies.
    across = vectors(slices.across)[np.array(number)]
    normal = np.cross(vectors(slices.towards), across)
    offset = np.abs(np.sum(vectors(direction) * normal, axis=1))
    pixel_width = float(np.linalg.norm(vectors(camera.left)))
    half_step = 0.5 * float(slices.length[0]) / 200 * pixel_width
    assert offset.max() < 1.02 * half_step
    inside = np.sum(vectors(direction) * across, axis=1) > -1e-6
    assert np.mean(inside) > 0.99


def test_a_pixel_whose_depth_no_sample_has_is_not_interpolated(variant):
    """A leaf before the ground, between the samples: it would have no airlight at all."""
    slices = slices_of(read(PLACES["in view"]))
    ground = mi.Float(5.0) + dr.zeros(mi.Float, SIZE[0] * SIZE[1])
    samples = mark_samples(slices, ground, count=32, step=4)
    values = dr.full(mi.Float, 0.25, slices.count * samples.count)
    point = mi.Float(7.5, 7.5), mi.Float(-4.5, -4.5)
    fraction, fits = between_samples(samples, values, point, mi.Float(5.0, 2.0))
    assert np.array(fits).tolist() == [True, False]
    assert float(fraction[0]) == pytest.approx(0.25)


def height_maps(scene, size=32, count=24):
    light = scene.lights[0]
    shadow_map = cast_shadow_map(scene.geometry, light, size)
    return slice_heights(shadow_map, inverse_depth(shadow_map), slices_of(scene, count), light)


def trees(heights):
    # the first place of a tree is never written, and may hold anything
    with np.errstate(invalid="ignore"):
        values = np.array(heights.tree).astype(float)
    return values.reshape(heights.slices.count, 2 * heights.leaves, 2)


def samples_of(heights):
    """Return the heights S at all samples of all slices."""
    leaves = trees(heights)[:, heights.leaves :]
    assert np.array_equal(leaves[:, 1:, 0], leaves[:, :-1, 1])
    return np.concatenate([leaves[:, :, 0], leaves[:, -1:, 1]], axis=1)


@pytest.mark.claim("tree-of-bounds")
@pytest.mark.parametrize("kind", ["point", "spot"])
def test_the_tree_holds_the_bounds(variant, kind):
    heights = height_maps(read((0.4, 1.9, 1.9), kind=kind), size=16)
    values, tree = samples_of(heights), trees(heights)
    assert heights.leaves == (32 if kind == "point" else 16)
    for level in range(1, heights.top + 1):
        side = 1 << level
        for node in range(heights.leaves // side):
            own = values[:, node * side : (node + 1) * side + 1]
            assert np.array_equal(tree[:, heights.leaves // side + node, 0], own.min(axis=1))
            assert np.array_equal(tree[:, heights.leaves // side + node, 1], own.max(axis=1))


@pytest.mark.claim("tree-of-bounds", tolerance="4e-3 m: the distance of the points")
@pytest.mark.parametrize("kind", ["point", "spot"])
def test_lit_pieces_are_those_of_many_points(variant, kind):
    """A ray of the slice looked at point by point in float64: where is it, and what
    does the map hold there?
    """
    scene = read((0.4, 1.9, 1.9), kind=kind)
    heights = height_maps(scene, size=32)
    values, slices = samples_of(heights), heights.slices
    rng = np.random.default_rng(8311)
    count, points = 200, 10000
    number = rng.integers(0, slices.count, count)
    angle = rng.uniform(0.02, np.pi - 0.02, count)
    distance = float(slices.distance[0])
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    x1 = rng.uniform(0.5, 9.0, count)
    x = (np.arange(points) + 0.5) / points * x1[:, None]
    position = np.array([distance, 0.0]) + x[..., None] * direction[:, None, :]
    if kind == "point":
        begin, edges = x1 * 0, np.array([[[1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [-1.0, 0.0]]])
        edges = np.broadcast_to(edges, (count, 2, 2, 2))
    else:
        chord = np.stack(
            [np.array(coordinate, dtype=float) for coordinate in heights.chord], axis=1
        )[number]
        edges, begin = chord.reshape(count, 1, 2, 2), x1 * 0
    total, inside_all = np.zeros(count), np.zeros(count)
    for edge in range(heights.edges):
        start, end = edges[:, edge, None, 0], edges[:, edge, None, 1]
        before = start[..., 0] * position[..., 1] - start[..., 1] * position[..., 0]
        beyond = position[..., 0] * end[..., 1] - position[..., 1] * end[..., 0]
        inside = (before >= 0) & (beyond > 0)
        q = np.where(inside, before / (before + beyond), 0.0)
        k = start + q[..., None] * (end - start)
        s = np.linalg.norm(k, axis=2) / np.linalg.norm(position, axis=2)
        at = np.minimum(q * heights.size, heights.size - 1e-9)
        leaf = at.astype(int)
        own = values[number[:, None], leaf + edge * heights.size]
        after = values[number[:, None], leaf + edge * heights.size + 1]
        lit = inside & (distance * s >= own + (at - leaf) * (after - own))
        total += lit.sum(axis=1) * (x1 / points)
        inside_all += inside.sum(axis=1) * (x1 / points)
    if kind == "spot":  # the walk is asked for the part of the ray in the chord only
        has = inside.any(axis=1)
        begin = np.where(has, x[np.arange(count), inside.argmax(axis=1)], 0.0)
        x1 = np.where(has, x[np.arange(count), points - 1 - inside[:, ::-1].argmax(axis=1)], 0.0)
    geometry = RayGeometry(
        mi.Float(-distance * np.cos(angle)), mi.Float(distance * np.sin(angle)), None, None
    )
    zero = mi.Float(np.zeros(count))
    segment = mi.Float(begin), mi.Float(x1)
    length = np.array(
        sum_lit_intervals(heights, mi.UInt32(number), geometry, segment, lambda a, b: b - a, zero)
    )
    assert np.mean((total > 0) & (total < inside_all - 1e-2)) > 0.1  # some rays are lit in part
    # The points are 9e-4 m apart at most; few rays have more than two pieces, of two ends each.
    assert length == pytest.approx(total, abs=4e-3)


# Frames -------------------------------------------------------------------------------------------


MAP = 256
CHANGES = {
    "light in view": lambda: camera((-2.5, -2.2, 0.3), (0.9, 0.7, 1.9)),
    "light behind": lambda: camera((1.7, 1.6, 2.9), (-0.9, -0.7, -0.1)),
    "spot": lambda: {"lamp": spot()},
    "colour, HG, two lights": lambda: {"fog": coloured_fog(), "second": lamp(-1, 1.4, 0.6)},
}
ALL = [
    pytest.param(change, marks=pytest.mark.slow) if "HG" in change else change for change in CHANGES
]


def scene_with(change):
    return tiny_scene(size=FRAME_SIZE, **CHANGES[change]())


def render(scene, method, **parameters):
    return frame(scene, method, **parameters).airlight


@pytest.mark.claim(
    "tree-of-bounds",
    tolerance="a fifth of the shadows; 0.4 of the error with an eighth of the texel",
)
@pytest.mark.parametrize("change", ALL)
def test_every_pixel_comes_to_the_reference_as_the_map_grows(variant, change):
    """Where the map jumps a wall leans over one texel: the error falls as its size, as
    its root at grazing rays.
    """
    scene = scene_with(change)
    expected = reference_of(scene).airlight
    errors = [
        relative_rmse(render(scene, "min-max", map=size, sampling="pixels", slices=1600), expected)
        for size in (64, 512)
    ]
    bare = relative_rmse(render(scene, "unshadowed"), expected)
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 0.2 * bare


@pytest.mark.claim("slices-converge", tolerance="relative RMSE 2e-3")
@pytest.mark.parametrize("change", ALL)
def test_slices_converge_to_the_light_volume(variant, change):
    """It has the same height field, in another way."""
    scene = scene_with(change)
    expected = render(scene, "light-volumes", map=MAP, walls="slanted")
    errors = [
        relative_rmse(render(scene, "min-max", map=MAP, sampling="pixels", slices=count), expected)
        for count in (200, 1600)
    ]
    # Measured 1.5e-3 at most, what sampling the height field once more is wrong by.
    assert errors[1] < 2e-3
    # First order, down to that and to rounding.
    assert errors[1] < max(0.6 * errors[0], 1e-6)


@pytest.mark.claim("slices-converge", tolerance="relative RMSE 6e-3")
@pytest.mark.parametrize("change", ALL)
def test_samples_converge_to_all_pixels(variant, change):
    scene = scene_with(change)
    expected = render(scene, "min-max", map=MAP, sampling="pixels", slices=1600)
    fine, coarse = (
        relative_rmse(render(scene, "min-max", map=MAP, **settings), expected)
        for settings in (
            {"slices": 200, "samples": 256, "step": 1},
            {"slices": 30, "samples": 32, "step": 16},
        )
    )
    assert fine < max(0.25 * coarse, 1e-6)
    # Measured 3.8e-3 at most: slices are half a pixel apart, and the mean of two is
    # as wrong as the nearest.
    assert fine < 6e-3


@pytest.mark.claim("a-lit-fraction")
def test_no_pixel_is_brighter_than_without_shadows(variant):
    """Lights in view and sharp phase functions: fractions of a rough estimate made an
    image 363 times too bright.
    """
    scene = read_scene(load_scene("random:427", (80, 60)).scene)
    image, bare = (
        np.asarray(render_frame(prepared(scene, configuration(method, None, {}))).airlight)
        for method in ("min-max", "unshadowed")
    )
    # Sums over lit intervals and the whole ray are rounded differently, and in float32
    # by the quadrature's size.
    assert (image <= bare * 1.01 + 1e-4 * bare.mean()).all()
    assert image.mean() < bare.mean()


def test_media_of_pure_colours_have_fractions_channel_by_channel(variant):
    """A ray that meets the red medium alone has no fraction of green, which its neighbours in the
    green one must not take for a number: pixels between the two were negative.
    """

    def fog(centre, radius, albedo):
        sphere = {"type": "sphere", "center": list(centre), "radius": radius}
        return bounded_medium(sphere, 0.9, albedo)

    scene = clear_scene(
        size=(64, 48),
        red=fog((-0.3, -0.6, 0.6), 0.5, (0.9, 0.0, 0.0)),
        green=fog((0.1, 0.7, 0.65), 0.6, (0.0, 0.9, 0.0)),
        ball={"type": "sphere", "center": [0.58, 0.71, 1.4], "radius": 0.12},
    )
    image, bare = (np.asarray(render(scene, name)) for name in ("min-max", "unshadowed"))
    assert (image >= -1e-6 * bare.mean()).all()
    assert (image <= bare * 1.01 + 1e-4 * bare.mean()).all()
    # Some rays meet both media.
    assert ((bare[..., 0] > 0) & (bare[..., 1] > 0)).sum() > 30
    assert image.mean() < bare.mean()
