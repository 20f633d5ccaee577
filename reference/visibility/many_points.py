# SPDX-License-Identifier: BSD-3-Clause
r"""Lit intervals of camera rays for many points of one light at once, by exact geometry.

The geometry is that of `reference.visibility.triangles` and `reference.visibility.spheres`, in t = tan(theta), the
distance from the foot point in units of the height, so that no angle is needed. Two things differ, and both make it
fast:

**Triangles are looked through once for a ray and a whole light.** The legs from the points of a light, inside of a ball
of centre C and radius R, to the points of a ray from O to E lie in the hull of ball and ray. What is beyond a plane
that has the hull on one side is left out; the planes used are those that hold the direction of the ray, or are at right
angles to the plane of ray and C.

**Compiled loops, a lane for each ray and point.** The first computes the shadows. The second begins at the end t of the
ray at the camera: shadows that begin before t and end after it move t to their end, until none does; then the ray is
lit from t to where the next shadow begins, and t moves there. Nothing is sorted.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.scene.area_light import TruthAreaLight
from reference.scene.shapes import Shapes
from reference.visibility.triangles import EXACT_EDGE

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_SLACK = 1e-9  # of the size of the scene: rounding of the planes that leave triangles out
_BLOCK = 1 << 17  # rays and shapes at once
_MERGE = 1e-12  # gaps between shadows below this share of 1 + |t| are rounding, as in `reference.visibility.triangles`
_SLOTS = 8  # lit intervals of a ray and point; more where they do not suffice


@dataclass(frozen=True)
class Blockers:
    """What can come between a light and each ray of a scene."""

    shapes: Shapes
    triangle: tuple[Index, Index]  #: where the triangles of each ray begin, (rays + 1,), and their numbers
    sphere: tuple[Index, Index]  #: the same for spheres

    @property
    def most(self) -> int:
        """How many shapes no ray exceeds."""
        return sum(int(np.diff(start).max(initial=0)) for start, _ in (self.triangle, self.sphere))


@dataclass(frozen=True)
class PairIntervals:
    """The lit parts of rays as points of a light shine on them; a pair is a ray and a point, point by point."""

    foot: Array  #: distance at which the ray is closest to the point, (pairs,) [m]
    height: Array  #: distance between point and ray there, (pairs,) [m]
    ends: tuple[Array, Array]  #: between which a ray was looked at, in units of the height from the foot, (pairs,) each
    pair: Index  #: of each lit interval, ascending, (intervals,)
    low: Array  #: where it begins, in the unit of the ends
    high: Array  #: where it ends
    edge: float = EXACT_EDGE  #: relative uncertainty of the distance of an edge


def blockers(light: TruthAreaLight, shapes: Shapes, origin: Array, direction: Array, distance: Array) -> Blockers:
    """Return what can come between a light and each ray.

    Parameters
    ----------
    light, shapes
        The light, and what can shadow it.
    origin, direction, distance
        Of the rays: where they start, (3,) [m], unit vectors, (rays, 3), and how far they go, (rays,) [m].

    Notes
    -----
    Valid for triangles and spheres; the tests leave some out, never one that matters.
    """
    corners = shapes.triangles - origin
    centres, zero = (shapes.centre - origin)[:, None], np.zeros(len(corners))
    rays = direction, distance
    return Blockers(
        shapes,
        _near_hull(light, light.centre - origin, rays, (corners, zero)),
        _near_hull(light, light.centre - origin, rays, (centres, shapes.radius)),
    )


def _near_hull(
    light: TruthAreaLight, centre: Array, rays: tuple[Array, Array], solids: tuple[Array, Array]
) -> tuple[Index, Index]:
    """Return which solids, (n, points, 3) with a ball about each, (n,), meet the hull of a light and each ray."""
    points, ball = solids
    direction, distance = rays
    count, each = points.shape[:2]
    if not count:
        return np.zeros(len(direction) + 1, np.int64), np.empty(0, np.int64)
    flat = points.reshape(-1, 3)
    size = 1 + np.linalg.norm(centre) + light.radius + np.abs(flat).max()
    slack = _SLACK * size + ball
    counts, numbers = [], []
    step = max(1, _BLOCK // (count * each))
    for first in range(0, len(direction), step):
        w, end = direction[first : first + step], distance[first : first + step, None]
        along = w @ centre
        away = centre - along[:, None] * w
        beside = np.linalg.norm(away, axis=1)
        helper = np.eye(3)[np.argmin(np.abs(w), axis=1)]
        up = np.where(beside[:, None] > 0, away, np.cross(w, helper))
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        across = np.cross(w, up)
        x, y, z = ((axes @ flat.T).reshape(len(w), count, each) for axes in (w, up, across))
        near = (z.min(axis=2) <= light.radius + slack) & (z.max(axis=2) >= -light.radius - slack)
        near &= y.min(axis=2) <= beside[:, None] + light.radius + slack
        near &= y.max(axis=2) >= np.minimum(0, beside - light.radius)[:, None] - slack
        near &= x.min(axis=2) <= np.maximum(end, along[:, None] + light.radius) + slack
        near &= x.max(axis=2) >= np.minimum(0, along - light.radius)[:, None] - slack
        # Tangents of the ball from both ends of the ray, in the plane of ray and centre.
        for start, side in ((np.zeros_like(end), -1.0), (end, 1.0)):
            outside = np.flatnonzero(np.isfinite(start[:, 0]) & (beside > light.radius))
            to, above = along[outside] - start[outside, 0], beside[outside]
            far = np.hypot(to, above)
            lean = light.radius / far
            # The direction to the centre, turned by the angle of the tangent; then its normal, away from the hull.
            level = np.sqrt(1 - lean**2)
            t_x = (to * level + side * above * lean) / far
            t_y = (above * level - side * to * lean) / far
            n_x, n_y = side * t_y, -side * t_x
            out = n_x[:, None, None] * (x[outside] - start[outside, :, None]) + n_y[:, None, None] * y[outside]
            near[outside] &= out.min(axis=2) <= slack
        # Seen along the ray, ball and ray are a circle and a point before it: a wedge.
        wedge = np.flatnonzero(beside > light.radius)
        lean = light.radius / beside[wedge]
        level = np.sqrt(1 - lean**2)
        for side in (-1.0, 1.0):
            out = side * level[:, None, None] * z[wedge] - lean[:, None, None] * y[wedge]
            near[wedge] &= out.min(axis=2) <= slack
        row, column = np.nonzero(near)
        counts.append(np.bincount(row, minlength=len(w)))
        numbers.append(column)
    start = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    return start.astype(np.int64), np.concatenate(numbers)


def pair_intervals(
    known: Blockers, origin: Array, rays: tuple[Index, Array, Array], points: tuple[Array, Array]
) -> PairIntervals:
    """Find the lit intervals of rays for points of a light, each of which shines on one side of its plane.

    Parameters
    ----------
    known
        From `blockers`.
    origin
        Where all rays start, (3,) [m].
    rays
        Numbers of the rays in `known`, (n,), unit directions, (n, 3), and distances to which they go, (n,) [m].
    points
        Positions [m] and unit normals, (m, 3) each.

    Notes
    -----
    Valid for points outside of all spheres. A pair has the number of its ray times m plus that of its point.
    """
    number, direction, distance = rays
    place, normal = points
    count = len(number) * len(place)
    pair = dr.arange(mi.UInt32, count)
    of_point = mi.UInt32(len(place))
    dr.make_opaque(of_point)
    row, point = pair // of_point, pair % of_point
    w, y, n = (
        dr.gather(mi.Vector3d, mi.Vector3d(v.T), i) for v, i in ((direction, row), (place, point), (normal, point))
    )
    o = mi.Vector3d(*(float(c) for c in origin))
    dr.make_opaque(o)
    from_point = o - y
    foot = -dr.dot(from_point, w)
    perpendicular = dr.fma(foot, w, from_point)
    perpendicular -= dr.dot(perpendicular, w) * w
    height = dr.maximum(dr.norm(perpendicular), 1e-290)
    across = perpendicular / height
    # The ray is looked at where a point of the light shines: axial t + beside > 0.
    axial, beside = dr.dot(n, w), dr.dot(n, across)
    low, high = -foot / height, (dr.gather(mi.Float64, mi.Float64(distance), row) - foot) / height
    zero = -beside / axial
    low = dr.select(axial > 0, dr.maximum(low, zero), low)
    high = dr.select(axial < 0, dr.minimum(high, zero), high)
    high = dr.select((axial == 0) & (beside <= 0), low, high)
    high = dr.maximum(low, high)
    dr.eval(foot, height, low, high, w, across, y)
    lanes = _Lanes(y, w, across, dr.cross(w, across), height)
    slots = _SLOTS
    while True:
        used, begin, end = _compiled(lanes, (low, high), _ranges(known, number, row), slots, known.most)
        most = int(used.max(initial=0))
        if most <= slots:
            break
        slots = 1 << (most - 1).bit_length()
    filled = np.flatnonzero(np.arange(slots) < used[:, None])
    numpy = [np.array(column, dtype=np.float64) for column in (foot, height, low, high)]
    return PairIntervals(numpy[0], numpy[1], (numpy[2], numpy[3]), filled // slots, begin[filled], end[filled])


@dataclass(frozen=True)
class _Lanes:
    """A pair in each lane: the point, and the frame of its plane with the ray."""

    point: Any
    direction: Any
    across: Any
    normal: Any
    height: Any


def _ranges(known: Blockers, number: Index, row: Any) -> list:
    """Return the lists of triangles and spheres, those that are not empty, with where each lane's begins and ends."""
    result = []
    for shadow, (start, numbers) in ((_triangle_shadow, known.triangle), (_sphere_shadow, known.sphere)):
        if len(numbers):
            first, last = (mi.UInt32(start[number + k].astype(np.uint32)) for k in (0, 1))
            ends = dr.gather(mi.UInt32, first, row), dr.gather(mi.UInt32, last, row)
            if shadow is _triangle_shadow:
                data = mi.Float64(known.shapes.triangles.ravel())
            else:
                data = mi.Float64(np.column_stack([known.shapes.centre, known.shapes.radius]).ravel())
            result.append((shadow, data, mi.UInt32(numbers.astype(np.uint32)), *ends))
    return result


