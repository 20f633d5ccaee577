# SPDX-License-Identifier: BSD-3-Clause
"""Boxes about the directions of tiles and blocks of rays, and which shadow planes can touch them.

Tiles and blocks: `realtime.tiles.candidate_lists`. Each has a box about the
directions of its rays in the frame of the light, and the least quotient 1/x at which one of them ends. What decides
whether a ray crosses a plane, D/x = A wx + B wy - wz and its like (`realtime.methods.shadow_planes.plane_table`), is
linear in the direction, so its largest value over the box is the value at the centre plus |A| ex + |B| ey + ez. So are
1/x = P wx + Q wy and the margin wz - A wx - B wy of a light at infinity.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import drjit as dr

from realtime.methods.shadow_planes.plane_entries import NUMBER
from realtime.methods.shadow_planes.plane_table import PlaneIndex
from realtime.numerics.array_types import four_numbers, two_numbers
from realtime.numerics.diamond_angle import TURN, diamond_angle
from realtime.tiles.candidate_lists import bounding, farthest, members

_SLACK = 1e-5  # of the terms of a sum: float32 rounding, with room to spare


@dataclass
class Box:
    """Boxes about directions, in the frame of the light."""

    x: Any  #: components of the centre, of unit directions
    y: Any
    z: Any
    x_half: Any  #: half the width
    y_half: Any
    z_half: Any
    ray_end: Any  #: least D/x at which a ray ends
    azimuth: Any  #: of the centre, diamond angle
    azimuth_half: Any


def tile_boxes(index: PlaneIndex, rays: Callable[[Any], tuple[Any, Any, Any]], distance, *, square: bool) -> Box:
    """Return the boxes of the tiles.

    Parameters
    ----------
    index
        The planes, for the frame of the light.
    rays
        (lane) -> direction in that frame, three arrays.
    distance
        At which every ray ends [m].
    square
        Whether every tile is a square of 4 x 4 pixels: then its corners bound it, but for the curvature of the sphere
        of directions.
    """
    lanes = members(dr.width(distance))
    directions = [rays(lane) for lane in bounding(lanes, square=square)]
    low = [reduce(dr.minimum, [w[axis] for w in directions]) for axis in range(3)]
    high = [reduce(dr.maximum, [w[axis] for w in directions]) for axis in range(3)]
    if square:
        # Between two directions at the angle a the sphere stands out by 1 - cos(a/2) < a^2/8.
        bulge = 0.125 * sum(dr.square(b - a) for a, b in zip(low, high))
        low, high = [a - bulge for a in low], [b + bulge for b in high]
    return _box(low, high, index.distance / farthest(distance, lanes))


def block_boxes(tile: Box) -> Box:
    """Return the boxes of the blocks of tiles."""

    def bounds(number):
        box = dr.gather(Box, tile, number)
        centre, half = (box.x, box.y, box.z), (box.x_half, box.y_half, box.z_half)
        low, high = [c - h for c, h in zip(centre, half)], [c + h for c, h in zip(centre, half)]
        return low, high, box.ray_end

    lows, highs, ray_ends = zip(*(bounds(number) for number in members(dr.width(tile.x))))
    low = [reduce(dr.minimum, along_axis) for along_axis in zip(*lows)]
    high = [reduce(dr.maximum, along_axis) for along_axis in zip(*highs)]
    return _box(low, high, reduce(dr.minimum, ray_ends))


def _box(low, high, ray_end) -> Box:
    """Return the box between two corners."""
    x, y, z = (0.5 * (a + b) for a, b in zip(low, high))
    x_half, y_half, z_half = (0.5 * (b - a) for a, b in zip(low, high))
    azimuth, azimuth_half = _azimuths((x, y), (x_half, y_half))
    return Box(x, y, z, x_half, y_half, z_half, ray_end, azimuth, azimuth_half)


def _azimuths(centre, half):
    """Return the azimuth of the centres and how far the corners are from it; a full turn where that is unclear."""
    (x, y), (x_half, y_half) = centre, half
    azimuth = diamond_angle(x, y)
    widest = type(x)(0)
    for side_x in (-1, 1):
        for side_y in (-1, 1):
            turn = diamond_angle(x + side_x * x_half, y + side_y * y_half) - azimuth
            turn = dr.abs(turn)
            widest = dr.maximum(widest, dr.minimum(turn, TURN - turn))
    holds_axis = (dr.abs(x) <= x_half) & (dr.abs(y) <= y_half)
    return azimuth, dr.select(holds_axis | (widest > 1), TURN, widest + 1e-6)


def touches(index: PlaneIndex, box: Box, entry, active):
    """Return whether a ray of the box could cross the plane of an `entry`, whether all that reach it do, and D/x there.

    D/x is that of the centre of the box.
    """
    Float = type(box.x)
    number = entry & NUMBER
    a, b, p, q = dr.gather(four_numbers(Float), index.lines, number, active)
    first, last = dr.gather(two_numbers(Float), index.spans, 2 * number, active)
    if index.w:
        quotient = dr.fma(a, box.x, dr.fma(b, box.y, -box.z))
        reach = dr.fma(dr.abs(a), box.x_half, dr.fma(dr.abs(b), box.y_half, box.z_half))
        reach += _SLACK * (dr.abs(a * box.x) + dr.abs(b * box.y) + 1)
        pd, qd = p * index.distance, q * index.distance
        margin = dr.fma(pd, box.x, qd * box.y) - quotient
        margin_reach = dr.fma(dr.abs(pd - a), box.x_half, dr.fma(dr.abs(qd - b), box.y_half, box.z_half))
        margin_reach += _SLACK * (dr.abs(a * box.x) + dr.abs(b * box.y) + dr.abs(pd * box.x) + dr.abs(qd * box.y) + 1)
    else:
        quotient = dr.fma(a, box.x, b * box.y)
        reach = dr.fma(dr.abs(a), box.x_half, dr.abs(b) * box.y_half)
        reach += _SLACK * (dr.abs(a * box.x) + dr.abs(b * box.y))
        margin = box.z - dr.fma(p, box.x, q * box.y)
        margin_reach = dr.fma(dr.abs(p), box.x_half, dr.fma(dr.abs(q), box.y_half, box.z_half))
        margin_reach += _SLACK * (dr.abs(p * box.x) + dr.abs(q * box.y) + 1)
    low, high = box.azimuth - box.azimuth_half, box.azimuth + box.azimuth_half
    overlaps = (first <= high) & (last >= low)
    overlaps |= (first <= high - TURN) & (last >= low - TURN)
    overlaps |= (first <= high + TURN) & (last >= low + TURN)
    largest = quotient + reach
    could = (largest > 0) & (largest >= box.ray_end) & (margin + margin_reach > 0)
    full = (quotient > reach) & (margin > margin_reach) & (first <= low) & (high < last) & (low >= 0) & (high < TURN)
    return active & overlaps & could, full, quotient
