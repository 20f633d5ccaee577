# SPDX-License-Identifier: BSD-3-Clause
"""How far rules of Gauss and Legendre with few nodes reach for a phase function, by the error
of the rules themselves.

Kernels integrate exp(-depth) p/r^2 by rules of fixed sizes, in one variable or another. How long a
panel may be depends on the phase function: where it has its lobe, and how steeply the lobe rises.
The rule is therefore tried on the phase function itself, once and in float64: a panel of some
length, with any beginning, by the rule and by a rule of 24 nodes. The longest panel is the one
beyond which the two differ by more than `LEFT`. There are three kinds of panels:

- in v, of `realtime.kernels.exact`, where E = d sinh v: the integrand is
  p/(1 + E^2) d cosh v, E >= 0;
- in x, of its short segments: p/r^2, with the length over the least distance r from the light; the
  height, which is 1 here, does not matter;
- in ln E, of `realtime.scene.media.integrate`.

Each rule is tried without extinction and up to the largest optical depth of a panel of its kind.
"""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from drjit.scalar import ArrayXf64
from numpy.typing import NDArray

from airlight.realtime.numerics.functions import WIDEST, unit_nodes

Array = NDArray[np.float64]

LEFT = 1e-6  #: of the integral over any panel
PANEL_NODES, PANEL_DEPTH = 8, 10.5  #: of panels in v
#: Short segments save a ninth of a frame of `hall`: 318 for 357 ms of shadow planes at 800 x 600,
#: processor time in turns (29 November 2026).
FEW_NODES, FEW_DEPTH = 4, 2.0

#: Nodes of panels of any medium, and how much depths and the logarithm of an extinction change
#: together. Eight nodes and 6.0 took a tenth longer in `three-media` and as long in `street`
#: (processor time of shadow planes, 320 x 240).
NODES, CHANGE = 6, 4.0


@dataclass(frozen=True)
class Reach:
    """The longest panels of rules."""

    panel: float  #: in v
    few: float  #: segments of four nodes in x, over their distance from the light
    width: float  #: in ln E


def shortest(*reaches: Reach) -> Reach:
    """Return how far rules reach for several phase functions alike."""
    return Reach(*map(min, *map(astuple, reaches)))


def reach_of(
    half: Callable[[Any, Any], Any], ends: tuple[float, float], left: float = LEFT
) -> Reach:
    """Return how far the rules reach for a phase function.

    `half`: its value from sin^2 and cos^2 of half the scattering angle, of eager arrays; `ends`:
    the E at which its forward lobe ends and its backward one begins; `left`: what a rule may leave.
    """

    def value(e: Array) -> Array:
        # sin^2 and cos^2 of half the scattering angle at E = tan of half of it.
        up = 1 / (1 + e * e)
        values = half(ArrayXf64((e * e * up).ravel()), ArrayXf64(up.ravel()))
        return np.broadcast_to(np.array(values), e.size).reshape(e.shape)

    # 160 panels of 0.11 in v reach up to E = 1e7: more a coarse table would not be worth.
    least_panel = 0.11
    return Reach(
        max(_longest(lambda width: _panel_error(value, ends, width), left), least_panel),
        _longest(lambda length: _segment_error(value, ends, length), left),
        _longest(lambda width: _width_error(value, ends, width), left),
    )


def _longest(error: Callable[[float], float], left: float) -> float:
    """Return the longest panel with no larger error, by halving; errors grow with the length."""
    # Nine halvings of the logarithm between 1e-3 and two times the widest argument of
    # `sinh_bounded`, which serves half a panel: to 1.6 %.
    low, high = math.log(1e-3), math.log(2 * WIDEST)
    for _ in range(9):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if error(math.exp(middle)) <= left else (low, middle)
    return float(f"{math.exp(low):.3g}")  # the same on every machine


def _error(integrand: Callable[[Array], Array], nodes: int) -> float:
    """Return the largest error of a rule for integrals from 0 to 1; the integrand
    takes a column of places.
    """
    # Each column of `values` is a panel. Its first rows are the nodes of the rule; the other rows
    # are the 24 nodes of a finer rule, which judges it.
    few, many = (np.array(unit_nodes(count)).T for count in (nodes, 24))
    values = integrand(np.concatenate([few[0], many[0]])[:, None])
    by_few, by_many = few[1] @ values[:nodes], many[1] @ values[nodes:]
    # Where a phase function is 0, neither rule errs.
    return float(np.max(np.abs(by_few - by_many) / np.maximum(by_many, 1e-300)))


