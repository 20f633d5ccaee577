# SPDX-License-Identifier: BSD-3-Clause
"""The projection of a shadow map: perspective for a light with a place,
orthographic for one at infinity.

A face has a basis of two vectors across the light and an axis, and (u, v) in [-1, 1]^2. With the
light at (l, w) both projections are one homogeneous map from (u, v, s) to the point (P, 1),

    (P, 1) ~ u (across, 0) + v (up, 0) + s (l, w) + (m, 1 - w).

* w = 1: m is the axis, and P = l + (axis + u across + v up) / s. Hence s is the inverse
  of the planar depth [1/m].
* w = 0: l = -axis, m is the middle of the rectangle behind which there are no shapes, and P = m + u
  across + v up - s axis. Hence s is the height above that rectangle [m].

It is linear in homogeneous coordinates, so planes stay planes and lines stay lines; the light
itself is s = infinity, and a point is lit where its s is above the s of the first surface. Where
nothing is hit s = 0: at infinity, or at the end of the media; s is far below 0 in a medium without
sides, which goes on behind the rectangle. The map is inverted with the vector d
from l (w = 1) or m (w = 0) to the point: for d = a across + b up + c axis,

    (u, v, s, 1) ~ (a, b, 1, c)  for w = 1,        (a, b, -c, 1)  for w = 0.

|across| and |up| are 1 for the face of a cube. For the face of a spot they are tan(cutoff), so that
its cone just fits; for a directional light they are half the sides of the rectangle [m].
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.scene.lights import Light


@dataclass(frozen=True)
class Projection:
    """The projection of the faces of a shadow map."""

    #: across, up and axis of the one face; None for the six of a cube
    basis: tuple[Any, Any, Any] | None
    #: w = 0: distance along the axis from where rays of the map start to where the media end [m]
    depth: Any = None
    #: w = 0: the s of what is behind all media, 0 or far below it [m]
    lowest: Any = 0

    @property
    def goes_on(self) -> Any:
        """Whether the medium goes on beside and behind the map of a directional light."""
        return self.lowest < 0

    @property
    def w(self) -> int:
        """The last coordinate of the light's homogeneous position: 1
        perspective, 0 orthographic.
        """
        return 1 if self.depth is None else 0

    @property
    def faces(self) -> int:
        """How many faces the map has."""
        return 1 if self.basis else 6

    @property
    def parallel_axis(self) -> Any:
        """The direction of the rays of a light at infinity, None for one with a place."""
        return self.basis[2] if self.basis and not self.w else None

    def products(self, face, vector) -> tuple[Any, Any, Any]:
        """Return the scalar products of a vector [m] with the across, up and axis of a face [m]."""
        if self.basis:
            return tuple(dr.dot(vector, basis_vector) for basis_vector in self.basis)
        # Faces 2k and 2k + 1 look along coordinate k, forwards and backwards; across and up are the
        # next two coordinates, counted cyclically.
        x, y, z = vector.x, vector.y, vector.z
        axis = face >> 1
        a, b, c = (
            dr.select(axis == 0, p, dr.select(axis == 1, q, r))
            for p, q, r in ((y, z, x), (z, x, y), (x, y, z))
        )
        return a, b, dr.select((face & 1) == 0, c, -c)

    def homogeneous(self, face, vector, weight: int) -> tuple[Any, Any, Any, Any]:
        """Return a multiple of (u, v, s, 1) on a face.

        `face`: number of the face; `vector`: of points, less the position of the light [m]; or
        directions; `weight`: 1 for points, 0 for directions: their last homogeneous coordinate.
        Returns `a`, `b`, `s`, `c`: linear in (vector, weight).
        """
        a, b, c = self.products(face, vector)
        if self.basis:
            # The basis is orthogonal, not of unit length; across and up of a spot are equally long.
            inverse = dr.rcp(dr.squared_norm(self.basis[0]))
            a, b = a * inverse, b * (inverse if self.w else dr.rcp(dr.squared_norm(self.basis[1])))
        # (a, b, 1, c) or (a, b, -c, 1) of a point; a direction has 0 for the 1.
        lane_weight = type(c)(weight)
        return (a, b, lane_weight, c) if self.w else (a, b, -c, lane_weight)

    def inverse_depth(self, place, distance):
        """Return the s of points that rays of the map meet: inverse planar depth [1/m],
        or height for w = 0 [m].

        `place`: (u, v) on a face; `distance`: along the rays, infinite where nothing is met [m].
        """
        if not self.w:
            # Rays start `depth` above the rectangle; what meets nothing ends behind all media.
            return dr.maximum(self.depth - distance, self.lowest)
        # A point at planar depth 1 is sqrt(1 + |across|^2 (u^2 + v^2)) from the light.
        u, v = place
        across = dr.squared_norm(self.basis[0]) if self.basis else type(distance)(1)
        return dr.sqrt(dr.fma(across, dr.square(u) + dr.square(v), 1)) / distance


def light_projection(light: Light) -> Projection:
    """Return the projection of the shadow map of a light, in the light's precision."""
    basis = light_basis(light)
    rounded = basis and tuple(type(light.position)(basis_vector) for basis_vector in basis)
    if light.w:
        return Projection(rounded)
    return Projection(rounded, light.extent.depth, light.extent.lowest)


