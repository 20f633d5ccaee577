# SPDX-License-Identifier: BSD-3-Clause
"""How far the light of a directional source runs through convex media on its way to a point.

With a the unit direction in which the light travels, the leg from a point P back to the light is P - f a, f >= 0. It
crosses the plane n . x = c of a half space at

    f = phi(P) = (n . P - c) / (n . a).

Where n . a < 0 the light comes in through the plane, and the leg is in the half space up to phi; where n . a > 0 it is
so from phi on. The leg therefore has in the medium the part

    l = max(0, min phi over the planes with n . a < 0  -  max(0, max phi over the others)).

phi is linear in P. Along a ray P = o + x d every phi is a line in x, l is linear between *bends*, and so is the optical
depth of the leg. The bends are those of the envelopes (`realtime.bounded_media.envelopes`), and where one of the two
maxima changes sides. A plane along the light has lines of next to no width: tilted a little it is like the others,
infinitely far on one side and on the other.

In a sphere of radius R about C, with w = P - C, the leg leaves at w . a + q and enters at w . a - q, q^2 = R^2 - |w x
a|^2. That has no bends but where the ray enters and leaves the cylinder |w x a| = R.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.envelopes import Envelopes, Lines
from realtime.numerics.array_types import four_numbers
from realtime.scene.medium import BoundedMedium


@dataclass(frozen=True)
class ParallelSeen:
    """A bounded medium as a directional light sees it."""

    bounded_medium: BoundedMedium
    axis: Any  #: unit direction in which the light travels
    planes: Any  #: four numbers a plane, phi = g . (P - centre) + k; None for a sphere
    comes_in: Any  #: by plane 1 where the light comes in, else 0


def seen_along(bounded_medium: BoundedMedium, axis) -> ParallelSeen:
    """Return what the legs to a directional light need of a bounded medium.

    `axis` is the unit direction in which the light travels, one for all lanes.
    """
    if bounded_medium.planes is None:
        return ParallelSeen(bounded_medium, axis, None, None)
    *normal, offset = bounded_medium.planes
    along = normal[0] * axis.x + normal[1] * axis.y + normal[2] * axis.z
    tilt = 16 * dr.epsilon(type(along))
    along = dr.select(dr.abs(along) < tilt, dr.select(along < 0, -tilt, tilt), along)
    room = offset - (
        normal[0] * bounded_medium.centre.x + normal[1] * bounded_medium.centre.y + normal[2] * bounded_medium.centre.z
    )
    planes = dr.zeros(type(along), 4 * bounded_medium.count)
    columns = (*(component / along for component in normal), -room / along)
    for place, column in enumerate(columns):
        dr.scatter(planes, column, 4 * dr.arange(mi.UInt32, bounded_medium.count) + place)
    comes_in = dr.select(along < 0, type(along)(1), 0)
    dr.eval(planes, comes_in)
    return ParallelSeen(bounded_medium, axis, planes, comes_in)


def parallel_legs(seen: ParallelSeen, origin, direction, distances, active=True) -> list[Any]:
    """Return how much of the legs to the points origin + distance direction lies in the medium [m].

    Parameters
    ----------
    seen
        The medium and the light.
    origin, direction
        Of the rays.
    distances
        A list of distances: the planes are read once for all of them.
    active
        Lanes to compute; others have 0.
    """
    start = origin - seen.bounded_medium.centre
    if seen.planes is None:
        return [dr.select(active, _sphere_leg(seen, start + direction * x), 0) for x in distances]
    Float = type(start.x)
    width = dr.width(start, direction, *distances)
    first = [dr.full(Float, -dr.inf, width) for _ in distances]
    last = [dr.full(Float, dr.inf, width) for _ in distances]

    def plane(number, first, last):
        constant, slope, comes_in = _line(seen, number, start, direction)
        low, high = dr.select(comes_in, -dr.inf, constant), dr.select(comes_in, constant, dr.inf)
        first = [dr.maximum(value, dr.fma(slope, x, low)) for value, x in zip(first, distances)]
        last = [dr.minimum(value, dr.fma(slope, x, high)) for value, x in zip(last, distances)]
        return number + 1, first, last

    _, first, last = dr.while_loop(
        state=(mi.UInt32(0), first, last),
        cond=lambda number, first, last: active & (number < seen.bounded_medium.count),
        body=plane,
        labels=("number", "first", "last"),
    )
    lengths = [dr.maximum(end - dr.maximum(begin, 0), 0) for begin, end in zip(first, last)]
    return [dr.select(active, length, 0) for length in lengths]


def leg_lines(seen: ParallelSeen, origin, direction) -> Lines:
    """Return the lines phi of a medium that has planes, along rays from `origin` [m] in unit `direction`s."""
    start = origin - seen.bounded_medium.centre
    return Lines(lambda number: _line(seen, number, start, direction), seen.bounded_medium.count)


def linear_length(envelopes: Envelopes, x) -> tuple[Any, Any]:
    """Return what of the legs lies in a medium at x [m], and its slope, with the planes of the legs there."""
    (last, last_rate), (first, first_rate) = (
        (dr.fma(rate, x, constant), rate) for constant, rate in (envelopes.least, envelopes.largest)
    )
    ahead = first > 0
    length = last - dr.select(ahead, first, 0)
    there = length > 0
    return dr.select(there, length, 0), dr.select(there, last_rate - dr.select(ahead, first_rate, 0), 0)


def cylinder_bend(seen: ParallelSeen, origin, direction, x):
    """Return the next distance beyond `x` at which rays enter or leave the cylinder about a sphere, or infinity [m].

    Rays begin at `origin` [m] and have unit `direction`s.
    """
    w = dr.cross(origin - seen.bounded_medium.centre, seen.axis)
    v = dr.cross(direction, seen.axis)
    a, b = dr.squared_norm(v), dr.dot(w, v)
    # b^2 - a c without its cancellation: a R^2 - |w x v|^2.
    inner = a * dr.square(seen.bounded_medium.radius) - dr.squared_norm(dr.cross(w, v))
    root = dr.sqrt(dr.maximum(inner, 0))
    bend = type(x)(dr.inf)
    for at in ((root - b) / a, (-root - b) / a):
        bend = dr.select((inner > 0) & (at > x), dr.minimum(at, bend), bend)
    return bend


def _sphere_leg(seen: ParallelSeen, w):
    along = dr.dot(w, seen.axis)
    inner = dr.square(seen.bounded_medium.radius) - dr.squared_norm(dr.cross(w, seen.axis))
    root = dr.sqrt(dr.maximum(inner, 0))
    return dr.select(inner > 0, dr.maximum(along + root - dr.maximum(along - root, 0), 0), 0)


def _line(seen: ParallelSeen, number, start, direction):
    """Return phi of a plane at a ray's start, its slope along the ray, and whether the light comes in through it."""
    values = dr.gather(four_numbers(type(seen.planes)), seen.planes, number)
    comes_in = dr.gather(type(seen.planes), seen.comes_in, number) > 0
    g = values.xyz
    return dr.dot(g, start) + values.w, dr.dot(g, direction), comes_in
