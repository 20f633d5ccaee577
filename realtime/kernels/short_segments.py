# SPDX-License-Identifier: BSD-3-Clause
r"""Few nodes for segments that are short beside their distance from the light, for float32.

Between the edges of shadows most segments are short. Over them the integrand of

    J = int_{x0}^{x1} exp(-sigma_t (x + r)) p/r^2 dx,     r^2 = s^2 + h^2,     s = x - foot,

needs no substitution. Where r vanishes, s = +-i h, it has its singularities, and nowhere closer those of p: with
E = (s + r)/h, dE/ds = E/r, and E is never closer to +-i d, those of a lobe in E (`realtime.kernels.exact`), than E
itself. So over a segment of the length L all of them are r/L or more lengths away, r being the least distance between
segment and light, and Gauss's rule converges as fast for every ray with the same r/L (`realtime.kernels.panels` has the
theorem). The exponent changes fastest at the end, by sigma_t (1 + s1/r1) a metre.

A segment is short where L/r and sigma_t (1 + s1/r1) L are below limits up to which four nodes, or eight, are right to
1e-6 for random rays; `tests/realtime/kernels/test_exact.py` tries others. Nodes are places s0 + f L, s0 = x0
- foot: close to the light, x itself has not the digits.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import drjit as dr

from realtime.numerics.fast_exp import exp_bounded
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.rays.ray_light import RayGeometry
from realtime.scene.phase import Phase, Reach


@dataclass(frozen=True)
class Rule:
    """How many nodes a rule has, and which segments it serves."""

    nodes: int
    depth: float  #: largest sigma_t (1 + s1/r1) L [1]
    length: Callable[[Reach], float]  #: largest L/r of a phase function [1]


FEW = Rule(4, 2.0, lambda reach: reach.few)
MORE = Rule(8, 10.0, lambda reach: reach.more)


@dataclass
class Extent:
    """How long segments are."""

    square: Any  #: (L/r)^2, infinite at the light
    depth: Any  #: sigma_t (1 + s1/r1) L of the largest extinction [1]


def extent(geometry: RayGeometry, x0, x1, extinctions) -> Extent:
    """Return how long the segments [x0, x1] [m] are; `extinctions` are those of the medium [1/m].

    Valid for any segment; see `serves` for what is too long.
    """
    s0, length, height_squared = x0 - geometry.foot, x1 - x0, dr.square(geometry.height)
    s1 = s0 + length
    nearest = dr.clip(0, s0, s1)
    rate = dr.fma(s1, dr.rsqrt(dr.fma(s1, s1, height_squared)), 1) * reduce(dr.maximum, extinctions)
    return Extent(dr.square(length) * dr.rcp(dr.fma(nearest, nearest, height_squared)), rate * length)


def serves(rule: Rule, segment_extent: Extent, phase: Phase):
    """Return whether a rule is accurate enough; False where a value is infinite or not a number.

    Length and depth each spoil part of it: by themselves they may reach their limits, together an ellipse.
    """
    of_length, of_depth = 1 / rule.length(phase.reach) ** 2, 1 / rule.depth**2
    return dr.fma(segment_extent.square, of_length, dr.square(segment_extent.depth) * of_depth) < 1


def short_segment(geometry: RayGeometry, x0, x1, phase: Phase, extinctions, *, rule: Rule):
    """Return J of short segments for each extinction [1/m].

    `geometry`, `x0`, `x1`: see `realtime.kernels`; `phase`: the phase function; `extinctions`: one or more [1/m];
    `rule`: how many nodes.

    Valid where the rule `serves`.
    """
    s0, length, height_squared = x0 - geometry.foot, x1 - x0, dr.square(geometry.height)
    totals = [type(length)(0) for _ in extinctions]
    for fraction, share in unit_nodes(rule.nodes):
        step = length * fraction
        s = s0 + step
        square = dr.fma(s, s, height_squared)
        inverse = dr.rsqrt(square)
        r = square * inverse
        value = share * dr.square(inverse)
        if not phase.constant:
            value *= phase.evaluate_half(*_half_angle(s, r, inverse, height_squared))
        path = x0 + (step + r)
        totals = [dr.fma(value, exp_bounded(-sigma_t * path), total) for sigma_t, total in zip(extinctions, totals)]
    return [total * length for total in totals]


def _half_angle(s, r, inverse, height_squared):
    """Return sin^2 and cos^2 of half the scattering angle, (r +- s)/(2 r), the smaller one without cancellation."""
    small = 0.5 * height_squared * inverse * dr.rcp(r + dr.abs(s))
    large = 1 - small
    behind = s > 0
    return dr.select(behind, large, small), dr.select(behind, small, large)
