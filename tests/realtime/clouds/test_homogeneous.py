# SPDX-License-Identifier: BSD-3-Clause
"""Claim: crossings, depths, order 1 and opacity of homogeneous clouds of any shape are
those of all their triangles.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.clouds.march import (
    cloud_surfaces,
    depths_along,
    next_crossing,
    segment_through,
)
from airlight.realtime.clouds.single_scattering import Beam, cloud_rays, light_once, opacity_of
from airlight.realtime.methods.published.bouthors2008 import printed_opacity, printed_step
from airlight.realtime.numerics.array_types import aligned_array
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import box, placed
from tests.helpers.clouds import SUN, cloud, crossings, length_inside, loaded, ring

pytestmark = pytest.mark.usefixtures("variant")

# Crossings and depths -----------------------------------------------------------------------------


GREY = 0.0363


def random_rays(count, seed=3, spread=200.0):
    random = np.random.default_rng(seed)
    direction = random.normal(size=(count, 3))
    return random.uniform(-spread, spread, (count, 3)), direction / np.linalg.norm(
        direction, axis=1, keepdims=True
    )


def depths_of(scene, origin, direction, end, precision="single"):
    read = read_scene(scene, precision)
    Float = type(read.camera.origin.x)
    Vector = type(read.camera.origin)
    arrays = (
        Vector(*(aligned_array(Float, column) for column in values.T))
        for values in (origin, direction)
    )
    rays = cloud_surfaces(read), read.medium.clouds, *arrays, dr.opaque(Float, end)
    depths = depths_along(*rays, stride=None, seen=False)
    return [np.array(depth, dtype=np.float64) for depth in depths]


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("end", [np.inf, 170.0])
def test_depths_in_a_ring_are_those_of_all_its_triangles(precision, end):
    """Rays start inside and outside and cross the ring up to four times;
    float32 rounds 400 m to 2e-5 m.
    """
    origin, direction = random_rays(400)
    (depth,) = depths_of(loaded(), origin, direction, end, precision)
    expected = [GREY * length_inside(ring(), *ray, end) for ray in zip(origin, direction)]
    assert np.count_nonzero(expected) > 50
    assert depth == pytest.approx(np.array(expected), abs=GREY * 5e-4)


def test_points_on_the_boundary_are_neither_lost_nor_counted_twice():
    """Segments start where camera rays enter and leave: inwards the whole chord
    counts, outwards nothing.
    """
    read = read_scene(loaded())
    surfaces = cloud_surfaces(read)
    origin, direction = random_rays(2000, seed=11)
    o, d = (
        mi.Vector3f(*(aligned_array(mi.Float, column) for column in values.T))
        for values in (origin, direction)
    )
    first = next_crossing(surfaces, o, d, mi.Float(0))
    met = np.array(dr.isfinite(first.distance) & ~first.leaves)
    place = o + d * first.distance
    inwards = mi.Vector3f(-first.normal)
    for way, sign in ((inwards, 1), (-inwards, 0)):
        rays = surfaces, read.medium.clouds, place, way, mi.Float(60.0)
        (depth,) = depths_along(*rays, stride=None, seen=False, active=mi.Bool(met))
        points, ways = (np.array(array, dtype=np.float64).T[met][:200] for array in (place, way))
        # A little further on there is no doubt about the start.
        expected = [
            GREY * (length_inside(ring(), point + 0.01 * unit, unit, 59.99) + 0.01 * sign)
            for point, unit in zip(points, ways)
        ]
        assert np.array(depth)[met][:200] == pytest.approx(np.array(expected), abs=GREY * 2e-3)


# Order 1 and opacity, by sums over small steps ----------------------------------------------------


COLOURED = {
    "type": "homogeneous",
    "sigma_t": {"type": "rgb", "value": [0.0163, 0.0271, 0.0414]},
    "albedo": {"type": "rgb", "value": [0.97, 0.93, 0.89]},
    "phase": {"type": "hg", "g": 0.71},
}
SIGMA, ALBEDO, G = np.array([0.0163, 0.0271, 0.0414]), np.array([0.97, 0.93, 0.89]), 0.71
TRAVELS = np.array([0.737, -0.271, -0.619]) / np.linalg.norm([0.737, -0.271, -0.619])


def rays(count=60):
    """Return rays that look at the ring from outside, and some that start in it."""
    random = np.random.default_rng(4)
    origin = np.array([30.83, -400.91, 57.03]) + random.uniform(-40, 40, (count, 3))
    direction = random.uniform(-110, 110, (count, 3)) - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin[::4] += 380 * direction[::4]
    return origin, direction


def segments(points):
    """Return lengths in the ring from points towards the sun [m]: where it
    leaves less where it enters.
    """
    vertices, faces = ring()
    a, b, c = np.moveaxis(vertices.astype(np.float32).astype(np.float64)[faces], 1, 0)
    first, second = b - a, c - a
    across = np.cross(-TRAVELS, second)
    inverse = 1 / np.einsum("ij,ij->i", first, across)
    offset = points[:, None] - a
    u = np.einsum("pij,ij->pi", offset, across) * inverse
    turned = np.cross(offset, first)
    v = turned @ -TRAVELS * inverse
    distance = np.einsum("pij,ij->pi", turned, second) * inverse
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    return np.sum(np.where(met, distance * np.sign(np.cross(first, second) @ -TRAVELS), 0), axis=1)


def summed_up(origin, direction, scale=1.0, steps=200):
    """Return radiance by the midpoint rule, for unit irradiance and P = 1, by channel."""
    total, before = np.zeros(3), 0.0
    distance, leaves = crossings(ring(), origin, direction)
    for begin, end in zip(np.append(0.0, distance)[:-1][leaves], distance[leaves]):
        width = (end - begin) / steps
        middle = begin + (np.arange(steps) + 0.5) * width
        segment = segments(origin + middle[:, None] * direction)
        path = before + middle - begin
        depth = SIGMA * (path + scale * segment)[:, None]
        total += (ALBEDO * SIGMA * np.exp(-depth)).sum(axis=0) * width
        before += end - begin
    return total / (4 * np.pi)


def device(array):
    return mi.Vector3f(*(aligned_array(mi.Float, column) for column in np.asarray(array).T))


def marched(scene, origin, direction, *, steps, scales=(1.0,), integral=None):
    read = read_scene(scene)
    surfaces, clouds = cloud_surfaces(read), read.medium.clouds
    path = cloud_rays(
        surfaces, clouds, device(origin), device(direction), mi.Float(dr.inf), stride=None
    )
    segment = segment_through(surfaces, clouds, read.lights[0], stride=None)
    ones = tuple((mi.Float(1),) for _ in scales)
    beam = Beam(mi.Color3f(1), tuple(mi.Float(scale) for scale in scales), ones, segment, None)
    (octaves,) = light_once(path, [beam], steps=steps, stride=1, integral=integral)
    dr.eval(octaves)
    return [np.array(octave, dtype=np.float64).T for octave in octaves]


@pytest.fixture(scope="module")
def few():
    origin, direction = rays()
    expected = np.array([summed_up(*ray) for ray in zip(origin, direction)])
    assert np.count_nonzero(expected[:, 0]) > 30
    return origin, direction, expected


@pytest.mark.claim("cloud-single-scattering", tolerance="0.5 % relative RMSE")
def test_order_one_with_64_steps(few):
    """From outside and inside, through two lobes one behind the other; the sum
    over 200 steps errs by less.
    """
    origin, direction, expected = few
    (radiance,) = marched(
        loaded(sun=SUN, ring=cloud("ring", ring(), COLOURED)), origin, direction, steps=64
    )
    assert np.sqrt(np.mean((radiance - expected) ** 2)) < 0.005 * expected.mean()


# of a box of droplets, and another beside it [m]
WALLS, GAP = ([-20.0, -13.0, -9.0], [30.0, 16.0, 14.0]), 0.002


@pytest.mark.claim("cloud-single-scattering", tolerance="rounding of the places, 1e-4")
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (-0.6, 0.8, 0.0), (0.28, -0.96, 0.0)])
def test_light_along_a_wall_is_that_within_the_cloud(direction):
    """Rays enter and leave by walls that a sun at the zenith shines along: on either
    side is another segment.

    On a level ray the segment is the same everywhere, so that one step is exact.
    """
    low, high = np.array(WALLS)
    size, middle, aside = (
        high - low,
        (low + high) / 2,
        np.array([GAP + WALLS[1][0] - WALLS[0][0], 0, 0]),
    )
    boxes = {
        name: cloud(name, placed(box(size), middle + place), COLOURED)
        for name, place in (("cloud", 0 * aside), ("beside", aside))
    }
    scene = loaded(sun=SUN | {"direction": [0.0, 0.0, -1.0]}, **boxes)
    # Rays lie side by side: where rounding has a wall differs from one to the next.
    across, along = np.array([-direction[1], direction[0], 0.0]), np.array(direction)
    start = np.array([*middle[:2], 2.3]) - 61.7 * along + np.linspace(-9, 9, 40)[:, None] * across
    (radiance,) = marched(scene, start, np.tile(along, (len(start), 1)), steps=1)
    level = along[:2] != 0
    length = np.zeros(len(start))
    for place in (0 * aside, aside):
        ends = (np.array([low, high])[:, None] + place - start)[..., :2][..., level] / along[:2][
            level
        ]
        length += np.maximum(ends.max(axis=0).min(axis=1) - ends.min(axis=0).max(axis=1), 0)
    depth = SIGMA * length[:, None]
    expected = ALBEDO * -np.expm1(-depth) * np.exp(-SIGMA * (high[2] - 2.3)) / (4 * np.pi)
    assert np.min(length) > 20
    assert radiance == pytest.approx(expected, rel=1e-4)


def opacity(surfaces, clouds, *rays):
    return opacity_of(
        depths_along(surfaces, clouds, *rays, stride=None, seen=False), type(clouds.albedo)
    )


@pytest.mark.claim("cloud-opacity", tolerance="0.1 %")
def test_opacity_is_one_less_the_transmittance():
    origin, direction = rays(300)
    read = read_scene(loaded(sun=SUN, ring=cloud("ring", ring(), COLOURED)))
    surfaces = cloud_surfaces(read)
    found = opacity(
        surfaces, read.medium.clouds, device(origin), device(direction), mi.Float(470.0)
    )
    length = np.array([length_inside(ring(), *ray, 470.0) for ray in zip(origin, direction)])
    fraction = np.array(found).T
    assert fraction == pytest.approx(1 - np.exp(-SIGMA * length[:, None]), rel=1e-3, abs=1e-5)


@pytest.mark.claim("cloud-printed-equations")
def test_equations_as_printed_have_the_wrong_sign(few):
    """On the slab of one step both differ from what is right by the factor -(1 +
    dl/dx), and by -1/kappa.
    """
    origin, direction, _ = few
    scene = loaded(sun=SUN, ring=cloud("ring", ring(), COLOURED))
    (printed,) = marched(scene, origin, direction, steps=16, integral=printed_step)
    (right,) = marched(scene, origin, direction, steps=16)
    assert right.min() >= 0 > printed.min()
    read = read_scene(scene)
    path = device(origin), device(direction), mi.Float(dr.inf)
    surfaces = cloud_surfaces(read)
    length = np.array(
        printed_opacity(cloud_rays(surfaces, read.medium.clouds, *path, stride=None), 1)
    ).T
    one_stretch = [len(crossings(ring(), *ray)[0]) <= 2 for ray in zip(origin, direction)]
    fraction = np.array(opacity(surfaces, read.medium.clouds, *path)).T
    assert length[one_stretch] == pytest.approx(-fraction[one_stretch] / SIGMA, rel=1e-4, abs=1e-4)