def _compiled(lanes: _Lanes, ends: tuple, ranges: list, slots: int, size: int) -> tuple[Index, Array, Array]:
    """Return how many lit intervals each lane has, and where they begin and end, (lanes * slots,) each."""
    low, high = ends
    count = dr.width(low)
    begins, finishes = dr.zeros(mi.Float64, count * slots), dr.zeros(mi.Float64, count * slots)
    lane, most = dr.arange(mi.UInt32, count), mi.UInt32(slots)
    dr.make_opaque(most)
    first = lane * most

    # What casts a shadow is computed once, and stored lane by lane.
    lows, highs = (dr.empty(mi.Float64, count * max(1, size)) for _ in range(2))
    known, stride = dr.zeros(mi.UInt32, count), mi.UInt32(count)
    dr.make_opaque(stride)
    for shadow, data, numbers, begin, end in ranges:

        def keep(j, known, shadow=shadow, data=data, numbers=numbers):
            start, finish = shadow(lanes, data, dr.gather(mi.UInt32, numbers, j))
            casts = (start < finish) & (start < high) & (finish > low)
            dr.scatter(lows, start, known * stride + lane, casts)
            dr.scatter(highs, finish, known * stride + lane, casts)
            return j + 1, known + dr.select(casts, mi.UInt32(1), mi.UInt32(0))

        _, known = dr.while_loop((mi.UInt32(begin), known), lambda j, known, end=end: j < end, keep)
    dr.eval(known, lows, highs)

    def body(t, used):
        def turn(j, t, after, moved):
            start, finish = (dr.gather(mi.Float64, column, j * stride + lane) for column in (lows, highs))
            limit = t + _MERGE * (1 + dr.abs(t))
            covers = (start <= limit) & (finish > t)
            after = dr.select(start > limit, dr.minimum(after, start), after)
            return j + 1, dr.select(covers, finish, t), after, moved | covers

        _, t, after, moved = dr.while_loop(
            (mi.UInt32(0), t, mi.Float64(high), mi.Bool(False)),
            lambda j, t, after, moved: (j < known) & (t < high),
            turn,
        )
        lit = ~moved & (t < high)
        wide = lit & (after - t > _MERGE * (1 + dr.abs(t)))
        here = wide & (used < most)
        dr.scatter(begins, t, first + used, here)
        dr.scatter(finishes, after, first + used, here)
        return dr.select(lit, after, t), used + dr.select(wide, mi.UInt32(1), mi.UInt32(0))

    _, used = dr.while_loop((mi.Float64(low), dr.zeros(mi.UInt32, count)), lambda t, used: t < high, body)
    dr.eval(used, begins, finishes)
    return np.array(used, dtype=np.int64), np.array(begins), np.array(finishes)


