# SPDX-License-Identifier: BSD-3-Clause
"""How much of a straight line lies in each medium.

A half-line from o along d leaves the half-space n . x <= c, c - n . o > 0, at 1/t = n . d / (c - n . o), and enters one
that it begins outside of, c - n . o < 0, at the same. So what all facets of a convex polyhedron say of many lines that
begin at one place, or go one way, is a product of matrices and its largest or smallest entries: 1/t of leaving is the
largest, 1/t of entering the smallest, which must be above 0.
"""

import numpy as np
from numpy.typing import NDArray

from reference.scene.convex_bounds import Bounds, Polyhedron
from reference.scene.read import TruthScene
from reference.visibility.line_crossings import crossings

Array = NDArray[np.float64]

_BLOCK = 1 << 17  # numbers of one product: it stays in the processor's cache
_ON_PLANE = 1e-290  # distance of a place from a plane that counts as none [m]


def lengths(truth: TruthScene, origin: Array, direction: Array, low: Array, high: Array) -> Array:
    """Return how much of parts of straight lines lies in each medium, that without bounds first, (n, media) [m].

    Parameters
    ----------
    origin, direction
        Of the lines, (n, 3), either also (3,) for all [m].
    low, high
        Distances, at least 0, between which the lines are looked at, (n,) [m]; `high` may be infinite where nothing
        surrounds the media: the length around them is then not finite and multiplies no extinction.
    """
    inside = []
    for medium in truth.media:
        enter, leave = _inside(medium.bounds, origin, direction)
        inside.append(np.maximum(np.minimum(leave, high) - np.maximum(enter, low), 0.0))
    around = np.where(np.isfinite(high), high, 0.0) - np.where(np.isfinite(high), low, 0.0) - sum(inside)
    return np.stack([np.maximum(around, 0.0), *inside], axis=1)


def _inside(bounds: Bounds, origin: Array, direction: Array) -> tuple[Array, Array]:
    """Return where half-lines are in a body: distances from 0 on, leave <= enter where they miss it, (n,) each [m]."""
    if not isinstance(bounds, Polyhedron):
        return crossings(bounds, origin, np.broadcast_to(direction, np.broadcast_shapes(origin.shape, direction.shape)))
    if origin.ndim == 1:
        return _from_one_place(bounds, origin, direction)
    if direction.ndim == 1:
        return _one_way(bounds, origin, direction)
    return crossings(bounds, origin, direction)


def _from_one_place(bounds: Polyhedron, origin: Array, direction: Array) -> tuple[Array, Array]:
    room = bounds.offset - bounds.normal @ origin
    room = np.where(np.abs(room) < _ON_PLANE, _ON_PLANE, room)
    facets = bounds.normal / room[:, None]
    leaves, enters = facets[room > 0], facets[room < 0]
    enter, leave = np.zeros(len(direction)), np.full(len(direction), np.inf)
    step = max(1, _BLOCK // len(room))
    with np.errstate(divide="ignore"):
        for first in range(0, len(direction), step):
            block = slice(first, first + step)
            leave[block] = 1 / np.maximum((direction[block] @ leaves.T).max(axis=1, initial=0.0), 0.0)
            # A line that goes away from a plane, or along it, never meets the body behind it.
            if len(enters):
                enter[block] = 1 / np.maximum((direction[block] @ enters.T).min(axis=1), 0.0)
    return enter, leave


def _one_way(bounds: Polyhedron, origin: Array, direction: Array) -> tuple[Array, Array]:
    rate = bounds.normal @ direction
    crossed = rate != 0
    facets, offset = bounds.normal[crossed] / rate[crossed, None], bounds.offset[crossed] / rate[crossed]
    inwards = rate[crossed] < 0
    beside = bounds.normal[~crossed], bounds.offset[~crossed]
    enter, leave = np.empty(len(origin)), np.empty(len(origin))
    step = max(1, _BLOCK // len(rate))
    for first in range(0, len(origin), step):
        block = slice(first, first + step)
        times = offset - origin[block] @ facets.T
        enter[block] = times[:, inwards].max(axis=1, initial=0.0)
        leave[block] = times[:, ~inwards].min(axis=1, initial=np.inf)
        outside = np.any(origin[block] @ beside[0].T > beside[1], axis=1)
        leave[block] = np.where(outside, 0.0, leave[block])
    return enter, leave
