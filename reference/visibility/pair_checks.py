# SPDX-License-Identifier: BSD-3-Clause
"""Random shadow rays that check the lit intervals of rays for many points of a light at once.

As in `reference.visibility.random_checks`: within float32 rounding of an edge the rays decide nothing, and a float64
test against every shape judges a contradiction.
"""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.scene.shapes import Shapes
from reference.visibility.intervals import RandomChecks
from reference.visibility.lit_intervals import CLEAR
from reference.visibility.many_points import PairIntervals
from reference.visibility.random_checks import JUDGED, ROUNDING, fresh_generator, lit_by_all_shapes

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_EVERY = 7  # of the pairs is checked: odd, so that it steps through all points, whose number is a power of two


def checked_pairs(
    occluders: Any, shapes: Shapes, lit: PairIntervals, rays: tuple[Array, Array], points: tuple[Array, Array]
) -> tuple[RandomChecks, Index]:
    """Check lit intervals at a random angle of every seventh pair of a ray and a point.

    Parameters
    ----------
    occluders, shapes
        What stands in the light: as an `mi.Scene`, and as numbers.
    lit
        The intervals.
    rays
        Where all start, (3,) [m], and their unit directions, (n, 3).
    points
        Positions [m] and unit normals, (m, 3) each.

    Returns
    -------
    checks, doubtful
        What was found, and the numbers of the pairs of which a contradiction is left.
    """
    place, normal = points
    origin, direction = rays
    count = len(lit.foot)
    pair = np.arange(0, count, _EVERY)
    begin, end = (np.arctan(column) for column in lit.ends)
    pair = pair[end[pair] > begin[pair]]
    if not len(pair) or not occluders.shapes():
        return RandomChecks(), np.empty(0, np.int64)
    theta = begin[pair] + (end[pair] - begin[pair]) * fresh_generator(lit.foot, lit.height).random(len(pair))
    low, high = np.arctan(lit.low), np.arctan(lit.high)
    at = np.full(count, np.nan)
    at[pair] = theta
    here = at[lit.pair]
    expected = np.bincount(lit.pair, (low <= here) & (here <= high), count)[pair] > 0
    gap = np.full(count, np.inf)
    gap[pair] = np.minimum(theta - begin[pair], end[pair] - theta)
    of_checked = np.flatnonzero(np.isfinite(here))
    near = np.minimum(np.abs(low - here), np.abs(high - here))[of_checked]
    np.minimum.at(gap, lit.pair[of_checked], near)
    ray, point = np.divmod(pair, len(place))
    target = origin + (lit.foot[pair] + lit.height[pair] * np.tan(theta))[:, None] * direction[ray]
    way = target - place[point]
    length = np.linalg.norm(way, axis=1)
    start = place[point] + CLEAR * (1 + np.abs(place[point]).max(axis=1))[:, None] * normal[point]
    shadow = mi.Ray3f(
        mi.Point3f(start.T), mi.Vector3f((way / length[:, None]).T), mi.Float(length * (1 - 2e-6)), 0.0, []
    )
    hidden = np.array(occluders.ray_test(shadow), dtype=bool)
    wrong = np.flatnonzero((hidden == expected) & (gap[pair] > ROUNDING))

    def leg(number: np.int64, angle: np.float64) -> tuple[Array, Array]:
        return place[point[number]], way[number]

    judged = wrong[:JUDGED]
    clear = np.array([lit_by_all_shapes((leg, shapes), k, theta[k]) for k in judged], dtype=bool)
    left = np.append(judged[clear != expected[judged]], wrong[JUDGED:])
    share = len(wrong) / len(pair)
    return RandomChecks(len(pair), len(wrong), len(wrong) - len(left), len(left), share), pair[left]
