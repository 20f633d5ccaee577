# SPDX-License-Identifier: BSD-3-Clause
"""Which share of a froxel each medium fills: engines write media into the grid.

The share is that of the part of the column's middle ray which lies in the froxel. So an edge of a medium that cuts a
froxel dims it, rather than to switch it on or off.
"""

from typing import Any

import drjit as dr

from realtime.bounded_media.pieces import Piece, camera_pieces
from realtime.methods.froxel_fog.grid import Grid
from realtime.methods.interface.view import View
from realtime.numerics.array_types import Metres


def column_pieces(view: View, grid: Grid, column: Any) -> tuple[Piece, ...]:
    """Return the pieces of the middle rays of columns in which something scatters, evaluated; () for one medium."""
    if not view.features.bounded:
        return ()
    ray = grid.column_ray(column)
    pieces = camera_pieces(view.medium, view.origin, ray * dr.rsqrt(dr.squared_norm(ray)))
    dr.eval([(piece.begin, piece.end) for piece in pieces])
    return pieces


def piece_length(piece: Piece, x0: Metres, x1: Metres, column: Any = None) -> Metres:
    """Return how much of the segment [x0, x1] of middle rays lies in a piece [m].

    `column` says whose ray it is, where lanes are not columns.
    """
    begin, end = piece.begin, piece.end
    if column is not None:
        begin, end = (dr.gather(type(x0), side, column) for side in (begin, end))
    return dr.maximum(dr.minimum(end, x1) - dr.maximum(begin, x0), 0)
