# SPDX-License-Identifier: BSD-3-Clause
"""The coordinates of the canonical transport, and the factors of the light of a slab that its
grid leaves out.

**The eight sets of orders of Bouthors 2008, section 5.1**, and the layers of images by
set; order 1 stands apart.

**The phase function of n scatterings**, P_s: the mean over the orders of a set.

**The coordinates**, so that few entries serve:

    thickness    log(t + 0.02), for t from 0.01 to 200
    depth        a(d)/(a(d) + a(t - d)), a(z) = log(1 + z/0.1): 0 at the lit face, 1 at the other, fine at both
    sun          sqrt(2 asin(mu_L)/pi), for mu_L from 0.02 to 1: fine where the sun is low
    direction    asin(mu)/pi + 1/2
    azimuth      phi/pi

**The steep powers of an order.** With n the first order of a set and m the mean of its orders, each
less 1, the light of the set has the factor exp(r),

    r = n log(t/(t + 0.02)) + m log(1 + d/m) - d        (31-inf: the first term alone):

thin slabs scatter with the power n of their thickness, and deep in thick ones the light of an order
is d^m exp(-d), as in Poisson's distribution.

**Interpolation on simplices:** the entries around a place of a regular grid, and their weights.

With the fractions f of the place in its cell sorted so that f_1 >= f_2 >= .., and the
strides s_i in that order,

    v = v_0 (1 - f_1) + v_1 (f_1 - f_2) + .. + v_n f_n,     v_i the entry at base + s_1 + .. + s_i,

linear within each of the simplices of a cell, and continuous: n + 1 entries, where products of
pairs of weights take 2^n. A function without mixed second derivatives has the same error in both.

**The phase function of a scene**, as the computation of slabs needs it.
"""

import math
from bisect import bisect_right
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.clouds.slab_orders.phases import AnglePhase, SlabPhase
from airlight.realtime.droplets import CUT
from airlight.realtime.numerics.array_types import ArrayTypes
from airlight.realtime.numerics.functions import cell_of
from airlight.realtime.scene.phase import Phase

#: First and last order of each set.
SETS: tuple[tuple[int, float], ...] = (
    (2, 2),
    (3, 4),
    (5, 6),
    (7, 8),
    (9, 12),
    (13, 18),
    (19, 30),
    (31, math.inf),
)


def set_name(number: int) -> str:
    """Return '2', '3-4', .. '31-inf'."""
    first, last = SETS[number]
    if first == last:
        return str(first)
    return f"{first}-{int(last)}" if math.isfinite(last) else f"{first}-inf"


#: The first order of each layer of an image by order of scattering: order n is light
#: that was scattered n times.
FIRST_ORDERS = (1, *(int(first) for first, _ in SETS))
#: The layers, 'airlight_1', 'airlight_2', 'airlight_3_4', .. 'airlight_31_inf';
#: the airlight is their sum.
ORDER_LAYERS = (
    "airlight_1",
    *("airlight_" + set_name(number).replace("-", "_") for number in range(len(SETS))),
)
OPACITY = "opacity"  #: 1 less the transmittance of the clouds up to the surface, or to infinity


def order_layer(order: int) -> str:
    """Return the layer of an `order`, 1 or more."""
    return ORDER_LAYERS[bisect_right(FIRST_ORDERS, order) - 1]


Array = NDArray[Any]

ENTRIES = 1025  #: at even angles from 0 to pi


