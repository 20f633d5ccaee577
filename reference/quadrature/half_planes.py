# SPDX-License-Identifier: BSD-3-Clause
r"""Area lights cut by half planes about an axis: a ray, or one through a surface point.

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
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.area_light import ReferenceAreaLight

Array = NDArray[np.float64]

_ASIDE = 1e-6  # of a cell: how far from its ends its density is looked up
TINY = 1e-300  #: a divisor at least, where what is divided is 0 too


@dataclass(frozen=True)
class Axes:
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


def axes_about(origin: Array, axis: Array, centre: Array) -> Axes:
    """Return the axes through points, (rows, 3), about which a centre has the azimuth 0."""
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
    return Axes(origin, axis, up, np.cross(axis, up), along, np.where(far, height, 0.0))


@dataclass(frozen=True)
class Fan:
    """The sections of a flat light by half planes about axes."""

    axes: Axes
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
        within = np.maximum(1 - n_e**2, TINY)
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
            spread = spread_of(self.axes.height, self.radius, self.normal[:, 1:])
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


def fan_of(light: ReferenceAreaLight, axes: Axes) -> Fan:
    """Return the sections of a light that is flat, or seen as flat: a rectangle, disk or sphere."""
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
        axes = axes_about(
            axes.origin, axes.axis, axes.origin + ((1 - ratio) * (1 + ratio))[:, None] * way
        )
    normal = axes.components(normal)[:, 0]
    if light.kind != "rectangle":
        return Fan(axes, None, normal, radius)
    corners = light.corners - axes.origin[:, None]
    return Fan(axes, axes.components(corners), normal, radius)


@dataclass(frozen=True)
class Spread:
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


def spread_of(height: Array, radius: Array | float, normal: Array) -> Spread:
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
    sine = np.sqrt(np.maximum(below, 0.0) / np.maximum(above + below, TINY))
    return Spread(middle, np.where(above > 0, np.minimum(sine, 1.0), 2.0))


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
    part = np.clip(2 * rest / np.maximum(left + root, TINY), 0.0, 1.0)
    return first + part * wide, np.maximum(left + part * (right - left), TINY) / total
