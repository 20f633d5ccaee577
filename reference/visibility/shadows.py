# SPDX-License-Identifier: BSD-3-Clause
r"""The shadows of triangles, disks and spheres on rays, and the lit rest: compiled
loops, a ray in each lane.

In the plane of a ray and its light (`reference.visibility.planes`) a triangle and a disk are
segments, a sphere is a disk of centre (c_z, c_y) and radius rho. Occluders lie in the strip 0 <= y,
w y < y_P, and each convex part of them hides one interval of the ray, since the map

    x = (z y_P - y z_P) / (y_P - w y)

takes lines to lines and keeps the order of points. No sampling, no rays cast, everything in
float64: however thin a shadow, it is found.

**Segments** are clipped to the strip and hide what lies between the images of both ends.

**Spheres.** The tangents from the light touch the disk at C + rho n. With e the unit vector along w
C - P, from the light to the centre, or along the light,

    n = -s e +- sqrt(1 - s^2) e',      s = w rho / |w C - P|,      e' across e,

and the shadow ends at the images of both, unless one is touched at w y >= y_P: the disk then
reaches beyond the line through the light along the ray, and the shadow is unbounded on that side;
or at y < 0: then the shadow ends where the ray itself meets the disk, at c_z +- sqrt(rho^2 -
c_y^2). A light inside of a sphere sees the inside and nothing else: the range in which a ray is
looked at is cut to the inside before (`reference.visibility.lit_intervals`).

**The lit rest.** Neighbours in a mesh mostly follow one another in its list: a shadow that touches
the shadow before it in the list is joined with it at once. Then t starts at the beginning of a ray.
Shadows that begin before t and end behind it move t to their end, until none does; the ray is lit
from t to where the next shadow begins, and t moves there. The loop goes through the list forwards
and backwards in turn, since shadows of a mesh mostly come in one order or the other. Nothing is
sorted. Gaps below 1e-12 of a distance are rounding: touching triangles share the coordinates of
their vertices.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.device import on_device, vectors
from airlight.reference.scene.shapes import Shapes
from airlight.reference.visibility.candidates import Near
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class _Lanes:
    """A ray in each lane, in the frame of its plane with the light."""

    origin: Any
    direction: Any
    across: Any
    normal: Any
    foot: Any
    height: Any
    w: Any

    def project(self, z: Any, y: Any) -> Any:
        return (z * self.height - y * self.foot) / (self.height - self.w * y)


def lit_parts(
    rays: Rays, ends: tuple[Array, Array], near: Near, shapes: Shapes, of: Index
) -> tuple[Index, Array, Array]:
    """Return the lit parts of rays between two distances.

    `rays`: the rays; `ends`: between which distances they are looked at, (rays,) each [m]; nowhere
    if the first is not below the second; `near`: lists of the shapes that can stand in the light;
    `shapes`: all shapes; `of`: by ray, the number of its lists in `near`, (rays,). Returns `ray`,
    `low`, `high`: of every lit part, ascending, (parts,) each; distances [m].
    """
    if not shapes.count:
        ray = np.flatnonzero(ends[1] > ends[0])
        return ray, ends[0][ray], ends[1][ray]
    data = [
        on_device(mi.Float64, np.ravel(part))
        for part in (
            shapes.triangles,
            np.column_stack([shapes.centre, shapes.radius]),
            np.column_stack([shapes.disks.centre, shapes.disks.normal, shapes.disks.radius]),
        )
    ]
    lists = [on_device(mi.UInt32, each[2]) for each in (near.triangles, near.spheres, near.disks)]
    ranges = [(begin[of], end[of]) for begin, end, _ in (near.triangles, near.spheres, near.disks)]
    shadows = max(1, int(np.sum([end - begin for begin, end in ranges], axis=0).max(initial=0)))
    # Every lane has room for the longest list of shadows, so that 2^23 shadows make a block of
    # lanes. It also has slots for 16 lit intervals; a block in which a ray has more is computed
    # again with enough of them.
    parts, slots, first = [], 16, 0
    while first < len(of):
        block = slice(first, min(len(of), first + max(1, (1 << 23) // shadows)))
        spans = [(begin[block], end[block]) for begin, end in ranges]
        lit = _compiled(
            rays[block], (ends[0][block], ends[1][block]), (data, lists, spans), (shadows, slots)
        )
        used = lit[0]
        if used.max(initial=0) > slots:
            slots = 1 << (int(used.max()) - 1).bit_length()
            continue
        # Only the first `used` slots of a lane hold intervals.
        filled = np.flatnonzero(np.arange(slots) < used[:, None])
        parts.append((first + filled // slots, lit[1][filled], lit[2][filled]))
        first = block.stop
    if not parts:
        return np.empty(0, np.int64), np.empty(0), np.empty(0)
    ray, low, high = (np.concatenate(column) for column in zip(*parts, strict=True))
    return ray, low, high


def _compiled(
    rays: Rays, ends: tuple, lists: tuple, sizes: tuple[int, int]
) -> tuple[Index, Array, Array]:
    """Return how many lit parts each lane has, and where they begin and end."""
    shadows, slots = sizes
    count = len(rays.foot)
    merge = 1e-12  # gaps between shadows below this fraction of 1 + |x| are rounding
    low, high = on_device(mi.Float64, ends[0]), on_device(mi.Float64, np.maximum(*ends))
    w, most, stride = mi.Float64(float(rays.w)), mi.UInt32(slots), mi.UInt32(count)
    # Opaque numbers are inputs of the compiled loops: one kernel serves all lights and sizes.
    dr.make_opaque(w, most, stride)
    origin = vectors(mi.Vector3d, np.broadcast_to(rays.origin, (count, 3)))
    direction, across = vectors(mi.Vector3d, rays.direction), vectors(mi.Vector3d, -rays.normal)
    foot, height = on_device(mi.Float64, rays.foot), on_device(mi.Float64, rays.height)
    lanes = _Lanes(origin, direction, across, dr.cross(direction, across), foot, height, w)
    lane = dr.arange(mi.UInt32, count)
    lows, highs = dr.empty(mi.Float64, count * shadows), dr.empty(mi.Float64, count * shadows)

    def store(number: Any, start: Any, finish: Any, active: Any) -> None:
        dr.scatter(lows, start, number * stride + lane, active)
        dr.scatter(highs, finish, number * stride + lane, active)

    # The list of shadows: how many were stored, and both ends of the one that was found last. That
    # one is held back, since the next one may go on from it.
    state = (
        dr.zeros(mi.UInt32, count),
        dr.full(mi.Float64, dr.inf, count),
        dr.full(mi.Float64, -dr.inf, count),
    )
    data, numbers, spans = lists
    for shadow, values, number, (begin, end) in zip(
        (_triangle, _sphere, _disk), data, numbers, spans, strict=True
    ):
        if not len(number):
            continue
        last = on_device(mi.UInt32, end)

        def look(j, stored, held0, held1, shadow=shadow, values=values, number=number):
            # A shadow counts where it meets the part of the ray that is looked at. If it touches
            # the shadow that is held back both become one; else that one is stored, and the new one
            # is held back.
            start, finish = shadow(lanes, values, dr.gather(mi.UInt32, number, j))
            casts = (start < finish) & (start < high) & (finish > low)
            touches = (start <= held1 + merge * (1 + dr.abs(held1))) & (
                held0 <= finish + merge * (1 + dr.abs(finish))
            )
            new = casts & ~touches & (held0 < held1)
            store(stored, held0, held1, new)
            stored += dr.select(new, mi.UInt32(1), mi.UInt32(0))
            held0 = dr.select(casts, dr.select(touches, dr.minimum(held0, start), start), held0)
            held1 = dr.select(casts, dr.select(touches, dr.maximum(held1, finish), finish), held1)
            return j + 1, stored, held0, held1

        _, *state = dr.while_loop(
            (on_device(mi.UInt32, begin), *state), lambda j, *others, last=last: j < last, look
        )
    # The last shadow has no next one to be joined with.
    stored, held0, held1 = state
    casts = held0 < held1
    store(stored, held0, held1, casts)
    stored += dr.select(casts, mi.UInt32(1), mi.UInt32(0))
    dr.eval(stored, lows, highs)
    begins, finishes = dr.zeros(mi.Float64, count * slots), dr.zeros(mi.Float64, count * slots)
    # The lit rest: t goes from the beginning of the ray to its end, one turn through the list for
    # each step of `body`.
    at = lane * most

    def body(t, used, back):
        def turn(j, t, after, moved):
            number = dr.select(back, stored - 1 - j, j)
            start, finish = (
                dr.gather(mi.Float64, column, number * stride + lane) for column in (lows, highs)
            )
            # A shadow that begins before t and ends behind it moves t to its end; of the shadows
            # that begin behind t the first one limits the lit part.
            limit = t + merge * (1 + dr.abs(t))
            covers = (start <= limit) & (finish > t)
            after = dr.select(start > limit, dr.minimum(after, start), after)
            return j + 1, dr.select(covers, finish, t), after, moved | covers

        _, t, after, moved = dr.while_loop(
            (mi.UInt32(0), t, mi.Float64(high), mi.Bool(False)),
            lambda j, t, after, moved: (j < stored) & (t < high),
            turn,
        )
        # Only a turn that did not move t has seen all shadows from the final t: the ray is lit up
        # to `after`. Gaps of the size of rounding are passed over without an interval.
        lit = ~moved & (t < high)
        wide = lit & (after - t > merge * (1 + dr.abs(t)))
        # Lanes with more intervals than slots only count them, and `lit_parts` asks again.
        here = wide & (used < most)
        dr.scatter(begins, t, at + used, here)
        dr.scatter(finishes, after, at + used, here)
        return dr.select(lit, after, t), used + dr.select(wide, mi.UInt32(1), mi.UInt32(0)), ~back

    state = mi.Float64(low), dr.zeros(mi.UInt32, count), dr.full(mi.Bool, False, count)
    _, used, _ = dr.while_loop(state, lambda t, used, back: t < high, body)
    dr.eval(used, begins, finishes)
    return np.array(used, dtype=np.int64), np.array(begins), np.array(finishes)


def _triangle(lanes: _Lanes, corners: Any, number: Any) -> tuple[Any, Any]:
    """Return where the shadow of a triangle on the ray begins and ends; the first above the
    second if there is none.
    """
    side, y, z = [], [], []
    for k in range(3):
        base = number * 9 + 3 * k
        corner = (
            mi.Vector3d(*(dr.gather(mi.Float64, corners, base + c) for c in range(3)))
            - lanes.origin
        )
        # The side of the plane of ray and light, and the coordinates in that plane: y towards the
        # light, z along the ray.
        side.append(dr.dot(corner, lanes.normal))
        y.append(dr.dot(corner, lanes.across))
        z.append(dr.dot(corner, lanes.direction))
    # The plane cuts the triangle if not all corners are on one side. Without a cut the numbers
    # below mean nothing, and `cut` rejects them.
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
    # The plane cuts both sides at the corner that is alone: a segment from one cut to the other.
    fractions = [s[0] / (s[0] - s[k]) for k in (1, 2)]
    (y0, y1), (z0, z1) = (
        [(1 - fraction) * v[0] + fraction * v[k] for k, fraction in enumerate(fractions, 1)]
        for v in (ordered(y), ordered(z))
    )
    return _segment(lanes, (z0, y0), (z1, y1), cut)


def _segment(lanes: _Lanes, first: tuple, second: tuple, cut: Any) -> tuple[Any, Any]:
    """Return the part of the ray that a segment of the plane hides."""
    (z0, y0), (z1, y1) = first, second
    swap = y0 > y1
    y0, y1, z0, z1 = (dr.select(swap, a, b) for a, b in ((y1, y0), (y0, y1), (z1, z0), (z0, z1)))
    # The lower end is first. Only the strip 0 <= y, w y < height can shadow the ray: a segment that
    # begins below it is cut at the ray, where it stands at z itself.
    w, top = lanes.w, lanes.height
    keep = cut & (y1 >= 0) & (w * y0 < top)
    slope = dr.select(y1 > y0, (z1 - z0) / (y1 - y0), 0.0)
    begin = dr.select(y0 < 0, z0 - y0 * slope, lanes.project(z0, y0))
    # A segment that reaches the height of the light shadows the ray without end, on the side on
    # which it crosses that height.
    beyond = dr.select(
        z0 + (top - y0) * slope > lanes.foot, mi.Float64(dr.inf), mi.Float64(-dr.inf)
    )
    end = dr.select(w * y1 >= top, beyond, lanes.project(z1, y1))
    return dr.select(keep, dr.minimum(begin, end), dr.inf), dr.select(
        keep, dr.maximum(begin, end), -dr.inf
    )


def _sphere(lanes: _Lanes, spheres: Any, number: Any) -> tuple[Any, Any]:
    """Return the part of the ray that a sphere hides."""
    parts = [dr.gather(mi.Float64, spheres, number * 4 + k) for k in range(4)]
    centre, radius = mi.Vector3d(*parts[:3]) - lanes.origin, parts[3]
    beside, c_y, c_z = (
        dr.dot(centre, lanes.normal),
        dr.dot(centre, lanes.across),
        dr.dot(centre, lanes.direction),
    )
    # The disk in which the plane cuts the sphere, and the direction e from the light to its centre.
    disk = _half_chord(radius, dr.abs(beside))
    e_z, e_y = lanes.w * c_z - lanes.foot, lanes.w * c_y - lanes.height
    far = dr.maximum(dr.norm(mi.Vector2d(e_z, e_y)), 1e-290)
    # A light inside of the sphere has no shadow of it: the range of the ray was cut before.
    outside = ~((lanes.w > 0) & (dr.square(far) + dr.square(beside) <= dr.square(radius)))
    e_z, e_y = e_z / far, e_y / far
    sine = dr.minimum(lanes.w * disk / far, 1.0)
    level = dr.sqrt((1 - sine) * (1 + sine))
    chord = _half_chord(disk, dr.abs(c_y))
    ends = []
    for sign in (-1.0, 1.0):
        # The tangent touches at C + rho n, n = -s e +- sqrt(1 - s^2) e'. Seen from the light, over
        # the ray, e' = (-e_y, e_z) points to positive z: the sign chooses the end of the shadow.
        z = c_z + disk * (-sine * e_z - sign * level * e_y)
        y = c_y + disk * (-sine * e_y + sign * level * e_z)
        # A tangent that touches below the ray ends at the ray inside of the disk: the shadow ends
        # where the ray leaves the disk. One that touches at the light's height or above has no end.
        end = dr.select(y < 0, c_z + sign * chord, lanes.project(z, y))
        ends.append(dr.select(lanes.w * y >= lanes.height, sign * dr.inf, end))
    # There is a shadow if the plane cuts the sphere, and the disk reaches into the strip.
    dark = (
        outside
        & (dr.abs(beside) < radius)
        & (c_y + disk > 0)
        & (lanes.w * (c_y - disk) < lanes.height)
    )
    return dr.select(dark, ends[0], dr.inf), dr.select(dark, ends[1], -dr.inf)


def _disk(lanes: _Lanes, disks: Any, number: Any) -> tuple[Any, Any]:
    """Return the part of the ray that a flat disk hides, by the segment in
    which the plane cuts it.
    """
    parts = [dr.gather(mi.Float64, disks, number * 7 + k) for k in range(7)]
    centre, n, radius = mi.Vector3d(*parts[:3]) - lanes.origin, mi.Vector3d(*parts[3:6]), parts[6]
    along = dr.cross(n, lanes.normal)
    within = dr.maximum(dr.norm(along), 1e-290)
    # A unit vector in the disk, across its section, towards the plane's normal. The section is the
    # chord at the distance `beside` from the disk's centre.
    away = dr.cross(along, n) / within
    beside = dr.dot(centre, lanes.normal) / within
    middle = centre - beside * away
    half = _half_chord(radius, dr.abs(beside)) / within * along
    ends = [
        (dr.dot(point, lanes.direction), dr.dot(point, lanes.across))
        for point in (middle - half, middle + half)
    ]
    return _segment(lanes, ends[0], ends[1], dr.abs(beside) < radius)


def _half_chord(radius: Any, distance: Any) -> Any:
    return dr.sqrt(dr.maximum(radius - distance, 0) * (radius + distance))