def repeated_scattering(phase: SlabPhase) -> Array:
    """Return P_s at even angles, (sets, ENTRIES).

    n scatterings of a beam without a boundary multiply Legendre moments: the mean over the orders
    of a set of sum (2 l + 1) chi_l^n P_l. The set without end counts as isotropic.
    """
    degrees = 800
    cosines = np.cos(np.linspace(0.0, np.pi, ENTRIES))
    moments = phase.moments(degrees)
    # The coefficients (2 l + 1) <chi_l^n> of each set.
    series = []
    for first, last in SETS:
        if math.isfinite(last):
            powers = np.mean([moments**order for order in range(first, int(last) + 1)], axis=0)
        else:
            powers = np.eye(1, degrees)[0]
        series.append((2 * np.arange(degrees) + 1) * powers)
    # The sums over l of all sets at once, P_l by its recurrence.
    lower, legendre = np.zeros_like(cosines), np.ones_like(cosines)
    total = np.zeros((len(SETS), ENTRIES))
    for degree, strengths in enumerate(np.array(series).T):
        total += strengths[:, None] * legendre
        lower, legendre = (
            legendre,
            ((2 * degree + 1) * cosines * legendre - degree * lower) / (degree + 1),
        )
    # The radiance of slabs is divided by P_s, which counts as this fraction of the mean at least.
    least = 1e-3
    return np.maximum(total, least)


def at_angle(table: Array, cosines: Array) -> Array:
    """Return values of one set at cosines, linear in the angle between entries."""
    return np.interp(
        np.arccos(np.clip(cosines, -1.0, 1.0)), np.linspace(0.0, np.pi, ENTRIES), table
    )


THINNEST, THICKEST = 0.01, 200.0
LOWEST_SUN = 0.02
THICKNESS_SHIFT = 0.02
DEPTH_SCALE = 0.1


def thicknesses(count: int) -> Array:
    """Return thicknesses at even steps [mean free paths]."""
    low, high = np.log(np.array([THINNEST, THICKEST]) + THICKNESS_SHIFT)
    values = np.exp(np.linspace(low, high, count)) - THICKNESS_SHIFT
    # The ends without the rounding of logarithm and exponential.
    values[0], values[-1] = THINNEST, THICKEST
    return values


def lowest_sun_coordinate() -> float:
    """Return the coordinate of the lowest sun."""
    return float(np.sqrt(2 / np.pi * np.arcsin(LOWEST_SUN)))


def suns(count: int) -> Array:
    """Return cosines of suns at even steps."""
    values = np.sin(np.linspace(lowest_sun_coordinate(), 1.0, count) ** 2 * (np.pi / 2))
    values[-1] = 1.0
    return values


def depth_coordinate(d: Array, t: float) -> Array:
    """Return the coordinate of depths in a slab."""
    upper, lower = np.log1p(d / DEPTH_SCALE), np.log1p((t - d) / DEPTH_SCALE)
    return upper / (upper + lower)


def depths(count: int, t: float) -> Array:
    """Return depths at even steps of their coordinate; the ends are just inside, where
    the source has its limit.
    """
    targets = np.linspace(0.0, 1.0, count)
    low, high = np.zeros(count), np.full(count, t)
    # The coordinate grows with the depth: it is inverted by halving, to the rounding of a depth.
    for _ in range(80):
        middle = (low + high) / 2
        above = depth_coordinate(middle, t) < targets
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    values = (low + high) / 2
    values[0], values[-1] = 1e-4 * t, (1 - 1e-4) * t
    return values


def steep_powers(number: int, t: float, d: Array) -> Array:
    """Return r of a set at depths in a slab."""
    first, last = SETS[number]
    # n and m of the derivation are orders less 1.
    thin = (first - 1) * np.log(t / (t + THICKNESS_SHIFT))
    if not math.isfinite(last):
        return np.full_like(d, thin)
    m = (first + last) / 2 - 1
    return thin + m * np.log1p(d / m) - d


def way_behind(d: Array, t: float, mu: Array) -> Array:
    """Return the way L from points back to where the line of sight enters
    the slab [mean free paths].
    """
    # A line of sight at the horizon never leaves the slab.
    return np.where(mu < 0, d, t - d) / np.maximum(np.abs(mu), 1e-9)


