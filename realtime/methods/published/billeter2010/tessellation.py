# SPDX-License-Identifier: BSD-3-Clause
"""Adaptive tessellation of a height field: large quads where it is flat, texels at its edges.

Billeter, Sintorn, Assarsson 2010, section 4.1: a Laplacian filter finds edges, a hierarchy says
which quads hold one, neighbours are made to differ by at most one level, and a quad is triangulated
by which of its sides are divided.

The filter. A quad of h x h texels, h even, that is divided into four gets five new corners: the
middles of its sides and of its diagonal. There it departs from the two triangles of the undivided
quad by half a second difference,

    e = | s(a) + s(b) - 2 s(middle) | / 2,     a, b the ends of the side or of the diagonal,

which is h^2 / 8 times the second derivative. The quad holds an edge if e > threshold s(middle) at
one of the five. These are the terms of the Laplacian of the inverse depth s, but taken

- of s and not of the depth: the mesh is linear in s, planes have no second
  difference however they are seen;
- one by one: their sum vanishes at a saddle, s = u^2 - v^2 or u v, where the mesh
  is as wrong as anywhere;
- at the spacing of every level, not of the texels alone: below a threshold at the texels, a smooth
  curvature would add up to 4^k times as much over quads of 2^k texels;
- relative to the local height, not to the range of a face: e / s is the relative error of the
  depth, so the same angle at the light wherever the surface is, and one near object does not hide
  what lies far behind it. Where s = 0, at infinity, any difference is an edge.

As each corner is examined in the quad that would introduce it, a tessellation is wrong nowhere by
more than a small multiple of the threshold: the errors of a corner and of the corners it was
interpolated from add up. A plain Laplacian of the depth at the texels, with as many triangles, 227
000 for six maps of 512^2 of the colonnade, leaves 5.8 times the error of the depth (root mean
square) and 1.3 times the error of the airlight (`airlight paper billeter`).

Levels: a node of level l has N / 2^l texels on a side; level 0 is a face, level log2 N the texels.
`divided[l]` has one flag for each node of each face, (faces, 2^l, 2^l), row by row, and nodes that
do not exist have the flag unset. Heights are arrays (faces, N + 1, N + 1) at the corners of the
texels; one face is a square, six are a cube as in `realtime.shadow_maps.shadow_map`.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from airlight.errors import InputError

#: The corners and the middles of the sides of a quad, counter-clockwise, as (column,
#: row) in halves of a side.
RING = ((0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def configuration(sides: int) -> list[tuple[int, int, int]]:
    """Return the triangles of a quad, counter-clockwise, as indices into `RING`.

    A fan from the first middle there is, which lies on no line with the rest of the ring, or
    without one from the corner (0, 0): 2 triangles, and one more for each divided side.

    `sides`: which sides are divided, one bit each: 1 lower, 2 right, 4 upper, 8 left.
    """
    # The corners of the ring have even numbers, the middles of its sides odd ones.
    middles = [2 * side + 1 for side in range(4) if sides >> side & 1]
    start = middles[0] if middles else 0
    ring = [k % 8 for k in range(start, start + 8) if k % 2 == 0 or k % 8 in middles]
    return [(start, a, b) for a, b in pairwise(ring[1:])]


def edges(height, threshold: float) -> list[Any]:
    """Return the nodes of each level that hold an edge at the spacing of that level.

    `height`: array (faces, N + 1, N + 1), N a power of two, of inverse depths [1/m], none negative;
    `threshold`: largest departure that is no edge, relative to the height [1]. Raises InputError if
    `threshold` is not a positive number.
    """
    if not 0 < threshold < np.inf:
        raise InputError(
            f"threshold: got {threshold!r}, expected a positive number, for instance 0.001"
        )
    size = height.shape[1] - 1
    marks_by_level = []
    for level in range(size.bit_length() - 1):
        # Every half-th corner: the corners of the quads of this level, and their middles. Face by
        # face, to save memory.
        half = size >> (level + 1)
        marks = [_marks(face_height[::half, ::half], threshold) for face_height in height]
        marks_by_level.append(np.stack(marks))
    return marks_by_level


def _marks(s, threshold: float):
    """Return the quads with an edge; their corners have even, their middles odd numbers in `s`."""

    def departs(a, b, middle):
        return abs(a + b - 2 * middle) > 2 * threshold * middle

    # On the sides along rows, on the sides along columns, and on the diagonal; a quad has two sides
    # of each kind.
    along_rows = departs(s[::2, :-1:2], s[::2, 2::2], s[::2, 1::2])
    along_columns = departs(s[:-1:2, ::2], s[2::2, ::2], s[1::2, ::2])
    diagonal = departs(s[:-1:2, :-1:2], s[2::2, 2::2], s[1::2, 1::2])
    return (
        along_rows[:-1] | along_rows[1:] | along_columns[:, :-1] | along_columns[:, 1:] | diagonal
    )


def divide(edge: list[Any]) -> list[Any]:
    """Return which nodes are divided: nodes with an edge in or below them, and the nodes that
    neighbours then need.

    From fine to coarse: where a node is divided, it and the four nodes across its sides must exist,
    so their parents are divided. Then the quads on both sides of an edge of the mesh differ by at
    most one level.
    """
    divided = list(edge)
    for level in reversed(range(1, len(edge))):
        # A divided node and its four neighbours must exist; a node exists if its parent is divided.
        exists = divided[level].copy()
        for across in _across(divided[level]):
            exists |= across
        divided[level - 1] = divided[level - 1] | (
            exists[:, ::2, ::2]
            | exists[:, ::2, 1::2]
            | exists[:, 1::2, ::2]
            | exists[:, 1::2, 1::2]
        )
    return divided


def _across(flags):
    """Return the flags of the nodes across the lower, right, upper and left sides; beyond
    a square they are unset.
    """
    lower, right, upper, left = (np.zeros_like(flags) for _ in range(4))
    lower[:, 1:], upper[:, :-1] = flags[:, :-1], flags[:, 1:]
    left[:, :, 1:], right[:, :, :-1] = flags[:, :, :-1], flags[:, :, 1:]
    if len(flags) == 6:
        # Axis k has across and up along the axes k + 1 and k + 2, counted cyclically. Hence the
        # side u = +-1 of face (k, sign) is the side v = sign of face (k + 1, +-1), and its side v =
        # +-1 is the side u = sign of face (k + 2, +-1); what runs along the side is the same
        # coordinate on both.
        for face in range(6):
            axis, border = face >> 1, -1 if face & 1 == 0 else 0
            to_right, to_upper = 2 * ((axis + 1) % 3), 2 * ((axis + 2) % 3)
            right[face, :, -1], left[face, :, 0] = (
                flags[to_right, border],
                flags[to_right + 1, border],
            )
            upper[face, -1], lower[face, 0] = (
                flags[to_upper, :, border],
                flags[to_upper + 1, :, border],
            )
    return lower, right, upper, left


def quads(divided: list[Any]):
    """Yield the quads of the mesh level by level: their level, flat numbers
    and sides that are divided.
    """
    faces = len(divided[0])
    exists = np.ones((faces, 1, 1), bool)
    for level, flags in enumerate(divided):
        # The quads of the mesh exist and are not divided; a side is divided if the node across is.
        numbers = np.flatnonzero(exists & ~flags)
        sides = np.zeros(len(numbers), np.uint8)
        for side, across in enumerate(_across(flags)):
            sides |= across.ravel()[numbers].astype(np.uint8) << side
        yield level, numbers, sides
        exists = np.repeat(np.repeat(flags, 2, axis=1), 2, axis=2)
    # Quads as large as texels have no divided sides.
    numbers = np.flatnonzero(exists)
    yield len(divided), numbers, np.zeros(len(numbers), np.uint8)


def triangles(divided: list[Any]):
    """Return the triangles of the quads, (m, 3) numbers of corners face by face and row by row.

    `divided`: the result of `divide`. Triangles are counter-clockwise in (column, row), and no
    corner lies inside a side of a triangle.
    """
    # Quads of one level with the same divided sides have one fan of triangles, at another corner.
    size = 2 ** len(divided)
    parts = []
    for level, numbers, sides in quads(divided):
        for sides_now in range(16):
            chosen = numbers[sides == sides_now] if len(numbers) else numbers
            if len(chosen):
                # The fan as steps from the corner (0, 0) of each quad.
                first, step = _first_corner(chosen, level, size)
                fan = np.array(
                    [
                        [_ring_offset(k, step, size) for k in triangle]
                        for triangle in configuration(sides_now)
                    ]
                )
                parts.append((first[:, None, None] + fan.astype(np.int32)).reshape(-1, 3))
    return np.concatenate(parts)


def _first_corner(numbers, level: int, size: int):
    """Return the number of the corner (0, 0) of each node, and the texels on a side of a node."""
    step = size >> level
    face, rest = np.divmod(numbers, 4**level)
    row, column = np.divmod(rest, 2**level)
    return ((face * (size + 1) + row * step) * (size + 1) + column * step).astype(np.int32), step


def _ring_offset(k: int, step: int, size: int) -> int:
    """Return the number of a corner of the ring, less the number of the quad's corner (0, 0)."""
    return (RING[k][1] * step // 2) * (size + 1) + RING[k][0] * step // 2
