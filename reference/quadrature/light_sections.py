# SPDX-License-Identifier: BSD-3-Clause
r"""Sections of area lights for surface points.

The solid angle about any axis through the point is dphi dcos(psi). The
half planes (`half_planes.py`) are about an axis across the way to the light, and the section of a flat light has a
range of cosines. The visible part of the section is exact, by the same intervals as on a ray under
a light: the section is the ray, the point is the light. A sample is drawn evenly in the cosine from
the visible part, and stands for all of it. The sum is therefore over a function of phi and of a
place in the visible part. That function is continuous where the visibility of points is not.

Where the light is seen as a whole, phi is drawn by the length of the range: evenly in the solid
angle (for rectangles Urena, Fajardo, King 2013, An area-preserving parametrization for spherical
rectangles, has this in closed form). In a penumbra the function has kinks, at corners of the light
and where an edge of a shadow meets its outline, and is smooth between: mirrored pairs
(`reference.quadrature.replicates`) have an error of N^-2 there. Sections begin at corners, so phi
drawn by length would behave like the root of the random number at both ends, and pairs would have
an error of N^-3/2. In a penumbra the azimuths of a rectangle are therefore even, and its whole
solid angle, which is known, is a control variate. Behind half a plane before a rectangle, 64 points
in each of eight replicates have an error of 4.9e-3 of a penumbra, 64 sections by length 1.3e-3,
even pairs of them 2.2e-4; 256 sections have 2.4e-4 and 2.4e-5, as root mean squares over seeds.
Sections across an edge of the shadow would have next to no error, but sections along it are visible
as a whole or not at all and have an error of 1/N: hence the axes are turned.

**A sphere** is seen from a point at the distance d from its centre as the disk that its tangents
touch. The disk faces the point at a distance of d - R^2/d and has the radius R sqrt(1 - R^2/d^2).
It fills the same cone of directions, so its sections are those of the sphere, with azimuths that
follow sin(delta) = S sin(g), g even. The solid angle of the cone, 2 pi (1 - sqrt(1 - R^2/d^2)), is
the control variate. The disk is within the sphere: a shape before the disk is before the sphere,
unless it reaches into the sphere. Then, and where a point sees the whole sphere, samples are even
in the cone, and each section is so short that it is seen or not.

**On a mesh** one coordinate of the square chooses a triangle (`reference.quadrature.mesh_choice`),
and the rest of the coordinate serves within the triangle: it has a short section, evenly over the
area.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.half_planes import TINY, axes_about, fan_of
from airlight.reference.quadrature.mesh_choice import Choice, choose_for_points, places_in
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.lit_intervals import IN_PLANE

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_SHORT = 1e-6  # of the radius of a sphere: the length of its short sections
_ALONG = 1e-6  # sine below which a way is along the normal of a triangle


@dataclass(frozen=True)
class Sections:
    """Sections of a light, each with the surface point that looks at it; the mean of their
    weights is what it sees.
    """

    eye: Array  #: the surface point, (n, 3) [m]
    axis: Array  #: unit, in the plane of point and section, (n, 3)
    start: Array  #: (n, 3) [m]
    way: Array  #: from the start to the end, (n, 3) [m]
    weight: Array  #: solid angle for which the whole section stands, (n,) [sr]

    def __getitem__(self, rows) -> "Sections":
        return Sections(*(getattr(self, f.name)[rows] for f in fields(self)))

    def _cosine(self, row: Index, part: Array) -> Array:
        q = self.start[row] + part[:, None] * self.way[row] - self.eye[row]
        return np.sum(q * self.axis[row], axis=1) / np.maximum(np.linalg.norm(q, axis=1), TINY)

    def drawn(self, lit: LitIntervals, uniform: Array) -> tuple[Index, Array, Array]:
        """Return which sections are seen at all, a point in the visible part of each, and
        the solid angle of that part [sr].

        `lit`: what is seen of each section, in fractions of its length; `uniform`: numbers from 0
        to 1, (n,), by which points are drawn.
        """
        every, count = np.arange(len(self.weight)), len(self.weight)
        first, last = (self._cosine(every, np.full(count, end)) for end in (0.0, 1.0))
        # Each visible interval of a section is a range of cosines: its solid angle about the axis.
        low, high = self._cosine(lit.ray, lit.low), self._cosine(lit.ray, lit.high)
        wide = np.abs(high - low)
        below = np.cumsum(wide) - wide
        total = np.bincount(lit.ray, wide, count)
        # A section draws one point, evenly in the cosine over all of its visible intervals. `below`
        # is the sum of the widths before an interval, counted on through all sections: one search
        # finds the interval of every section. The clip keeps it among the section's intervals.
        row = np.flatnonzero(total > 0)
        begin = np.searchsorted(lit.ray, row)
        wanted = below[begin] + uniform[row] * total[row]
        chosen = np.clip(
            np.searchsorted(below, wanted, side="right") - 1,
            begin,
            np.searchsorted(lit.ray, row, "right") - 1,
        )
        cosine = low[chosen] + np.sign(high - low)[chosen] * np.clip(
            wanted - below[chosen], 0.0, wide[chosen]
        )
        sine = np.sqrt(np.maximum((1 - cosine) * (1 + cosine), 0.0))
        # In the plane of point and section: where the direction (cosine, sine) meets the
        # line (z, h) + t (dz, dh).
        axis, way, start = self.axis[row], self.way[row], self.start[row] - self.eye[row]
        end = start + way
        over = end - np.sum(end * axis, axis=1)[:, None] * axis
        over /= np.maximum(np.linalg.norm(over, axis=1), TINY)[:, None]
        z, h, dz, dh = (
            np.sum(a * b, axis=1)
            for a, b in ((start, axis), (start, over), (way, axis), (way, over))
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.nan_to_num((h * cosine - z * sine) / (dz * sine - dh * cosine))
        # Rounding must not move the point into the shadow beside its interval. The weight is the
        # visible fraction of the whole section, and all of the visible part shares one sample.
        part = np.clip(part, lit.low[chosen], lit.high[chosen])
        fraction = total[row] / np.maximum(np.abs(last - first)[row], TINY)
        return row, self.start[row] + part[:, None] * way, fraction * self.weight[row]


def sections_for_points(
    light: ReferenceAreaLight, place: Array, square: Array, turn: float = 0.0, even: bool = False
) -> Sections:
    """Return sections of a light for surface points that lie before it, point by point,
    even in the solid angle.

    `light`: the light; `place`: the points, (points, 3) [m]; `square`: points of the unit square,
    (samples, 2) [1], or of each surface point, (points, samples, 2). Where sections are not short,
    the second number is left for the place in the visible part of a section. `turn`: the angle by
    which the axis is turned about the way to the light [rad]; `even`: for points that see a part of
    the light: rectangles have even azimuths instead of even solid angles, spheres long sections
    instead of short ones.
    """
    if light.kind == "mesh":
        chosen = choose_for_points(light, place, square)
        return _before_triangles(
            chosen, np.repeat(place, square.shape[-2], axis=0), _SHORT * light.radius
        )
    if light.kind == "sphere" and not even:
        return _in_cone(light, place, square)
    way = light.centre - place
    # The side of the light that lies more across the way to it.
    sides = light.frame[:2]
    side = sides[np.argmin(np.abs(way @ sides.T), axis=1)]
    axis = side - (np.sum(side * way, axis=1) / np.sum(way * way, axis=1))[:, None] * way
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    # Turned about the way to the light, the axis stays across it. Sections that follow an edge of a
    # shadow would be seen as a whole or not at all.
    beside = np.cross(way / np.linalg.norm(way, axis=1)[:, None], axis)
    axis = np.cos(turn) * axis + np.sin(turn) * beside
    fan = fan_of(light, axes_about(place, axis, light.centre))

    def span(z0: Array, h0: Array, z1: Array, h1: Array) -> Array:
        return np.abs(_cosine(z1, h1) - _cosine(z0, h0))

    # Where a part of the light is hidden the azimuths are even, for mirrored pairs; else they
    # follow the range of cosines, so that samples are even in the solid angle.
    phi, per_density = fan.even(square[..., 0]) if even else fan.drawn(square[..., 0], span)
    z0, h0, z1, h1 = fan.section(phi)
    start, end = fan.axes.point(z0, h0, phi), fan.axes.point(z1, h1, phi)
    return _sections(place, axis[:, None], start, end - start, span(z0, h0, z1, h1) * per_density)


def solid_angle(light: ReferenceAreaLight, place: Array) -> Array:
    """Return the solid angle of a sphere, or of a rectangle by its corners, from points
    before it [sr].
    """
    if light.kind == "sphere":
        return 2 * np.pi * _one_minus_cosine(light, np.linalg.norm(place - light.centre, axis=1))
    x, y, z = ((place - light.centre) @ light.frame.T).T
    total = np.zeros(len(place))
    # The solid angle of a rectangle is a sum over its corners, with alternating signs, of the solid
    # angle of the rectangle between a corner and the foot of the point.
    for sign, a, b in ((1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)):
        across, up = a * light.half[0] - x, b * light.half[1] - y
        total += sign * np.arctan2(across * up, z * np.sqrt(across**2 + up**2 + z**2))
    return total


def _sections(eye: Array, axis: Array, start: Array, way: Array, weight: Array) -> Sections:
    """Return sections in rows, from arrays by surface point and sample."""
    eye, axis = (np.broadcast_to(part, start.shape).reshape(-1, 3) for part in (eye[:, None], axis))
    weight = np.broadcast_to(weight, start.shape[:2]).ravel()
    return Sections(eye, axis, start.reshape(-1, 3), way.reshape(-1, 3), weight)


def _cosine(z: Array, h: Array) -> Array:
    return z / np.maximum(np.hypot(z, h), TINY)


def _before_triangles(chosen: Choice, eye: Array, length: float) -> Sections:
    """Return short sections of triangles, across the way to points; without
    weight for points behind them.
    """
    start = places_in(chosen.corners, chosen.square)
    way = eye - start
    above = np.sum(way * chosen.normal, axis=1)
    # A point in the plane of a triangle, to rounding, sees nothing of it, and would find a section
    # of any visibility.
    largest = np.maximum(np.abs(start), np.abs(eye)).max(axis=1, initial=0.0)
    sees = above > IN_PLANE * largest
    weight = np.where(
        sees, chosen.area * above / np.linalg.norm(way, axis=1) ** 3 / chosen.chance, 0.0
    )
    across = np.cross(chosen.normal, way)
    size = np.linalg.norm(across, axis=1)[:, None]
    side = chosen.corners[:, 1] - chosen.corners[:, 0]
    # Before the middle of its triangle a point looks along the normal, and no direction is across
    # both: a side of the triangle serves.
    along = size > _ALONG * np.linalg.norm(way, axis=1)[:, None]
    across = np.where(
        along, across / np.maximum(size, TINY), side / np.linalg.norm(side, axis=1)[:, None]
    )
    return Sections(eye, across, start, length * across, weight)


def _in_cone(light: ReferenceAreaLight, place: Array, square: Array) -> Sections:
    """Return short sections of a sphere for points outside of it, even in the cone of
    directions that meet it.
    """
    way = light.centre - place
    d = np.linalg.norm(way, axis=1)[:, None]
    axis = way / d
    helper = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])
    helper /= np.linalg.norm(helper, axis=1)[:, None]
    # Even in the solid angle: even in the cosine to the axis, from the rim of the cone to 1. The
    # numbers are kept as one minus the cosine, which has digits for a far sphere.
    span = _one_minus_cosine(light, d)
    down = square[..., 0] * span
    cosine, sine = 1 - down, np.sqrt(down * (2 - down))
    turn = 2 * np.pi * square[..., 1]
    helper, other = helper[:, None], np.cross(axis, helper)[:, None]
    direction = cosine[..., None] * axis[:, None] + sine[..., None] * (
        np.cos(turn)[..., None] * helper + np.sin(turn)[..., None] * other
    )
    # The nearer of the two crossings of the direction with the sphere; at the rim the chord is
    # zero.
    half = np.sqrt(np.maximum((light.radius - d * sine) * (light.radius + d * sine), 0.0))
    start = place[:, None] + (d * cosine - half)[..., None] * direction
    around = (
        np.cos(turn)[..., None] * other - np.sin(turn)[..., None] * helper
    )  # along the sphere, across the direction
    return _sections(place, around, start, _SHORT * light.radius * around, 2 * np.pi * span)


def _one_minus_cosine(light: ReferenceAreaLight, d: Array) -> Array:
    """Return one minus the cosine of the half angle of the cone that a sphere fills, by
    the distance to its centre.
    """
    ratio = np.minimum(light.radius / d, 1.0)
    # 1 - cos = sin^2 / (1 + cos): no digits cancel for a far sphere.
    return ratio**2 / (1 + np.sqrt((1 - ratio) * (1 + ratio)))


def to_sphere(light: ReferenceAreaLight, way: Array, towards: Array) -> Array:
    """Return how far a sphere is in unit directions that meet it, `way` from its
    centre, (n, 3) each [m].

    Directions to the rim of the disk that the tangents touch may miss the sphere by
    rounding: they go to the tangent.
    """
    near = -np.sum(way * towards, axis=1)
    beside = np.linalg.norm(way + near[:, None] * towards, axis=1)
    return near - np.sqrt(np.maximum((light.radius - beside) * (light.radius + beside), 0.0))
