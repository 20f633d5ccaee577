# SPDX-License-Identifier: BSD-3-Clause
"""Lists of candidates by tile: what its rays have to look at, and little else.

Candidates (shadow planes, nodes over a shadow map) are drawn in two levels. A *block* of sixteen tiles draws its list
from all of them, found by an index: bins of azimuth, a pyramid of heights. A *tile* of sixteen rays draws from the list
of its block. Both ask one question of each: could any ray of mine meet it? A box or a beam about the rays answers, and
may say yes too often. Whether a ray does meet it the ray finds out.

**Where a list has no room, a cover takes its place**: a coarser list that holds all its candidates. No room is too
small, nothing is cut off, and the image is the same to rounding; rays only take longer. What the cover is follows from
the candidates:

- shadow planes have nothing coarser than themselves. The cover is the list that was drawn on: that of the block, or of
  the block its bins;
- nodes have larger ones. The cover is drawn from the pyramid anew, down to nodes of twice the size, and so on up to the
  whole face.

There are two ways to make room:

- *Count, scan, write*: candidates are counted, a prefix sum gives every list its place behind the one before, and they
  are visited once more to be written. That is for lists of very different lengths, which shadow planes have.
- *Fixed*: every list has the same room, and one visit counts and writes. That is for candidates that are dear to visit,
  as nodes are: to draw their lists is 20 % of the time of a frame (`colonnade` at 800 x 600, map=512, two threads,
  2026-11-22, the execution times in `dr.kernel_history`), which a second visit would nearly double, while 12 lists of
  68 314 have no room.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.tiles.layout import SIDE, TILE

_CORNERS = (0, SIDE - 1, TILE - SIDE, TILE - 1)  # the rays at the corners of a square


def members(count: int) -> list[Any]:
    """Return by tile the numbers of its sixteen rays, or by block those of its tiles; the last again beyond it."""
    tile = dr.arange(mi.UInt32, -(-count // TILE))
    return [dr.minimum(tile * TILE + k, count - 1) for k in range(TILE)]


def bounding(lanes: list[Any], *, square: bool) -> list[Any]:
    """Return those of a tile's rays, `lanes`, that bound it: all, or the corners of a square of pixels."""
    return [lanes[k] for k in _CORNERS] if square else lanes


def farthest(distance, lanes: list[Any]):
    """Return by tile the largest distance of its rays [m]; `lanes` are those of `members`."""
    return reduce(dr.maximum, (dr.gather(type(distance), distance, lane) for lane in lanes))


def over_lists(length, look: Callable[[Any, Any], Any], state):
    """Return the state of boxes or rays after they have gone over their lists.

    Parameters
    ----------
    length
        Of the lists.
    look
        Function (k, state) -> state after the k-th entry.
    state
        Before the first, with one entry for each: how many candidates were drawn, for instance.
    """
    _, state = dr.while_loop(
        state=(dr.zeros(mi.UInt32, dr.width(state)), state),
        cond=lambda k, state: k < length,
        body=lambda k, state: (k + 1, look(k, state)),
        labels=("k", "state"),
    )
    return state
