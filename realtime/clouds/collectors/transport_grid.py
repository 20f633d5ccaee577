# SPDX-License-Identifier: BSD-3-Clause
r"""The canonical transport on one grid of five dimensions, for frames that have no time for the tables.

A look-up of the tables reads a hundred packets of numbers and more, which is what their accuracy takes. Here are the
same coordinates, thickness, depth, sun and direction (`realtime.clouds.canonical.coordinates`), and the azimuth as the
fifth, with one packet an entry,

    log(Q/Q_0),   c_x/sigma,   c_y/sigma,   log sigma,     Q = T / (P_s (1 - exp(-L))),

where P_s and 1 - exp(-L) are the steep factors that the tables leave out, too, and Q_0(t, d, mu_L) is Q of one level
direction: deep in thick slabs it falls by many powers of e, so that it has a grid of its own, of three dimensions and
finer. Between entries it is linear on simplices (`realtime.clouds.canonical.coordinates`): 6 entries, where products of
five pairs of weights would read 32. The entries are looked up in the tables when a scene is prepared. All sets have one
code: the number of the set is an offset.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.clouds.canonical import coordinates
from realtime.clouds.canonical.coordinates import ENTRIES, around
from realtime.clouds.canonical.look_up import place_shares, scattered_at
from realtime.numerics.array_types import four_numbers

#: Entries along thickness, depth, sun, direction and azimuth.
SIDES = (20, 14, 10, 25, 9)
#: Entries of Q_0 along thickness, depth and sun.
FINE = (48, 72, 16)
_DARK = -60.0  #: logarithm of what is left where there is no light
_ASIDE = 1e-4  #: of the thickness by which entries keep from both faces, and of the cosine from 0


@dataclass(frozen=True)
class TransportGrid:
    """The grid of all sets as a `realtime.clouds.collectors.search.Transport`."""

    entries: Any  #: four numbers each, set after set
    sources: Any  #: log Q_0, set after set
    angular: Any  #: P_s at even angles, set after set

    def __call__(self, set_number, t, d, mu, cos_phi, sin_phi, mu_l):
        """Return T [1/sr], c_x, c_y, sigma [mean free paths]; see `realtime.clouds.canonical.look_up.DeviceTables`."""
        Float = type(t)
        number = mi.UInt32(set_number)
        t = dr.maximum(t, 1e-6)
        d = dr.clip(d, 0, t)
        sun = dr.clip(mu_l, coordinates.LOWEST_SUN, 1)
        inside = dr.clip(t, coordinates.THINNEST, coordinates.THICKEST)
        depth = d * (inside / t)
        azimuth = dr.safe_acos(cos_phi) * dr.inv_pi
        shares = _shares(inside, depth, sun, mu)
        four = _between(four_numbers(Float), self.entries, number, (*shares, azimuth), SIDES)
        source, x, y, log_sigma = four
        source += _between(Float, self.sources, number, shares[:3], FINE)
        sigma = dr.exp(log_sigma)
        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - sun * sun)), cos_phi, -mu * sun)
        dimmed = dr.clip(mu_l / coordinates.LOWEST_SUN, 0, 1) * dr.minimum(t / coordinates.THINNEST, 1)
        T = scattered_at(self.angular, number * ENTRIES, cosine) * _passed(t, d, mu) * dr.exp(source) * dimmed
        return T, x * sigma, dr.mulsign(y, sin_phi) * sigma, sigma

    def _source(self, look_up: Any, number: int, t, d, mu, cos_phi, sin_phi, mu_l) -> tuple[Any, Any, Any, Any]:
        """Return log Q, c_x, c_y and sigma of a set by the tables."""
        T, *collector = look_up(number, t, d, mu, cos_phi, sin_phi, mu_l)
        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - mu_l * mu_l)), cos_phi, -mu * mu_l)
        steep = scattered_at(self.angular, mi.UInt32(number * ENTRIES), cosine) * _passed(t, d, mu)
        return dr.maximum(dr.log(dr.maximum(T / steep, 1e-30)), _DARK), *collector


def transport_grid(look_up: Any, angular: Any, sets: int) -> TransportGrid:
    """Return the grid of a look-up.

    `look_up`: `realtime.clouds.canonical.look_up.DeviceTables`; `angular`: p_s by set, as the tables have it; `sets`:
    how many.
    """
    Float = type(look_up.angular[0])
    Four, Vector = four_numbers(Float), dr.uint32_array_t(Float)
    count, fine_count = math.prod(SIDES), math.prod(FINE)
    grid = TransportGrid(dr.empty(Float, 4 * count * sets), dr.empty(Float, fine_count * sets), Float(angular.ravel()))
    t_share, d_share, sun_share, mu_share, azimuth = _node_shares(SIDES, Float)
    t, d, sun, mu = _places(t_share, d_share, sun_share, mu_share)
    t_share, d_share, sun_share = _node_shares(FINE, Float)
    fine_t, fine_d, fine_sun, level = _places(t_share, d_share, sun_share, Float(0.5))
    cos_phi, sin_phi = dr.cos(azimuth * dr.pi), dr.sin(azimuth * dr.pi)
    dr.eval(t, d, sun, mu, cos_phi, sin_phi, fine_t, fine_d, fine_sun)
    for number in range(sets):
        own = Vector(number)
        source, *_ = grid._source(look_up, number, fine_t, fine_d, level, Float(0), Float(1), fine_sun)
        dr.scatter(grid.sources, source, dr.arange(Vector, fine_count) + number * fine_count)
        dr.eval(grid.sources)
        source, c_x, c_y, sigma = grid._source(look_up, number, t, d, mu, cos_phi, sin_phi, sun)
        source -= _between(Float, grid.sources, own, _shares(t, d, sun, mu)[:3], FINE)
        entries = Four(source, c_x / sigma, c_y / sigma, dr.log(sigma))
        dr.scatter(grid.entries, entries, dr.arange(Vector, count) + number * count)
        dr.eval(grid.entries)
    dr.make_opaque(grid)
    return grid


def _node_shares(sides: tuple[int, ...], Float: Any) -> list[Any]:
    """Return the coordinates of all entries, from 0 to 1."""
    index = dr.arange(mi.UInt32, math.prod(sides))
    return [
        Float((index // stride) % side) * (1 / (side - 1)) for side, stride in zip(sides, _strides(sides), strict=True)
    ]


def _strides(sides: tuple[int, ...]) -> list[int]:
    return [math.prod(sides[place + 1 :]) for place in range(len(sides))]


def _between(kind: Any, table: Any, number, places, sides: tuple[int, ...]) -> Any:
    """Return what a table of a set has at a place, linear on the simplex of entries that holds it."""
    total = kind(0)
    for index, weight in around(tuple(places), sides, number * math.prod(sides)):
        total = dr.fma(dr.gather(kind, table, index), weight, total)
    return total


def _passed(t, d, mu):
    """Return 1 - exp(-L), without cancellation where the way L behind the point is short."""
    behind = dr.select(mu < 0, d, t - d) / dr.maximum(dr.abs(mu), 1e-6)
    return dr.select(behind < 0.02, behind * (1 - behind * (0.5 - behind * (1 / 6))), 1 - dr.exp(-behind))


def _shares(t, d, sun, mu):
    """Return the coordinates of thickness, depth, sun and direction, from 0 to 1."""
    return *place_shares(t, d, sun), dr.fma(dr.asin(dr.clip(mu, -1, 1)), dr.inv_pi, 0.5)


def _places(t_share, d_share, sun_share, mu_share):
    """Return what has these coordinates; the depth by bisection."""
    low, high = (math.log(end + coordinates.THICKNESS_SHIFT) for end in (coordinates.THINNEST, coordinates.THICKEST))
    t = dr.exp(dr.fma(t_share, high - low, low)) - coordinates.THICKNESS_SHIFT
    above, below = dr.zeros(type(t), dr.width(t)), t
    for _ in range(40):
        middle = 0.5 * (above + below)
        upper, lower = (dr.log(1 + length / coordinates.DEPTH_SCALE) for length in (middle, t - middle))
        less = upper < d_share * (upper + lower)
        above, below = dr.select(less, middle, above), dr.select(less, below, middle)
    d = dr.clip(0.5 * (above + below), _ASIDE * t, (1 - _ASIDE) * t)
    low_sun = coordinates.lowest_sun_coordinate()
    sun = dr.sin(0.5 * dr.pi * dr.square(dr.fma(sun_share, 1 - low_sun, low_sun)))
    mu = dr.sin(dr.pi * (mu_share - 0.5))
    return t, d, sun, dr.select(dr.abs(mu) < _ASIDE, _ASIDE, mu)
