# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals of camera rays by exact geometry: what every triangle and sphere takes from the light of every ray.

A camera ray and a light span a plane. A triangle cuts that plane in a segment, and the segment hides from the light one
interval of the angle theta along the ray. In the plane, relative to the light, let y be the component along n (towards
the foot point) and z that along the direction of the ray; the ray is y = height, and the point of the ray that lies
behind (y, z) as seen from the light is the one at theta = atan2(z, y), provided that 0 < y <= height. So

    shadow of a segment = [atan2(z_a, y_a), atan2(z_b, y_b)],   the segment clipped to 0 < y <= height,

and what is lit is what neither a triangle nor a sphere (`reference.visibility.spheres`) hides. No sampling, no rays
cast, everything in float64: however thin a shadow, it is found. It shares nothing with the ray-traced visibility of
`reference.visibility.lit_intervals`, which checks it.

All camera rays start in one point, so their planes turn about one axis, from the camera to the light. A triangle can
only matter to rays whose azimuth about that axis lies within its own, that pass beyond it as seen along the axis (the
angle at the camera), and that have not ended before it (the angle at the light). The rays are sorted by azimuth and
taken a few at a time; what these three tests leave of (rays) x (triangles) is computed. A triangle's two angles are
bounded below by those of a sphere around it, which is what the tests use.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.scene.read import TruthLight, TruthScene
from reference.scene.shapes import Shapes, read_shapes
from reference.visibility.intervals import LitIntervals
from reference.visibility.spheres import Shadows, sphere_shadows

Array = NDArray[np.float64]
Index = NDArray[np.int64]

RAYS = 256  # rays taken at once: pairs of a few hundred rays with their triangles stay in the processor's cache
SLACK = 1e-9  # added to the culling angles [rad]: float64 rounding of an angle is 1e-15, of a near vertex some more
_ROUNDED = 1e-12  # wider than the rounding of an azimuth [rad]
_MERGE = 1e-12  # gaps between shadows below this share of a ray are rounding: neighbouring triangles share an edge

#: Relative uncertainty of the distance of an edge: float64 rounding, a digit lost on a near vertex, and `_MERGE`.
EXACT_EDGE = 1e-11


@dataclass(frozen=True)
class Reaches:
    """Bounds of the triangles about the axis from the camera to the light, arrays of shape (triangles,)."""

    azimuth: Array  #: where the interval of azimuths begins, in [-pi, pi] [rad]
    width: Array  #: its width, 2 pi if the axis meets the triangle [rad]
    camera: Array  #: smallest angle at the camera, from the light [rad]
    before: Array  #: what only rays that end later can be shadowed by: here the smallest angle at the light [rad]


def geometric_intervals(
    truth: TruthScene,
    light: TruthLight,
    rays: tuple[Array, Array, Array],
    *,
    ends: tuple[Array, Array],
    shapes: Shapes | None = None,
) -> LitIntervals:
    """Find the lit intervals of camera rays between two angles, exactly.

    Parameters
    ----------
    truth
        The scene; its `origin` is where all rays start.
    light
        The light.
    rays
        Unit directions (n, 3), unit normals from the light to the foot points (n, 3), heights (n,) [m].
    ends
        Angles at the light between which a ray is looked at [rad], each (n,); empty where the first is not below the
        second.
    shapes
        What `reference.scene.shapes.read_shapes` returned, if known.

    Notes
    -----
    Valid for opaque triangles and spheres; what else hides the light is left out. Touching triangles are assumed to
    share the coordinates of their vertices: a crack between them is light.
    """
    shapes = read_shapes(truth.occluders) if shapes is None else shapes
    corners = shapes.triangles - light.position
    spheres = shapes.centre - light.position, shapes.radius
    used = np.flatnonzero(ends[1] > ends[0])
    frame = axis_frame(light.position - truth.origin)
    cones = _cones(corners, truth.origin - light.position, frame)
    azimuth = np.arctan2(rays[0][used] @ frame[2], rays[0][used] @ frame[1])
    order = np.argsort(azimuth, kind="stable")
    parts = []
    for start in range(0, len(used), RAYS):
        chosen = order[start : start + RAYS]
        mine = used[chosen]
        # The angle at the light between the camera and the point at theta is, in the triangle of camera, light and that
        # point, pi minus the angle at the camera minus the angle at the point, pi/2 - theta: pi/2 + theta - camera.
        at_camera = np.arccos(np.clip(rays[0][mine] @ frame[0], -1, 1)) + SLACK
        at_light = 0.5 * np.pi + ends[1][mine] - at_camera + 3 * SLACK
        pairs = near_pairs(azimuth[chosen], (at_camera, at_light), cones)
        lines = rays[0][mine], rays[1][mine], rays[2][mine]
        hidden = _shadows(corners, lines, pairs), sphere_shadows(spheres, *lines)
        row, begin, end = (np.concatenate(both) for both in zip(*hidden, strict=True))
        parts.append(lit_of_chunk((row, begin, end), ends, mine))
    ray, low, high = (np.concatenate([part[i] for part in parts] or [np.empty(0)]) for i in range(3))
    by_ray = np.lexsort((low, ray))
    ray, low, high = ray[by_ray].astype(np.int64), low[by_ray], high[by_ray]
    transitions = int(np.sum(low > ends[0][ray]) + np.sum(high < ends[1][ray]))
    return LitIntervals(ray, low, high, transitions, edge=EXACT_EDGE)


