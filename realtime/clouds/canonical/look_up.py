# SPDX-License-Identifier: BSD-3-Clause
"""The canonical transport on the device: sums of products of what depends on the place and on the direction.

Tables are kept with the fewest entries that cubics need. Here, once, splines put more of them along every coordinate,
so that a frame reads no more than the corners of a simplex (`coordinates.py`): of a place in the slab (t, d, mu_L) four
entries of the means b and log s_b, and four of the coefficients, of a direction (mu, phi) three of the shapes, in
packets of four products. Who does not use T does not pay for it. All arrays take about 250 MB.

Outside the tables:

- a point above the lit face counts as on it, one below the other face as on that (Bouthors 2008, 5.1);
- thinner than 0.01: c and sigma are those of 0.01 at the same share of the depth, and T falls with the power of the
  thickness that the first order of the set has;
- thicker than 200: a point within 50 of a face keeps its distance from it, others are in between in proportion;
- a sun lower than mu_L = 0.02: c and sigma are those of 0.02, and T falls with mu_L, to 0 at 0 and below.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from realtime.clouds.canonical import coordinates
from realtime.clouds.canonical.coordinates import ENTRIES, around
from realtime.clouds.canonical.tables import RANKS, CanonicalTables
from realtime.numerics.array_types import ArrayTypes

Array = NDArray[Any]

#: (set_number, t, d, mu, cos_phi, sin_phi, mu_l) -> T [1/sr], c_x, c_y, sigma [mean free paths]
LookUp = Callable[..., tuple[Any, Any, Any, Any]]

_FINER_MEANS = 4, 4, 6  #: times as many steps of thickness, depth and sun
_FINER = 2, 2, 2
_DIRECTIONS, _AZIMUTHS = 129, 65  #: entries of shapes
_NEAR = 50.0  #: distance from a face that points of thicker slabs keep [mean free paths]


def on_device(tables: CanonicalTables, types: ArrayTypes) -> "DeviceTables":
    """Return the look-up of tables, whose arrays are made here, once.

    They are float32, whatever is stored: a look-up of halves takes four times as long, and its code is compiled fifteen
    times as long.
    """
    means = [_finer(each, _FINER_MEANS) for each in tables.means]
    products = [_finer(each, _FINER) for each in tables.coefficients]
    shapes = [_fine_shapes(each, ranks) for each, ranks in zip(tables.shapes, RANKS, strict=True)]
    arrays = [tuple(mi.Float(each.ravel().astype(np.float32)) for each in group) for group in (means, products, shapes)]
    made = DeviceTables(
        arrays[0],
        arrays[1],
        arrays[2],
        tuple(types.scalar(each) for each in tables.angular),
        means[0].shape[:3],
        products[0].shape[:3],
    )
    dr.make_opaque(made)
    return made


@dataclass(frozen=True)
class DeviceTables:
    """Tables as a `LookUp`; its arrays are fields, so that recorded functions take them as inputs.

    A call takes `set_number`, 0 for order 2 to 7 for 31-inf, a Python number; the thickness `t`
    and the depth `d` of the point below the lit face along the normal [mean free paths]; `mu`, the cosine of the angle
    between the outward normal of the lit face and the direction in which the light leaves the point; `cos_phi` and
    `sin_phi` of that direction's azimuth from the horizontal direction in which the sun's light travels, and `mu_l`,
    the cosine of the sun's zenith angle. It returns the radiance for unit irradiance across the beam [1/sr], and the
    centre of the collector from the foot of the point on the lit face, c_x along the sun's horizontal direction, c_y
    along the normal times that, and its standard deviation of one axis [mean free paths].
    """

    means: tuple[Any, ...]
    coefficients: tuple[Any, ...]
    shapes: tuple[Any, ...]
    angular: tuple[Any, ...]
    of_means: tuple[int, ...]  #: entries of thickness, depth and sun
    of_coefficients: tuple[int, ...]

    def __call__(self, set_number: int, t, d, mu, cos_phi, sin_phi, mu_l):
        """Return T [1/sr], c_x, c_y, sigma [mean free paths]; see above."""
        d = dr.clip(d, 0, t)
        mu = dr.clip(mu, -1, 1)
        behind = dr.select(mu < 0, d, t - d) / dr.maximum(dr.abs(mu), 1e-6)
        t_inside, d_inside = _inside(t, d)
        sun = dr.clip(mu_l, coordinates.LOWEST_SUN, 1)
        dimmed = dr.clip(mu_l / coordinates.LOWEST_SUN, 0, 1)
        thinner = dr.minimum(t / coordinates.THINNEST, 1)

        place = place_shares(t_inside, d_inside, sun)
        from_place = around(place, self.of_coefficients)
        azimuth = dr.safe_acos(cos_phi) * dr.inv_pi
        from_direction = around((direction_share(mu), azimuth), (_DIRECTIONS, _AZIMUTHS))
        ranks = RANKS[set_number]
        packets = sum(ranks) // 4
        ends = [sum(ranks[:which]) // 4 for which in range(5)]

        def between(kind, table, entries, packets: int, number: int) -> Any:
            return sum(dr.gather(kind, table, index * packets + number) * weight for index, weight in entries)

        def summed(low: int, high: int) -> Any:
            """Return a sum of products."""
            return sum(
                dr.dot(
                    between(mi.Vector4f, self.coefficients[set_number], from_place, packets, number),
                    between(mi.Vector4f, self.shapes[set_number], from_direction, packets, number),
                )
                for number in range(low, high)
            )

        b, log_spread = between(mi.Vector2f, self.means[set_number], around(place, self.of_means), 1, 0)
        f, x, y, z = (summed(low, high) for low, high in pairwise(ends))
        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - sun * sun)), cos_phi, -mu * sun)
        scattered = scattered_at(self.angular[set_number], mi.UInt32(0), cosine)
        # Series take the place of differences where the way is short.
        left, is_short = dr.exp(-behind), behind < coordinates.SHORT
        passed = dr.select(is_short, behind * (1 - behind * (0.5 - behind * (1 / 6))), 1 - left)
        share = left / passed
        far = dr.fma(-behind, share, 1)
        on_way = dr.select(is_short, behind * (0.5 - behind * (1 / 12)), far)
        far_variance = dr.fma(-(behind + 2) * behind, share, 2) - far * far
        square = dr.square(behind)
        variance = dr.select(is_short, square * (1 / 12 - square * (1 / 240)), dr.maximum(far_variance, 0))
        power, mean_power = coordinates.powers(set_number)
        steep = power * dr.log(t_inside / (t_inside + coordinates.THICKNESS_SHIFT))
        if mean_power:
            steep += mean_power * dr.log(1 + d_inside * (1 / mean_power)) - d_inside
        T = scattered * passed * dr.exp(steep + b + f) * dimmed * thinner**power
        spread, sine = dr.exp(log_spread), dr.safe_sqrt((1 - mu) * (1 + mu))
        c_x = -dr.fma(spread, x, sine * cos_phi * on_way)
        c_y = -dr.fma(spread, dr.mulsign(y, sin_phi), sine * sin_phi * on_way)
        sigma = dr.sqrt(dr.square(spread * dr.exp(z)) + 0.5 * sine * sine * variance)
        return T, c_x, c_y, sigma


def _inside(t, d):
    """Return a thickness and a depth within the tables."""
    thickest, thinnest = coordinates.THICKEST, coordinates.THINNEST
    left = t - d
    middle = _NEAR + (thickest - 2 * _NEAR) * (d - _NEAR) / dr.maximum(t - 2 * _NEAR, thickest - 2 * _NEAR)
    thick = dr.select(d < _NEAR, d, dr.select(left < _NEAR, thickest - left, middle))
    thin = thinnest * d / dr.maximum(t, 1e-30)
    inside = dr.select(t > thickest, thick, dr.select(t < thinnest, thin, d))
    return dr.clip(t, thinnest, thickest), inside


def place_shares(t, d, sun) -> tuple[Any, Any, Any]:
    """Return the coordinates of thickness, depth and the cosine of the sun's zenith angle, from 0 to 1."""
    low, high = (math.log(end + coordinates.THICKNESS_SHIFT) for end in (coordinates.THINNEST, coordinates.THICKEST))
    upper, lower = (dr.log(1 + length / coordinates.DEPTH_SCALE) for length in (d, t - d))
    low_sun = coordinates.lowest_sun_coordinate()
    return (
        (dr.log(t + coordinates.THICKNESS_SHIFT) - low) / (high - low),
        upper / dr.maximum(upper + lower, 1e-30),
        (dr.sqrt(dr.asin(sun) * (2 * dr.inv_pi)) - low_sun) / (1 - low_sun),
    )


