# SPDX-License-Identifier: BSD-3-Clause
r"""Samples of area lights: points of the light that suit one ray, and sections
that suit one surface point.

**Along a ray.** A point y of the light at the height h over the ray sends J(y) into it, which grows
like 1/h: points drawn evenly on the light leave a peak next to the light that no number of points
resolves. In half planes about the ray, with phi the azimuth of such a half plane and l the arc
length along the curve in which it cuts the light,

    dA = h dphi dl / n_in,        n_in the length of the part of the normal within the half plane,

and h J(y) is bounded however close the ray passes: without extinction an unbounded ray receives
(1 + cos) n_in from y, with cos the cosine of the angle in the half plane between normal and ray.
Samples are therefore drawn by phi and l. These are polar coordinates about the ray, the same for
all of its points, with the lit intervals of one point light.

A half plane cuts a rectangle, a triangle and a disk in a segment, a sphere of radius R in a circle
of radius rho. There dA = R h dphi db with the angle b on the circle. The azimuths of a disk or
sphere that the line of the ray misses are those of the quadratic form

    e^T M e <= 0,     M = c c^T - R^2 (1 - n n^T)     (a sphere: n = 0),

e the unit normal of the half plane, c the way from the ray to the centre. Its eigenvalues are
-a <= 0 < b. With the angle delta from the middle, half the chord is proportional to sqrt(S^2 -
sin^2(delta)), S^2 = a/(a + b); with sin(delta) = S sin(g) that is a smooth function of g and
periodic, and so is all that is computed from it; samples are even in g. A line that meets the light
has all azimuths, and samples that are even in phi. For a polygon phi follows the length of the
section, which is tabulated: the density is linear between nodes, at corners of the light and
between them, and the density itself weights a sample, so that the table costs no accuracy.

**From a surface point.** The solid angle about any axis through the point is dphi dcos(psi). The
half planes are now about an axis across the way to the light, and the section of a flat light has a
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
and the rest of the coordinate serves within the triangle: along rays as above in one that is near,
evenly over its area in others. For surface points each has a short section, evenly over the area.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.mesh_choice import (
    Choice,
    choose_for_points,
    choose_for_rays,
    places_in,
)
from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.lit_intervals import IN_PLANE

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_ASIDE = 1e-6  # of a cell: how far from its ends its density is looked up
_TINY = 1e-300
_SHORT = 1e-6  # of the radius of a sphere: the length of its short sections


@dataclass(frozen=True)
class LightSamples:
    """Samples of a light for each of some rays; the mean over them of weight times f is
    the integral over the area.
    """

    place: Array  #: (rays, samples, 3) [m]
    normal: Array  #: unit, of the side that emits, (rays, samples, 3)
    weight: Array  #: dA [m^2], (rays, samples)

    def flat(self) -> tuple[Array, Array, Array]:
        """Return place, normal and weight of all pairs of ray and sample, ray by ray."""
        return self.place.reshape(-1, 3), self.normal.reshape(-1, 3), self.weight.ravel()


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
        return np.sum(q * self.axis[row], axis=1) / np.maximum(np.linalg.norm(q, axis=1), _TINY)

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
        over /= np.maximum(np.linalg.norm(over, axis=1), _TINY)[:, None]
        z, h, dz, dh = (
            np.sum(a * b, axis=1)
            for a, b in ((start, axis), (start, over), (way, axis), (way, over))
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.nan_to_num((h * cosine - z * sine) / (dz * sine - dh * cosine))
        # Rounding must not move the point into the shadow beside its interval. The weight is the
        # visible fraction of the whole section, and all of the visible part shares one sample.
        part = np.clip(part, lit.low[chosen], lit.high[chosen])
        fraction = total[row] / np.maximum(np.abs(last - first)[row], _TINY)
        return row, self.start[row] + part[:, None] * way, fraction * self.weight[row]


@dataclass(frozen=True)
class _Axes:
    """An axis for each row, and the light's centre seen along it: the centre has the azimuth 0."""

    origin: Array  # (rows, 3)
    axis: Array  # unit, (rows, 3)
    up: Array  # unit, across the axis towards the centre
    side: Array  # unit, across both
    along: Array  # of the centre, (rows,)
    height: Array  # of the centre over the axis, (rows,)

    def components(self, vector: Array) -> Array:
        """Return the components of vectors, (rows, k, 3), along axis, up and side."""
        return np.stack(
            [np.einsum("rki,ri->rk", vector, part) for part in (self.axis, self.up, self.side)],
            axis=-1,
        )

    def point(self, z: Array, h: Array, phi: Array) -> Array:
        """Return the points at z along the axis, h over it, and the
        azimuth phi, (rows, k, 3) [m].
        """
        across = (
            np.cos(phi)[..., None] * self.up[:, None] + np.sin(phi)[..., None] * self.side[:, None]
        )
        return self.origin[:, None] + z[..., None] * self.axis[:, None] + h[..., None] * across