def place_fractions(t: Any, d: Any, sun: Any) -> tuple[Any, Any, Any]:
    """Return the coordinates of thickness, depth and the cosine of the sun's
    zenith angle, from 0 to 1.
    """
    # The logarithm of the thickness, the ratio of logarithms of depths, and the root of the sun's
    # height: the module docstring's coordinates, from the first entry to the last.
    low, high = (math.log(end + THICKNESS_SHIFT) for end in (THINNEST, THICKEST))
    upper, lower = (dr.log(1 + length / DEPTH_SCALE) for length in (d, t - d))
    low_sun = lowest_sun_coordinate()
    return (
        (dr.log(t + THICKNESS_SHIFT) - low) / (high - low),
        upper / dr.maximum(upper + lower, 1e-30),
        (dr.sqrt(dr.asin(sun) * (2 * dr.inv_pi)) - low_sun) / (1 - low_sun),
    )


def around(
    places: tuple[Any, ...], sides: tuple[int, ...], first: Any = 0
) -> list[tuple[Any, Any]]:
    """Return indices and weights of the entries around places.

    `places`: coordinates from 0 to 1; two, three or five; `sides`: entries along each, the last of
    which lie side by side; `first`: index of the first entry.
    """
    # The entry with the lowest indices around the place, and by axis the fraction f of the place in
    # its cell with the stride to the next entry.
    base: Any = mi.UInt32(first)
    pairs: list[tuple[Any, Any]] = []
    for axis, (place, side) in enumerate(zip(places, sides, strict=True)):
        cell, fraction = cell_of(place * (side - 1), side)
        stride = math.prod(sides[axis + 1 :])
        base += cell * stride
        pairs.append((fraction, mi.UInt32(stride)))
    # Sorted so that f_1 >= f_2 >= ..: networks compare the same pairs of axes in all lanes.
    networks = {
        2: ((0, 1),),
        3: ((0, 2), (0, 1), (1, 2)),
        5: ((0, 3), (1, 4), (0, 2), (1, 3), (0, 1), (2, 4), (1, 2), (3, 4), (2, 3)),
    }
    for first, second in networks[len(pairs)]:
        (a, p), (b, q) = pairs[first], pairs[second]
        swap = a < b
        pairs[first] = dr.select(swap, b, a), dr.select(swap, q, p)
        pairs[second] = dr.select(swap, a, b), dr.select(swap, p, q)
    # From corner to corner of the simplex, along the axis of the largest fraction first; the weight
    # of a corner is the difference of two neighbouring fractions, from 1 down to 0.
    entries, before = [], type(pairs[0][0])(1)
    for fraction, stride in pairs:
        entries.append((base, before - fraction))
        base, before = base + stride, fraction
    return [*entries, (base, before)]


def slab_phase(phase: Phase, types: ArrayTypes, *, modified: bool = False) -> AnglePhase:
    """Return the phase function of a scene by its values.

    `phase`: of a medium of the scene; `types`: of its numbers; `modified`: whether the peak below
    `CUT` is cut to zero: lengths then belong to the medium whose density is lowered by
    `fraction_of_peak`.
    """
    edge = np.deg2rad(CUT)

    def heights(angles: Array) -> Array:
        values = _values(phase, types, angles)
        return np.where(angles < edge, 0.0, values) if modified else values

    return AnglePhase(heights, np.array([0.0, edge, np.pi]))


def fraction_of_peak(phase: Phase, types: ArrayTypes) -> float:
    """Return the fraction of the light [1] that a phase function scatters by less than `CUT`."""
    # (1/2) int_0^edge p sin(angle) d(angle), with Gauss nodes in the peak alone.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    edge = np.deg2rad(CUT)
    angles = edge * (nodes + 1) / 2
    return float(weights @ (_values(phase, types, angles) * np.sin(angles)) * edge / 4)


def _values(phase: Phase, types: ArrayTypes, angles: Array) -> Array:
    # Kernels evaluate phase functions from sin^2 and cos^2 of half the angle.
    down, up = (types.scalar(function(angles / 2) ** 2) for function in (np.sin, np.cos))
    return np.array(phase.evaluate_half(down, up), dtype=np.float64)
