# SPDX-License-Identifier: BSD-3-Clause
"""An oracle of light volumes: the same height field met by the same rays, in float64,
one line after the other.

`realtime.shadow_maps.shadow_map` says what a shadow map holds and
`realtime.shadow_maps.inverse_depth_field` what height field it makes: linear in s = 1 / planar
depth over the halves of the texels of a face, lit where the s of a point is above it. The oracle
takes only the distances of the map; the rest is derived again here, in other variables than in the
methods.

**The ray.** Let n be the unit vector from the light to the foot point of a ray, w its direction,
theta the angle at the light (`analytic.geometry`). The point at theta is h n + h tan(theta) w away
from the light: the direction there is

    d(theta) = cos(theta) n + sin(theta) w,        of unit length, as n is perpendicular to w,

and its distance h / cos(theta). With (a, b, c) the coordinates of d in a face, which are sums of
cos(theta) and sin(theta) too,

    u = a / c,      v = b / c,      s = cos(theta) / (h c),

finite at every theta, even at the end of an unbounded ray, theta = pi/2.

**The lines.** The borders of texels and their diagonals are lines p a + q b + r c = 0, so a ray
meets each of them once, where A cos(theta) + B sin(theta) = 0. All of a face's lines are solved
for, whether they count or not, clipped to the part of the ray that lies in the face, and sorted:
between two neighbours the ray stays within one triangle.

**The crossings.** Over one triangle the height is linear in (u, v), so that c times it is
linear in (a, b, c), and

    f(theta) = h c (s - height) = cos(theta) - h c height(u, v)

is one sum of cos(theta) and sin(theta). From f1 and f2 at theta1 and theta1 + delta follows

    f(theta1 + e) sin(delta) = f1 sin(delta - e) + f2 sin(e),

which changes sign once at most, where tan(e) = f1 sin(delta) / (f1 cos(delta) - f2).

The lit parts of a ray, clipped to faces and cones of spots, are integrated like the lit intervals
of the reference (`reference.quadrature.intervals`): the oracle differs from the reference only by
the errors of the shadow map.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.methods.light_volumes.jump_search import with_walls
from airlight.realtime.scene.read_scene import Scene
from airlight.realtime.shadow_maps.inverse_depth_field import inverse_depth_field
from airlight.realtime.shadow_maps.shadow_map import ShadowMap
from airlight.reference.quadrature.light_airlight import lit_sums
from airlight.reference.quadrature.model_terms import route_of
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.distances import exact_distance
from airlight.reference.visibility.planes import Rays, cone_interval, rays_at
from tests.evidence.oracles.height_field import (
    Array,
    HeightField,
    Index,
    Path,
    by_ray,
    height_field,
    zero_angle,
)
from tests.evidence.oracles.upright_walls import walled_parts

_CHUNK = 1 << 20  # crossings of rays and lines looked at together: 8 MB an array


def traced_walls(scene: Scene, shadow_maps: Sequence[ShadowMap]) -> list[NDArray[np.uint32]]:
    """Return by light the walls that its rays find between the samples of its
    map, for `oracle_airlight`.
    """
    pairs = zip(shadow_maps, scene.lights, strict=True)
    return [
        np.array(with_walls(inverse_depth_field(shadow_map), scene.geometry, light).walls)
        for shadow_map, light in pairs
    ]


def oracle_airlight(
    reference: ReferenceScene,
    shadow_maps: Sequence[ShadowMap],
    *,
    distance: Array | None = None,
    walls: Sequence[NDArray[np.uint32]] | None = None,
) -> Array:
    """Return the airlight that shadow maps stand for.

    Valid for rays that miss the lights; a ray through one has an infinite airlight, whatever
    hides the light beyond it.
    """
    if reference.media:
        raise InputError(
            f"medium '{reference.media[0].name}' has bounds; expected one medium without bounds"
        )
    if len(shadow_maps) != len(reference.lights):
        raise InputError(
            f"got {len(shadow_maps)} shadow maps for {len(reference.lights)} lights; expected one "
            "for each"
        )
    if distance is None:
        hits = surface_hits(reference)
        distance = exact_distance(reference, hits.interaction, hits.distance)
    total = np.zeros((len(reference.direction), 3))
    for number, (light, shadow_map) in enumerate(zip(reference.lights, shadow_maps, strict=True)):
        rays, ends = _rays_of(reference, light, np.reshape(distance, -1))
        lit = volume_intervals(
            height_field(shadow_map, walls[number] if walls else None), rays, ends
        )
        route = route_of(reference, np.reshape(distance, -1))
        total += lit_sums(reference, light, rays, lit, route)[0]
    return total.reshape(reference.height, reference.width, 3)


def _rays_of(
    reference: ReferenceScene, light: ReferenceLight, distance: Array
) -> tuple[Rays, tuple[Array, Array]]:
    """Return the rays and the angles between which they can be lit: up to
    the surface, in the cone.
    """
    rays = rays_at(reference.origin, reference.direction, light.position)
    cone = cone_interval(rays, light, light.cutoff)
    return rays, (np.maximum(rays.theta(0.0), cone[0]), np.minimum(rays.theta(distance), cone[1]))


def volume_intervals(field: HeightField, rays: Rays, ends: tuple[Array, Array]) -> LitIntervals:
    """Return the lit parts of rays, cut where they go from one face to the next."""
    parts: list[tuple[Index, Array, Array]] = [(np.empty(0, np.int64), np.empty(0), np.empty(0))]
    for face, matrix in enumerate(field.coordinates):
        normal, direction = rays.normal @ matrix.T, rays.direction @ matrix.T
        low, high = _within_face(face, normal, direction, ends) if field.is_cube else ends
        inside = np.flatnonzero(high > low)
        step = max(1, _CHUNK // (4 * field.size))
        for first in range(0, len(inside), step):
            some = inside[first : first + step]
            path = Path(normal[some], direction[some], rays.height[some])
            within = field, face, path, (low[some], high[some])
            if field.walls is None:
                row, begin, end = _lit_parts(*within)
            else:
                row, begin, end = walled_parts(*within, high[some] == ends[1][some])
            parts.append((some[row], begin, end))
    ray, low, high = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((low, ray))
    ray, ends = ray[order], (low[order], high[order])
    return LitIntervals(ray, *(rays.distance(end, ray) for end in ends), len(ray), 0.0)


def _within_face(
    face: int, normal: Array, direction: Array, ends: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return where rays are within |a| <= c, |b| <= c: four times where a cosine of
    theta - middle is positive.

    Where that is 0 at every theta, the ray stays on the border with the face of another axis,
    and the first axis has it.
    """
    axis = face // 2
    low, high = ends
    for across_axis in (0, 1):
        for sign in (-1.0, 1.0):
            across, along = (
                normal[:, 2] + sign * normal[:, across_axis],
                direction[:, 2] + sign * direction[:, across_axis],
            )
            middle = np.arctan2(along, across)
            low, high = (
                np.maximum(low, middle - 0.5 * np.pi),
                np.minimum(high, middle + 0.5 * np.pi),
            )
            if (axis + 1 + across_axis) % 3 < axis:
                high = np.where((across == 0) & (along == 0), low, high)
    return low, high


