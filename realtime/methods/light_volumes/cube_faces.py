# SPDX-License-Identifier: BSD-3-Clause
"""Which faces of a cube of shadow maps the rays of a tile pass, and in which order: the others cost nothing.

A face of the cube about a light is seen through a pyramid that four of the six planes |p| = |q|, p and q two of the
coordinates x, y, z from the light, cut out of space: the face along +x is where x + y, x - y, x + z and x - z are
positive. Rays start at the camera, go at most a distance L along directions that are combinations, with positive
weights, of the corners d of their tile. Those weights add up to at most 1/c, with c the least cosine between a corner
and the middle m of the tile, since a unit vector has d . m <= 1. So along all rays a coordinate n . P is at most

    n . (camera - light) + (L/c) max(0, n . d),     d the corner where that is largest,

and where this is negative for one of the four planes no ray comes into the pyramid.
"""

from functools import reduce
from itertools import combinations
from operator import or_
from typing import Any

import drjit as dr
import mitsuba as mi

FACE_BITS = 3  #: of the number of a face in an order of faces
NO_FACE = (1 << FACE_BITS) - 1  #: stands behind the last

_SLACK = 1e-6  # of a coordinate or a slope: float32 rounding, with room
_FAR = 1e30  # stands for the end of endless rays [m]


def faces_passed(directions, middle, end, away) -> Any:
    """Return bit k for each face k of a cube that rays may pass, by tile.

    Parameters
    ----------
    directions
        Unit directions of rays, by tile, of which all others are combinations with positive weights.
    middle
        The unit direction of their sum.
    end
        Largest length of a ray, by tile [m].
    away
        The camera less the light [m].
    """
    # A combination is as long as its part along the middle, at least: a unit vector takes larger weights by that much.
    shortest = reduce(dr.minimum, [dr.dot(d, middle) for d in directions])
    length = dr.minimum(end / dr.maximum(shortest, 1e-6), _FAR) * (1 + 1e-5)
    rounding = _SLACK * dr.norm(away)
    missed: dict[tuple[int, int, int, int], Any] = {}
    for first, second in combinations(range(3), 2):
        for sign in (1, -1):
            slopes = [d[first] + sign * d[second] for d in directions]
            start = away[first] + sign * away[second]
            largest = dr.fma(length, dr.maximum(reduce(dr.maximum, slopes) + _SLACK, 0), start)
            least = dr.fma(length, dr.minimum(reduce(dr.minimum, slopes) - _SLACK, 0), start)
            below, above = largest < -rounding, least > rounding
            # Of x + y the face -y looks from below, of x - y from above; the face x from above, -x from below.
            missed[first, 1, second, sign], missed[first, -1, second, sign] = below, above
            missed[second, 1, first, sign] = below if sign > 0 else above
            missed[second, -1, first, sign] = above if sign > 0 else below
    passed = mi.UInt32(0)
    for face in range(6):
        axis, side = face // 2, 1 - 2 * (face % 2)
        planes = [missed[axis, side, other, sign] for other in range(3) if other != axis for sign in (1, -1)]
        passed |= dr.select(reduce(or_, planes), 0, mi.UInt32(1 << face))
    return passed


def faces_in_order(passed, begins) -> Any:
    """Return the faces that rays may pass in the order of their beginnings, three bits each, the first in the lowest.

    Parameters
    ----------
    passed
        From `faces_passed`.
    begins
        Where a ray of the tile comes into each of the six faces, infinite where it does not [m].
    """
    there = [(passed >> face & 1) != 0 for face in range(6)]
    order = mi.UInt32(NO_FACE) << (FACE_BITS * dr.popcnt(passed))
    for face, begin in enumerate(begins):
        rank = mi.UInt32(0)
        for other, its_begin in enumerate(begins):
            before = its_begin <= begin if other < face else its_begin < begin
            rank += dr.select(there[other] & before, mi.UInt32(1), 0)
        order |= dr.select(there[face], mi.UInt32(face) << (FACE_BITS * rank), 0)
    return order
