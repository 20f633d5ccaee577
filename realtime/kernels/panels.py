# SPDX-License-Identifier: BSD-3-Clause
"""Panels of Gauss-Legendre nodes for float32: every ray takes as many as its segment needs.

The integral is that of `realtime.kernels.exact` in v, E = d sinh v:

    I = int_{v0}^{v1} exp(-a (E - E0)) P(E) d cosh v dv,     a = sigma_t h,     P = p/(1 + E^2).

**How many panels.** P has its singularities at |Im v| = pi/2. On a panel of half width D, Gauss's rule with n nodes is
wrong by about M rho^(-2n), where rho = H + sqrt(1 + H^2), H = pi/(2 D), is the size of the largest ellipse about the
panel that holds none of them (Trefethen 2013, theorem 19.3) and M the largest value of the integrand on it: for a given
accuracy a panel may have some width, whatever the ray. Two things make M large. Lobes of a high power of 1/(1 + E^2)
grow steeply towards their poles; their panels are narrower. And the extinction, bounded by 1 where Re E > E0, grows to
the left of the panel like exp(T t), with t the distance in widths of the panel and

    T = a d cosh(v0) (v1 - v0)

the optical depth that the segment would have, if all of it were as dense in v as its beginning. For a pure exponential
the rule errs by less than T^2n (n!)^4 / ((2n + 1) (2n)!^3) of the first value, 4e-7 for n = 8 and T = 10.5: a panel may
also have some T. So there are

    m = ceil(max((v1 - v0)/w, T/T1))

equal panels. w and T1 are the largest that keep random rays of every magnitude within 1e-6 of the integral, rounding
left aside, for each phase function, which knows its own w; `tests/realtime/kernels/test_panels.py` tries others.

**What they cost.** All rays of a packet take part in as many steps as the one that needs most, no more. Panels of a ray
are equally wide: sinh and cosh of the offsets of the nodes are the same in each, and computed once. From the start of a
panel, with F = E/d and C = sqrt(1 + F^2) there,

    F' - F = F (cosh u - 1) + C sinh u,     C' = C cosh u + F sinh u,

are sums of positive terms, for its nodes and for its end, where the next begins. The extinctions of a coloured medium
share all but the exponential: the range is that of the smallest, T that of the largest.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.numerics.fast_exp import LOG2_E, exp2_bounded, sinh_bounded
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.scene.phase import Phase

_NODES = 8
_MOST = 160  # panels; no segment needs as many, but a loop over values that are not numbers must end too
_DEPTH = 10.5  # T1
_SOFT = 0.85  #: w for a light whose intensity falls off
_NO_RATE = 1e-30
_DEEPEST = 116.0  # e^-80


def panels_mean(phase: Phase, start, scale, width, decays, weight: Callable[[Any], Any] | None):
    """Return I/(d (v1 - v0)), the mean over the range of v, for each extinction [1].

    `phase`: the phase function; `start`: (F, C), sinh and cosh of v0, float32; `scale`: d, see above; `width`: v1 - v0;
    0 where there is nothing to integrate; `decays`: a = sigma_t h, one or more; `weight`: relative intensity of the
    light by E, or None where it is 1 everywhere.

    Valid for any decay. The values are 0 where e^-80 is.
    """
    Float = type(width)
    f, c = start
    largest = reduce(dr.maximum, decays)
    count = panel_count(phase, width, largest * scale * c * width, soft=weight is not None)
    part_of_all = dr.rcp(dr.maximum(Float(count), 1))
    part = width * part_of_all
    nodes = [(share, *_offset(part * fraction)) for fraction, share in unit_nodes(_NODES)]
    sinh_end, less_end = _offset(part)
    # Not 0 in a vacuum, where Dr.Jit would see a depth that no turn of the loop changes, and drop it from the state.
    rates = [dr.minimum(-decay * scale * LOG2_E, -_NO_RATE) for decay in decays]

    def panel(index, f, c, depths, totals):
        for share, sinh, less in nodes:
            step = dr.fma(f, less, c * sinh)
            value = share * phase.density(f + step, dr.fma(f, sinh, dr.fma(c, less, c)), scale)
            if weight is not None:
                value *= weight(scale * (f + step))
            kept = [_kept(dr.fma(rate, step, depth)) for rate, depth in zip(rates, depths)]
            totals = [dr.fma(value, attenuation, total) for attenuation, total in zip(kept, totals)]
        step = dr.fma(f, less_end, c * sinh_end)
        c = dr.fma(f, sinh_end, dr.fma(c, less_end, c))
        return index + 1, f + step, c, [dr.fma(rate, step, depth) for rate, depth in zip(rates, depths)], totals

    lanes = dr.zeros(Float, dr.width(width, f, *decays))
    none = [lanes + 0 for _ in decays]
    *_, totals = dr.while_loop(
        state=(mi.UInt32(0) + dr.zeros(mi.UInt32, dr.width(lanes)), f + lanes, c + lanes, none, [*none]),
        cond=lambda index, f, c, depths, totals: index < count,
        body=panel,
        labels=("index", "f", "c", "depths", "totals"),
    )
    return [total * part_of_all for total in totals]


def _kept(depth):
    return exp2_bounded(dr.maximum(depth, -_DEEPEST))


def panel_count(phase: Phase, width, depth, *, soft: bool = False):
    """Return the number of panels m of segments of some width in v [1], and depth T [1]; 0 where the width is 0."""
    Float = type(width)
    widest = phase.panel_width(Float)
    if soft:
        widest = dr.minimum(widest, _SOFT)
    count = dr.maximum(width / widest, depth * (1 / _DEPTH))
    # As whole numbers: a minimum of floats lets through what is no number, as 2^32 - 1 panels.
    return dr.select(width > 0, dr.minimum(mi.UInt32(dr.ceil(count)), _MOST), 0)


def _offset(u):
    """Return sinh u and cosh u - 1."""
    half = sinh_bounded(0.5 * u)
    double = 2 * half
    return double * dr.sqrt(dr.fma(half, half, 1)), double * half