def _axes(origin: Array, axis: Array, centre: Array) -> _Axes:
    origin = np.broadcast_to(origin, axis.shape)
    way = centre - origin
    along = np.sum(way * axis, axis=1)
    away = way - along[:, None] * axis
    height = np.linalg.norm(away, axis=1)
    helper = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])
    # A centre on the axis, to rounding, has no direction from it: any direction across the axis
    # then serves as the azimuth 0, and the height is 0.
    far = height > 1e-12 * np.linalg.norm(way, axis=1)
    up = np.where(far[:, None], away, helper)
    # Rounding leaves a part along the axis, which is large beside a centre close to the axis.
    up -= np.sum(up * axis, axis=1)[:, None] * axis
    up /= np.linalg.norm(up, axis=1)[:, None]
    return _Axes(origin, axis, up, np.cross(axis, up), along, np.where(far, height, 0.0))


def samples_for_rays(
    light: ReferenceAreaLight, origin: Array, direction: Array, distance: Array, square: Array
) -> LightSamples:
    """Return samples of a light for the airlight of rays.

    `light`: the light; `origin`, `direction`, `distance`: of the rays: where they start, (3,) [m],
    unit vectors, (rays, 3), and how far they go, (rays,) [m]; `square`: points of the unit square,
    (samples, 2) [1], or of each ray, (rays, samples, 2).
    """
    if light.kind == "mesh":
        return _on_triangles(
            choose_for_rays(light, origin, direction, distance, square), origin, direction
        )
    axes = _axes(origin, direction, light.centre)
    if light.kind == "sphere":
        return _on_sphere(light, axes, distance, square)
    place, weight = _on_flat(_fan(light, axes), square)
    return LightSamples(place, np.broadcast_to(light.normal, place.shape), weight)


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
    fan = _fan(light, _axes(place, axis, light.centre))

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
    return z / np.maximum(np.hypot(z, h), _TINY)


# --- Flat lights: a half plane cuts them in a segment ---