def axis_frame(to_light: Array) -> Array:
    """Return unit vectors as rows, (3, 3): along the way from the camera to the light, (3,) [m], and two across."""
    length = np.linalg.norm(to_light)
    axis = to_light / length if length > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    return np.stack([axis, across, np.cross(axis, across)])


def _cones(corners: Array, camera: Array, frame: Array) -> Reaches:
    """Bound every triangle, given relative to the light, in azimuth and in the angles at the camera and the light."""
    begin, width = azimuths(corners, frame)
    centre, radius = spheres_around(corners)
    at_camera = angle_below(centre - camera, radius, frame[0])
    at_light = angle_below(centre, radius, -frame[0])
    return Reaches(begin, width, at_camera - SLACK, at_light - SLACK)


def azimuths(corners: Array, frame: Array) -> tuple[Array, Array]:
    """Return where the azimuths of triangles about the axis begin, and how wide they are.

    Parameters
    ----------
    corners
        Of the triangles, relative to a point of the axis, (n, 3, 3) [m].
    frame
        From `axis_frame`, (3, 3).

    Returns
    -------
    begin, width
        (n,) each [rad]; the width is 2 pi where the axis meets the triangle or passes close by.
    """
    across = corners @ frame[1:].T
    azimuth = np.sort(np.arctan2(across[..., 1], across[..., 0]), axis=1)
    # A triangle that the axis misses spans less than half a turn: it fills the complement of the widest gap.
    gaps = np.stack([azimuth[:, 1] - azimuth[:, 0], azimuth[:, 2] - azimuth[:, 1]], axis=1)
    gaps = np.concatenate([gaps, 2 * np.pi - gaps.sum(axis=1, keepdims=True)], axis=1)
    widest = np.argmax(gaps, axis=1)
    width = 2 * np.pi - gaps.max(axis=1)
    begin = azimuth[np.arange(len(azimuth)), (widest + 1) % 3]
    near_axis = np.linalg.norm(across, axis=2).min(axis=1) < 1e-6 * np.abs(corners).max(axis=(1, 2), initial=0)
    return begin, np.where((width > np.pi - 1e-6) | near_axis, 2 * np.pi, width)


def spheres_around(corners: Array) -> tuple[Array, Array]:
    """Return centres, (n, 3) [m], and radii, (n,) [m], of spheres that hold triangles, (n, 3, 3) [m]."""
    centre = corners.mean(axis=1)
    return centre, np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1, initial=0)


def angle_below(centre: Array, radius: Array, axis: Array) -> Array:
    """Return a lower bound of the angle between an axis and the points of spheres.

    Parameters
    ----------
    centre, radius
        Of the spheres, (n, 3) and (n,) [m].
    axis
        Unit vector, (3,).

    Returns
    -------
    numpy.ndarray
        (n,) [rad].
    """
    distance = np.linalg.norm(centre, axis=1)
    along = centre @ axis
    angle = np.arctan2(np.linalg.norm(centre - along[:, None] * axis, axis=1), along)
    inside = radius >= distance
    return np.where(inside, 0.0, angle - np.arcsin(np.where(inside, 0, radius / np.maximum(distance, 1e-300))))


