# SPDX-License-Identifier: BSD-3-Clause
"""Crossings of rays with clouds against all triangles in float64."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.clouds.bounds import cloud_surfaces, next_crossing
from realtime.clouds.march import depths_along
from realtime.numerics.array_types import aligned_array
from realtime.scene.read_scene import read_scene
from tests.helpers.clouds import length_inside, loaded, ring

pytestmark = pytest.mark.usefixtures("variant")

SIGMA = 0.0363


def random_rays(count, seed=3, spread=200.0):
    random = np.random.default_rng(seed)
    direction = random.normal(size=(count, 3))
    return random.uniform(-spread, spread, (count, 3)), direction / np.linalg.norm(direction, axis=1, keepdims=True)


def depths_of(scene, origin, direction, end, precision="single"):
    read = read_scene(scene, precision)
    Float = type(read.camera.origin.x)
    Vector = type(read.camera.origin)
    arrays = (Vector(*(aligned_array(Float, column) for column in values.T)) for values in (origin, direction))
    rays = cloud_surfaces(read), read.medium.clouds, *arrays, dr.opaque(Float, end)
    depths = depths_along(*rays, stride=None, seen=False)
    return [np.array(depth, dtype=np.float64) for depth in depths]


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("end", [np.inf, 170.0])
def test_depths_in_a_ring_are_those_of_all_its_triangles(precision, end):
    """Rays start inside and outside and cross the ring up to four times; float32 rounds 400 m to 2e-5 m."""
    origin, direction = random_rays(400)
    (depth,) = depths_of(loaded(), origin, direction, end, precision)
    expected = [SIGMA * length_inside(ring(), *ray, end) for ray in zip(origin, direction)]
    assert np.count_nonzero(expected) > 50
    assert depth == pytest.approx(np.array(expected), abs=SIGMA * 5e-4)


def test_points_on_the_boundary_are_neither_lost_nor_counted_twice():
    """Legs start where camera rays enter and leave: towards the inside the whole chord counts, away from it nothing."""
    read = read_scene(loaded())
    surfaces = cloud_surfaces(read)
    origin, direction = random_rays(2000, seed=11)
    o, d = (mi.Vector3f(*(aligned_array(mi.Float, column) for column in values.T)) for values in (origin, direction))
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
            SIGMA * (length_inside(ring(), point + 0.01 * unit, unit, 59.99) + 0.01 * sign)
            for point, unit in zip(points, ways)
        ]
        assert np.array(depth)[met][:200] == pytest.approx(np.array(expected), abs=SIGMA * 2e-3)
