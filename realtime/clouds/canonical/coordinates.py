# SPDX-License-Identifier: BSD-3-Clause
"""The coordinates of the tables, and the steep factors that they leave out, so that few entries serve.

    thickness    log(t + 0.02), for t from 0.01 to 200
    depth        a(d)/(a(d) + a(t - d)), a(z) = log(1 + z/0.1): 0 at the lit face, 1 at the other, fine at both
    sun          sqrt(2 asin(mu_L)/pi), for mu_L from 0.02 to 1: fine where the sun is low
    direction    v in mu = +-(1 - cos(pi v))/2, v from -1 to 1: fine at the horizon, where light comes from within
                 abs(mu) mean free paths of depth, and even in the angle at the normal, since waves of the azimuth grow
                 with its sine there

What is looked up is not T, c and sigma but what is left of them without their steep factors. With L the way from the
point back to where the line of sight enters the slab, and P_s the phase function scattered n times, the mean over the
orders of the set,

    T = P_s(cos Theta) (1 - exp(-L)) exp(r + b + F),     L = d/|mu| for mu < 0, (t - d)/mu for mu > 0,

where 1 - exp(-L) leaves the mean of the source along that way, finite and smooth at mu = 0 and at both faces, and P_s
holds lobe, glory and fogbow. r(t, d) is what an order does by itself. With n the first order of the set and m the mean
of its orders, each less 1,

    r = n log(t/(t + 0.02)) + m log(1 + d/m) - d        (31-inf: the first term alone):

thin slabs scatter with the power n of their thickness, and deep in thick ones the light of an order is d^m exp(-d), as
in Poisson's distribution. b(t, d, mu_L), the mean of the logarithm over directions, is smooth after that.

On that way light comes a length s from its last scattering. Where the source is even, s has the mean and the variance

    <s> = 1 - L e^{-L}/(1 - e^{-L}),     <s^2> = 2 - (L^2 + 2 L) e^{-L}/(1 - e^{-L}),

which change from L/2 to 1 within |mu| about as small as t: these are left out too. With w the horizontal part of the
direction and log s_b(t, d, mu_L) a mean over directions,

    D = w <s> + s_b (X, Y),     sigma^2 = s_b^2 exp(2 Z) + |w|^2 (<s^2> - <s>^2)/2.

F, X, Y and Z are sums of products, see `low_rank.py`.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical.sets import SETS

Array = NDArray[Any]

THINNEST, THICKEST = 0.01, 200.0
LOWEST_SUN = 0.02
THICKNESS_SHIFT = 0.02
DEPTH_SCALE = 0.1
HORIZON = 5e-4  #: cosine of the entries at mu = 0
SHORT = 0.05  #: way below which series take the place of differences


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


def directions(count: int) -> Array:
    """Return cosines of directions at even steps, an odd number of them: the one in the middle is just off 0."""
    places = np.linspace(-1.0, 1.0, count)
    values = np.sign(places) * (1 - np.cos(np.pi * places)) / 2
    values[count // 2] = HORIZON
    return values


def depth_coordinate(d: Array, t: float) -> Array:
    """Return the coordinate of depths in a slab."""
    upper, lower = np.log1p(d / DEPTH_SCALE), np.log1p((t - d) / DEPTH_SCALE)
    return upper / (upper + lower)


def depths(count: int, t: float) -> Array:
    """Return depths at even steps of their coordinate; the ends are just inside, where the source has its limit."""
    wanted = np.linspace(0.0, 1.0, count)
    low, high = np.zeros(count), np.full(count, t)
    for _ in range(80):
        middle = (low + high) / 2
        above = depth_coordinate(middle, t) < wanted
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    values = (low + high) / 2
    values[0], values[-1] = 1e-4 * t, (1 - 1e-4) * t
    return values


def powers(number: int) -> tuple[int, float]:
    """Return n and m of r for a set of orders; m is 0 for the set without end."""
    first, last = SETS[number]
    return first - 1, (first + last) / 2 - 1 if math.isfinite(last) else 0.0


def reference(number: int, t: float | Array, d: Array) -> Array:
    """Return r of a set at depths in a slab."""
    n, m = powers(number)
    deep = m * np.log1p(d / m) - d if m else 0.0
    return n * np.log(t / (t + THICKNESS_SHIFT)) + deep + 0.0 * d


def way_behind(d: Array, t: float | Array, mu: Array) -> Array:
    """Return L [mean free paths]."""
    return np.where(mu < 0, d, t - d) / np.maximum(np.abs(mu), 1e-9)


def last_way(way: Array) -> tuple[Array, Array]:
    """Return the mean and the variance of s for L [mean free paths and their square]."""
    way = np.minimum(way, 200.0)
    short = np.minimum(way, SHORT)
    lost = np.exp(-way) / -np.expm1(-np.maximum(way, SHORT))
    mean = 1 - way * lost
    variance = 2 - (way + 2) * way * lost - mean**2
    series = short / 2 - short**2 / 12, short**2 / 12 - short**4 / 240
    return np.where(way < SHORT, series[0], mean), np.where(way < SHORT, series[1], np.maximum(variance, 0.0))
