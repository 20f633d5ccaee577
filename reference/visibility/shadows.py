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
c_y^2). The light inside of a sphere reaches the inside alone: the searched range of the ray is cut
to the inside before (`reference.visibility.lit_intervals`).

**The lit rest.** Neighbours in a mesh mostly follow one another in its list: a shadow that touches
the shadow before it in the list is joined with it at once. Then t starts at the beginning of a ray.
Shadows that begin before t and end behind it move t to their end, until none does; the ray is lit
from t to where the next shadow begins, and t moves there. The loop goes through the list forwards
and backwards in turn, since shadows of a mesh mostly come in one order or the other. Nothing is
sorted. Gaps below 1e-12 of a distance are rounding: touching triangles share the coordinates of
their vertices.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

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
#: begin and end of a part of the ray of each lane [m]; begin > end where there is none
Interval: TypeAlias = "tuple[mi.Float64, mi.Float64]"
#: a point of the plane of ray and light, (z, y) [m]
PlanePoint: TypeAlias = "tuple[mi.Float64, mi.Float64]"

# gaps between shadows below this fraction of |x| and a metre, or of |x| and a smaller scene, are
# rounding
_MERGE = 1e-12


@dataclass(frozen=True)
class _Lanes:
    """A ray in each lane, in the frame of its plane with the light."""

    origin: "mi.Vector3d"  #: [m]
    direction: "mi.Vector3d"  #: unit, the axis z of the plane
    across: "mi.Vector3d"  #: unit, the axis y, on the side of the light
    normal: "mi.Vector3d"  #: unit, of the plane
    foot: "mi.Float64"  #: z_P: z of the light [m], or the cosine
    height: "mi.Float64"  #: y_P: y of the light [m], or the sine
    w: "mi.Float64"  #: 1: the light is a place, 0: a direction
    metre: "mi.Float64"  #: 1 m, or the size of a smaller scene [m]

    def project(self, z: "mi.Float64", y: "mi.Float64") -> "mi.Float64":
        """Return x, the image on the ray of a point of the plane [m]."""
        return (z * self.height - y * self.foot) / (self.height - self.w * y)


@dataclass(frozen=True)
class _Solids:
    """The shapes of one kind, and the lists of those that can stand in the light of each ray."""

    shadow: "Callable[[_Lanes, mi.Float64, mi.UInt32], Interval]"  #: of the shape of a number
    values: "mi.Float64"  #: of all shapes, one shape after another
    numbers: "mi.UInt32"  #: the lists of all rays, one after the other
    begin: Index  #: where the list of each ray begins, (rays,)
    end: Index  #: where it ends, (rays,)


@dataclass(frozen=True)
class _Shadows:
    """The shadows on the ray of each lane: the shadow of number k is at k * stride + lane."""

    low: "mi.Float64"  #: where it begins [m]
    high: "mi.Float64"  #: where it ends [m]
    count: "mi.UInt32"  #: how many there are, by lane
    stride: "mi.UInt32"  #: how many lanes there are
    metre: "mi.Float64"  #: 1 m, or the size of a smaller scene [m]


