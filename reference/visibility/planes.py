# SPDX-License-Identifier: BSD-3-Clause
r"""The plane of a ray and a light, and the one map that projects all occluders to the ray.

A light is a homogeneous position: a place p with w = 1, or the unit direction p towards it with w =
0. In the plane of a ray o + x d and the light let z be the component along d, and y across it on
the light's side; the ray is y = 0. The light is at

    (z_P, y_P) = (foot, height) of a place,      (cos, sin) of the angle between ray and light of a direction.

An occluder at (z, y) is on the shadow segment of one point of the ray,

    x = (z y_P - y z_P) / (y_P - w y),      where 0 <= y and w y < y_P,

which for a direction is z - y cos/sin. At y = y_P a place sends light along the ray: x goes to
infinity, on the side on which it stands. For a direction -cos is the cosine of the angle between
the light's way and the ray; the scattering angle has the cosine cos.

With theta, the angle at a light at a place from the foot point, x = z_P + y_P tan(theta). The
cosine between an axis of the light and the way to the point at theta is

    c(theta) = axial sin(theta) + across cos(theta) = m cos(theta - theta_m),
    m = sqrt(axial^2 + across^2),   theta_m = atan2(axial, across),

`axial` and `across` the components of the axis along d and along n, the unit vector from the light
to the foot point. A cone of half angle b is therefore one interval, |theta - theta_m| <= acos(cos
b / m), nothing if m < cos b: no nappes, no cases. (`realtime.rays` solves a quadratic equation in
the distance instead.)

Cosines of small angles have few of their digits: a spot of 0.3 degrees would end 1e-11 of its edge
beside its place, and adaptive rules would chase that. With the third component of the axis,
`beside`, the sine of its angle to the way is

    s(theta) = sqrt((axial cos(theta) - across sin(theta))^2 + beside^2),

and 1 - c = s^2/(1 + c), tan(half) = sqrt(sin^2 b - beside^2)/cos b, which keep theirs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.point_light import ReferenceLight

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Rays:
    """Camera rays, each in its plane with a light: arrays of shape (n, ...)."""

    origin: Array  #: where all begin [m], (3,), or each, (n, 3)
    direction: Array  #: unit, (n, 3)
    #: p: where the light of each ray is [m], or the unit direction towards it, (n, 3)
    position: Array
    #: unit vector across the ray, from the light to the foot point or along the light, (n, 3)
    normal: Array
    foot: Array  #: z_P: distance along the ray [m], or the cosine, (n,)
    height: Array  #: y_P: distance from the ray [m], or the sine, (n,)
    w: int = 1  #: 1: p is a place, 0: a direction

    def __getitem__(self, rows: Index | NDArray[np.bool_] | slice) -> "Rays":
        return Rays(
            self.origin if self.origin.ndim == 1 else self.origin[rows],
            self.direction[rows],
            self.position[rows],
            self.normal[rows],
            self.foot[rows],
            self.height[rows],
            self.w,
        )

    def point(self, ray: Index, x: Array) -> Array:
        """Return the points at distances along rays of these numbers, (k, 3) [m]."""
        return self.origin + x[:, None] * self.direction[ray]

    def theta(self, x: Array, ray: Index | slice = slice(None)) -> Array:
        """Return the angle at the light of points at distances x of rays of these numbers [rad]."""
        return np.arctan2(x - self.foot[ray], self.height[ray])

    def distance(self, theta: Array, ray: Index | slice = slice(None)) -> Array:
        """Return distances, infinite from a right angle on [m]."""
        with np.errstate(over="ignore"):
            x = self.foot[ray] + self.height[ray] * np.tan(theta)
        return np.where(np.abs(theta) >= 0.5 * np.pi, np.copysign(np.inf, theta), x)


def rays_at(origin: Array, direction: Array, position: Array, w: int = 1) -> Rays:
    """Return rays in their planes with a light.

    `origin`: where all rays begin [m], (3,), or each, (n, 3); `direction`: unit vectors, (n, 3);
    `position`: of the light, (3,), or of the light of each ray, (n, 3): places [m] or unit
    directions; `w`: 1 for places, 0 for directions.

    Valid for all rays. One that meets the light lies in many planes: any is as good.
    """
    position = np.broadcast_to(position, direction.shape)
    way = w * origin - position  # from a place to the camera, or along the light
    foot = -np.sum(way * direction, axis=1)
    away = way + foot[:, None] * direction
    # Again, since the first subtraction leaves rounding along the ray.
    away -= np.sum(away * direction, axis=1)[:, None] * direction
    height = np.linalg.norm(away, axis=1)
    # A ray as close as 1e-12 rad to the direction of a light is as good as one beside it.
    least = np.finfo(float).tiny if w else 1e-12
    # A ray that meets the light lies in many planes: the normal is then any vector across the ray.
    helper = np.cross(
        direction, np.where(np.abs(direction[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    )
    helper /= np.linalg.norm(helper, axis=1)[:, None]
    beside = height > least
    normal = np.where(beside[:, None], away / np.maximum(height, least)[:, None], helper)
    return Rays(
        origin, direction, position, normal, foot, height if w else np.maximum(height, least), w
    )


def cone_interval(rays: Rays, light: ReferenceLight, angle: float) -> tuple[Array, Array]:
    """Return the interval of theta inside a cone about the light's axis.

    `rays`, `light`: the rays in their planes with the light; for a light without an axis the
    interval is the whole line; `angle`: half angle of the cone [rad]. Returns `low`, `high`:
    (rays,) each [rad]; low > high where the ray misses the cone.
    """
    if light.axis is None:
        half_pi = np.full(len(rays.foot), 0.5 * np.pi)
        return -half_pi, half_pi
    axial, across, beside = _in_plane(rays, light.axis)
    middle = np.arctan2(axial, across)
    # The half angle within the plane has the cosine cos(angle)/sqrt(1 - beside^2), and this tangent,
    # which keeps the digits of narrow cones.
    square = np.sin(angle) ** 2 - beside**2
    half = np.where(square > 0, np.arctan2(np.sqrt(np.maximum(square, 0)), np.cos(angle)), -1.0)
    return middle - half, middle + half


def _in_plane(rays: Rays, axis: Array) -> tuple[Array, Array, Array]:
    """Return the components of an axis along the rays, along their normals, and beside both,
    (rays,) each [1].
    """
    beside = np.cross(rays.direction, rays.normal) @ axis
    return rays.direction @ axis, rays.normal @ axis, beside


def falloff(theta: Array, rays: Rays, light: ReferenceLight) -> Array:
    """Return intensity over that on the axis [1]: Mitsuba's spot profile, linear
    behind the beam, or a cosine.

    `theta`: angles at the light, (rays, angles) [rad]; `rays`, `light`: the rays in
    their planes with the light.
    """
    if not light.is_soft or light.axis is None:
        return np.ones_like(theta)
    if not light.cosine:
        return spot_edge(axis_versine(theta, rays, light.axis), light)
    # The cosine at a sample of an area light.
    axial, across, _ = (each[:, None] for each in _in_plane(rays, light.axis))
    return np.maximum(axial * np.sin(theta) + across * np.cos(theta), 0.0)


def axis_versine(theta: Array, rays: Rays, axis: Array) -> Array:
    """Return 1 - cos of the angles between an axis of the light and the ways to points, (rays,
    angles) [1].

    `theta`: angles at the light, (rays, angles) [rad].
    """
    axial, across, beside = (each[:, None] for each in _in_plane(rays, axis))
    cosine = axial * np.sin(theta) + across * np.cos(theta)
    return versine(cosine, (axial * np.cos(theta) - across * np.sin(theta)) ** 2 + beside**2)


def versine(cosine: Array, squared_sine: Array) -> Array:
    """Return 1 - cos, which keeps its digits at small angles: sin^2 over 1 + cos."""
    return np.where(cosine > 0, squared_sine / (1 + np.maximum(cosine, 0)), 1 - cosine)


def spot_edge(versine: Array, light: ReferenceLight) -> Array:
    """Return the profile of Mitsuba's spot, linear in the angle from `beam` to `cutoff`, by 1 - cos
    of the angle to the axis [1].
    """
    angle = 2 * np.arcsin(np.sqrt(np.clip(0.5 * versine, 0.0, 1.0)))
    if not light.is_soft:
        return (angle <= light.cutoff).astype(np.float64)
    return np.clip((light.cutoff - angle) / (light.cutoff - light.beam), 0.0, 1.0)


def before(rays: Rays, normal: Array) -> tuple[Array, Array]:
    """Return between which distances rays are before the planes through their lights
    with unit normals, (n, 3).

    low >= high where they are not.
    """
    rise = np.sum(normal * rays.direction, axis=1)
    start = np.sum(normal * (rays.origin - rays.position), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Where n . (o + x d - P) passes zero; a ray in parallel to the plane is before it
        # everywhere or nowhere.
        zero = np.where(rise != 0, -start / rise, np.where(start > 0, -np.inf, np.inf))
    return np.where(rise >= 0, zero, -np.inf), np.where(rise < 0, zero, np.inf)