@dataclass(frozen=True)
class _Fan:
    """The sections of a flat light by half planes about axes."""

    axes: _Axes
    corners: Array | None  # of a polygon, along axis, up and side, (rows, k, 3); None for a disk
    normal: Array  # of the light, along the same, (rows, 3)
    radius: Array  # of a disk, (rows,) [m]
    cells: int = 8  # of the table of sections between two corners

    def section(self, phi: Array) -> tuple[Array, Array, Array, Array]:
        """Return z and h of both ends of the sections at azimuths, (rows, k) each; without
        length where there is none.

        The end that is closer to the axis comes first.
        """
        z0, h0, z1, h1 = self._polygon(phi) if self.corners is not None else self._disk(phi)
        # The half plane ends at the axis. If a section crosses the axis, its part on the other
        # side, h < 0, belongs to the azimuth phi + pi: cut it at h = 0. A section that lies there
        # as a whole gets no length.
        swap = h0 > h1
        z0, z1, h0, h1 = (
            np.where(swap, z1, z0),
            np.where(swap, z0, z1),
            np.where(swap, h1, h0),
            np.where(swap, h0, h1),
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            on_axis = z0 - h0 * (z1 - z0) / (h1 - h0)
        behind = (h0 < 0) & (h1 > 0)
        z0, h0 = np.where(behind, on_axis, z0), np.where(behind, 0.0, h0)
        none = h1 <= 0
        return np.where(none, z1, z0), np.maximum(h0, 0.0), z1, np.maximum(h1, 0.0)

    def _polygon(self, phi: Array) -> tuple[Array, Array, Array, Array]:
        assert self.corners is not None
        sine, cosine = np.sin(phi)[..., None], np.cos(phi)[..., None]
        z = np.broadcast_to(self.corners[:, None, :, 0], (*phi.shape, self.corners.shape[1]))
        a, b = self.corners[:, None, :, 1], self.corners[:, None, :, 2]
        # Turn the corners into the half plane: `h` is in it, `beside` across it.
        beside, h = b * cosine - a * sine, a * cosine + b * sine
        after = [np.roll(part, -1, axis=-1) for part in (beside, h, z)]
        # The outline crosses the plane where two corners in a row lie on different sides. A convex
        # polygon has two such sides or none; without one both ends are the same point, and the
        # section has no length.
        cut = (beside >= 0) != (after[0] >= 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            fraction = np.where(cut, beside / (beside - after[0]), 0.0)
        h, z = h + fraction * (after[1] - h), z + fraction * (after[2] - z)
        first = np.argmax(cut, axis=-1)[..., None]
        last = cut.shape[-1] - 1 - np.argmax(cut[..., ::-1], axis=-1)[..., None]
        last = np.where(cut.any(axis=-1, keepdims=True), last, first)
        z0, h0, z1, h1 = (
            np.take_along_axis(part, end, axis=-1)[..., 0]
            for end in (first, last)
            for part in (z, h)
        )
        return z0, h0, z1, h1

    def _disk(self, phi: Array) -> tuple[Array, Array, Array, Array]:
        n_w, n_u, n_v = (self.normal[:, k, None] for k in range(3))
        sine, cosine = np.sin(phi), np.cos(phi)
        # The normal of the disk in the half plane, `n_w` and `n_d`, and across it, `n_e`.
        n_d, n_e = n_u * cosine + n_v * sine, n_v * cosine - n_u * sine
        within = np.maximum(1 - n_e**2, _TINY)
        height = self.axes.height[:, None]
        beside = -height * sine  # of the centre from the half plane
        # The line in which both planes meet is beside / sqrt(within) from the centre; Pythagoras
        # gives half the chord. The line has the direction (-n_d, n_w) / sqrt(within), and `half`
        # contains the division by that root.
        half = np.sqrt(np.maximum(self.radius[:, None] ** 2 - beside**2 / within, 0.0) / within)
        z = self.axes.along[:, None] + beside * n_e * n_w / within
        h = height * cosine + beside * n_e * n_d / within
        return z - half * n_d, h + half * n_w, z + half * n_d, h - half * n_w

    def even(self, uniform: Array) -> tuple[Array, Array]:
        """Return azimuths, (rows, k), even or by the smooth map of a disk,
        and one over their density.
        """
        if self.corners is None:
            spread = _spread(self.axes.height, self.radius, self.normal[:, 1:])
            return spread.azimuth(
                np.broadcast_to(uniform, (len(self.axes.along), uniform.shape[-1]))
            )
        ends = self._breaks()[:, [0, -1]]
        width = np.diff(ends, axis=1)
        return ends[:, :1] + width * uniform, width

    def drawn(self, uniform: Array, length) -> tuple[Array, Array]:
        """Return azimuths, of a polygon by the length of the sections, (rows, k),
        and one over their density.

        `uniform`: numbers from 0 to 1, (k,), or (rows, k); `length`: (z0, h0, z1, h1) -> what
        the density is to follow.
        """
        if self.corners is None:
            return self.even(uniform)
        phi, density = _by_table(self._breaks(), lambda phi: length(*self.section(phi)), uniform)
        return phi, 1 / density

    def _breaks(self) -> Array:
        """Return the azimuths of the corners of a polygon, and of nodes
        between them, (rows, nodes).
        """
        assert self.corners is not None
        a, b = self.corners[..., 1], self.corners[..., 2]
        # The polygon surrounds the axis if all corners follow each other in one sense: azimuths
        # then go around. Else they go from the first corner to the last one.
        turn = a * np.roll(b, -1, axis=1) - b * np.roll(a, -1, axis=1)
        around = (turn > 0).all(axis=1) | (turn < 0).all(axis=1)
        # Seen from the centre's azimuth, 0, a polygon beside the axis lies within half a turn to
        # either side, so that the sorted azimuths of its corners need no unwrapping.
        azimuth = np.sort(np.arctan2(b, a), axis=1)
        last = np.where(around, azimuth[:, 0] + 2 * np.pi, azimuth[:, -1])
        breaks = np.concatenate([azimuth, last[:, None]], axis=1)
        part = np.arange(self.cells) / self.cells
        nodes = breaks[:, :-1, None] + np.diff(breaks, axis=1)[..., None] * part
        return np.concatenate([nodes.reshape(len(a), -1), last[:, None]], axis=1)


def _fan(light: ReferenceAreaLight, axes: _Axes) -> _Fan:
    rows = len(axes.along)
    normal, radius = np.broadcast_to(light.normal, (rows, 1, 3)), np.full(rows, light.radius)
    if light.kind == "sphere":  # the disk that the tangents touch
        way = light.centre - axes.origin
        d = np.linalg.norm(way, axis=1)
        ratio = np.minimum(light.radius / d, 1.0)
        normal, radius = (
            -(way / d[:, None])[:, None],
            light.radius * np.sqrt((1 - ratio) * (1 + ratio)),
        )
        axes = _axes(
            axes.origin, axes.axis, axes.origin + ((1 - ratio) * (1 + ratio))[:, None] * way
        )
    normal = axes.components(normal)[:, 0]
    if light.kind != "rectangle":
        return _Fan(axes, None, normal, radius)
    corners = light.corners - axes.origin[:, None]
    return _Fan(axes, axes.components(corners), normal, radius)


def _on_flat(fan: _Fan, square: Array) -> tuple[Array, Array]:
    """Return samples by azimuth and by the place in the section, and the
    areas for which they stand.
    """
    phi, per_density = fan.drawn(square[..., 0], lambda z0, h0, z1, h1: np.hypot(z1 - z0, h1 - h0))
    z0, h0, z1, h1 = fan.section(phi)
    part = square[..., 1]
    z, h = z0 + part * (z1 - z0), h0 + part * (h1 - h0)
    # dA = h dphi dl / n_in: `across` is the component of the normal along the normal of the half
    # plane, and `within`, n_in, the length of the rest of the normal.
    across = -fan.normal[:, 1:2] * np.sin(phi) + fan.normal[:, 2:] * np.cos(phi)
    within = np.sqrt(np.maximum((1 - across) * (1 + across), 0.0))
    weight = h * np.hypot(z1 - z0, h1 - h0) * per_density / np.maximum(within, _TINY)
    return fan.axes.point(z, h, phi), weight


# --- Meshes ---


def _on_triangles(chosen: Choice, origin: Array, direction: Array) -> LightSamples:
    """Return samples of a mesh for rays: of triangles that are near as of a flat
    light, of others evenly.
    """
    rows = len(direction)
    # Far triangles: a point anywhere stands for the area.
    place, weight = places_in(chosen.corners, chosen.square), chosen.area.copy()
    near = np.flatnonzero(chosen.near)
    if len(near):
        corners = chosen.corners[near]
        # Near ones: each sample is a row with its own axis along its ray and its own fan of
        # sections.
        axes = _axes(
            origin, np.repeat(direction, len(weight) // rows, axis=0)[near], corners.mean(axis=1)
        )
        normal = axes.components(chosen.normal[near, None])[:, 0]
        radius = np.zeros(len(near))
        # A table that serves a single sample has two cells between corners.
        fan = _Fan(axes, axes.components(corners - axes.origin[:, None]), normal, radius, cells=2)
        samples = _on_flat(fan, chosen.square[near, None])
        place[near], weight[near] = (part[:, 0] for part in samples)
    shape = rows, -1, 3
    return LightSamples(
        place.reshape(shape),
        chosen.normal.reshape(shape),
        (weight / chosen.chance).reshape(rows, -1),
    )


def _before_triangles(chosen: Choice, eye: Array, length: float) -> Sections:
    """Return short sections of triangles, across the way to points; without
    weight for points behind them.
    """
    start = places_in(chosen.corners, chosen.square)
    way = eye - start
    above = np.sum(way * chosen.normal, axis=1)
    # A point in the plane of a triangle, to rounding, sees nothing of it, and would find a section
    # of any visibility.
    sees = above > IN_PLANE * np.maximum(1.0, np.abs(start).max(axis=1, initial=0.0))
    weight = np.where(
        sees, chosen.area * above / np.linalg.norm(way, axis=1) ** 3 / chosen.chance, 0.0
    )
    across = np.cross(chosen.normal, way)
    size = np.linalg.norm(across, axis=1)[:, None]
    side = chosen.corners[:, 1] - chosen.corners[:, 0]
    # Before the middle of its triangle a point looks along the normal, and no direction is across
    # both: a side of the triangle serves.
    along = size > _ASIDE * np.linalg.norm(way, axis=1)[:, None]
    across = np.where(
        along, across / np.maximum(size, _TINY), side / np.linalg.norm(side, axis=1)[:, None]
    )
    return Sections(eye, across, start, length * across, weight)


@dataclass(frozen=True)
class _Spread:
    """The azimuths of disks or spheres about axes, by a number t from 0 to 1."""

    middle: Array  # (rows,) [rad]
    sine: Array  # of half of the range, (rows,); above 1: all azimuths

    def azimuth(self, t: Array) -> tuple[Array, Array]:
        """Return azimuths, (rows, k), and dphi/dt."""
        sine, middle = self.sine[:, None], self.middle[:, None]
        # sin(delta) = S sin(g), g even. Where S > 1 stands for all azimuths, phi itself is even.
        angle = np.pi * (t - 0.5)
        s = np.minimum(sine, 1.0) * np.sin(angle)
        phi = np.where(sine > 1, 2 * np.pi * t, np.arcsin(s))
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.pi * sine * np.cos(angle) / np.sqrt((1 - s) * (1 + s))
        return middle + phi, np.where(sine > 1, 2 * np.pi, rate)


def _spread(height: Array, radius: Array | float, normal: Array) -> _Spread:
    """Return the azimuths of a disk with normals (rows, 2) across the axes, or of a
    sphere, whose normals are zero.
    """
    n_u, n_v = normal.T
    # The quadratic form e^T M e of the derivation, M = [[first, mixed], [mixed, second]]. `middle`
    # is the direction of the eigenvector with the larger eigenvalue: half planes are across their
    # normals e, whose range is about the other eigenvector.
    first = height**2 - radius**2 * (1 - n_u**2)
    second, mixed = -(radius**2) * (1 - n_v**2), radius**2 * n_u * n_v
    middle = 0.5 * np.arctan2(2 * mixed, first - second)
    root = np.hypot(0.5 * (first - second), mixed)
    # The eigenvalues are `above` and -`below`. `above` <= 0 means that all half planes cut the
    # light: S = 2 says so.
    above, below = 0.5 * (first + second) + root, root - 0.5 * (first + second)
    sine = np.sqrt(np.maximum(below, 0.0) / np.maximum(above + below, _TINY))
    return _Spread(middle, np.where(above > 0, np.minimum(sine, 1.0), 2.0))


def _by_table(nodes: Array, density, uniform: Array) -> tuple[Array, Array]:
    """Return numbers, (rows, k), whose density is linear between nodes, (rows,
    nodes), and that density.
    """
    width = np.diff(nodes, axis=1)
    # At a corner sections begin at a point, or at once with a side: the density on both
    # sides of a node differs.
    left, right = density(nodes[:, :-1] + _ASIDE * width), density(nodes[:, 1:] - _ASIDE * width)
    mass = 0.5 * width * (left + right)
    # A light seen edge-on has sections without length at all azimuths: draw evenly, the weights are
    # zero anyway.
    none = mass.sum(axis=1, keepdims=True) <= 0
    left, right, mass = left + none, right + none, np.where(none, width, mass)
    total = mass.sum(axis=1, keepdims=True)
    below = np.cumsum(mass, axis=1)
    wanted = np.broadcast_to(uniform, (len(nodes), uniform.shape[-1])) * total
    # The cell in which the cumulated mass passes the wanted one.
    cell = np.minimum((below[:, None, :-1] <= wanted[..., None]).sum(axis=2), mass.shape[1] - 1)
    first, left, right, wide = (
        np.take_along_axis(part, cell, axis=1) for part in (nodes[:, :-1], left, right, width)
    )
    rest = wanted - np.take_along_axis(below - mass, cell, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.where(wide > 0, np.maximum(rest, 0.0) / wide, 0.0)
    # Within a cell the mass is a quadratic in the place: left t + (right - left) t^2/2 = rest. This
    # form of its root does not cancel where the density is level, and at 0/0 gives the beginning of
    # the cell.
    root = np.sqrt(np.maximum(left * left + 2 * (right - left) * rest, 0.0))
    part = np.clip(2 * rest / np.maximum(left + root, _TINY), 0.0, 1.0)
    return first + part * wide, np.maximum(left + part * (right - left), _TINY) / total


# --- Spheres ---


def _on_sphere(
    light: ReferenceAreaLight, axes: _Axes, distance: Array, square: Array
) -> LightSamples:
    """Return samples of a sphere by azimuth and by the angle on the circle in
    which a half plane cuts it.

    Both are periodic where the line misses the sphere. Where it does not, the circle ends at the
    line, and where the ray ends at the sphere, at what its beginning sees: the ray sees no other
    point of the sphere.
    """
    radius, rows = light.radius, len(axes.along)
    # A half plane cuts the sphere in a circle of radius rho; dA = R h dphi db with the angle b on
    # the circle.
    spread = _spread(axes.height, radius, np.zeros((rows, 2)))
    meets = axes.height < radius
    front = axes.along - np.sqrt(np.maximum(radius**2 - axes.height**2, 0.0))
    ends = (meets & (front > 0) & (distance <= 0.5 * (front + axes.along)))[:, None]
    meets = meets[:, None]

    def circle(phi: Array) -> tuple[Array, Array, Array, Array]:
        """Return height and radius of the circles, and both ends of the angles on them."""
        beside = axes.height[:, None] * np.sin(phi)
        rho = np.sqrt(np.maximum((radius - beside) * (radius + beside), 0.0))
        middle = axes.height[:, None] * np.cos(phi)
        # Where the line meets the sphere the circle is cut by the axis, h = 0; angles go from one
        # cut to the other. Else they go all around.
        reach = np.where(
            meets, np.arccos(np.clip(-middle / np.maximum(rho, _TINY), -1.0, 1.0)), np.pi
        )
        to_middle = np.hypot(middle, axes.along[:, None])
        # The tangent from the beginning of the ray to the circle ends what that beginning sees.
        back = np.arctan2(-axes.along[:, None], -middle) + np.arccos(
            np.clip(rho / np.maximum(to_middle, rho), 0.0, 1.0)
        )
        return middle, rho, -reach, np.where(ends, np.clip(back, -reach, reach), reach)

    # The lattice of `reference.quadrature.replicates` is folded in its first coordinate
    # and periodic in the other.
    folded, periodic = square[..., 0], square[..., 1]
    phi, rate = spread.azimuth(np.where(meets, periodic, folded))
    middle, rho, low, high = circle(phi)
    angle = low + np.where(meets, folded, periodic) * (high - low)
    # Rounding at the cut with the axis must not give a negative height.
    h = np.maximum(middle + rho * np.cos(angle), 0.0)
    place = axes.point(axes.along[:, None] + rho * np.sin(angle), h, phi)
    return LightSamples(place, (place - light.centre) / radius, radius * h * (high - low) * rate)


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