def _triangle_shadow(lanes: _Lanes, corners: Any, number: Any) -> tuple:
    """Return where the shadow of a triangle on the ray begins and ends; the first above the second if there is none."""
    side, y, z = [], [], []
    for k in range(3):
        base = number * 9 + 3 * k
        corner = mi.Vector3d(*(dr.gather(mi.Float64, corners, base + c) for c in range(3))) - lanes.point
        side.append(dr.dot(corner, lanes.normal))
        y.append(dr.dot(corner, lanes.across))
        z.append(dr.dot(corner, lanes.direction))
    above = [s >= 0 for s in side]
    cut = (above[0] != above[1]) | (above[1] != above[2])
    # The corner that is alone on its side of the plane comes first.
    last, middle = above[0] == above[1], above[0] == above[2]

    def ordered(values: list) -> tuple:
        a = dr.select(last, values[2], dr.select(middle, values[1], values[0]))
        b = dr.select(last, values[0], dr.select(middle, values[2], values[1]))
        c = dr.select(last, values[1], dr.select(middle, values[0], values[2]))
        return a, b, c

    s = ordered(side)
    shares = [s[0] / (s[0] - s[k]) for k in (1, 2)]
    (y0, y1), (z0, z1) = (
        [(1 - share) * v[0] + share * v[k] for k, share in enumerate(shares, 1)] for v in (ordered(y), ordered(z))
    )
    swap = y0 > y1
    y0, y1, z0, z1 = (dr.select(swap, a, b) for a, b in ((y1, y0), (y0, y1), (z1, z0), (z0, z1)))
    keep = cut & (y0 <= lanes.height) & (y1 > 0)
    slope = dr.select(y1 > y0, (z1 - z0) / (y1 - y0), 0.0)
    top = dr.minimum(y1, lanes.height)
    z_bottom, z_top = (
        dr.select(y0 < 0, z0 - y0 * slope, z0),
        dr.select(y1 > lanes.height, z0 + (lanes.height - y0) * slope, z1),
    )
    first = dr.select(y0 > 0, z_bottom / y0, dr.select(z_bottom > 0, dr.inf, -dr.inf))
    second = z_top / top
    return dr.select(keep, dr.minimum(first, second), dr.inf), dr.select(keep, dr.maximum(first, second), -dr.inf)


