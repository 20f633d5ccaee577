# SPDX-License-Identifier: BSD-3-Clause
"""Exact lit intervals of camera rays among spheres, boxes and screens, in mpmath.

A point X(x) = origin + x d of a ray is lit where the open segment from the light L to X meets no
occluder and, for a spot, X lies in the cone. As x grows this can only change at the distances
below, all in closed form. Write u(x) = X - L = a + x d with a = origin - L; the ray ends where it
enters the first occluder.

**Sphere** of centre C and radius R. With v = C - L and T^2 = |v|^2 - R^2, the squared length of the
tangents from L, the tangents make the angle acos(T/|v|) with v: u lies on their cone where u . v =
|u| T, hence on the roots of

    (u . v)^2 = T^2 |u|^2.                                                                                      (cone)

On a line through L inside the cone, L is in front of the sphere; a ray changes from in front of the
sphere to behind it either across the cone or through the sphere, and then it has ended.

**Cone** of a spot: the same equation with v the axis, of unit length, and T the
cosine of the half angle.

**Box and screen.** The shadow of a convex body is bounded by itself and by the planes through L and
its silhouette edges. The ray crosses the plane through L and an edge from A to B where det(u, A -
L, B - L) = 0, which is linear:

    x = -det(a, A - L, B - L) / det(d, A - L, B - L).                                                           (edge)

All edges are taken; those that are no silhouettes only add distances at which nothing changes. The
same holds for the other half of a cone and for the other side of a plane.

Between two neighbours of all these distances a ray is lit or dark as a whole. The definition
itself, evaluated in the middle for the segment against every occluder, tells which. Nothing here is
shared with `reference.visibility.shadows`, which projects triangles on the plane of ray and light,
nor with the casting of rays.
"""

from collections.abc import Sequence
from itertools import combinations, pairwise, product
from typing import Any

from mpmath import mp, mpf

from tests.evidence.certified.model import FogBox, FogLight, FogScreen, FogSphere

Number = Any  # mpmath.mpf
Vector = tuple[Number, Number, Number]
Occluder = FogSphere | FogBox | FogScreen

_SAME = 1e-25  # distances closer than this count as equal [m]: they come with 40 digits


def vector(values: Sequence[float]) -> Vector:
    """Return `values`, (3,) in any unit such as [m], as a vector of mpmath
    numbers; floats count as exact.
    """
    x, y, z = (mpf(value) for value in values)
    return x, y, z