def lit_parts(
    rays: Rays, ends: tuple[Array, Array], near: Near, shapes: Shapes, of: Index
) -> tuple[Index, Array, Array]:
    """Return the lit parts of rays between two distances.

    `rays`: the rays; `ends`: distances between which lit parts are searched, (rays,) each [m]; a
    ray has none if the first is not below the second; `near`: lists of the shapes that can stand in
    the light; `shapes`: all shapes; `of`: by ray, the number of its lists in `near`, (rays,).
    Returns `ray`, `low`, `high`: the number of the ray, and the ends [m], of every lit part,
    ascending, (parts,) each.
    """
    if not shapes.count:
        ray = np.flatnonzero(ends[1] > ends[0])
        return ray, ends[0][ray], ends[1][ray]
    disks = shapes.disks
    solids = [
        _Solids(
            shadow,
            on_device(mi.Float64, np.ravel(values)),
            on_device(mi.UInt32, numbers),
            begin[of],
            end[of],
        )
        for shadow, values, (begin, end, numbers) in (
            (_triangle, shapes.triangles, near.triangles),
            (_sphere, np.column_stack([shapes.centre, shapes.radius]), near.spheres),
            (_disk, np.column_stack([disks.centre, disks.normal, disks.radius]), near.disks),
        )
    ]
    longest = int(np.sum([each.end - each.begin for each in solids], axis=0).max(initial=0))
    # Every lane has room for the longest list of shadows, and a block of lanes for 2^23 shadows. A
    # lane also has slots for 16 lit parts; a block in which a ray has more is computed again with
    # enough of them.
    room = max(1, longest)
    metre = shapes.metre(rays.origin, *([rays.position] if rays.w else ()))
    parts, slots, first = [], 16, 0
    while first < len(of):
        block = slice(first, min(len(of), first + max(1, (1 << 23) // room)))
        used, low, high = _lit_parts_of_block(
            rays[block],
            (ends[0][block], ends[1][block]),
            [replace(each, begin=each.begin[block], end=each.end[block]) for each in solids],
            metre,
            room,
            slots,
        )
        if used.max(initial=0) > slots:
            slots = 1 << (int(used.max()) - 1).bit_length()
            continue
        # Only the first `used` slots of a lane hold lit parts.
        filled = np.flatnonzero(np.arange(slots) < used[:, None])
        parts.append((first + filled // slots, low[filled], high[filled]))
        first = block.stop
    if not parts:
        return np.empty(0, np.int64), np.empty(0), np.empty(0)
    ray, low, high = (np.concatenate(column) for column in zip(*parts, strict=True))
    return ray, low, high


def _lit_parts_of_block(
    rays: Rays,
    ends: tuple[Array, Array],
    solids: list[_Solids],
    metre: float,
    room: int,
    slots: int,
) -> tuple[Index, Array, Array]:
    """Return how many lit parts each ray has, (rays,), and where they begin and end [m],
    (rays * slots,), for at most `room` shadows on a ray and `slots` parts of it; `metre`: 1 m, or
    the size of a smaller scene [m].
    """
    count = len(rays.foot)
    low, high = on_device(mi.Float64, ends[0]), on_device(mi.Float64, np.maximum(*ends))
    w, most, stride = mi.Float64(float(rays.w)), mi.UInt32(slots), mi.UInt32(count)
    size = mi.Float64(metre)
    # Opaque numbers are inputs of the compiled loops: one kernel serves all lights and sizes.
    dr.make_opaque(w, most, stride, size)
    origin = vectors(mi.Vector3d, np.broadcast_to(rays.origin, (count, 3)))
    direction, across = vectors(mi.Vector3d, rays.direction), vectors(mi.Vector3d, -rays.normal)
    foot, height = on_device(mi.Float64, rays.foot), on_device(mi.Float64, rays.height)
    normal = dr.cross(direction, across)
    lanes = _Lanes(origin, direction, across, normal, foot, height, w, size)
    shadows = _shadows(lanes, solids, (low, high), stride, room)
    # The lit rest of each lane, into its own slots.
    begins, ends_of_parts = (dr.zeros(mi.Float64, count * slots) for _ in range(2))
    used = _lit_rest(shadows, (low, high), (begins, ends_of_parts), most)
    dr.eval(used, begins, ends_of_parts)
    return np.array(used, dtype=np.int64), np.array(begins), np.array(ends_of_parts)


def _shadows(
    lanes: _Lanes, solids: list[_Solids], searched: Interval, stride: "mi.UInt32", room: int
) -> _Shadows:
    """Return the shadows on the searched parts of rays, each joined with the one before it in the
    list where both touch.
    """
    low, high = searched
    count = dr.width(low)
    lane = dr.arange(mi.UInt32, count)
    lows, highs = dr.empty(mi.Float64, count * room), dr.empty(mi.Float64, count * room)

    def store(
        number: "mi.UInt32", begin: "mi.Float64", end: "mi.Float64", active: "mi.Bool"
    ) -> None:
        dr.scatter(lows, begin, number * stride + lane, active)
        dr.scatter(highs, end, number * stride + lane, active)

    # How many shadows are stored, and both ends of the last one, which is not stored yet, since the
    # next one may touch it.
    state = (
        dr.zeros(mi.UInt32, count),
        dr.full(mi.Float64, dr.inf, count),
        dr.full(mi.Float64, -dr.inf, count),
    )
    for each in solids:
        if not len(each.numbers):
            continue
        end_of_list = on_device(mi.UInt32, each.end)

        def add(j, stored, last_begin, last_end, solids=each):
            # A shadow counts where it meets the searched part of the ray. If it touches the last
            # shadow both become one; else the last one is stored, and the new one is the last.
            number = dr.gather(mi.UInt32, solids.numbers, j)
            begin, end = solids.shadow(lanes, solids.values, number)
            casts = (begin < end) & (begin < high) & (end > low)
            touches = (begin <= last_end + _MERGE * (lanes.metre + dr.abs(last_end))) & (
                last_begin <= end + _MERGE * (lanes.metre + dr.abs(end))
            )
            apart = casts & ~touches & (last_begin < last_end)
            store(stored, last_begin, last_end, apart)
            stored += dr.select(apart, mi.UInt32(1), mi.UInt32(0))
            joined = dr.minimum(last_begin, begin), dr.maximum(last_end, end)
            last_begin = dr.select(casts, dr.select(touches, joined[0], begin), last_begin)
            last_end = dr.select(casts, dr.select(touches, joined[1], end), last_end)
            return j + 1, stored, last_begin, last_end

        _, *state = dr.while_loop(
            (on_device(mi.UInt32, each.begin), *state),
            lambda j, *others, end=end_of_list: j < end,
            add,
        )
    # The last shadow of all has no next one to be joined with.
    stored, last_begin, last_end = state
    casts = last_begin < last_end
    store(stored, last_begin, last_end, casts)
    stored += dr.select(casts, mi.UInt32(1), mi.UInt32(0))
    dr.eval(stored, lows, highs)
    return _Shadows(lows, highs, stored, stride, lanes.metre)


def _lit_rest(
    shadows: _Shadows, searched: Interval, parts: Interval, slots: "mi.UInt32"
) -> "mi.UInt32":
    """Write both ends of the lit parts of each lane to its slots, and return how many there are.

    A lane with more parts than slots only counts those that have no slot.
    """
    low, high = searched
    begins, ends = parts
    count = dr.width(low)
    lane = dr.arange(mi.UInt32, count)
    first_slot = lane * slots

    # The distance t goes from the beginning of the ray to its end, with one turn through the list
    # of shadows for each step.
    def step(t, used, back):
        def turn(j, t, after, moved):
            number = dr.select(back, shadows.count - 1 - j, j)
            begin, end = (
                dr.gather(mi.Float64, column, number * shadows.stride + lane)
                for column in (shadows.low, shadows.high)
            )
            # A shadow that begins before t and ends behind it moves t to its end; of the shadows
            # that begin behind t the first one limits the lit part.
            limit = t + _MERGE * (shadows.metre + dr.abs(t))
            covers = (begin <= limit) & (end > t)
            after = dr.select(begin > limit, dr.minimum(after, begin), after)
            return j + 1, dr.select(covers, end, t), after, moved | covers

        _, t, after, moved = dr.while_loop(
            (mi.UInt32(0), t, mi.Float64(high), mi.Bool(False)),
            lambda j, t, after, moved: (j < shadows.count) & (t < high),
            turn,
        )
        # Only in a turn that did not move t all shadows were compared with the final t: the ray is
        # lit up to `after`. Gaps of the size of rounding are passed over without a lit part.
        lit = ~moved & (t < high)
        wide = lit & (after - t > _MERGE * (shadows.metre + dr.abs(t)))
        has_slot = wide & (used < slots)
        dr.scatter(begins, t, first_slot + used, has_slot)
        dr.scatter(ends, after, first_slot + used, has_slot)
        return dr.select(lit, after, t), used + dr.select(wide, mi.UInt32(1), mi.UInt32(0)), ~back

    state = mi.Float64(low), dr.zeros(mi.UInt32, count), dr.full(mi.Bool, False, count)
    _, used, _ = dr.while_loop(state, lambda t, used, back: t < high, step)
    return used


def _triangle(lanes: _Lanes, corners: "mi.Float64", number: "mi.UInt32") -> Interval:
    """Return the part of the ray that a triangle hides; `corners`: nine coordinates of each [m]."""
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
    # One corner is alone on its side of the plane: the last, the middle or the first one.
    last, middle = above[0] == above[1], above[0] == above[2]

    def ordered(values: "list[mi.Float64]") -> "tuple[mi.Float64, mi.Float64, mi.Float64]":
        """Return the values of the three corners, first that of the corner that is alone."""
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


def _segment(lanes: _Lanes, first: PlanePoint, second: PlanePoint, cut: "mi.Bool") -> Interval:
    """Return the part of the ray that a segment of the plane hides; none where `cut` is False."""
    (z0, y0), (z1, y1) = first, second
    swap = y0 > y1
    y0, y1, z0, z1 = (dr.select(swap, a, b) for a, b in ((y1, y0), (y0, y1), (z1, z0), (z0, z1)))
    # The lower end is first. Only the strip 0 <= y, w y < height can shadow the ray: a segment that
    # begins below the ray is cut where it meets the ray.
    w, top = lanes.w, lanes.height
    hides = cut & (y1 >= 0) & (w * y0 < top)
    slope = dr.select(y1 > y0, (z1 - z0) / (y1 - y0), 0.0)
    begin = dr.select(y0 < 0, z0 - y0 * slope, lanes.project(z0, y0))
    # A segment that reaches the height of the light shadows the ray without end, on the side on
    # which it crosses that height.
    beyond = dr.select(
        z0 + (top - y0) * slope > lanes.foot, mi.Float64(dr.inf), mi.Float64(-dr.inf)
    )
    end = dr.select(w * y1 >= top, beyond, lanes.project(z1, y1))
    return dr.select(hides, dr.minimum(begin, end), dr.inf), dr.select(
        hides, dr.maximum(begin, end), -dr.inf
    )


def _sphere(lanes: _Lanes, spheres: "mi.Float64", number: "mi.UInt32") -> Interval:
    """Return the part of the ray that a sphere hides; `spheres`: centre and radius of each [m]."""
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
    # A sphere that holds the light casts no shadow: the range of the ray was cut to its inside.
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


def _disk(lanes: _Lanes, disks: "mi.Float64", number: "mi.UInt32") -> Interval:
    """Return the part of the ray that a flat disk hides, by the segment in which the plane cuts it;
    `disks`: centre [m], normal and radius [m] of each.
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


def _half_chord(radius: "mi.Float64", distance: "mi.Float64") -> "mi.Float64":
    """Return half of the chord at a distance from the centre of a disk [m]."""
    return dr.sqrt(dr.maximum(radius - distance, 0) * (radius + distance))