def direction_share(mu):
    """Return the coordinate of a direction, from 0 to 1."""
    v = dr.safe_acos(dr.fma(-2, dr.abs(mu), 1)) * dr.inv_pi
    return dr.fma(dr.mulsign(v, mu), 0.5, 0.5)


def _finer(table: Array, times: tuple[int, ...]) -> Array:
    """Return a table with so many times the steps along its first axes, by splines."""
    for axis, finer in enumerate(times):
        count = table.shape[axis]
        table = np.moveaxis(_spline(count, (count - 1) * finer + 1) @ np.moveaxis(table, axis, -2), -2, axis)
    return table


def _spline(count: int, finer: int) -> Array:
    """Return what takes values at even steps to values at finer ones, (finer, count)."""
    spline = make_interp_spline(np.linspace(0, 1, count), np.eye(count), k=min(3, count - 1))
    return np.asarray(spline(np.linspace(0, 1, finer)), dtype=np.float32)


def _fine_shapes(shapes: Array, ranks: tuple[int, ...]) -> Array:
    """Return shapes (directions, azimuths, products) at the entries that frames read.

    Along the azimuth they are cosines, those of Y sines; along the direction a spline in each hemisphere.
    """
    directions, count, _ = shapes.shape
    middles = (np.arange(count) + 0.5) * np.pi / count
    azimuths = np.linspace(0, np.pi, _AZIMUTHS)
    waves, from_one = np.arange(count), np.arange(1, count + 1)
    cosines = np.cos(np.outer(azimuths, waves)) * np.where(waves > 0, 2, 1) @ np.cos(np.outer(waves, middles)) / count
    halves = np.where(from_one < count, 2, 1)
    sines = np.sin(np.outer(azimuths, from_one)) * halves @ np.sin(np.outer(from_one, middles)) / count
    ends = np.cumsum([0, *ranks])
    parts = [
        np.tensordot(sines if which == 2 else cosines, shapes[..., low:high], axes=(1, 1))
        for which, (low, high) in enumerate(pairwise(ends))
    ]
    fine = np.concatenate(parts, axis=-1)
    middle = directions // 2
    spline = _spline(middle + 1, _DIRECTIONS // 2 + 1)
    below, above = (
        np.tensordot(spline, fine[:, half], axes=(1, 1)) for half in (slice(middle + 1), slice(middle, None))
    )
    return np.concatenate([below, above[1:]])


def scattered_at(table, first, cosine):
    """Return P_s, linear in the angle; `first` is the index of its first entry in the table."""
    Float = type(cosine)
    position = dr.safe_acos(cosine) * ((ENTRIES - 1) * dr.inv_pi)
    cell = dr.minimum(mi.UInt32(position), ENTRIES - 2)
    low, high = (dr.gather(Float, table, first + cell + offset) for offset in (0, 1))
    return dr.lerp(low, high, position - Float(cell))
