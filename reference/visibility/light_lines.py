# SPDX-License-Identifier: BSD-3-Clause
r"""The parts of lights with extent that surface points see: exact lit intervals along scan lines of the light.

Line sampling (Billen, Dutre 2016, Line sampling for direct illumination, Computer Graphics Forum 35(4)): instead of
points, straight lines across the light are drawn at random; along each the visible parts are exact, so that what is
left to chance is a continuous function of one number, the place of the line.

A surface point P and a scan line span a plane, like a light and a camera ray. The parts of the line that P sees are the
lit intervals of that line for a point light at P, in the angle theta at P from the perpendicular to the line, and the
plane sections of `reference.visibility.triangles` and `reference.visibility.spheres` apply as they are.

**The plane of the lines.** That of a rectangle or a disk. A sphere of radius R at the distance d shows P a disk: the
circle where its tangents touch, of radius R T/d in the plane at T^2/d, T^2 = d^2 - R^2. Lines in that plane stand for
directions; where a direction meets the sphere is further on (`distance_on_line`).

**The lines.** All directions of the lines occur: lines along the edge of a shadow would see it at one place or not at
all. Lines are drawn with a density proportional to their length, so that each stands for the same area. With u uniform,
and q = |2u - 1|, the place V of the line is, for a disk of radius R,

    V = +- R sin(psi),    q = (2 psi + sin(2 psi))/pi,

and for a rectangle, whose lines are of full length L up to V = w and shorten linearly to nothing at V = W,

    V = +- q A/(2 L)    or, where that exceeds w,    +- (W - sqrt((1 - q) A (W - w)/L)).

**What hides a line.** A triangle matters only if no plane through P and a side of the square around the light has all
of it on the outer side, and if it is neither beyond the light nor below the horizon of P.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.scene.area_light import TruthAreaLight
from reference.scene.shapes import Shapes
from reference.visibility.line_crossings import half_chord
from reference.visibility.spheres import Shadows, hidden_behind, hidden_from_inside
from reference.visibility.triangles import clipped, lit_of_chunk, sections_of, spheres_around

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

_HORIZON = 1e-6  # rad: what rises less above the horizon of a point counts as its own surface; float32 normals
_OWN = 1e-5  # of its radius: a point closer to a sphere lies on it
_PAIRS = 1 << 19  # points and triangles at once
_POINTS = 16  # whose lines are cut at once
_ROUNDING = 1e-13  # of the distance: what is nearer to a plane may be on either side of it
_GROUP = 64  # points for which the triangles are looked through at once
_NEWTON = 8
_FAR = 1e150  # m: no sphere reaches that far


@dataclass(frozen=True)
class Points:
    """Surface points that look at a light."""

    place: Array  #: (points, 3) [m]
    normal: Array  #: unit, on the side of the camera, (points, 3)


@dataclass(frozen=True)
class Facing:
    """The light as each point sees it: a flat shape in the plane of the scan lines."""

    seen: Bools  #: whether the point sees the side that emits, or would if nothing were in the way, (points,)
    centre: Array  #: of the flat shape, relative to the point, (points, 3) [m]
    frame: Array  #: unit vectors as rows, two in the plane and the third from the point towards it, (points, 3, 3)
    depth: Array  #: distance between point and plane, (points,) [m]
    half: Array  #: half sides of the flat shape, of a disk twice the radius, (points, 2) [m]
    area: Array  #: of the flat shape, (points,) [m^2]


@dataclass(frozen=True)
class ScanLines:
    """Scan lines, each of one point."""

    point: Index  #: number of the point, (lines,)
    along: Array  #: unit vector along the line, (lines, 3)
    normal: Array  #: unit vector from the point to the foot on the line, (lines, 3)
    height: Array  #: distance between point and line, (lines,) [m]
    chord: Array  #: length of the line on the light, (lines,) [m]
    ends: tuple[Array, Array]  #: angles at the point of both ends of the line, (lines,) each [rad]
    above: tuple[Array, Array]  #: the same, clipped below the horizon of the point; nothing where first >= second


def facing(light: TruthAreaLight, points: Points) -> Facing:
    """Return a light as points see it."""
    away = light.centre - points.place
    count = len(away)
    if light.kind == "sphere":
        distance = np.linalg.norm(away, axis=1)
        seen = distance > light.radius * (1 + _OWN)
        distance = np.where(seen, distance, 2 * light.radius)
        axis = np.where(seen[:, None], away / distance[:, None], light.frame[2])
        tangent = half_chord(distance, np.full(count, light.radius))
        depth, radius = tangent**2 / distance, light.radius * tangent / distance
        helper = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
        first = np.cross(axis, helper)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        frame = np.stack([first, np.cross(axis, first), axis], axis=1)
        return Facing(seen, depth[:, None] * axis, frame, depth, np.stack([radius, radius], axis=1), np.pi * radius**2)
    depth = -(away @ light.normal)
    seen = depth > _HORIZON * max(1.0, float(np.abs(light.centre).max()))
    frame = np.stack([light.frame[0], light.frame[1], -light.normal])
    return Facing(
        seen,
        away,
        np.broadcast_to(frame, (count, 3, 3)),
        np.where(seen, depth, 1.0),
        np.broadcast_to(light.half, (count, 2)),
        np.full(count, light.area),
    )


def scan_lines(kind: str, seen: Facing, points: Points, lines: tuple[Index, Array, Array]) -> ScanLines:
    """Return scan lines of a light.

    Parameters
    ----------
    kind
        Of the light.
    seen
        The light as the points see it.
    points
        The points.
    lines
        Numbers of the points, angles of the lines in the plane [rad], and places u [1], (lines,) each.
    """
    row, turn, place = lines
    cosine, sine = np.cos(turn), np.sin(turn)
    first, second, axis = (seen.frame[row, k] for k in range(3))
    along = cosine[:, None] * first + sine[:, None] * second
    across = cosine[:, None] * second - sine[:, None] * first
    half = seen.half[row]
    flat = _on_rectangle if kind == "rectangle" else _on_disk
    offset, low, high = flat(half, cosine, sine, place)
    centre = seen.centre[row]
    foot = -np.sum(centre * along, axis=1)
    beside = np.sum(centre * across, axis=1) + offset
    towards = seen.depth[row][:, None] * axis + beside[:, None] * across
    height = np.hypot(seen.depth[row], beside)
    normal = towards / height[:, None]
    ends = np.arctan2(low - foot, height), np.arctan2(high - foot, height)
    # The horizon is a line through the plane of point and scan line: an interval of pi about its middle.
    up = points.normal[row]
    middle = np.arctan2(np.sum(up * along, axis=1), np.sum(up * normal, axis=1))
    above = np.maximum(ends[0], middle - 0.5 * np.pi), np.minimum(ends[1], middle + 0.5 * np.pi)
    return ScanLines(row, along, normal, height, high - low, ends, above)


def distance_on_line(light: TruthAreaLight, lines: ScanLines, of: Index, theta: Array, points: Points) -> Array:
    """Return the distances from points to the light in directions of scan lines.

    Parameters
    ----------
    light, lines, points
        The light, the lines and the points.
    of
        Number of the line of each row, (n,).
    theta
        Angles at the point, (n, nodes) [rad].
    """
    if light.kind != "sphere":
        return lines.height[of, None] / np.cos(theta)
    centre = light.centre - points.place[lines.point[of]]
    along, normal = np.sum(centre * lines.along[of], axis=1), np.sum(centre * lines.normal[of], axis=1)
    middle = along[:, None] * np.sin(theta) + normal[:, None] * np.cos(theta)
    tangent2 = np.sum(centre**2, axis=1) - light.radius**2
    # Near root of r^2 - 2 middle r + tangent^2 = 0, as a quotient of sums of one sign.
    root = np.sqrt(np.maximum(middle**2 - tangent2[:, None], 0.0))
    return np.asarray(tangent2[:, None] / (middle + root))


def seen_intervals(
    light: TruthAreaLight, seen: Facing, lines: ScanLines, points: Points, shapes: Shapes
) -> tuple[Index, Array, Array]:
    """Return the parts of scan lines that their points see.

    Parameters
    ----------
    light, seen, lines, points
        The light, as the points see it, its scan lines, sorted by point, and the points.
    shapes
        What can shadow the light, without its own shape; triangles and spheres count.

    Returns
    -------
    line, low, high
        Number of the line and angles at the point, (intervals,) each [rad].
    """
    used = np.flatnonzero(lines.above[1] > lines.above[0])
    hidden = [*_triangle_shadows(light, seen, lines, points, shapes, used)]
    hidden += _sphere_shadows(light, lines, points, shapes, used)
    if not hidden:
        return used, lines.above[0][used], lines.above[1][used]
    row, low, high = (np.concatenate(parts) for parts in zip(*hidden, strict=True))
    # Rows of `used`: the merge of shadows orders lines and angles by one number, so a few lines at a time.
    place = np.full(len(lines.point), -1)
    place[used] = np.arange(len(used))
    row = place[row]
    order = np.argsort(row, kind="stable")
    row, low, high = row[order], low[order], high[order]
    parts = []
    for first in range(0, len(used), 256):
        mine = used[first : first + 256]
        begin, end = np.searchsorted(row, (first, first + len(mine)))
        parts.append(lit_of_chunk((row[begin:end] - first, low[begin:end], high[begin:end]), lines.above, mine))
    line, low, high = (np.concatenate([part[i] for part in parts] or [np.empty(0)]) for i in range(3))
    return line.astype(np.int64), low, high


def _on_disk(half: Array, cosine: Array, sine: Array, place: Array) -> tuple[Array, Array, Array]:
    """Return the offsets of lines across a disk, and where they begin and end, from its centre [m]."""
    q = np.abs(2 * place - 1)
    psi = np.minimum(0.25 * np.pi * q, 0.5 * np.pi)
    psi = np.where(q > 0.8, 0.5 * np.pi - np.cbrt(0.75 * np.pi * (1 - q)), psi)
    for _ in range(_NEWTON):
        slope = np.maximum(2 + 2 * np.cos(2 * psi), 1e-12)
        psi = np.clip(psi - (2 * psi + np.sin(2 * psi) - np.pi * q) / slope, 0.0, 0.5 * np.pi)
    end = half[:, 0] * np.cos(psi)
    return half[:, 0] * np.sin(psi) * np.sign(place - 0.5), -end, end


def _on_rectangle(half: Array, cosine: Array, sine: Array, place: Array) -> tuple[Array, Array, Array]:
    """Return the offsets of lines across a rectangle, and where they begin and end, from its centre [m]."""
    a, b = half.T
    wide, thin = a * np.abs(sine) + b * np.abs(cosine), np.abs(a * np.abs(sine) - b * np.abs(cosine))
    area, q = 4 * a * b, np.abs(2 * place - 1)
    full = area / (wide + thin)
    flat = 0.5 * q * area / full
    offset = np.where(flat <= thin, flat, wide - np.sqrt(np.maximum((1 - q) * area * (wide - thin) / full, 0.0)))
    offset *= np.sign(place - 0.5)
    low, high = np.full(len(a), -np.inf), np.full(len(a), np.inf)
    for side, rate, start in ((a, cosine, -sine * offset), (b, sine, cosine * offset)):
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = (-side - start) / rate, (side - start) / rate
        level = np.abs(rate) < 1e-14
        low = np.maximum(low, np.where(level, -np.inf, np.minimum(*ends)))
        high = np.minimum(high, np.where(level, np.inf, np.maximum(*ends)))
    return offset, low, np.maximum(high, low)


def _triangle_shadows(
    light: TruthAreaLight, seen: Facing, lines: ScanLines, points: Points, shapes: Shapes, used: Index
) -> list[Shadows]:
    if not len(shapes.triangles):
        return []
    parts = []
    begin, end = (np.searchsorted(lines.point[used], np.arange(len(points.place)), side) for side in ("left", "right"))
    plane = np.cross(lines.along[used], lines.normal[used])
    for group in _groups(points.place, np.flatnonzero(end > begin)):
        pairs = _near_triangles(light, seen, points, group, shapes.triangles)
        for first in range(0, len(pairs), _POINTS):
            met = []
            for point, triangle, cut in pairs[first : first + _POINTS]:
                mine = slice(begin[point], end[point])
                corners = shapes.triangles[triangle] - points.place[point]
                side = (plane[mine] @ corners.reshape(-1, 3).T).reshape(-1, len(triangle), 3)
                low, high = side.min(axis=2), side.max(axis=2)
                size = _ROUNDING * np.abs(corners).max(axis=(1, 2))
                row, column = np.nonzero((low <= size) & (high >= -size))
                met.append((used[mine][row], triangle[column], cut[column]))
            met_line, which, flagged = (np.concatenate(column) for column in zip(*met, strict=True))
            parts += _hidden_lines(light, lines, points, shapes.triangles, (met_line, which, flagged))
    return parts


def _groups(place: Array, which: Index) -> list[Index]:
    """Return the numbers of points that lie together, `_GROUP` at most: halved again and again where widest."""
    done, waiting = [], [which] if len(which) else []
    while waiting:
        part = waiting.pop()
        if len(part) <= _GROUP:
            done.append(np.sort(part))
            continue
        part = part[np.argsort(place[part, np.argmax(np.ptp(place[part], axis=0))], kind="stable")]
        waiting += [part[: len(part) // 2], part[len(part) // 2 :]]
    return done


def _near_triangles(
    light: TruthAreaLight, seen: Facing, points: Points, group: Index, triangles: Array
) -> list[tuple[int, Index, Bools]]:
    """Return for points that have any the triangles that can shadow the light there, and which of them cut a sphere."""
    place = points.place[group]
    candidate = _in_tube(place, light, triangles)
    corners = triangles[candidate]
    step = max(1, _PAIRS // max(1, len(candidate)))
    result = []
    for first in range(0, len(group), step):
        rows = group[first : first + step]
        near = _in_pyramid(light, seen, points, rows, corners)
        cut = np.zeros_like(near)
        if light.kind == "sphere":
            near, cut = _before_sphere(light, points.place[rows], corners, near)
        for row in np.flatnonzero(near.any(axis=1)):
            chosen = np.flatnonzero(near[row])
            result.append((int(rows[row]), candidate[chosen], cut[row, chosen]))
    return result


def _in_tube(place: Array, light: TruthAreaLight, triangles: Array) -> Index:
    """Return the triangles that come near to a segment from some of the points to the light.

    The distance from a line is convex along a segment: the tube about any line that holds all ends holds all segments.
    """
    middle = place.mean(axis=0)
    way = light.centre - middle
    length = float(np.linalg.norm(way))
    centre, radius = spheres_around(triangles)
    if length == 0:
        return np.arange(len(triangles))
    axis = way / length
    tube = max(light.radius, float(np.linalg.norm(np.cross(place - middle, axis), axis=1).max()))
    reach = radius + tube + _HORIZON * length
    back = (place - middle) @ axis
    along = (centre - middle) @ axis
    near = np.linalg.norm(np.cross(centre - middle, axis), axis=1) <= reach
    near &= (along + radius >= back.min() - _HORIZON) & (along - radius <= length + light.radius)
    return np.flatnonzero(near)


def _in_pyramid(light: TruthAreaLight, seen: Facing, points: Points, rows: Index, corners: Array) -> Bools:
    """Return which triangles reach into the pyramid from a point to the square around the light, and over its horizon.

    Shape (points, triangles).
    """
    place, frame = points.place[rows], seen.frame[rows]
    flat = corners.reshape(-1, 3)

    def components(vectors: Array) -> Array:
        parts = flat @ vectors.T - np.sum(place * vectors, axis=1)
        return parts.reshape(len(corners), 3, len(rows))

    x, y, z = (components(frame[:, k]) for k in range(3))
    far = seen.depth[rows] if light.kind != "sphere" else np.linalg.norm(seen.centre[rows], axis=1) + 2 * light.radius
    near = (z > 0).any(axis=1) & (z < far * (1 + _HORIZON)).any(axis=1)
    depth, radius = seen.depth[rows], (1 + _HORIZON) * np.hypot(*seen.half[rows].T)
    if light.kind != "rectangle":
        radius = (1 + _HORIZON) * seen.half[rows, 0]
    for component, k in ((x, 0), (y, 1)):
        middle = np.sum(seen.centre[rows] * frame[:, k], axis=1)
        near &= (component * depth <= (middle + radius) * z).any(axis=1)
        near &= (component * depth >= (middle - radius) * z).any(axis=1)
    up = components(points.normal[rows])
    size = np.maximum(np.abs(x), np.maximum(np.abs(y), np.abs(z)))
    near &= (up > _HORIZON * (size + 0.1)).any(axis=1)
    return np.asarray(near.T)


def _before_sphere(light: TruthAreaLight, place: Array, corners: Array, near: Bools) -> tuple[Bools, Bools]:
    """Return which triangles can lie before a sphere, and which of them have planes that cut it."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.maximum(length, np.finfo(float).tiny)
    offset = np.sum(normal * corners[:, 0], axis=1)
    from_light, from_point = normal @ light.centre - offset, place @ normal.T - offset
    cut = np.abs(from_light) < light.radius
    between = from_point * from_light < 0
    return near & (between | cut), near & cut


