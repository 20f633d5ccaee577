# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals of camera rays by exact geometry for a directional light: as `triangles` and `spheres` do for others.

In the plane of a ray and the direction to the light (`reference.visibility.parallel_rays`) what lies at (z, y), y >= 0,
is on the leg of the point x = z - y c/s of the ray, and what lies at y < 0 is on none.

**Triangles** cut the plane in segments. The map is linear: a segment, clipped to y >= 0, hides from the light what lies
between the images of its ends.

**Spheres** cut it in disks, of the centre (c_z, c_y) and the radius rho. What the disk hides is all from which a leg
meets it; the part of the disk in y >= 0 is convex, and so is its image, one interval. Legs keep their distance
q = z s - y c from the one through the camera, x = q/s. The largest q of the disk, q_c + rho, is that of the tangent,
which touches at y = c_y - rho c, the smallest, q_c - rho, at y = c_y + rho c. Each counts if it touches at y > 0;
otherwise the interval ends where the ray itself leaves or enters the disk, at c_z +- sqrt(rho^2 - c_y^2). Nothing is
hidden if c_y + rho <= 0.

All planes hold the line through the camera towards the light, as all planes of a point light hold that to the light.
So the same bounds, in azimuth about that line and in the angle from it at the camera, leave few triangles for each ray;
the third is the distance from the line, x s at the end of a ray.
"""

import numpy as np
from numpy.typing import NDArray

from reference.scene.shapes import Shapes
from reference.visibility.intervals import LitIntervals
from reference.visibility.line_crossings import half_chord
from reference.visibility.parallel_rays import ParallelRays
from reference.visibility.spheres import Shadows
from reference.visibility.triangles import (
    EXACT_EDGE,
    RAYS,
    SLACK,
    Reaches,
    angle_below,
    axis_frame,
    azimuths,
    lit_of_chunk,
    near_pairs,
    plane_sections,
    spheres_around,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def parallel_intervals(rays: ParallelRays, shapes: Shapes) -> LitIntervals:
    """Find the lit intervals of camera rays, exactly.

    Parameters
    ----------
    rays
        The rays and between which distances they are looked at.
    shapes
        What hides the light; only triangles and spheres are looked at.

    Returns
    -------
    LitIntervals
        Shares of the way from `rays.first` to `rays.last`.

    Notes
    -----
    Valid for opaque triangles and spheres, wherever they are; touching triangles share the coordinates of their
    vertices.
    """
    corners = shapes.triangles - rays.origin
    spheres = shapes.centre - rays.origin, shapes.radius
    used = np.flatnonzero(rays.last > rays.first)
    if not len(used):
        return LitIntervals(used, np.empty(0), np.empty(0), 0, edge=EXACT_EDGE)
    frame = axis_frame(rays.to_light[used[0]])
    reaches = _reaches(corners, frame)
    away = rays.sine[:, None] * rays.direction - rays.cosine[:, None] * rays.across  # from the axis, in each plane
    azimuth = np.arctan2(away[used] @ frame[2], away[used] @ frame[1])
    order = np.argsort(azimuth, kind="stable")
    parts = []
    for start in range(0, len(used), RAYS):
        chosen = order[start : start + RAYS]
        mine = used[chosen]
        at_camera = np.arctan2(rays.sine[mine], rays.cosine[mine]) + SLACK
        at_end = rays.last[mine] * rays.sine[mine]
        pairs = near_pairs(azimuth[chosen], (at_camera, at_end), reaches)
        hidden = _triangle_shadows(corners, rays, mine, pairs), _sphere_shadows(spheres, rays, mine)
        row, begin, end = (np.concatenate(both) for both in zip(*hidden, strict=True))
        parts.append(lit_of_chunk((row, begin, end), (rays.first, rays.last), mine))
    ray, low, high = (np.concatenate([part[i] for part in parts]) for i in range(3))
    by_ray = np.lexsort((low, ray))
    ray, low, high = ray[by_ray].astype(np.int64), low[by_ray], high[by_ray]
    transitions = int(np.sum(low > rays.first[ray]) + np.sum(high < rays.last[ray]))
    length = rays.last[ray] - rays.first[ray]
    shares = (low - rays.first[ray]) / length, (high - rays.first[ray]) / length
    return LitIntervals(ray, *shares, transitions, edge=EXACT_EDGE)


def _reaches(corners: Array, frame: Array) -> Reaches:
    """Bound triangles, given relative to the camera, in azimuth, angle from the light, and distance from the axis."""
    centre, radius = spheres_around(corners)
    distance = np.linalg.norm(centre @ frame[1:].T, axis=1)
    slack = SLACK * (np.abs(corners).max(axis=(1, 2), initial=0) + 1)
    return Reaches(*azimuths(corners, frame), angle_below(centre, radius, frame[0]) - SLACK, distance - radius - slack)


def _triangle_shadows(corners: Array, rays: ParallelRays, mine: Index, pairs: tuple[Index, Index]) -> Shadows:
    """Return rows of `mine` and the intervals of the distance that triangles hide there."""
    row, (y0, z0), (y1, z1) = plane_sections(corners, (rays.direction[mine], rays.across[mine]), pairs)
    keep = np.flatnonzero(np.maximum(y0, y1) > 0)
    row, y0, z0, y1, z1 = row[keep], y0[keep], z0[keep], y1[keep], z1[keep]
    slope = (rays.cosine / rays.sine)[mine][row]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_ray = z0 - y0 * ((z1 - z0) / (y1 - y0))  # where the segment crosses the ray, if it does
    begin = np.where(y0 < 0, on_ray, z0 - y0 * slope)
    end = np.where(y1 < 0, on_ray, z1 - y1 * slope)
    return row, np.minimum(begin, end), np.maximum(begin, end)


def _sphere_shadows(spheres: tuple[Array, Array], rays: ParallelRays, mine: Index) -> Shadows:
    """Return rows of `mine` and the intervals of distance that spheres hide there; centres relative to the camera."""
    centre, radius = spheres
    side = np.cross(rays.direction[mine], rays.across[mine]) @ centre.T
    row, sphere = np.nonzero(np.abs(side) < radius)
    disk = half_chord(radius[sphere], np.abs(side[row, sphere]))
    c_z = np.einsum("ij,ij->i", rays.direction[mine][row], centre[sphere])
    c_y = np.einsum("ij,ij->i", rays.across[mine][row], centre[sphere])
    dark = np.flatnonzero(c_y + disk > 0)
    row, disk, c_z, c_y = row[dark], disk[dark], c_z[dark], c_y[dark]
    sine, cosine = rays.sine[mine][row], rays.cosine[mine][row]
    chord = half_chord(disk, np.abs(c_y))
    ends = []
    for sign in (-1, 1):
        touches = c_y - sign * disk * cosine > 0
        ends.append(np.where(touches, c_z - c_y * cosine / sine + sign * disk / sine, c_z + sign * chord))
    return row, ends[0], ends[1]
