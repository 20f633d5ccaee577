# SPDX-License-Identifier: BSD-3-Clause
"""The published orders of shadow planes, and the buffer of 8 bits, against NumPy plane by plane."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.methods.published.biri2006.crossings import Buffer, _entry_key, sum_crossings
from tests.helpers.shadow_planes import (
    bundles,
    crossings,
    lit_lengths,
    occluders_of,
    planes_of,
    rays_of,
)


def added_up(planes, ways, end, *, order, buffer=None):
    """The sum of 1 - exp(-x) over the crossings."""
    Float = type(planes.index.distance)
    gammas = (lambda plane, ray, x: 1 - dr.exp(-x)), (lambda x: 1 - dr.exp(-x))
    distance = Float(np.asarray(end, dtype=np.float64))
    total, lit = sum_crossings(
        planes, rays_of(planes.index, ways), distance, gammas, order=order, buffer=buffer
    )
    return np.array(total, dtype=np.float64), np.array(lit)


def most(wrong):
    """All but one ray in a hundred, which rounding takes past an edge, or
    to a plane before another.
    """
    return wrong.mean() < 0.01


def weight(x):
    return 1 - np.exp(-x)


@pytest.mark.claim("orders-of-the-planes")
def test_exact_order_is_right_where_shadows_overlap(variant):
    planes = planes_of(occluders_of("torus", "open cylinder", "crossing spheres"))
    ways = bundles(1920, spread=0.003)
    end = np.full(len(ways), 4.7)
    expected, lit = lit_lengths(planes, ways, end, weight=weight)
    total, total_lit = added_up(planes, ways, end, order="exact")
    # Two crossings can come in the wrong order within a wedge: that is counted, not repaired.
    wrong = (np.abs(total - expected) > 1e-4) | (total_lit != lit)
    assert wrong.mean() < 0.03


@pytest.mark.claim("orders-of-the-planes")
def test_without_an_order_every_plane_counts(variant):
    """The artefact of Fig. 4, by formula: Gamma at the surface if it is lit, and all
    planes with their signs.
    """
    planes = planes_of(occluders_of("torus", "crossing spheres"))
    ways = bundles(1920, spread=0.003)
    end = np.full(len(ways), 4.7)
    x, gain = crossings(planes, ways)
    _, lit = lit_lengths(planes, ways, end, weight=weight)
    crossed = x < end[:, None]
    of_planes = np.sum(np.where(crossed, gain * weight(np.where(crossed, x, 0)), 0), axis=1)
    expected = np.where(lit, weight(end), 0) + of_planes
    total, _ = added_up(planes, ways, end, order="none")
    assert most(np.abs(total - expected) > 1e-4)
    assert np.max(np.abs(expected - lit_lengths(planes, ways, end, weight=weight)[0])) > 0.1


@pytest.mark.claim("orders-of-the-planes")
def test_order_of_the_paper_is_by_the_stencil_rule(variant):
    """Plane by plane in NumPy, towards the camera by the cosine of the edge's middle."""
    planes = planes_of(occluders_of("torus", "crossing spheres"), precision="double", order="paper")
    ways = bundles(960, spread=0.003)
    end = np.full(len(ways), 4.7)
    x, gain = crossings(planes, ways)
    cosine = np.array(planes.centres)[: len(gain)]
    total, lit = added_up(planes, ways, end, order="paper")
    expected = np.zeros(len(ways))
    for ray in range(len(ways)):
        order = np.argsort(cosine, kind="stable")
        order = order[x[ray][order] < end[ray]]
        stencil = np.array(planes.index.layers).item() + gain[order].sum()
        expected[ray] = weight(end[ray]) if stencil <= 0 else 0
        for plane in order:
            if gain[plane] > 0:
                expected[ray] += weight(x[ray][plane]) if stencil == 1 else 0
            else:
                expected[ray] -= weight(x[ray][plane]) if stencil == 0 else 0
            stencil -= gain[plane]
    # Planes of one cosine come in either order.
    assert most(np.abs(total - expected) > 1e-9)
    assert np.any(lit)


@pytest.mark.claim("buffer-of-eight-bits")
def test_buffer_clamps_after_every_plane(variant):
    """Full at the surface, it forgets what is above, and the planes then take away too much."""
    planes = planes_of(occluders_of("sphere"))
    ways = bundles(960, spread=0.003)
    end = np.full(len(ways), 4.7)
    free, lit = added_up(planes, ways, end, order="exact")
    clamped, _ = added_up(planes, ways, end, order="exact", buffer=Buffer(0.5))
    rounded, _ = added_up(planes, ways, end, order="exact", buffer=Buffer(3.0))
    shadowed = lit & (free < weight(4.7) - 1e-3)
    assert shadowed.any()
    # The sum never exceeds two: no clamping, three roundings by half a step.
    assert np.max(np.abs(rounded - free)) < 1.5 * 3 / 255 + 1e-5
    assert np.all(clamped[lit & ~shadowed] == pytest.approx(0.5))
    assert np.mean(free[shadowed] - clamped[shadowed]) > 0.05


def test_the_key_of_an_entry_is_the_angle_at_the_light_and_a_number_along_its_axis_too(variant):
    """The light is at 0, the camera at D on the z axis; the cosine of a ray along it
    may exceed 1 by rounding.
    """
    x, z, distance = (
        np.array([2.0, 3.0, 1.5, 1.5]),
        np.array([-0.6, 0.3, 1.0, np.nextafter(np.float32(1), 2)]),
        4.0,
    )
    index, ray = SimpleNamespace(distance=mi.Float(distance)), SimpleNamespace(z=mi.Float(z))
    entry = SimpleNamespace(distance=mi.Float(x))
    point = np.stack([x * np.sqrt(np.maximum(1 - z**2, 0)), distance + x * z])
    key = np.array(_entry_key(index, ray, entry, "paper"))
    np.testing.assert_allclose(key, -point[1] / np.linalg.norm(point, axis=0), rtol=2e-6)  # float32
    np.testing.assert_allclose(
        np.array(_entry_key(index, ray, entry, "exact")), distance / x, rtol=1e-6
    )
