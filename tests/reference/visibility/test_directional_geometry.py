# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals under a light at infinity: exact geometry against definitions, rays that are cast, and closed forms."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

import reference.visibility.directional_casting as module
from reference.quadrature.segments import camera_segments, scattering_range
from reference.quadrature.surface import surface_hits
from reference.scene.directional_light import DirectionalLight
from reference.scene.read import read_truth
from reference.scene.shapes import Shapes
from reference.visibility.parallel_rays import parallel_rays
from tests.helpers.suns import ball_over_floor, brick, sunny


def random_rays(count, seed, towards):
    """Return rays from the origin in all directions, looked at between 0.1 and 5 m."""
    direction = np.random.default_rng(seed).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    light = DirectionalLight(-np.asarray(towards), np.ones(3), None)
    return parallel_rays(np.zeros(3), direction, light, (np.full(count, 0.1), np.full(count, 5.0)))


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def samples(rays, intervals, count, seed):
    """Return random points of rays, whether the intervals call them lit, and their distance from the next edge [m]."""
    share = np.random.default_rng(seed).random((len(rays.first), count))
    lit, gap = np.zeros(share.shape, bool), np.full(share.shape, np.inf)
    for ray, low, high in zip(intervals.ray, intervals.low, intervals.high, strict=True):
        lit[ray] |= (share[ray] > low) & (share[ray] < high)
        gap[ray] = np.minimum(gap[ray], np.minimum(np.abs(share[ray] - low), np.abs(share[ray] - high)))
    x = rays.first[:, None] + share * (rays.last - rays.first)[:, None]
    return (
        rays.origin + x[..., None] * rays.direction[:, None],
        lit,
        np.minimum(gap, 1) * (rays.last - rays.first)[:, None],
    )


def hits_triangles(point, towards, triangles):
    """Return whether half lines from points meet triangles: Cramer's rule for point + t towards = a + u e + v f."""
    hit = np.zeros(point.shape[:-1], bool)
    for a, b, c in triangles:
        inverse = np.linalg.inv(np.stack([b - a, c - a, -towards], axis=1))
        u, v, t = np.moveaxis((point - a) @ inverse.T, -1, 0)
        hit |= (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return hit


def hits_spheres(point, towards, spheres):
    hit = np.zeros(point.shape[:-1], bool)
    for centre, radius in spheres:
        off = centre - point
        along = off @ towards
        inside = np.sum(off**2, axis=-1) < radius**2
        hit |= inside | ((along > 0) & (np.sum(off**2, axis=-1) - along**2 < radius**2))
    return hit


@pytest.mark.claim("directional-truth")
@pytest.mark.parametrize("towards", [(0.3, -0.5, 0.7), (0.0, 0.0, 1.0), (-0.9, 0.02, 0.0)])
def test_random_points_by_the_definition(towards):
    """Triangles and spheres all around the camera, one sphere around it: points far from an edge are lit or not."""
    from reference.visibility.directional_geometry import parallel_intervals

    towards, generator = unit(towards), np.random.default_rng(4)
    triangles = generator.uniform(-4, 4, (60, 1, 3)) + generator.normal(size=(60, 3, 3)) * 0.6
    centres, radii = generator.uniform(-4, 4, (9, 3)), generator.uniform(0.1, 0.9, 9)
    rays = random_rays(900, 7, towards)
    intervals = parallel_intervals(rays, Shapes(triangles, centres, radii))
    point, lit, gap = samples(rays, intervals, 60, 2)
    hidden = hits_triangles(point, towards, triangles) | hits_spheres(point, towards, list(zip(centres, radii)))
    assert intervals.transitions > 500
    assert 0.1 < hidden.mean() < 0.9
    # Where a plane all but touches a sphere, or a ray is all but along the light, rounding is worth more.
    assert not np.any((lit == hidden)[gap > 1e-9])


@pytest.mark.claim("directional-truth", tolerance="1e-13")
def test_one_triangle_in_closed_form():
    """Light, triangle and ray in one plane: z - y cot for the corners, the crossing where it goes through the ray."""
    from reference.visibility.directional_geometry import parallel_intervals

    light = DirectionalLight(unit([-3.0, 0.0, -4.0]), np.ones(3), None)  # cot = 3/4 for a ray along x
    rays = parallel_rays(np.zeros(3), np.array([[1.0, 0, 0]]), light, (np.zeros(1), np.array([10.0])))
    out = np.array([0.0, 0.3, 0.0])
    for ends, expected in (
        (((4.0, 0.0, 2.0), (6.0, 0.0, 1.0)), (2.5, 5.25)),
        (((4.0, 0.0, -2.0), (6.0, 0.0, 2.0)), (4.5, 5.0)),  # half of it lies on the dark side
    ):
        a, b = (np.array(end) for end in ends)
        intervals = parallel_intervals(rays, Shapes(np.array([[a + out, a - out, b]])))
        low, high = expected
        assert 10 * intervals.low == pytest.approx([0, high], abs=1e-13)
        assert 10 * intervals.high == pytest.approx([low, 10], abs=1e-13)
        assert intervals.transitions == 2
        below = parallel_intervals(rays, Shapes(np.array([[a + out, a - out, b]]) * [1, 1, -1]))
        assert len(below.ray) == (1 if ends[0][2] > 0 else 2)


def scene_of_many(**changes):
    slats = {
        f"slat{k}": {
            "type": "cube",
            "to_world": mi.ScalarTransform4f()
            .translate([-0.9 + 0.13 * k, 0.1, 1.3 + 0.03 * k])
            .scale([0.02, 0.6, 0.011]),
        }
        for k in range(7)
    }
    return sunny(brick=brick(), **ball_over_floor(), **slats, **changes)


def rays_and_truth(scene):
    truth = read_truth(mi.load_dict(scene))
    span = scattering_range(camera_segments(truth, surface_hits(truth).distance))
    return truth, parallel_rays(truth.origin, truth.direction, truth.directional[0], span)


def test_wrong_geometry_is_left_in_doubt(variant, monkeypatch):
    """Were slats forgotten, the check would tell, and the bound of the image would grow."""
    from reference.visibility.directional_geometry import parallel_intervals

    truth, rays = rays_and_truth(scene_of_many(size=(48, 36)))
    right = module.directional_intervals(truth, rays)

    def with_fewer_slats(rays, shapes):
        # By where they stand: Mitsuba may load shapes in any order.
        x = shapes.triangles[..., 0]
        slats = np.any([np.all(np.abs(x - (-0.9 + 0.13 * k)) < 0.03, axis=1) for k in (0, 1)], axis=0)
        assert slats.sum() == 24
        return parallel_intervals(rays, replace(shapes, triangles=shapes.triangles[~slats]))

    monkeypatch.setattr(module, "parallel_intervals", with_fewer_slats)
    wrong = module.directional_intervals(truth, rays)
    assert right.random_checks.left == 0
    assert wrong.random_checks.left > 5
    assert wrong.doubt is not None