def _hidden_lines(
    light: TruthAreaLight, lines: ScanLines, points: Points, triangles: Array, pairs: tuple[Index, Index, Bools]
) -> list[Shadows]:
    line, triangle, cut = pairs
    shadows = []
    for sphere in (False, True) if cut.any() else (False,):
        chosen = cut == sphere
        mine = line[chosen]
        corners = triangles[triangle[chosen]] - points.place[lines.point[mine], None]
        row, a, b = sections_of(corners, (lines.along, lines.normal), mine)
        if sphere:
            row, a, b = _before_disk(light, lines, points, (row, a, b))
        # What shadows a sphere may lie behind the plane of the lines: it is before the sphere all the same.
        shadows.append(_angles(row, a, b) if light.kind == "sphere" else clipped(row, a, b, lines.height[row]))
    return shadows


def _angles(row: Index, a: tuple[Array, Array], b: tuple[Array, Array]) -> Shadows:
    """Return the angles between which segments in front of their points lie, clipped to y > 0."""
    (y0, z0), (y1, z1) = a, b
    keep = np.flatnonzero(np.maximum(y0, y1) > 0)
    row, y0, z0, y1, z1 = row[keep], y0[keep], z0[keep], y1[keep], z1[keep]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_axis = z0 - y0 * (z1 - z0) / (y1 - y0)
    low, high = (np.arctan2(np.where(y > 0, z, on_axis), np.where(y > 0, y, 0.0)) for y, z in ((y0, z0), (y1, z1)))
    return row, np.minimum(low, high), np.maximum(low, high)