def _sphere_shadow(lanes: _Lanes, spheres: Any, number: Any) -> tuple:
    """Return where the shadow of a sphere on the ray begins and ends; the first above the second if there is none."""
    parts = [dr.gather(mi.Float64, spheres, number * 4 + k) for k in range(4)]
    centre, radius = mi.Vector3d(*parts[:3]) - lanes.point, parts[3]
    beside, c_y, c_z = dr.dot(centre, lanes.normal), dr.dot(centre, lanes.across), dr.dot(centre, lanes.direction)
    disk = _half_chord(radius, dr.abs(beside))
    distance = dr.norm(centre)
    tangent = _half_chord(distance, radius)
    chord = _half_chord(disk, dr.abs(lanes.height - c_y))
    long = dr.norm(mi.Vector2d(tangent, disk))
    ends = []
    for sign in (-1, 1):
        # The direction to the centre, turned by the angle whose tangent is disk / tangent.
        t_y, t_z = (c_y * tangent - sign * c_z * disk) / long, (c_z * tangent + sign * c_y * disk) / long
        size = tangent / dr.norm(mi.Vector2d(t_y, t_z))
        cut = dr.select(t_y * size > lanes.height, (c_z + sign * chord) / lanes.height, t_z / t_y)
        ends.append(dr.select(t_y > 0, cut, sign * dr.inf))
    dark = (dr.abs(beside) < radius) & (c_y - disk <= lanes.height) & (c_y + disk > 0)
    return dr.select(dark, ends[0], dr.inf), dr.select(dark, ends[1], -dr.inf)


def _half_chord(radius: Any, distance: Any) -> Any:
    return dr.sqrt(dr.maximum(radius - distance, 0) * (radius + distance))
