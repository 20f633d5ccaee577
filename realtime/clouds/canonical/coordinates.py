# SPDX-License-Identifier: BSD-3-Clause
"""The coordinates of the canonical transport, and which factors of the light of a
slab its grid leaves out.

**The eight sets of orders of Bouthors 2008, section 5.1**, and the layers of images by
set; order 1 stands apart.

**The phase function scattered n times**, P_s: the mean over the orders of a set.

**The coordinates**, so that few entries serve:

    thickness    log(t + 0.02), for t from 0.01 to 200
    depth        a(d)/(a(d) + a(t - d)), a(z) = log(1 + z/0.1): 0 at the lit face, 1 at the other, fine at both
    sun          sqrt(2 asin(mu_L)/pi), for mu_L from 0.02 to 1: fine where the sun is low
    direction    asin(mu)/pi + 1/2
    azimuth      phi/pi

**The effect of an order by itself.** With n the first order of a set and m the mean of
its orders, each less 1,

    r = n log(t/(t + 0.02)) + m log(1 + d/m) - d        (31-inf: the first term alone):

thin slabs scatter with the power n of their thickness, and deep in thick ones the light of an order
is d^m exp(-d), as in Poisson's distribution.

**Interpolation on simplices:** the entries around a place of a regular grid, and what each counts.

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
_DEGREES = 800
_LEAST = 1e-3  #: of the mean, below which nothing is divided by it


def repeated_scattering(phase: SlabPhase) -> Array:
    """Return P_s at even angles, (sets, ENTRIES).

    n scatterings of a beam without a boundary multiply Legendre moments: the mean over the orders
    of a set of sum (2 l + 1) chi_l^n P_l. The set without end counts as isotropic.
    """
    cosines = np.cos(np.linspace(0.0, np.pi, ENTRIES))
    moments = phase.moments(_DEGREES)
    series = []
    for first, last in SETS:
        if math.isfinite(last):
            powers = np.mean([moments**order for order in range(first, int(last) + 1)], axis=0)
        else:
            powers = np.eye(1, _DEGREES)[0]
        series.append((2 * np.arange(_DEGREES) + 1) * powers)
    before, now = np.zeros_like(cosines), np.ones_like(cosines)
    total = np.zeros((len(SETS), ENTRIES))
    for degree, strengths in enumerate(np.array(series).T):
        total += strengths[:, None] * now
        before, now = now, ((2 * degree + 1) * cosines * now - degree * before) / (degree + 1)
    return np.maximum(total, _LEAST)


def at_angle(table: Array, cosines: Array) -> Array:
    """Return values of one set at cosines, linear in the angle between entries."""
    return np.interp(
        np.arccos(np.clip(cosines, -1.0, 1.0)), np.linspace(0.0, np.pi, ENTRIES), table
    )


THINNEST, THICKEST = 0.01, 200.0
LOWEST_SUN = 0.02
THICKNESS_SHIFT = 0.02
DEPTH_SCALE = 0.1
HORIZON = 1e-4  #: cosine of the entries at mu = 0


def thicknesses(count: int) -> Array:
    """Return thicknesses at even steps [mean free paths]."""
    low, high = np.log(np.array([THINNEST, THICKEST]) + THICKNESS_SHIFT)
    values = np.exp(np.linspace(low, high, count)) - THICKNESS_SHIFT
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
    wanted = np.linspace(0.0, 1.0, count)
    low, high = np.zeros(count), np.full(count, t)
    for _ in range(80):
        middle = (low + high) / 2
        above = depth_coordinate(middle, t) < wanted
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    values = (low + high) / 2
    values[0], values[-1] = 1e-4 * t, (1 - 1e-4) * t
    return values


def steep_powers(number: int, t: float, d: Array) -> Array:
    """Return r of a set at depths in a slab."""
    first, last = SETS[number]
    thin = (first - 1) * np.log(t / (t + THICKNESS_SHIFT))
    if not math.isfinite(last):
        return np.full_like(d, thin)
    m = (first + last) / 2 - 1
    return thin + m * np.log1p(d / m) - d


def way_behind(d: Array, t: float, mu: Array) -> Array:
    """Return the way L from points back to where the line of sight enters
    the slab [mean free paths].
    """
    return np.where(mu < 0, d, t - d) / np.maximum(np.abs(mu), 1e-9)


def place_fractions(t: Any, d: Any, sun: Any) -> tuple[Any, Any, Any]:
    """Return the coordinates of thickness, depth and the cosine of the sun's
    zenith angle, from 0 to 1.
    """
    low, high = (math.log(end + THICKNESS_SHIFT) for end in (THINNEST, THICKEST))
    upper, lower = (dr.log(1 + length / DEPTH_SCALE) for length in (d, t - d))
    low_sun = lowest_sun_coordinate()
    return (
        (dr.log(t + THICKNESS_SHIFT) - low) / (high - low),
        upper / dr.maximum(upper + lower, 1e-30),
        (dr.sqrt(dr.asin(sun) * (2 * dr.inv_pi)) - low_sun) / (1 - low_sun),
    )


#: Networks that sort so many numbers by comparisons of pairs.
_NETWORKS = {
    2: ((0, 1),),
    3: ((0, 2), (0, 1), (1, 2)),
    5: ((0, 3), (1, 4), (0, 2), (1, 3), (0, 1), (2, 4), (1, 2), (3, 4), (2, 3)),
}


def around(
    places: tuple[Any, ...], sides: tuple[int, ...], first: Any = 0
) -> list[tuple[Any, Any]]:
    """Return indices and weights of the entries around places.

    `places`: coordinates from 0 to 1; two, three or five; `sides`: entries along each, the last of
    which lie side by side; `first`: index of the first entry.
    """
    base: Any = mi.UInt32(first)
    pairs: list[tuple[Any, Any]] = []
    for axis, (place, side) in enumerate(zip(places, sides, strict=True)):
        cell, fraction = cell_of(place * (side - 1), side)
        stride = math.prod(sides[axis + 1 :])
        base += cell * stride
        pairs.append((fraction, mi.UInt32(stride)))
    for first, second in _NETWORKS[len(pairs)]:
        (a, p), (b, q) = pairs[first], pairs[second]
        less = a < b
        pairs[first] = dr.select(less, b, a), dr.select(less, q, p)
        pairs[second] = dr.select(less, a, b), dr.select(less, p, q)
    entries, before = [], type(pairs[0][0])(1)
    for fraction, stride in pairs:
        entries.append((base, before - fraction))
        base, before = base + stride, fraction
    return [*entries, (base, before)]


def slab_phase(phase: Phase, types: ArrayTypes, *, modified: bool = False) -> AnglePhase:
    """Return the phase function of a scene by its values.

    `phase`: of a medium of the scene; `types`: of its numbers; `modified`: whether the peak below
    `CUT` is cut to zero: then lengths are those of the medium whose density is lowered by
    `fraction_of_peak`.
    """
    edge = np.deg2rad(CUT)

    def heights(angles: Array) -> Array:
        values = _values(phase, types, angles)
        return np.where(angles < edge, 0.0, values) if modified else values

    return AnglePhase(heights, np.array([0.0, edge, np.pi]))


def fraction_of_peak(phase: Phase, types: ArrayTypes) -> float:
    """Return the fraction of the light [1] that a phase function scatters by less than `CUT`."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    edge = np.deg2rad(CUT)
    angles = edge * (nodes + 1) / 2
    return float(weights @ (_values(phase, types, angles) * np.sin(angles)) * edge / 4)


def _values(phase: Phase, types: ArrayTypes, angles: Array) -> Array:
    down, up = (types.scalar(function(angles / 2) ** 2) for function in (np.sin, np.cos))
    return np.array(phase.evaluate_half(down, up), dtype=np.float64)