def _before_disk(
    light: TruthAreaLight, lines: ScanLines, points: Points, segments: tuple[Index, tuple, tuple]
) -> tuple[Index, tuple[Array, Array], tuple[Array, Array]]:
    """Return the parts of segments that lie before the disk in which the plane of a line cuts a sphere light.

    A segment meets the disk in one interval. What is before and behind that lies before the disk where its end on the
    circle does, on the arc that faces the point; a segment that misses the disk does where it is met before the disk's
    middle, in the direction in which both are seen.
    """
    row, a, b = segments
    centre = light.centre - points.place[lines.point[row]]
    c_z, c_y = np.sum(centre * lines.along[row], axis=1), np.sum(centre * lines.normal[row], axis=1)
    beside = np.sum(centre * np.cross(lines.along[row], lines.normal[row]), axis=1)
    square = light.radius**2 - beside**2
    (y0, z0), (y1, z1) = a, b
    way_y, way_z, from_y, from_z = y1 - y0, z1 - z0, y0 - c_y, z0 - c_z
    quadratic, half = way_y**2 + way_z**2, way_y * from_y + way_z * from_z
    discriminant = half**2 - quadratic * (from_y**2 + from_z**2 - square)
    root = np.sqrt(np.maximum(discriminant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        enter, leave = (-half - root) / quadratic, (-half + root) / quadratic
    meets = (discriminant > 0) & (leave > 0) & (enter < 1) & (square > 0)

    def at(share: Array, rows: Index) -> tuple[Array, Array]:
        return y0[rows] + share * way_y[rows], z0[rows] + share * way_z[rows]

    parts = []
    for begins, end in ((True, enter), (False, leave)):
        rows = np.flatnonzero(meets & ((end > 0) if begins else (end < 1)))
        y, z = at(end[rows], rows)
        front = (y - c_y[rows]) * y + (z - c_z[rows]) * z < 0
        rows, place = rows[front], at(end[rows][front], rows[front])
        other = at(np.zeros(len(rows)) if begins else np.ones(len(rows)), rows)
        parts.append((row[rows], other, place))
    missed = np.flatnonzero(~meets)
    front = _met_first((y0[missed], z0[missed]), (y1[missed], z1[missed]), (c_y[missed], c_z[missed]), square[missed])
    missed = missed[front]
    parts.append((row[missed], (y0[missed], z0[missed]), (y1[missed], z1[missed])))
    numbers, first, second = zip(*parts, strict=True)
    (y_a, z_a), (y_b, z_b) = ([np.concatenate([end[k] for end in side]) for k in range(2)] for side in (first, second))
    return np.concatenate(numbers), (y_a, z_a), (y_b, z_b)


def _met_first(a: tuple[Array, Array], b: tuple[Array, Array], c: tuple[Array, Array], square: Array) -> Bools:
    """Return which segments that miss a disk are met before it, in the middle of where both are seen."""
    (y0, z0), (y1, z1), (c_y, c_z) = a, b, c
    angles = np.arctan2(z0, y0), np.arctan2(z1, y1)
    middle, half = np.arctan2(c_z, c_y), np.arcsin(np.clip(np.sqrt(np.maximum(square, 0)) / np.hypot(c_y, c_z), 0, 1))
    low = np.maximum(np.minimum(*angles), middle - half)
    high = np.minimum(np.maximum(*angles), middle + half)
    theta = 0.5 * (low + high)
    sine, cosine = np.sin(theta), np.cos(theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (y0 * (z1 - z0) - z0 * (y1 - y0)) / (cosine * (z1 - z0) - sine * (y1 - y0))
    return np.asarray((low < high) & (distance > 0) & (distance < c_y * cosine + c_z * sine))


def _sphere_shadows(
    light: TruthAreaLight, lines: ScanLines, points: Points, shapes: Shapes, used: Index
) -> list[Shadows]:
    shadows: list[Shadows] = []
    along, normal, height = lines.along[used], lines.normal[used], lines.height[used]
    side = np.cross(along, normal)
    point = lines.point[used]
    for place, radius in zip(shapes.centre, shapes.radius, strict=True):
        centre = place - points.place
        distance = np.linalg.norm(centre, axis=1)
        own = np.abs(distance - radius) < _OWN * radius
        faces = np.sum(centre * points.normal, axis=1) > 0
        inside = np.where(own, faces, distance < radius)
        meets = np.abs(np.sum(side * centre[point], axis=1)) < radius
        row = np.flatnonzero(meets & ~(own & ~faces)[point])
        c_y, c_z = np.sum(normal[row] * centre[point[row]], axis=1), np.sum(along[row] * centre[point[row]], axis=1)
        disk = half_chord(np.full(len(row), radius), np.abs(np.sum(side[row] * centre[point[row]], axis=1)))
        within = inside[point[row]]
        tangent = half_chord(np.maximum(distance, radius), np.full(len(distance), radius))[point[row]]
        behind = ~within
        h = height[row]
        if light.kind == "sphere":
            behind &= _nearer(light, points, (lines, used[row]), (c_y, c_z))
            h = np.full(len(row), _FAR)
        line = used[row]
        shadows.append(hidden_behind(line[behind], *(v[behind] for v in (c_y, c_z, disk, h, tangent))))
        if within.any():
            shadows += hidden_from_inside(line[within], *(v[within] for v in (c_y, c_z, disk, height[row])))
    return shadows


def _nearer(light: TruthAreaLight, points: Points, lines: tuple[ScanLines, Index], c: tuple[Array, Array]) -> Bools:
    """Return in which planes of lines a sphere is nearer than a sphere that emits; the two do not meet."""
    known, row = lines
    centre = light.centre - points.place[known.point[row]]
    c_z, c_y = np.sum(centre * known.along[row], axis=1), np.sum(centre * known.normal[row], axis=1)
    return np.asarray(np.hypot(*c) < np.hypot(c_y, c_z))
