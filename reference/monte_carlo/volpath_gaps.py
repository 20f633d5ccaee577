# SPDX-License-Identifier: BSD-3-Clause
"""Bodies of media so thin or dense, or so near to each other, that Mitsuba's rays leap over a part of
their light or over the gap.

Past the boundary of a medium Mitsuba starts the ray again, further on by

    d = RayEpsilon (1 + m),        m the largest coordinate of the place,

so that it does not meet the same boundary once more: 9e-5 (1 + m) in single precision, 0.2 m at 2
km. Where the next body begins nearer than d, the ray starts within it, meets no boundary and takes
the body for vacuum: `volpath` would lose light and not say so. In a row of boxes 2 mm apart, of 2
km, it loses 2 % of the first order and half of all orders. In a body that is thinner than d the ray
starts beyond the other side, in fog that never ends.

The layer that is leapt over scatters nothing: of the light of a body about the part d/w is lost, w
its width, or a mean free path where that is less. Measured, 8e6 paths to 4 x 4 pixels, lamp and
camera 2 m away: -2.76 +- 0.20 % in a slab of 1 cm (d/w is 2.68 %), -0.34 +- 0.08 % in one of 10 cm
(0.27 %), and -1.57 +- 0.04 % there with a mean free path of 2 cm (1.34 %). Spheres of 1 cm are as
far off, too bright about their rims.
"""

from collections.abc import Sequence
from itertools import combinations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.convex_bounds import Bounds, Sphere, largest_ball

Array = NDArray[np.float64]

#: The largest part of a body's light that may be lost. Reports judge volpath by +-1 % and run until
#: intervals are within 0.4 of that: with a bias of half a percent these still lie within it.
_LOST = 0.005


class CannotTrace(InputError):
    """A scene of which Mitsuba's volpath would give wrong light."""


def check_gaps(bodies: Sequence[tuple[str, Bounds, float]]) -> None:
    """Refuse disjoint convex bodies of which rays leap over a visible part, or that are nearer to
    each other than rays leap: each has a name, bounds, and the extinction at them [1/m].
    """
    for name, body, sigma_t in bodies:
        leap, width = _leap(*_box(body)), _width(body)
        if leap * max(1 / width, sigma_t) > _LOST:
            free = f", with a mean free path of {1 / sigma_t:.2g} m" if sigma_t * width > 1 else ""
            raise CannotTrace(
                f"volpath: the medium in '{name}' is {width:.3g} m thick{free}, and Mitsuba's rays "
                f"leap over {leap:.2g} m of it; expected {leap / _LOST:.2g} m at least, or a "
                "smaller unit of length: take another --estimator"
            )
    for (name, body, _), (other_name, other, _) in combinations(bodies, 2):
        (low, high), (other_low, other_high) = _box(body), _box(other)
        leap = _leap(low, high, other_low, other_high)
        apart = float(np.maximum(low - other_high, other_low - high).max())
        gap = apart if apart > leap else _gap(body, other)
        if gap <= leap:
            raise CannotTrace(
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