def near_pairs(azimuth: Array, reach: tuple[Array, Array], cones: Reaches) -> tuple[Index, Index]:
    """Return the pairs (ray, triangle) of a chunk of rays that can matter.

    Parameters
    ----------
    azimuth
        Of the rays, ascending [rad].
    reach
        By ray, what `Reaches.camera` and `Reaches.before` of a triangle must not exceed.
    cones
        The triangles.
    """
    at_camera, at_end = reach
    # Distance in azimuth from where the triangle begins, modulo a turn; the slack lets a ray begin just before it.
    first = np.mod(azimuth[0] - cones.azimuth + SLACK, 2 * np.pi)
    turn = cones.width + 2 * SLACK
    touched = (first <= turn) | (first + (azimuth[-1] - azimuth[0]) >= 2 * np.pi)
    touched &= (cones.camera < at_camera.max()) & (cones.before < at_end.max())
    triangle = np.flatnonzero(touched)
    row, column = _azimuths_within(first[triangle], turn[triangle], azimuth - azimuth[0])
    near = cones.camera[triangle[column]] < at_camera[row]
    near &= cones.before[triangle[column]] < at_end[row]
    return row[near], triangle[column[near]]


def _azimuths_within(first: Array, turn: Array, beyond: Array) -> tuple[Index, Index]:
    """Return the pairs (ray, triangle) whose azimuths meet, by ray and then by triangle.

    A ray at first + beyond, less a turn where it is more than one, must not be beyond the width: as rays ascend, those
    of a triangle are two runs. Each is taken somewhat wider, and then its rays are asked.

    Parameters
    ----------
    first, turn
        By triangle, how far the first ray is from where it begins, and how far it reaches [rad].
    beyond
        By ray, how far it is from the first one, ascending [rad].
    """
    wraps = 2 * np.pi - first
    before, end = (
        np.searchsorted(beyond, far + _ROUNDED, side="right") for far in (np.minimum(turn - first, wraps), turn + wraps)
    )
    begins = np.concatenate([np.zeros_like(before), np.maximum(np.searchsorted(beyond, wraps - _ROUNDED), before)])
    lengths = np.maximum(np.concatenate([before, end]) - begins, 0)
    column = np.repeat(np.tile(np.arange(len(first)), 2), lengths)
    row = np.arange(len(column)) - np.repeat(np.cumsum(lengths) - lengths - begins, lengths)
    turned = first[column] + beyond[row]
    turned -= 2 * np.pi * (turned >= 2 * np.pi)
    kept = turned <= turn[column]
    row, column = row[kept], column[kept]
    order = np.argsort(row * len(first) + column)
    return row[order], column[order]


def lit_of_chunk(shadows: Shadows, ends: tuple[Array, Array], used: Index) -> tuple[Array, Array, Array]:
    """Return the lit intervals of a chunk of rays, given what is hidden.

    Parameters
    ----------
    shadows
        Rows of `used`, and where hidden intervals begin and end, in any order.
    ends
        Between which all rays are looked at, (rays,) each: angles at the light [rad], or shares of the way [1].
    used
        Numbers of the rays of the chunk.

    Returns
    -------
    ray, low, high
        Of every lit interval, (intervals,) each, in the unit of the ends.
    """
    low, high = ends[0][used], ends[1][used]
    row, begin, end = shadows
    begin, end = np.maximum(begin, low[row]), np.minimum(end, high[row])
    # One number orders all: the ray's place in the chunk plus the share of the ray. Two shadows that meet within
    # `_MERGE` are one; the numbers keep 3e-14 of a ray. A shadow that is no wider than that is left out, so that none
    # begins at the very end of a ray, where its number would be that of the next ray's beginning.
    scale = 1 / (high - low)
    hidden = (end - begin) * scale[row] > _MERGE
    row, begin, end = row[hidden], begin[hidden], end[hidden]
    start = row + (begin - low[row]) * scale[row]
    order = np.argsort(start)
    row, begin, end, start = row[order], begin[order], end[order], start[order]
    place = row + (end - low[row]) * scale[row]
    furthest = np.maximum.accumulate(place)
    last = np.maximum.accumulate(np.where(place == furthest, np.arange(len(row)), 0))
    # A gap opens before a shadow that begins beyond all earlier ones of its ray, and behind the last one of each ray.
    first_of_ray = np.append(True, row[1:] != row[:-1])[: len(row)]
    gap_begin = np.where(first_of_ray, low[row], np.append(0.0, end[last[:-1]])[: len(row)])
    gap_before = first_of_ray | (start > np.append(-1.0, furthest[:-1])[: len(row)] + _MERGE)
    tail = np.append(first_of_ray[1:], True)[: len(row)]
    clear = np.setdiff1d(np.arange(len(used)), row)
    rows = np.concatenate([row[gap_before], row[tail], clear])
    begins = np.concatenate([gap_begin[gap_before], end[last[tail]], low[clear]])
    finish = np.concatenate([begin[gap_before], high[row[tail]], high[clear]])
    wide = (finish - begins) * scale[rows] > _MERGE
    return used[rows[wide]], begins[wide], finish[wide]


