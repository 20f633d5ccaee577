# SPDX-License-Identifier: BSD-3-Clause
"""Where straight lines from one point run through convex media.

From the point P, with v a vector from it, the line P + f v meets the plane n . x = c of a half space where

    1/f = g . v,        g = n / (c - n . P).

A line from outside of the half space (c - n . P < 0) is in it from f on, one from inside of it up to f. So the line
enters the medium at f_in and leaves it at f_out with

    1/f_in = min g . v   over the half spaces that P is outside of,
    1/f_out = max g . v  over the others,

both linear in v piece by piece: no division a plane, and a point that moves along a ray, v = v0 + x d, changes g . v by
x (g . d). The line misses the medium where 1/f_in <= 0 or f_out <= f_in; from inside f_in = 0. A share of the line
between P and P + v lies in the medium: min(f_out, 1) - min(f_in, 1).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.envelopes import Lines
from realtime.numerics.array_types import four_numbers, packed
from realtime.scene.medium import BoundedMedium


@dataclass(frozen=True)
class Seen:
    """A bounded medium as one point sees it."""

    bounded_medium: BoundedMedium
    toward: Any  #: from the point to the centre of the medium's sphere [m]
    planes: Any  #: four numbers a plane: g [1/m], and whether the point is outside of the half space; None for a sphere


def seen_from(bounded_medium: BoundedMedium, point) -> Seen:
    """Return what lines from a point [m], one for all lanes, need of a bounded medium."""
    toward = bounded_medium.centre - point
    if bounded_medium.planes is None:
        return Seen(bounded_medium, toward, None)
    *normal, offset = bounded_medium.planes
    room = offset - (normal[0] * point.x + normal[1] * point.y + normal[2] * point.z)
    # A point in the plane itself counts as just outside: the line enters at once, or never.
    room = dr.select(dr.abs(room) < 1e-7 * bounded_medium.radius, -1e-7 * bounded_medium.radius, room)
    columns = (*(component / room for component in normal), dr.select(room < 0, type(room)(1), 0))
    numbers = packed(four_numbers(type(room))(*columns))
    dr.eval(numbers, toward)
    return Seen(bounded_medium, toward, numbers)


def crossing_lines(seen: Seen, start, direction, active=True) -> Lines:
    """Return the lines 1/f; of planes that the point is outside of the least counts. See `inverse_crossings`."""
    Four = four_numbers(type(start.x))

    def line(number):
        # Four numbers at once: reading them is most of the work.
        values = dr.gather(Four, seen.planes, number, active)
        g = values.xyz
        return dr.dot(g, start), dr.dot(g, direction), values.w > 0

    return Lines(line, seen.bounded_medium.count, active)


def inverse_crossings(seen: Seen, start, direction, distances, active, *, leaves: bool = True):
    """Return 1/f_in and 1/f_out for the lines from the point to start + distance direction.

    Parameters
    ----------
    seen
        The medium and the point.
    start, direction
        Vectors, `start` from the point on [m].
    distances
        A list of distances: the planes are read once for all of them.
    active
        Lanes to compute.
    leaves
        Whether f_out is wanted.

    Returns
    -------
    enter, leave
        Lists; 1/f_in is 0 or less where the line misses, infinite from inside; 1/f_out may be 0 or less: it never
        leaves.
    """
    if seen.bounded_medium.planes is None:
        crossings = [_sphere_crossings(seen, start + direction * x) for x in distances]
        return [enter for enter, _ in crossings], [leave for _, leave in crossings]
    Float = type(start.x)
    width = dr.width(start, direction, active, *distances)
    enter = [dr.full(Float, dr.inf, width) for _ in distances]
    leave = [dr.full(Float, -dr.inf, width) for _ in distances] if leaves else []

    lines = crossing_lines(seen, start, direction, active)

    def plane(number, enter, leave):
        constant, slope, outside = lines.line(number)
        first, last = dr.select(outside, constant, dr.inf), dr.select(outside, -dr.inf, constant)
        enter = [dr.minimum(value, dr.fma(slope, x, first)) for value, x in zip(enter, distances)]
        leave = [dr.maximum(value, dr.fma(slope, x, last)) for value, x in zip(leave, distances)]
        return number + 1, enter, leave

    _, enter, leave = dr.while_loop(
        state=(mi.UInt32(0), enter, leave),
        cond=lambda number, enter, leave: active & (number < seen.bounded_medium.count),
        body=plane,
        labels=("number", "enter", "leave"),
    )
    return enter, leave


def _sphere_crossings(seen: Seen, v):
    """Return 1/f_in and 1/f_out: with u = 1/f, |v - u w|^2 = u^2 radius^2, w from the point to the centre.

    That is c u^2 - 2 b u + a = 0 with a = |v|^2, b = v . w, c = |w|^2 - radius^2, which is negative inside.
    """
    w = seen.toward
    a, b = dr.dot(v, v), dr.dot(v, w)
    distance = dr.norm(w)
    c = (distance - seen.bounded_medium.radius) * (distance + seen.bounded_medium.radius)
    # b^2 - a c without its cancellation: |v|^2 radius^2 - |v x w|^2.
    inner = a * dr.square(seen.bounded_medium.radius) - dr.squared_norm(dr.cross(v, w))
    root = dr.sqrt(dr.maximum(inner, 0))
    q = b + dr.mulsign(root, b)
    # From outside u is the larger root to enter and the smaller one to leave; from inside only the positive one counts.
    first_root, second_root = q / c, a / q
    enter = dr.select(c > 0, dr.select((inner > 0) & (b > 0), dr.maximum(first_root, second_root), -1), dr.inf)
    leave = dr.select(c > 0, dr.minimum(first_root, second_root), dr.maximum(first_root, second_root))
    return enter, leave


def share_inside(enter, leave=None):
    """Return the share of the line between the point and its end that lies in the medium [1].

    Parameters
    ----------
    enter, leave
        From `inverse_crossings`; `leave` None where the end is known to be inside.
    """
    begin = dr.rcp(dr.maximum(enter, 1))
    end = 1 if leave is None else dr.rcp(dr.maximum(leave, 1))
    return dr.maximum(end - begin, 0)


def near_line(seen: Seen, direction, length):
    """Return whether a line of a unit direction and a length may meet the medium; never False where it does."""
    along = dr.dot(seen.toward, direction)
    nearest = dr.clip(along, 0, length)
    reach = seen.bounded_medium.radius * 1.001
    return dr.squared_norm(dr.fma(-direction, nearest, seen.toward)) < reach * reach
