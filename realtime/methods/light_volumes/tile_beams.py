# SPDX-License-Identifier: BSD-3-Clause
"""Beams: the rays of a tile of the image, as planes that bound them.

A beam starts at the camera and is bounded by four planes through it, w . (P - camera) >= 0, and by a plane beyond which
every ray has met a surface. Two of the four go through camera *and light*: between them the beam lies as the light sees
it. The other two go across them. Where the light, or the point opposite it, is seen within the beam there are no such
planes, and the sides of a rectangle about the rays serve instead. In the projective coordinates (u, v, s) of a light's
face (`realtime.shadow_maps.inverse_depth_field`) a plane is

    gu u + gv v + g0 + gs s >= 0,   (gu, gv, g0) = w . (across, up, axis),   gs = w . (light - camera),

as w . (P - camera) = w . (light - camera + (axis + u across + v up) / s). So a box in (u, v, s) that lies beyond one of
the planes misses the beam. Those through the light have gs = 0: they bound the footprint of the beam on the map, which
others alone do not, since a box at a depth discontinuity is long in s. So do two lines where the beam begins and ends.

Where the rays of the light are parallel, "through the light" is along its axis, and with
P = light + u across + v up - s axis the coefficients are

    (gu, gv) = w . (across, up),   g0 = w . (light - camera),   gs = -w . axis.
"""

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import drjit as dr
import mitsuba as mi

_SLACK = 2e-6  # of the terms of a sum: float32 rounding, with room to spare


@dataclass
class Beam:
    """Rays through a rectangle, by tile."""

    normals: list[Any]  #: of the four planes through the camera
    middle: Any  #: unit direction
    end: Any  #: no ray goes farther along the middle [m]
    light: Any  #: light - camera [m]
    parallel: bool = False  #: whether the rays of the light are parallel


@dataclass
class BeamPlanes:
    """The planes of a beam in the coordinates of a face: lists of gu, gv, g0, gs, and the rounding error of each.

    The first four bound it sideways, two of them through the light, the next where it ends. The last two are lines on
    the map, gs = 0.
    """

    u: list[Any]
    v: list[Any]
    constant: list[Any]
    s: list[Any]
    slack: list[Any]


_LINES = (5, 6)  # of the planes: lines on the map where a beam begins and ends
_NARROW = (0, 1, 6)  # planes that tell the texels of a leaf apart best


def make_beam(directions, end, light, axis=None) -> Beam:
    """Return the beams about rays.

    Parameters
    ----------
    directions
        Unit directions of rays, by tile, of which all others are combinations with positive weights.
    end
        Largest distance to a surface, by tile, infinite where a ray meets none [m].
    light
        The light less the camera [m].
    axis
        Direction of a directional light.
    """
    middle = dr.normalize(sum(directions[1:], directions[0]))
    across = directions[-1] - directions[0]
    across -= middle * dr.dot(across, middle)
    # A tile of one ray, or of a row of pixels, has no extent in some direction: take any.
    other = dr.cross(middle, dr.select(dr.abs(middle.x) < 0.7, type(middle)(1, 0, 0), type(middle)(0, 1, 0)))
    across = dr.normalize(dr.select(dr.squared_norm(across) > 1e-12, across, other))
    up = dr.cross(middle, across)
    corners, sides = _rectangle(directions, middle, across, up)
    # Planes through the light bound the footprint of the beam on the map, planes across them its heights.
    toward = light if axis is None else axis
    (left, right), bounded = _pair_about(corners, toward)
    above, below = _pair_about(corners, dr.cross(toward, middle))[0]
    normals = [dr.select(bounded, plane, side) for plane, side in zip((left, right, above, below), sides)]
    return Beam(normals, middle, end, light, axis is not None)


def _pair_about(corners, axis):
    """Return the normals of the planes through an axis on either side of the corners, and whether there are such."""
    Vector = type(axis)
    left, right = Vector(0), Vector(0)
    on_left, on_right = dr.mask_t(axis.x)(False), dr.mask_t(axis.x)(False)
    for corner in corners:
        normal = dr.cross(axis, corner)
        sides = [dr.dot(normal, other) for other in corners]
        reach = 1e-6 * dr.norm(normal)
        least, largest = reduce(dr.minimum, sides), reduce(dr.maximum, sides)
        left, on_left = dr.select(least >= -reach, normal, left), on_left | (least >= -reach)
        right, on_right = dr.select(largest <= reach, -normal, right), on_right | (largest <= reach)
    return (left, right), on_left & on_right


def _rectangle(directions, middle, across, up):
    """Return the corners of the rectangle about directions on the plane before the middle, and its side planes."""
    place = [(dr.dot(d, across), dr.dot(d, up), dr.dot(d, middle)) for d in directions]
    a, b = [x / z for x, _, z in place], [y / z for _, y, z in place]
    margin = 1e-6  # of the directions' rounding
    a0, b0 = (reduce(dr.minimum, values) - margin for values in (a, b))
    a1, b1 = (reduce(dr.maximum, values) + margin for values in (a, b))
    corners = [middle + across * x + up * y for x in (a0, a1) for y in (b0, b1)]
    return corners, [across - middle * a0, middle * a1 - across, up - middle * b0, middle * b1 - up]


