# SPDX-License-Identifier: BSD-3-Clause
"""Where straight lines enter and leave convex bounds, without cancellation, in float64."""

import numpy as np
from numpy.typing import NDArray

from reference.scene.convex_bounds import Bounds, Polyhedron, Sphere

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_BLOCK = 1 << 21  # numbers in one block of rays and facets


def crossings(bounds: Bounds, origin: Array, direction: Array) -> tuple[Array, Array]:
    """Return where rays enter and leave a body.

    `bounds`: the body; `origin`: (n, 3), or (3,) for one that all share [m]; `direction`: unit vectors, (n, 3). Returns
    `enter`, `leave`: distances along the whole straight line, (n,) [m]; leave <= enter where it misses the body.
    """
    if isinstance(bounds, Sphere):
        return sphere_crossings(np.sum((bounds.centre - origin) * direction, axis=-1), _power(bounds, origin))
    return crossed_facets(bounds, origin, direction)[2:]


def crossed_facets(bounds: Polyhedron, origin: Array, direction: Array) -> tuple[Index, Index, Array, Array]:
    """Return the facets at which rays enter and leave a polyhedron, and the distances, as `crossings` does.

    `bounds`: the polyhedron; `origin`, `direction`: as in `crossings`. Returns `entered`, `left`: numbers of the
    facets, (n,) each. Returns `enter`, `leave`: distances along the whole straight line, (n,) each [m]; leave <= enter
    where it misses the polyhedron.
    """
    origin = np.atleast_2d(origin)
    enter, leave = np.empty(len(direction), np.int64), np.empty(len(direction), np.int64)
    low, high = np.empty(len(direction)), np.empty(len(direction))
    step = max(1, _BLOCK // len(bounds.offset))
    for first in range(0, len(direction), step):
        block = slice(first, first + step)
        rate = direction[block] @ bounds.normal.T
        room = bounds.offset - (origin if len(origin) == 1 else origin[block]) @ bounds.normal.T
        with np.errstate(divide="ignore", invalid="ignore"):
            times = room / rate
        entering, leaving = np.where(rate < 0, times, -np.inf), np.where(rate > 0, times, np.inf)
        enter[block], leave[block] = np.argmax(entering, axis=1), np.argmin(leaving, axis=1)
        missed = np.any((rate == 0) & (room < 0), axis=1)  # outside along one of the planes
        low[block] = np.where(missed, np.inf, np.max(entering, axis=1))
        high[block] = np.where(missed, -np.inf, np.min(leaving, axis=1))
    return enter, leave, low, high


def sphere_crossings(along: Array, power: Array | float) -> tuple[Array, Array]:
    """Return where lines enter and leave a sphere, the roots of t^2 - 2 along t + power, +-inf where they miss it [m].

    The smaller root in size is taken from the product of both, which is the power, so that nothing cancels.

    `along`: direction . (centre - origin), (n,) [m], for a unit direction. `power`: |centre - origin|^2 - radius^2, the
    power of the origin, (n,) or a scalar [m^2]. Returns `low`, `high`: (n,) each [m].
    """
    inner = along * along - power
    root = np.sqrt(np.maximum(inner, 0.0))
    far = np.where(along >= 0, along + root, along - root)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(far != 0, power / far, 0.0)
    low, high = np.where(along >= 0, near, far), np.where(along >= 0, far, near)
    return np.where(inner > 0, low, np.inf), np.where(inner > 0, high, -np.inf)


def _power(sphere: Sphere, origin: Array) -> Array:
    return np.sum((sphere.centre - origin) ** 2, axis=-1) - sphere.radius**2


def half_chord(radius: Array | float, distance: Array) -> Array:
    """Return half of the chord at a distance from a disk's centre, sqrt(radius^2 - distance^2); 0 beyond the radius.

    `radius`: of the disk, (n,) or a scalar [m]; `distance`: of the chord from the centre, (n,) [m], at least 0. Returns
    (n,) [m], without cancellation where both are alike.
    """
    return np.sqrt(np.maximum(radius - distance, 0) * (radius + distance))
