# SPDX-License-Identifier: BSD-3-Clause
r"""Samples of area lights along rays: points of the light that suit one ray.

A point y of the light at the height h over the ray sends J(y) into it, which grows
like 1/h: points drawn evenly on the light leave a peak next to the light that no number of points
resolves. In half planes about the ray, with phi the azimuth of such a half plane and l the arc
length along the curve in which it cuts the light,

    dA = h dphi dl / n_in,        n_in the length of the part of the normal within the half plane,

and h J(y) is bounded however close the ray passes: without extinction an unbounded ray receives
(1 + cos) n_in from y, with cos the cosine of the angle in the half plane between normal and ray.
Samples are therefore drawn by phi and l. These are polar coordinates about the ray, the same for
all of its points, with the lit intervals of one point light.

The half planes are those of `half_planes.py`.

**On a mesh** one coordinate of the square chooses a triangle (`reference.quadrature.mesh_choice`),
and the rest of the coordinate serves within the triangle: as above in one that is near, evenly over
its area in others.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.half_planes import TINY, Axes, Fan, axes_about, fan_of, spread_of
from airlight.reference.quadrature.mesh_choice import Choice, choose_for_rays, places_in
from airlight.reference.scene.area_light import ReferenceAreaLight

Array = NDArray[np.float64]


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
    axes = axes_about(origin, direction, light.centre)
    if light.kind == "sphere":
        return _on_sphere(light, axes, distance, square)
    place, weight = _on_flat(fan_of(light, axes), square)
    return LightSamples(place, np.broadcast_to(light.normal, place.shape), weight)


def _on_flat(fan: Fan, square: Array) -> tuple[Array, Array]:
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
    weight = h * np.hypot(z1 - z0, h1 - h0) * per_density / np.maximum(within, TINY)
    return fan.axes.point(z, h, phi), weight


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
        axes = axes_about(
            origin, np.repeat(direction, len(weight) // rows, axis=0)[near], corners.mean(axis=1)
        )
        normal = axes.components(chosen.normal[near, None])[:, 0]
        radius = np.zeros(len(near))
        # A table that serves a single sample has two cells between corners.
        fan = Fan(axes, axes.components(corners - axes.origin[:, None]), normal, radius, cells=2)
        samples = _on_flat(fan, chosen.square[near, None])
        place[near], weight[near] = (part[:, 0] for part in samples)
    shape = rows, -1, 3
    return LightSamples(
        place.reshape(shape),
        chosen.normal.reshape(shape),
        (weight / chosen.chance).reshape(rows, -1),
    )


def _on_sphere(
    light: ReferenceAreaLight, axes: Axes, distance: Array, square: Array
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
    spread = spread_of(axes.height, radius, np.zeros((rows, 2)))
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
            meets, np.arccos(np.clip(-middle / np.maximum(rho, TINY), -1.0, 1.0)), np.pi
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
