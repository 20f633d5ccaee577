# SPDX-License-Identifier: BSD-3-Clause
"""The canonical transport on the device: linear between entries, waves of the azimuth on top.

Tables are kept with the fewest entries that cubics need. Here, once, the cubic through the four nearest entries puts
more of them along thickness and depth, so that a frame reads no more than its neighbours: one look-up reads 8 packets
of four numbers of the means, 16 corners of one or two packets of four for T, and 16 of one to four for c and
sigma. Who does not use T does not pay for it. All arrays take about 200 MB.

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

from realtime.clouds.canonical import coordinates
from realtime.clouds.canonical.angular import ENTRIES
from realtime.clouds.canonical.sets import SETS
from realtime.clouds.canonical.tables import LENGTHS, WAVES, CanonicalTables
from realtime.numerics.array_types import ArrayTypes

#: (set_number, t, d, mu, cos_phi, sin_phi, mu_l) -> T [1/sr], c_x, c_y, sigma [mean free paths]
LookUp = Callable[..., tuple[Any, Any, Any, Any]]

_FINER_MEANS, _FINER = 3, 2  #: times as many steps of thickness and depth
_FINER_LENGTHS = 2  #: the first sets, whose lengths need them too
_NEAR = 50.0  #: distance from a face that points of thicker slabs keep [mean free paths]


def on_device(tables: CanonicalTables, types: ArrayTypes) -> "DeviceTables":
    """Return the look-up of tables, whose arrays are made here, once.

    They are float32, whatever is stored: a look-up of halves takes four times as long, and its code is compiled fifteen
    times as long.
    """
    means = [_refined(each, _FINER_MEANS) for each in tables.means]
    waves = [_refined(each, _FINER) for each in tables.waves]
    lengths = [_refined(each, _FINER if number < _FINER_LENGTHS else 1) for number, each in enumerate(tables.lengths)]
    groups = means, waves, lengths
    arrays = [tuple(mi.Float(each.ravel().astype(np.float32)) for each in group) for group in groups]
    made = DeviceTables(
        arrays[0],
        arrays[1],
        arrays[2],
        tuple(types.scalar(each) for each in tables.angular),
        tuple(tuple(each.shape[:-1] for each in group) for group in groups),
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
    waves: tuple[Any, ...]
    lengths: tuple[Any, ...]
    angular: tuple[Any, ...]
    shapes: tuple[tuple[tuple[int, ...], ...], ...]  #: of means, waves and lengths by set

    def __call__(self, set_number: int, t, d, mu, cos_phi, sin_phi, mu_l):
        """Return T [1/sr], c_x, c_y, sigma [mean free paths]; see above."""
        Float = type(t)
        lowest = math.log(coordinates.THINNEST + coordinates.THICKNESS_SHIFT)
        highest = math.log(coordinates.THICKEST + coordinates.THICKNESS_SHIFT)
        low_sun = coordinates.lowest_sun_coordinate()
        first = SETS[set_number][0]
        d = dr.clip(d, 0, t)
        mu = dr.clip(mu, -1, 1)
        behind = dr.select(mu < 0, d, t - d) / dr.maximum(dr.abs(mu), 1e-6)
        t_inside, d_inside = _inside(t, d)
        sun = dr.clip(mu_l, coordinates.LOWEST_SUN, 1)
        dimmed = dr.clip(mu_l / coordinates.LOWEST_SUN, 0, 1)
        thinner = dr.minimum(t / coordinates.THINNEST, 1)

        upper = dr.log(1 + d_inside / coordinates.DEPTH_SCALE)
        lower = dr.log(1 + (t_inside - d_inside) / coordinates.DEPTH_SCALE)
        shares = (
            (dr.log(t_inside + coordinates.THICKNESS_SHIFT) - lowest) / (highest - lowest),
            upper / (upper + lower),
            (dr.sqrt(dr.asin(sun) * (2 / math.pi)) - low_sun) / (1 - low_sun),
            direction_share(mu),
        )
        counts = LENGTHS[set_number]

        def entries(group: int, table, packets: int) -> list[Any]:
            shape = self.shapes[group][set_number]
            return _linear(shares[: len(shape)], shape, lambda index: _read(mi.Vector4f, table, index, packets))

        b, mean, log_spread, _ = entries(0, self.means[set_number], 1)
        f = entries(1, self.waves[set_number], WAVES[set_number] // 4)
        values = entries(2, self.lengths[set_number], sum(counts) // 4)
        ends = [sum(counts[:place]) for place in range(4)]
        x, y, z = (values[low:high] for low, high in pairwise(ends))

        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - sun * sun)), cos_phi, -mu * sun)
        scattered = _scattered(self.angular[set_number], cosine, Float)
        # Series take the place of differences where the way is short.
        left, is_short = dr.exp(-behind), behind < coordinates.SHORT
        passed = dr.select(is_short, behind * (1 - behind * (0.5 - behind * (1 / 6))), 1 - left)
        share = left / passed
        far = dr.fma(-behind, share, 1)
        on_way = dr.select(is_short, behind * (0.5 - behind * (1 / 12)), far)
        far_variance = dr.fma(-(behind + 2) * behind, share, 2) - far * far
        square = dr.square(behind)
        variance = dr.select(is_short, square * (1 / 12 - square * (1 / 240)), dr.maximum(far_variance, 0))
        T = scattered * passed * dr.exp(b + _cosines(f, cos_phi)) * dimmed * thinner ** (first - 1)
        spread, sine = dr.exp(log_spread), dr.safe_sqrt((1 - mu) * (1 + mu))
        c_x = -dr.fma(spread, _cosines(x, cos_phi), dr.fma(sine * cos_phi, on_way, mean))
        c_y = -dr.fma(spread, _sines(y, cos_phi, sin_phi), sine * sin_phi * on_way)
        sigma = dr.sqrt(dr.square(spread * dr.exp(_cosines(z, cos_phi))) + 0.5 * sine * sine * variance)
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


def direction_share(mu):
    """Return the coordinate of a direction, from 0 to 1."""
    argument = dr.asin(mu) * (2 / math.pi * coordinates.DIRECTION_ARGUMENT)
    # asinh without cancellation of negative arguments
    height = dr.abs(argument)
    third = dr.log(height + dr.sqrt(dr.fma(height, height, 1))) * (1 / 3)
    grown = dr.exp(third)
    v = coordinates.DIRECTION_ROOT * (grown - 1 / grown)
    return dr.fma(dr.mulsign(v, mu), 0.5, 0.5)


def _refined(table, times: int):
    """Return a table with so many times the steps along its first two axes, by cubics through the nearest entries."""
    for axis in (0, 1) if times > 1 else ():
        count = table.shape[axis]
        places = np.arange((count - 1) * times + 1) / times
        first = np.clip(places.astype(np.int64) - 1, 0, count - 4)
        u = places - first - 1
        weights = (
            -u * (u - 1) * (u - 2) / 6,
            (u + 1) * (u - 1) * (u - 2) / 2,
            -(u + 1) * u * (u - 2) / 2,
            (u + 1) * u * (u - 1) / 6,
        )
        along = [-1 if other == axis else 1 for other in range(table.ndim)]
        parts = [
            weight.reshape(along).astype(np.float32) * np.take(table, first + step, axis=axis)
            for step, weight in enumerate(weights)
        ]
        table = sum(parts[1:], start=parts[0])
    return table


def _linear(shares, counts: tuple[int, ...], read: Callable[[Any], list[Any]]) -> list[Any]:
    """Return what `read` gives at the entries around a place, linear in every coordinate.

    `shares` are coordinates from 0 to 1, `counts` the entries along them, the last of which lie side by side.
    """
    corner: Any = mi.UInt32(0)
    weights = []
    for share, count in zip(shares, counts):
        position = dr.clip(share, 0, 1) * (count - 1)
        cell = dr.minimum(mi.UInt32(position), count - 2)
        corner = corner * count + cell
        weights.append(position - type(position)(cell))
    strides = [math.prod(counts[place + 1 :]) for place in range(len(counts))]

    def between(axis: int, offset: int) -> list[Any]:
        if axis == len(counts):
            return read(corner + offset)
        low, high = between(axis + 1, offset), between(axis + 1, offset + strides[axis])
        return [dr.fma(weights[axis], b - a, a) for a, b in zip(low, high)]

    return between(0, 0)


def _read(packet, table, index, packets: int) -> list[Any]:
    """Return the numbers of an entry, in packets of four."""
    numbers: list[Any] = []
    for number in range(packets):
        numbers.extend(mi.Vector4f(dr.gather(packet, table, packets * index + number)))
    return numbers


def _scattered(table, cosine, Float):
    """Return P_s, linear in the angle."""
    position = dr.safe_acos(cosine) * ((ENTRIES - 1) / math.pi)
    cell = dr.minimum(mi.UInt32(position), ENTRIES - 2)
    low, high = dr.gather(Float, table, cell), dr.gather(Float, table, cell + 1)
    return dr.lerp(low, high, position - Float(cell))


def _cosines(coefficients, cos_phi):
    """Return sum_m a_m cos(m phi) by Clenshaw's recurrence."""
    after, now = 0, 0
    for coefficient in reversed(coefficients[1:]):
        now, after = coefficient + 2 * cos_phi * now - after, now
    return coefficients[0] + cos_phi * now - after


def _sines(coefficients, cos_phi, sin_phi):
    """Return sum_m a_m sin(m phi), m from 1 on."""
    after, now = 0, 0
    for coefficient in reversed(coefficients):
        now, after = coefficient + 2 * cos_phi * now - after, now
    return sin_phi * now