def _shadows(
    corners: Array, rays: tuple[Array, Array, Array], pairs: tuple[Index, Index]
) -> tuple[Index, Array, Array]:
    """Return the rays and the intervals of theta that triangles hide."""
    row, first, second = plane_sections(corners, rays[:2], pairs)
    return clipped(row, first, second, rays[2][row])


def plane_sections(
    corners: Array, axes: tuple[Array, Array], pairs: tuple[Index, Index]
) -> tuple[Index, tuple[Array, Array], tuple[Array, Array]]:
    """Return the segments in which triangles meet the planes of rays.

    Parameters
    ----------
    corners
        Relative to a point of all planes, (triangles, 3, 3) [m].
    axes
        Unit vectors along z and along y, which span the planes, (rays, 3) each.
    pairs
        Numbers of the rays and triangles to look at.

    Returns
    -------
    row, first, second
        Number of the ray, and (y, z) of both ends [m], (segments,) each.
    """
    row, triangle = pairs
    return sections_of(corners[triangle], axes, row)


def sections_of(
    chosen: Array, axes: tuple[Array, Array], row: Index
) -> tuple[Index, tuple[Array, Array], tuple[Array, Array]]:
    """Return the segments in which triangles meet planes, a triangle for each plane that is looked at.

    Parameters
    ----------
    chosen
        Corners relative to a point of the plane, (pairs, 3, 3) [m].
    axes
        Unit vectors along z and along y, which span the planes, (rays, 3) each.
    row
        Number of the ray whose plane each triangle is cut by, (pairs,).

    Returns
    -------
    row, first, second
        As `plane_sections`, in the order of the pairs.
    """
    direction, normal = axes
    side = _components(chosen, np.cross(direction, normal)[row])
    above = side >= 0
    count = above.sum(axis=0)
    cut = np.flatnonzero((count == 1) | (count == 2))
    row, chosen, side = row[cut], chosen[cut], side[:, cut]
    # The corner that is alone on its side of the plane: both edges that the plane cuts start there.
    alone = np.argmax(above[:, cut] == (count[cut] == 1), axis=0)
    y, z = _components(chosen, normal[row]), _components(chosen, direction[row])
    first, second = (_crossing(alone, (alone + k) % 3, side, (y, z)) for k in (1, 2))
    return row, first, second


def _components(chosen: Array, vector: Array) -> Array:
    """Return the components of triangles' corners along one vector each, (3, pairs)."""
    return np.ascontiguousarray(np.einsum("ikj,ij->ki", chosen, vector))


def _crossing(a: Index, b: Index, side: Array, parts: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return where the edges from corner a to corner b cross the plane."""
    column = np.arange(side.shape[1])
    share = side[a, column] / (side[a, column] - side[b, column])
    first, second = ((1 - share) * part[a, column] + share * part[b, column] for part in parts)
    return first, second


def clipped(row: Index, a: tuple[Array, Array], b: tuple[Array, Array], height: Array) -> tuple[Index, Array, Array]:
    """Clip the segments from a to b to 0 < y <= height and return the angles of what is left.

    Parameters
    ----------
    row
        Number of the ray of each segment, (n,).
    a, b
        Components y and z of both ends, (n,) each [m].
    height
        Of the rays, (n,) [m].

    Returns
    -------
    row, low, high
        Numbers of the rays and angles in [-pi/2, pi/2] [rad], of the segments of which something is left.
    """
    (y0, z0), (y1, z1) = a, b
    swap = y0 > y1
    y0, y1, z0, z1 = np.where(swap, y1, y0), np.where(swap, y0, y1), np.where(swap, z1, z0), np.where(swap, z0, z1)
    keep = np.flatnonzero((y0 <= height) & (y1 > 0))
    row, height, y0, y1, z0, z1 = row[keep], height[keep], y0[keep], y1[keep], z0[keep], z1[keep]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(y1 > y0, (z1 - z0) / (y1 - y0), 0.0)
    bottom, top = np.maximum(y0, 0.0), np.minimum(y1, height)
    z_bottom = np.where(y0 < 0, z0 - y0 * slope, z0)
    z_top = np.where(y1 > height, z0 + (height - y0) * slope, z1)
    angle_a, angle_b = np.arctan2(z_bottom, bottom), np.arctan2(z_top, top)
    return row, np.minimum(angle_a, angle_b), np.maximum(angle_a, angle_b)
