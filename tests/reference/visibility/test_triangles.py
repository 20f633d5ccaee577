# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np
import pytest

from reference.scene.read import read_truth
from reference.scene.shapes import Shapes
from reference.visibility.lit_intervals import lit_intervals
from reference.visibility.triangles import geometric_intervals
from tests.helpers.polygons import box, box_scene, lit_lengths, rays_of, visibility_test
from tests.helpers.scenes import tiny_scene
from validation.scenes.loading import load_scene


def shadow_rays_disagree(truth, lamp, rays, ends, intervals, count=400):
    """Return how many random shadow rays contradict the intervals further than 1e-5 rad from an edge."""
    used = np.flatnonzero(ends[1] > ends[0])
    ray = np.repeat(used, count)
    theta = ends[0][ray] + (ends[1] - ends[0])[ray] * np.random.default_rng(7).random(len(ray))
    lit = visibility_test(truth.occluders, lamp.position, rays)(ray, theta)
    expected, near = np.zeros(len(ray), bool), np.zeros(len(ray), bool)
    for interval in zip(intervals.ray, intervals.low, intervals.high, strict=True):
        mine = slice(*np.searchsorted(ray, [interval[0], interval[0] + 1]))
        expected[mine] |= (theta[mine] > interval[1]) & (theta[mine] < interval[2])
        near[mine] |= np.minimum(np.abs(theta[mine] - interval[1]), np.abs(theta[mine] - interval[2])) < 1e-5
    return int(np.sum((lit != expected) & ~near))


@pytest.mark.claim("exact-shadows")
@pytest.mark.parametrize("name", ["colonnade", "two-pens"])
def test_shadow_rays_agree_with_the_geometry_of_built_in_scenes(variant, name):
    truth = read_truth(load_scene(name, size=(24, 18)).scene)
    light, rays, ends = rays_of(truth)
    intervals = geometric_intervals(truth, light, rays, ends=ends)
    assert intervals.transitions > 100
    assert shadow_rays_disagree(truth, light, rays, ends, intervals) == 0


@pytest.mark.claim("cast-shadows", tolerance="2e-5, median 1e-6: where shadow rays stop")
def test_edges_by_geometry_are_those_by_bisection(variant):
    """Two routes that share no code: edge by edge within the rounding of a float32 shadow ray."""
    truth = read_truth(mi.load_dict(box_scene()))
    light, rays, ends = rays_of(truth)
    exact = geometric_intervals(truth, light, rays, ends=ends)
    cast = lit_intervals(truth, light, rays, ends=ends, edges="rays")
    lit = [lit_lengths(intervals, ends) for intervals in (exact, cast)]
    # Edges of boxes that a plane cuts at a grazing angle magnify the rounding of 1e-7; 2e-6 is where shadow rays stop.
    assert np.abs(lit[0] - lit[1]).max() < 2e-5
    assert np.median(np.abs(lit[0] - lit[1])) < 1e-6


@pytest.mark.claim("exact-shadows")
def test_a_needle_is_found_where_regular_samples_step_over_it(variant):
    """Its shadow in closed form: the two sides of a box that is seen from the light, in one plane."""
    width = 2e-4
    scene = tiny_scene(ball=None, floor=None, needle=box((0.3, -0.1, 0.9), (width, width, 8.0)))
    truth = read_truth(mi.load_dict(scene))
    light, rays, ends = rays_of(truth)
    intervals = geometric_intervals(truth, light, rays, ends=ends)
    shadowed = np.setdiff1d(
        np.arange(len(ends[0])), intervals.ray[(intervals.high - intervals.low) > (ends[1] - ends[0])[intervals.ray]]
    )
    gaps = (ends[1] - ends[0]) - lit_lengths(intervals, ends)
    crossed = np.flatnonzero(gaps > 1e-6)
    assert len(crossed) > 50
    assert len(shadowed) >= len(crossed)
    assert np.median(gaps[crossed] / (ends[1] - ends[0])[crossed]) < 2e-4

    share = (np.arange(256) + 0.5) / 256
    theta = ends[0][crossed, None] + (ends[1] - ends[0])[crossed, None] * share
    lit = visibility_test(truth.occluders, light.position, rays)(np.repeat(crossed, 256), theta.ravel())
    assert np.mean(lit.reshape(theta.shape).all(axis=1)) > 0.9  # regular samples see no shadow at all

    # The middle of each gap is in the needle's shadow, and a little beside it is not.
    first = intervals.ray[:-1] == intervals.ray[1:]
    ray, low, high = intervals.ray[:-1][first], intervals.high[:-1][first], intervals.low[1:][first]
    visible = visibility_test(truth.occluders, light.position, rays)
    assert not visible(ray, 0.5 * (low + high)).any()
    assert visible(ray, low - (high - low)).all()
    assert visible(ray, high + (high - low)).all()


@pytest.mark.claim("exact-shadows", tolerance="1e-12")
def test_one_triangle_against_its_closed_form(variant):
    """Light, triangle and ray in one plane: the angles of the two corners as seen from the light."""
    truth = read_truth(mi.load_dict(tiny_scene(ball=None, floor=None, size=(1, 1))))
    light, (direction, normal, height), ends = rays_of(truth)
    a = light.position + 0.3 * height[0] * (np.cos(0.2) * normal[0] + np.sin(0.2) * direction[0])
    b = light.position + 0.4 * height[0] * (np.cos(0.5) * normal[0] + np.sin(0.5) * direction[0])
    across = np.cross(direction[0], normal[0])
    corners = np.array([[a + 0.3 * across, a - 0.3 * across, b]])  # the plane cuts it from a to b
    intervals = geometric_intervals(truth, light, (direction, normal, height), ends=ends, shapes=Shapes(corners))
    assert intervals.low == pytest.approx([ends[0][0], 0.5], abs=1e-12)
    assert intervals.high == pytest.approx([0.2, ends[1][0]], abs=1e-12)
    # Behind the ray, as seen from the light, it hides nothing; on the other side of the light neither.
    for factor in (4.0, -1.0):
        moved = light.position + factor * (corners - light.position)
        intervals = geometric_intervals(truth, light, (direction, normal, height), ends=ends, shapes=Shapes(moved))
        assert intervals.low == pytest.approx([ends[0][0]])
        assert intervals.high == pytest.approx([ends[1][0]])
