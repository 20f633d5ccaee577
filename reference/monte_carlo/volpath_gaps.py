# SPDX-License-Identifier: BSD-3-Clause
"""Bodies of media so thin, or so near to each other, that Mitsuba's rays leap over them or the gap.

Past the boundary of a medium Mitsuba starts the ray again, further on by

    d = RayEpsilon (1 + m),        m the largest coordinate of the place,

so that it does not meet the same boundary once more: 9e-5 (1 + m) in single precision, 0.2 m at 2
km. Where the next body begins nearer than d, the ray starts within it, meets no boundary and takes
the body for vacuum: `volpath` would lose light and not say so. In a row of boxes 2 mm apart, of 2
km, it loses 2 % of the first order and half of all orders. In a body that is thinner than d the ray
starts beyond the other side, in fog that never ends.
"""

from collections.abc import Sequence
from itertools import combinations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.convex_bounds import Bounds, Sphere, largest_ball

Array = NDArray[np.float64]


def check_gaps(bodies: Sequence[tuple[str, Bounds]]) -> None:
    """Refuse disjoint convex bodies, by their names, that are thinner, or nearer to each other, than
    rays leap.
    """
    for name, body in bodies:
        leap = _leap(*_box(body))
        if (width := _width(body)) <= leap:
            raise InputError(
                f"volpath: the medium in '{name}' is {width:.2g} m thick, and Mitsuba's rays leap "
                f"{leap:.2g} m, beyond its other side; expected a thicker body, or a smaller unit "
                "of length: take another --estimator"
            )
    for (name, body), (other_name, other) in combinations(bodies, 2):
        (low, high), (other_low, other_high) = _box(body), _box(other)
        leap = _leap(low, high, other_low, other_high)
        apart = float(np.maximum(low - other_high, other_low - high).max())
        gap = apart if apart > leap else _gap(body, other)
        if gap <= leap:
            raise InputError(
                f"volpath: the media in '{name}' and '{other_name}' are {max(gap, 0.0):.2g} m "
                f"apart, and Mitsuba's rays leap {leap:.2g} m, over the boundary of the next one; "
                "expected a wider gap: take another --estimator"
            )


def _leap(*places: Array) -> float:
    """Return how far rays leap past a boundary at the furthest of places [m]."""
    return float(mi.math.RayEpsilon * (1 + np.abs(places).max()))


def _width(body: Bounds) -> float:
    """Return the least distance of a facet from the furthest corner, or a diameter [m]."""
    if isinstance(body, Sphere):
        return 2 * body.radius
    corners = body.edge.reshape(-1, 3)
    return float((body.offset - (corners @ body.normal.T).min(axis=0)).min())


def _box(body: Bounds) -> tuple[Array, Array]:
    """Return the least and largest coordinates, (3,) each [m]."""
    if isinstance(body, Sphere):
        return body.centre - body.radius, body.centre + body.radius
    corners = body.edge.reshape(-1, 3)
    return corners.min(axis=0), corners.max(axis=0)


def _gap(first: Bounds, second: Bounds) -> float:
    """Return a distance that two convex bodies have at least [m]: their own for two spheres, and
    where a facet faces the other body.
    """
    if isinstance(first, Sphere):
        if isinstance(second, Sphere):
            between = float(np.linalg.norm(first.centre - second.centre))
            return between - first.radius - second.radius
        return float((second.normal @ first.centre - second.offset).max()) - first.radius
    if isinstance(second, Sphere):
        return _gap(second, first)
    # Where all planes move outwards by half of the gap, the bodies share a point.
    normal = np.concatenate([first.normal, second.normal])
    return -2 * largest_ball(normal, np.concatenate([first.offset, second.offset]))