def minus(a: Vector, b: Vector) -> Vector:
    """Return the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def along(start: Vector, x: Number, direction: Vector) -> Vector:
    """Return the point start + x direction."""
    return start[0] + x * direction[0], start[1] + x * direction[1], start[2] + x * direction[2]


def dot(a: Vector, b: Vector) -> Number:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(v: Vector) -> Vector:
    """Return the vector of length 1."""
    length = mp.sqrt(dot(v, v))
    return v[0] / length, v[1] / length, v[2] / length


def ray_end(origin: Vector, direction: Vector, occluders: Sequence[Occluder]) -> Number:
    """Return the distance at which a ray enters the first occluder [m],
    infinite if it meets none.
    """
    crossed = [_crossed(shape, origin, direction, mp.inf) for shape in occluders]
    return min((part[0] for part in crossed if part is not None), default=mp.inf)


def lit_parts(
    origin: Vector,
    direction: Vector,
    *,
    end: Number,
    light: FogLight,
    occluders: Sequence[Occluder],
) -> list[tuple[Number, Number, bool]]:
    """Return the lit parts of a ray.

    Valid for cameras and lights outside of all occluders, and cut-off angles below 90 degrees. The
    result has nearly the working precision, half of it where a ray all but touches a cone.
    """
    place = vector(light.position)
    start = minus(origin, place)
    cuts = [x for shape in occluders for x in _shadow_crossings(shape, place, start, direction)]
    cones = spot_cones(light)
    for axis, cosine in cones:
        cuts += _cone_crossings(start, direction, axis, cosine * cosine)
    marks = [mp.zero]
    marks += [
        x
        for before, x in pairwise([mp.zero, *sorted(cuts)])
        if max(before, 0) + _SAME < x < end - _SAME
    ]
    parts: list[tuple[Number, Number, bool]] = []
    for low, high in pairwise([*marks, end]):
        middle = (low + high) / 2 if mp.isfinite(high) else 2 * low + 1
        u = along(start, middle, direction)
        inside = [dot(u, axis) > cosine * mp.sqrt(dot(u, u)) for axis, cosine in cones]
        if (inside and not inside[0]) or any(
            _crossed(shape, place, u, mp.one) for shape in occluders
        ):
            continue
        faint = len(inside) == 2 and not inside[1]
        if parts and parts[-1][1] == low and parts[-1][2] == faint:
            low = parts.pop()[0]
        parts.append((low, high, faint))
    return parts


def spot_cones(light: FogLight) -> list[tuple[Vector, Number]]:
    """Return axis and cosine of the half angle of a spot's cut-off and, if it
    is narrower, of its beam.
    """
    if light.matrix is None:
        return []
    axis = unit(vector([row[2] for row in light.matrix[:3]]))
    angles = [light.cutoff, light.beam] if light.beam < light.cutoff else [light.cutoff]
    return [(axis, mp.cos(mp.radians(mpf(angle)))) for angle in angles]


def _crossed(
    shape: Occluder, start: Vector, step: Vector, longest: Number
) -> tuple[Number, Number] | None:
    """Return the fractions of `step` between which the line is in a shape.

    None unless it enters between 0 and `longest`: both ends of the segment
    are outside of the shape.
    """
    if isinstance(shape, FogSphere):
        towards = minus(start, vector(shape.centre))
        half, length = dot(towards, step), dot(step, step)
        inner = half * half - length * (dot(towards, towards) - mp.mpf(shape.radius) ** 2)
        if inner <= 0:
            return None
        low, high = (-half - mp.sqrt(inner)) / length, (-half + mp.sqrt(inner)) / length
    else:
        edges = [vector(edge) for edge in shape.half_edges]
        flat = isinstance(shape, FogScreen)
        if flat:
            edges.append(cross(edges[0], edges[1]))
        at = _coordinates(edges, minus(start, vector(shape.centre)))
        rate = _coordinates(edges, step)
        low, high = -mp.inf, mp.inf
        for number, (place, speed) in enumerate(zip(at, rate)):
            reach = 0 if flat and number == 2 else 1
            if speed == 0:
                if abs(place) > reach or reach == 0:
                    return None
                continue
            first, last = sorted([(-reach - place) / speed, (reach - place) / speed])
            low, high = max(low, first), min(high, last)
        if low > high:
            return None
    return (low, high) if 0 < low < longest else None


def _coordinates(edges: Sequence[Vector], point: Vector) -> list[Number]:
    """Return a, b, c with point = a u + b v + c w, by Cramer's rule."""
    u, v, w = edges
    volume = dot(u, cross(v, w))
    return [
        dot(point, cross(v, w)) / volume,
        dot(point, cross(w, u)) / volume,
        dot(point, cross(u, v)) / volume,
    ]


def _shadow_crossings(
    shape: Occluder, place: Vector, start: Vector, direction: Vector
) -> list[Number]:
    """Return where a ray crosses the cone or the planes that bound a shadow; `start` is
    its origin from the light.
    """
    if isinstance(shape, FogSphere):
        v = minus(vector(shape.centre), place)
        return _cone_crossings(start, direction, v, dot(v, v) - mpf(shape.radius) ** 2)
    crossings = []
    for first, second in _edges(shape, place):
        normal = cross(first, second)
        rate = dot(direction, normal)
        if rate != 0:
            crossings.append(-dot(start, normal) / rate)
    return crossings


def _edges(shape: FogBox | FogScreen, place: Vector) -> list[tuple[Vector, Vector]]:
    """Return the ends of all edges, as seen from a point: corners that differ in one sign."""
    centre = minus(vector(shape.centre), place)
    edges = [vector(edge) for edge in shape.half_edges]
    corners = {}
    for signs in product((-1, 1), repeat=len(edges)):
        corner = centre
        for sign, edge in zip(signs, edges):
            corner = along(corner, sign, edge)
        corners[signs] = corner
    pairs = combinations(corners, 2)
    return [(corners[s], corners[t]) for s, t in pairs if sum(a != b for a, b in zip(s, t)) == 1]


def _cone_crossings(start: Vector, direction: Vector, v: Vector, square: Number) -> list[Number]:
    """Return the real roots x of (u . v)^2 = square |u|^2 with u = start + x direction."""
    sv, dv = dot(start, v), dot(direction, v)
    a = dv * dv - square * dot(direction, direction)
    b = sv * dv - square * dot(start, direction)
    c = sv * sv - square * dot(start, start)
    inner = b * b - a * c
    if inner <= 0:
        return []
    larger = -b - mp.sqrt(inner) if b >= 0 else -b + mp.sqrt(inner)
    return ([larger / a] if a != 0 else []) + ([c / larger] if larger != 0 else [])
