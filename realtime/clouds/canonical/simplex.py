# SPDX-License-Identifier: BSD-3-Clause
"""Interpolation on simplices: the entries around a place of a regular grid, and what each counts.

With the shares f of the place in its cell sorted so that f_1 >= f_2 >= .., and the strides s_i in that order,

    v = v_0 (1 - f_1) + v_1 (f_1 - f_2) + .. + v_n f_n,     v_i the entry at base + s_1 + .. + s_i,

linear within each of the simplices of a cell, and continuous: n + 1 entries, where products of pairs of weights take
2^n. A function without mixed second derivatives has the same error in both.
"""

import math
from typing import Any

import drjit as dr
import mitsuba as mi

#: Networks that sort so many numbers by comparisons of pairs.
_NETWORKS = {
    2: ((0, 1),),
    3: ((0, 2), (0, 1), (1, 2)),
    5: ((0, 3), (1, 4), (0, 2), (1, 3), (0, 1), (2, 4), (1, 2), (3, 4), (2, 3)),
}


def around(places: tuple[Any, ...], sides: tuple[int, ...], first: Any = 0) -> list[tuple[Any, Any]]:
    """Return indices and weights of the entries around places.

    `places`: coordinates from 0 to 1; two, three or five; `sides`: entries along each, the last of which lie side by
    side; `first`: index of the first entry.
    """
    base: Any = mi.UInt32(first)
    pairs: list[tuple[Any, Any]] = []
    for axis, (place, side) in enumerate(zip(places, sides, strict=True)):
        position = dr.clip(place, 0, 1) * (side - 1)
        cell = dr.minimum(mi.UInt32(position), side - 2)
        stride = math.prod(sides[axis + 1 :])
        base += cell * stride
        pairs.append((position - type(position)(cell), mi.UInt32(stride)))
    for first, second in _NETWORKS[len(pairs)]:
        (a, p), (b, q) = pairs[first], pairs[second]
        less = a < b
        pairs[first] = dr.select(less, b, a), dr.select(less, q, p)
        pairs[second] = dr.select(less, a, b), dr.select(less, p, q)
    entries, before = [], type(pairs[0][0])(1)
    for share, stride in pairs:
        entries.append((base, before - share))
        base, before = base + stride, share
    return [*entries, (base, before)]