def _starts(ends: tuple[float, float]) -> Array:
    """Return v from the axis to where both lobes are far behind."""
    first, last = ends
    return np.linspace(0, math.asinh(30 * last / first), 33)


def _panel_error(value, ends, width: float) -> float:
    # Panels from v0 on, by three depths; no panel has more than 20 up to its end, behind which
    # kernels end.
    enough = 20.0
    v0, depth = (
        grid.ravel() for grid in np.meshgrid(_starts(ends), PANEL_DEPTH * np.array([0, 0.3, 1]))
    )
    rate = np.minimum(depth / (width * np.cosh(v0)), enough / (np.sinh(v0 + width) - np.sinh(v0)))

    def integrand(t):
        v = v0 + width * t
        e = ends[0] * np.sinh(v)
        return value(e) / (1 + e * e) * np.cosh(v) * np.exp(-rate * (np.sinh(v) - np.sinh(v0)))

    return _error(integrand, PANEL_NODES)


def _segment_error(value, ends, length: float) -> float:
    # Segments before and behind the foot, over their least distance r, and segments that hold the
    # foot, at some place `across` them, where this distance is the height.
    first, last = ends
    u = np.sinh(np.linspace(0, math.asinh(15 * max(1 / first, last)), 33))
    across = np.linspace(0, 1, 9)
    worst = 0.0
    # Length and depth may reach their limits by themselves, together an ellipse.
    for angle in (0, 0.4, 0.8, 1.2):
        fraction = length * math.cos(angle)
        long = fraction * np.hypot(1, u)
        s0 = np.concatenate([u, -u - long, -across * fraction])
        whole = np.concatenate([long, long, np.full(len(across), fraction)])
        s1 = s0 + whole
        rate = FEW_DEPTH * math.sin(angle) / (_along(s1) / np.hypot(1, s1) * whole)

        def integrand(t, s0=s0, whole=whole, rate=rate):
            s = s0 + whole * t
            e = _along(s)
            return value(e) / (1 + s * s) * np.exp(-rate * (e - _along(s0)))

        worst = max(worst, _error(integrand, FEW_NODES))
    return worst


def _width_error(value, ends, width: float) -> float:
    # Panels from E = e0 on, e^4 before the forward lobe ends to e^3 behind the backward one; s and
    # r are over the height.
    first, last = ends
    e0 = np.exp(np.linspace(math.log(first) - 4, math.log(last) + 3, 61))
    s0, r0 = 0.5 * (e0 - 1 / e0), 0.5 * (e0 + 1 / e0)
    widest, worst = (math.cosh(width) - 1) * s0 + math.sinh(width) * r0, 0.0
    # Width and depth may reach their limits by themselves, together an ellipse.
    for angle in (0, 0.3, 0.6, 0.9, 1.2, 1.5):
        length = widest * math.cos(angle)
        e1 = _along(s0 + length)
        # N and D, linear in t, and the rule in t, as in `realtime.scene.media.integrate`.
        (n0, d0), (n1, d1) = ((np.sqrt(e), 1 / np.sqrt(e)) for e in (e0, e1))
        rate, scale = CHANGE * math.sin(angle) / length, length / (n0 * n1 + d0 * d1)

        def integrand(t, n0=n0, n1=n1, d0=d0, d1=d1, rate=rate, scale=scale):
            n, d = n0 + t * (n1 - n0), d0 + t * (d1 - d0)
            return (
                value(n / d)
                / (n * n + d * d)
                * np.exp(-rate * t * scale * (n * n0 + d * d0) / (n * d))
            )

        worst = max(worst, _error(integrand, NODES))
    return worst


def _along(s: Array) -> Array:
    """Return E = s + r, height 1."""
    r = np.hypot(1, s)
    return np.where(s < 0, 1 / (r + np.abs(s)), r + s)