def _lit_parts(
    field: HeightField, face: int, path: Path, ends: tuple[Array, Array]
) -> tuple[Index, Array, Array]:
    """Return the rays and the angles at both ends of what is lit between
    two angles within a face.
    """
    low, high = ends[0][:, None], ends[1][:, None]
    lines = _lines(field.size).T
    theta = np.sort(
        np.clip(zero_angle(path.normal @ lines, path.direction @ lines), low, high), axis=1
    )
    theta = np.concatenate([low, theta, high], axis=1)
    f = _above(field, face, path, theta)
    lit = f >= 0
    row, column = np.nonzero(lit[:, 1:] != lit[:, :-1])
    f1, f2 = np.abs(f[row, column]), np.abs(f[row, column + 1])  # of opposite signs
    delta = theta[row, column + 1] - theta[row, column]
    crossing = theta[row, column] + np.arctan2(f1 * np.sin(delta), f1 * np.cos(delta) + f2)
    # Beginnings and ends of the intervals of a ray take turns, so that both lists
    # go by the same intervals.
    opens = lit[row, column + 1]
    first, last = np.flatnonzero(lit[:, 0]), np.flatnonzero(lit[:, -1])
    ray, begin = by_ray(first, ends[0][first], row[opens], crossing[opens])
    _, end = by_ray(last, ends[1][last], row[~opens], crossing[~opens])
    return ray, begin, end


def _lines(size: int) -> Array:
    """Return (p, q, r) of all lines p a + q b + r c = 0 that bound triangles, (4 size + 1, 3).

    In texels, x = (u + 1) size/2 and y = (v + 1) size/2, they are x = i, y = i and
    the diagonals x - y = i.
    """
    half, border, diagonal = 0.5 * size, np.arange(size + 1.0), np.arange(1.0 - size, size)
    rows = (
        np.stack(np.broadcast_arrays(p, q, r), axis=1)
        for p, q, r in (
            (half, 0.0, half - border),
            (0.0, half, half - border),
            (half, -half, -diagonal),
        )
    )
    return np.concatenate(list(rows))


def _above(field: HeightField, face: int, path: Path, theta: Array) -> Array:
    """Return f, the s of the points at theta above the height field there, times h c."""
    size = field.size
    cosine, sine = np.cos(theta), np.sin(theta)
    a, b, c = (
        cosine * path.normal[:, i, None] + sine * path.direction[:, i, None] for i in range(3)
    )
    x, y = (0.5 * size * (coordinate / c + 1) for coordinate in (a, b))
    column, row = (
        np.clip(np.floor(coordinate), 0, size - 1).astype(np.int64) for coordinate in (x, y)
    )
    x, y = x - column, y - row
    corner = row * (size + 1) + column
    s00, s10, s01, s11 = (
        np.take(field.heights[face], corner + step) for step in (0, 1, size + 1, size + 2)
    )
    height = s00 + np.where(
        x >= y, x * (s10 - s00) + y * (s11 - s10), y * (s01 - s00) + x * (s11 - s01)
    )
    return cosine - path.height[:, None] * c * height
