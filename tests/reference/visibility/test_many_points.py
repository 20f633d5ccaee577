# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals for many points at once are those for one point after another."""

import mitsuba as mi
import numpy as np
import pytest

import reference.visibility.many_points as module
from reference.quadrature.light_points import PointPlan, light_points, square_points
from reference.quadrature.surface import surface_hits
from reference.scene.read import read_truth
from reference.visibility.before_light import before_light
from reference.visibility.many_points import blockers, pair_intervals
from reference.visibility.pair_checks import checked_pairs
from reference.visibility.spot_cone import cone_interval, perpendicular
from reference.visibility.triangles import geometric_intervals
from tests.helpers.area_lights import lamp, lit_scene

GREY = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.5, 0.4]}}


@pytest.fixture
def crowded(variant):
    """A lamp before a few dozen boxes and balls, without a floor: some rays are endless."""
    transform = mi.ScalarTransform4f
    draw = np.random.default_rng(5).uniform
    shapes = {}
    for k in range(30):
        place, angle = draw((-1.6, -1.6, 0.3), (1.6, 1.6, 2.2)).tolist(), float(draw(0, 180))
        turned = transform().translate(place).rotate([0.6, 0.0, 0.8], angle).scale(draw(0.02, 0.25, 3).tolist())
        shapes[f"box{k}"] = {"type": "cube", "to_world": turned, "bsdf": GREY}
    for k in range(5):
        place = draw((-1.6, -1.6, 0.3), (1.6, 1.6, 2.2)).tolist()
        shapes[f"ball{k}"] = {"type": "sphere", "center": place, "radius": float(draw(0.05, 0.3)), "bsdf": GREY}
    tilted = transform().translate([0.3, 0.4, 2.9]).rotate([0.8, 0.6, 0.0], 163).scale([0.5, 0.3, 1.0])
    return read_truth(lit_scene(size=(12, 9), lamp=lamp(to_world=tilted), **shapes))


def intervals_of(truth, count=16):
    """Return the lit intervals for all points, the points, and the distances of the rays."""
    light, (_, shapes) = truth.area[0], before_light(truth, truth.area[0])
    points = light_points(light, square_points(PointPlan(most=count), 0, 0, light.kind))
    distance = surface_hits(truth).distance
    known = blockers(light, shapes, truth.origin, truth.direction, distance)
    arrays = np.stack([point.position for point in points]), np.stack([point.axis for point in points])
    rays = np.arange(len(distance)), truth.direction, distance
    return pair_intervals(known, truth.origin, rays, arrays), points, arrays, distance, known


def test_as_for_one_point_after_another(crowded):
    lit, points, _, distance, known = intervals_of(crowded)
    direction, count = crowded.direction, len(points)
    for number, point in enumerate(points):
        foot, height = lit.foot[number::count], lit.height[number::count]
        normal = perpendicular(crowded.origin, direction, point)
        ends = np.arctan2(-foot, height), np.where(np.isinf(distance), np.pi / 2, np.arctan2(distance - foot, height))
        cone = cone_interval(direction, normal, point, point.cutoff)
        ends = np.maximum(ends[0], cone[0]), np.minimum(ends[1], cone[1])
        one = geometric_intervals(crowded, point, (direction, normal, height), ends=ends, shapes=known.shapes)
        mine = lit.pair % count == number
        assert np.array_equal(lit.pair[mine] // count, one.ray)
        assert np.arctan(lit.low[mine]) == pytest.approx(one.low, abs=1e-11)
        assert np.arctan(lit.high[mine]) == pytest.approx(one.high, abs=1e-11)
    per_pair = np.bincount(lit.pair, minlength=len(lit.foot))
    assert per_pair.max() >= 3
    assert (per_pair == 0).any()


def test_the_shadow_rays_agree_and_notice_a_fault(crowded):
    from dataclasses import replace

    lit, _, arrays, _, known = intervals_of(crowded)
    rays = crowded.origin, crowded.direction
    scene, _ = before_light(crowded, crowded.area[0])
    checks, doubtful = checked_pairs(scene.occluders, known.shapes, lit, rays, arrays)
    assert checks.checked > 100
    assert (checks.left, len(doubtful)) == (0, 0)
    wrong = replace(lit, pair=lit.pair[::2], low=lit.low[::2], high=lit.high[::2])
    checks, doubtful = checked_pairs(scene.occluders, known.shapes, wrong, rays, arrays)
    assert checks.left == len(doubtful) > 10


def test_no_blocker_is_left_out(crowded):
    """With every shape for every ray the intervals are the same, so what was left out was in nobody's way."""
    from dataclasses import replace

    lit, _, arrays, distance, known = intervals_of(crowded, 64)
    n, triangles, spheres = len(distance), len(known.shapes.triangles), len(known.shapes.radius)
    assert len(known.triangle[1]) < 0.7 * n * triangles
    every = [(np.arange(n + 1) * k, np.tile(np.arange(k), n)) for k in (triangles, spheres)]
    rays = np.arange(n), crowded.direction, distance
    full = module.pair_intervals(replace(known, triangle=every[0], sphere=every[1]), crowded.origin, rays, arrays)
    assert np.array_equal(lit.pair, full.pair)
    assert np.array_equal(lit.low, full.low)
    assert np.array_equal(lit.high, full.high)