def beam_planes(beam: Beam, products) -> BeamPlanes:
    """Return the planes of a beam on a face; `products` gives the scalar products of a vector with its base."""
    if beam.parallel:
        return _parallel_planes(beam, products)
    coefficients = [(*products(normal), dr.dot(normal, beam.light)) for normal in beam.normals]
    ends = dr.isfinite(beam.end)
    beyond = beam.end * (1 + 1e-5) - dr.dot(beam.middle, beam.light)
    coefficients.append(tuple(dr.select(ends, g, 0) for g in (*(-g for g in products(beam.middle)), beyond)))
    slack = [_SLACK * (dr.abs(gu) + dr.abs(gv) + dr.abs(g0)) for gu, gv, g0, _ in coefficients]
    start = *products(beam.middle), dr.dot(beam.middle, beam.light)
    return _with_lines(coefficients, slack, start)


def _with_lines(planes, slack, start) -> BeamPlanes:
    """Return planes, and the lines on the map where a beam begins and ends.

    A box that is long in s lies on both sides of every plane that is not steep, also behind the camera or beyond the
    end. A sum of two planes with positive weights bounds the beam too; one of those above and below it takes s away.
    """
    lines = [_line(plane, slack[4], planes[2:4], slack[2:4]) for plane in (start, planes[4])]
    planes = [*planes, *(line for line, _ in lines)]
    slack = [*slack, *(reach for _, reach in lines)]
    u, v, constant, s = ([plane[k] for plane in planes] for k in range(4))
    return BeamPlanes(u, v, constant, s, slack)


def _line(plane, slack, others, slacks):
    """Return the line on the map in which a plane and one of two others add up, and its rounding error."""
    first = others[0][3] * plane[3] < 0
    other = [dr.select(first, a, b) for a, b in zip(*others)]
    share, own = dr.abs(plane[3]), dr.abs(other[3])
    adds_up = other[3] * plane[3] < 0
    line = [dr.select(adds_up, dr.fma(own, a, share * b), 0) for a, b in zip(plane[:3], other[:3])]
    reach = dr.fma(own, slack, share * dr.select(first, *slacks))
    # Large terms are added and rounded anew, and what is left of s is taken for 0.
    reach += 4 * _SLACK * reduce(add, (own * dr.abs(a) + share * dr.abs(b) for a, b in zip(plane[:3], other[:3])))
    return (*line, type(share)(0)), reach


def _parallel_planes(beam: Beam, products) -> BeamPlanes:
    """Return what `beam_planes` does where the rays of the light are parallel."""
    length = dr.norm(beam.light)
    planes, slack = [], []
    for normal in beam.normals:
        gu, gv, along = products(normal)
        planes.append((gu, gv, dr.dot(normal, beam.light), -along))
        slack.append(_SLACK * (dr.abs(gu) + dr.abs(gv) + dr.norm(normal) * length))
    gu, gv, along = products(beam.middle)
    ends = dr.isfinite(beam.end)
    beyond = dr.select(ends, beam.end, 0) * (1 + 1e-5) - dr.dot(beam.middle, beam.light)
    planes.append(tuple(dr.select(ends, g, 0) for g in (-gu, -gv, beyond, along)))
    slack.append(_SLACK * (dr.abs(gu) + dr.abs(gv) + length))
    return _with_lines(planes, slack, (gu, gv, dr.dot(beam.middle, beam.light), -along))


def over_square(planes: BeamPlanes, centre, half):
    """Return for every plane gu u + gv v + g0 where it is largest over the square about `centre`, `half` a side."""
    u, v = centre
    return [
        dr.fma(gu, u, dr.fma(gv, v, dr.fma(dr.abs(gu) + dr.abs(gv), half, g0 + slack)))
        for gu, gv, g0, slack in zip(planes.u, planes.v, planes.constant, planes.slack)
    ]


def may_meet(planes: BeamPlanes, values, low, high):
    """Return whether a beam may meet the box from height `low` to `high`; `values` from `over_square`."""
    low, high = dr.fma(-1e-5, high, low), dr.fma(1e-5, high, high)
    met = dr.mask_t(low)(True)
    for k, (value, gs) in enumerate(zip(values, planes.s)):
        met &= (value if k in _LINES else value + dr.maximum(gs * low, gs * high)) >= 0
    return met


def parts_within(planes: BeamPlanes, values, half, low, high):
    """Return bit 4 row + column of each of the 4 x 4 parts of a square that is not beyond a plane through the light.

    `values` are those of the planes at the middle of the square, `half` is half its side, and `low` and `high` bound
    the heights over it [1/m].
    """
    low, high = dr.fma(-1e-5, high, low), dr.fma(1e-5, high, high)
    sides = []
    for k in _NARROW:
        gu, gv, gs = planes.u[k], planes.v[k], planes.s[k]
        value = values[k] - 0.75 * half * (dr.abs(gu) + dr.abs(gv))
        value = value if k in _LINES else value + dr.maximum(gs * low, gs * high)
        sides.append((value, 0.5 * half * gu, 0.5 * half * gv))
    met = mi.UInt32(0)
    for k in range(16):
        x, y = k % 4 - 1.5, k // 4 - 1.5
        least = reduce(dr.minimum, (dr.fma(along, x, dr.fma(upward, y, value)) for value, along, upward in sides))
        met |= dr.select(least >= 0, mi.UInt32(1 << k), 0)
    return met
