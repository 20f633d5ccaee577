# SPDX-License-Identifier: BSD-3-Clause
"""Sums over lit segments are those between the crossings, in whatever order planes come."""

import itertools
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.methods.shadow_planes.sweep import sum_lit_intervals
from tests.helpers.planes import CAMERA, LIGHT, bundles, index_of, lit_lengths, occluders_of, rays_of

CAMERAS = {"in the light": CAMERA, "in shadow": -0.7 * LIGHT, "among the casters": np.array([0.1, -0.05, 0.31])}
NAMES = ["torus", "open cylinder", "Moebius strip"]


def walked(index, ways, end, *, begin=0.0):
    """The sum over lit segments of 1 - exp(-x), and whether the light reaches the end."""
    Float = type(index.distance)
    rays = rays_of(index, ways, end)
    segment = Float(np.full(len(ways), begin)), Float(np.asarray(end, dtype=np.float64))
    total, lit = sum_lit_intervals(
        index, rays, segment, lambda a, b: dr.exp(-a) - dr.exp(-b), dr.zeros(Float, len(ways))
    )
    return np.array(total, dtype=np.float64), np.array(lit)


def weight(x):
    return -np.exp(-x)


def assert_same(sums, expected, *, tolerance):
    """All but one ray in a thousand: one that passes a vertex or an edge within rounding may miss it or not."""
    wrong = (np.abs(sums[0] - expected[0]) > tolerance) | (sums[1] != expected[1])
    assert wrong.sum() <= len(wrong) // 1000


@pytest.mark.claim("planes-are-exact", tolerance="1e-4: float32 at grazing angles")
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_lit_segments_are_those_between_the_crossings(variant, name, camera):
    index = index_of(occluders_of(name), camera=CAMERAS[camera])
    ways = bundles(1920, spread=0.01, camera=CAMERAS[camera])
    end = np.random.default_rng(3).choice([0.9, 2.7, 6.1, np.inf], len(ways))
    # float32 crossings at grazing angles: 1e-7 over the sine of the angle between ray and plane.
    expected = lit_lengths(index, ways, end, weight=weight)
    assert_same(walked(index, ways, end), expected, tolerance=1e-4)
    assert expected[1].any()


@pytest.mark.claim("rays-notice-a-wrong-order", tolerance="1e-4: float32 at grazing angles")
@pytest.mark.parametrize("order", ["shuffled", "backwards", "two changed", "five at a time backwards"])
def test_rays_notice_an_order_that_is_wrong(variant, order):
    """And find their segments with a longer queue, or by selection."""
    index = index_of(occluders_of("torus", "open cylinder", "crossing spheres"))
    ways = bundles(960, spread=0.01)
    end = np.full(len(ways), np.inf)
    entries, start = np.array(index.entries), np.array(index.start).astype(int)
    rng = np.random.default_rng(9)
    changed = 0
    for first, behind in itertools.pairwise(start):
        places, count = np.arange(first, behind), behind - first
        if order == "shuffled" and count > 0:
            entries[places] = entries[rng.permutation(places)]
        elif order == "backwards" and count > 0:
            entries[places] = entries[places[::-1]]
        elif order == "five at a time backwards" and count > 0:  # too much for a queue of two, nothing for one of eight
            entries[places] = entries[np.concatenate([places[k : k + 5][::-1] for k in range(0, count, 5)])]
        elif order == "two changed" and count > 3:
            entries[places[[0, -1]]] = entries[places[[-1, 0]]]
        changed += count > 3
    bounds = dr.full(type(index.bounds), np.inf, dr.width(index.bounds))  # rays read all of their wedge
    expected = lit_lengths(index, ways, end, weight=weight)
    index = replace(index, entries=mi.UInt32(entries), bounds=bounds)
    assert changed > 20
    assert_same(walked(index, ways, end), expected, tolerance=1e-4)


def test_segments_begin_where_they_are_told_to(variant):
    """Between two distances, as a spot's cone cuts them: what is lit up to the second less what is up to the first."""
    index = index_of(occluders_of("torus", "open cylinder"))
    ways = bundles(960, spread=0.01)
    begin, end = 1.7, np.full(len(ways), 3.3)
    until_end, lit = lit_lengths(index, ways, end, weight=weight)
    until_begin, _ = lit_lengths(index, ways, np.full(len(ways), begin), weight=weight)
    sums = walked(index, ways, end, begin=begin)
    assert_same(sums, (until_end - until_begin, lit), tolerance=1e-4)