def light_faces(light: Light) -> int:
    """Return how many faces the shadow map of a light has: one for a cone or parallel
    rays, six for all directions.
    """
    return 1 if light.axis is not None else 6


def light_basis(light: Light) -> tuple[Any, Any, Any] | None:
    """Return two vectors across a light's axis and the axis, in float64; None
    for a light without one.
    """
    if light.axis is None:
        return None
    axis = light.exact_axis
    if not light.w:
        return mi.Vector3d(light.extent.across), mi.Vector3d(light.extent.up), axis
    # Any vector that is not parallel to the axis will do to start from.
    helper = dr.select(dr.abs(axis.x) < 0.5, type(axis)(1, 0, 0), type(axis)(0, 1, 0))
    across = dr.normalize(dr.cross(helper, axis))
    # tan(cutoff), so that the cone just fits the face.
    square = light.cone.square_sin
    scale = dr.sqrt(square / (1 - square))
    return across * scale, dr.cross(axis, across) * scale, axis


def map_ray(light: Light, face, u, v) -> tuple[Any, Any]:
    """Return start and unit direction, in float64, of the ray of a light's map
    through (u, v) of a face.
    """
    basis = light_basis(light)
    if basis is None:
        # In this order the sum does not depend on which coordinate is which.
        unit = cube_direction(mi.Vector3d, face, u, v) * dr.rsqrt((dr.square(u) + dr.square(v)) + 1)
        return light.position, unit
    across, up, axis = basis
    if light.w:
        return light.position, dr.normalize(across * u + up * v + axis)
    # Parallel rays start before all shapes, `depth` above the rectangle where the media end.
    before = mi.Vector3d(light.position) - axis * mi.Float64(light.extent.depth)
    return before + across * u + up * v, axis


def cube_direction(Vector, face, u, v):
    """Return the direction through (u, v) of a face of a cube, not of unit length.

    Face 2k looks along +axis k, face 2k + 1 along -axis k; u and v go along the next two axes.
    """
    sign = dr.select((face & 1) == 0, type(u)(1), type(u)(-1))
    axis = face >> 1
    return dr.select(
        axis == 0, Vector(sign, u, v), dr.select(axis == 1, Vector(v, sign, u), Vector(u, v, sign))
    )


def cube_coordinates(d):
    """Return the face of a cube that a direction `d` of any length goes through, and u
    and v there, from -1 to 1.
    """
    # The largest coordinate chooses the face. Divided by its size, the next two are u and v.
    size = dr.abs(d)
    x_major = (size.x >= size.y) & (size.x >= size.z)
    y_major = ~x_major & (size.y >= size.z)
    major = dr.select(x_major, d.x, dr.select(y_major, d.y, d.z))
    inverse = dr.rcp(dr.abs(major))
    u = dr.select(x_major, d.y, dr.select(y_major, d.z, d.x)) * inverse
    v = dr.select(x_major, d.z, dr.select(y_major, d.x, d.y)) * inverse
    axis = dr.select(x_major, mi.UInt32(0), dr.select(y_major, mi.UInt32(1), mi.UInt32(2)))
    return 2 * axis + dr.select(major < 0, mi.UInt32(1), mi.UInt32(0)), u, v
