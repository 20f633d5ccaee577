# SPDX-License-Identifier: BSD-3-Clause
r"""Sampling points on area lights, in Dr.Jit: for places on surfaces, and towards the ray.

A surface point has points that are even over the area, or over the disk as which it sees a sphere:
with theta the angle at the centre between a point of the sphere and the way to the place,
cos(theta)^2 is uniform above (R/d)^2 and the density cos(theta)/(pi R^2 (1 - (R/d)^2)).

For one point y of a light, the distances along a camera ray come from
`reference.monte_carlo.single_scatter.distance_sampling`, as for a point light at y. The value of
such a sample is bounded by range/h, h the distance of y from the ray. If y were uniform over the
area, its mean square would be the integral of 1/h^2 over the area, which diverges where a ray meets
the light. Half of the points are therefore spread about the place c where the ray meets the light,
or comes nearest to it, with a density that goes as 1/rho, rho = \|y - c\|: the mean square is then
the integral of 1/rho over the area, which is finite.

In the plane of a rectangle, disk or triangle, seen from c, with R(phi) how far the piece
reaches in the direction phi:

    rho = R(phi) v,  phi uniform        pdf = 1 / (2 pi R(phi) rho)

On a sphere of radius R the chord rho from c to y is uniform in [0, 2 R], and the angle about the
axis through c is uniform too. With an area of rho d(rho) d(phi) (Archimedes: equal slices have
equal areas, and rho^2 is linear in the height),

    pdf = 1 / (4 pi R rho).

A ray may meet a sphere twice: each of both places has a quarter of the points. On a mesh half of
the points are spread so in the one triangle that the ray meets first, if any, and the others evenly
over all triangles. The density of a point is the mean over the techniques, each with its fraction
(the balance heuristic with one sample, Veach 1997, section 9.2.4).

References
----------
E. Veach 1997, Robust Monte Carlo methods for light transport simulation, chapter 9.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.scene.area_light import ReferenceAreaLight, triangle_areas, triangle_normals
from airlight.reference.scene.device import on_device

_PARALLEL = 1e-9  # sine of the angle between ray and plane below which they count as parallel
_TOUCHING = 1e-12  # of a light's size: no direction is known over a shorter way
_LEAST = 1e-30


#: coordinates of points in a plane [m]
Coordinates: TypeAlias = "tuple[mi.Float64, mi.Float64]"


@dataclass(frozen=True)
class LightSample:
    """Points on a light."""

    position: "mi.Point3d"  #: [m]
    normal: "mi.Vector3d"  #: unit vector
    density: "mi.Float64"  #: of the points over the area [1/m^2]; 0 where a point does not count


@dataclass(frozen=True)
class Triangles:
    """A mesh, as tables with nine, three and one number for each triangle."""

    scene: "mi.Scene"  #: these triangles, in their order
    corners: "mi.Float64"  #: nine numbers: a corner, and the ways from it to both others [m]
    normals: "mi.Float64"  #: three numbers: a unit vector to the side that emits
    #: one number: the area of the triangles up to this one, itself included, over the area of all
    below: "mi.Float64"
    count: int  #: how many triangles there are
    area: float  #: of all [m^2]

    def facing(self, u: "mi.Float64", v: "mi.Float64", place: "mi.Point3d") -> LightSample:
        """Sample points evenly over the area."""
        number = dr.binary_search(
            0, self.count - 1, lambda i: dr.gather(mi.Float64, self.below, i) <= u
        )
        return self._even(number, u, v)

    def towards(
        self, u: "mi.Float64", v: "mi.Float64", origin: "mi.Point3d", direction: "mi.Vector3d"
    ) -> LightSample:
        """Sample points evenly over the area; for a ray that meets a triangle half of the points
        about the place where it does.
        """
        # If the ray meets a triangle, points with v below `fraction` are spread about that place;
        # all other points are even over all triangles. Either kind uses u, and v stretched to 0 to
        # 1.
        hit = self.scene.ray_intersect_preliminary(
            mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
        )
        meets = hit.is_valid()
        met = dr.select(meets, hit.prim_index, 0)
        fraction = mi.Float64(dr.select(meets, 0.5, 0))
        number = dr.binary_search(
            0, self.count - 1, lambda i: dr.gather(mi.Float64, self.below, i) <= u
        )
        even = self._even(number, u, (v - fraction) / (1 - fraction)).position

        # The place in the triangle that was met, in the axes of its first side and across it.
        corner, first, second = (
            self._vector(self.corners, met * 9 + 3 * which) for which in range(3)
        )
        normal = self._vector(self.normals, met * 3)
        across = dr.normalize(first)
        up = dr.cross(normal, across)
        slope = dr.dot(direction, normal)
        reach = dr.dot(corner - origin, normal) / dr.select(dr.abs(slope) < _PARALLEL, 1, slope)
        place = origin + direction * reach
        ends = [corner, corner + first, corner + second]
        sine, cosine = dr.sincos(2 * math.pi * u)
        way = across * cosine + up * sine
        about = meets & (v < fraction)
        near = place + way * (
            _edge_of_triangle(place, way, ends, normal) * v / dr.maximum(fraction, _LEAST)
        )
        position = dr.select(about, near, even)
        number = dr.select(about, met, number)

        # The density of a point is the sum over both techniques, whichever of them drew it: an even
        # point in the triangle that the ray meets could have been drawn about the place, too.
        in_met = meets & (number == met)
        rho = dr.norm(position - place)
        counts = ~in_met | (rho > _TOUCHING * dr.norm(first))
        rho = dr.select(in_met & counts, rho, 1)
        edge = _edge_of_triangle(place, (position - place) / rho, ends, normal)
        density = (1 - fraction) / self.area + dr.select(in_met, _about(fraction, edge, rho), 0)
        return LightSample(
            position, self._vector(self.normals, number * 3), dr.select(counts, density, 0)
        )

    def _even(self, number: "mi.UInt32", u: "mi.Float64", v: "mi.Float64") -> LightSample:
        """Return points of triangles that were chosen by u, in proportion to their areas; v is in
        [0, 1).
        """
        before = dr.select(
            number == 0, 0, dr.gather(mi.Float64, self.below, dr.maximum(number, 1) - 1)
        )
        # The rest of u within the chosen triangle is uniform again; its root spreads the points
        # evenly.
        root = dr.sqrt((u - before) / (dr.gather(mi.Float64, self.below, number) - before))
        corner, first, second = (
            self._vector(self.corners, number * 9 + 3 * which) for which in range(3)
        )
        position = corner + first * (root * (1 - v)) + second * (root * v)
        return LightSample(
            position, self._vector(self.normals, number * 3), mi.Float64(1 / self.area)
        )

    def _vector(self, numbers: "mi.Float64", base: "mi.UInt32") -> "mi.Vector3d":
        """Return the vector in three numbers of a table, from the place `base` on."""
        return mi.Vector3d(*(dr.gather(mi.Float64, numbers, base + axis) for axis in range(3)))


@dataclass(frozen=True)
class Flat:
    """A rectangle or a disk."""

    centre: "mi.Vector3d"  #: [m]
    across: "mi.Vector3d"  #: unit vector in its plane
    up: "mi.Vector3d"  #: unit vector in its plane, at right angles to `across`
    normal: "mi.Vector3d"  #: unit vector to the side that emits
    half: tuple[float, float]  #: half of the sides along `across` and `up`, or the radius twice [m]
    round: bool  #: whether it is a disk

    @property
    def area(self) -> float:
        """Its area [m^2]."""
        return (math.pi if self.round else 4) * self.half[0] * self.half[1]

    def facing(self, u: "mi.Float64", v: "mi.Float64", place: "mi.Point3d") -> LightSample:
        """Sample points evenly over the area."""
        x, y = self._even(u, v)
        return LightSample(self._at(x, y), self.normal, mi.Float64(1 / self.area))

    def towards(
        self, u: "mi.Float64", v: "mi.Float64", origin: "mi.Point3d", direction: "mi.Vector3d"
    ) -> LightSample:
        """Sample points evenly, and about the place of the light that is nearest to where the ray
        meets its plane.
        """
        # Where the ray meets the plane of the light; where it is nearest to the centre of the light
        # if both are parallel. Then the nearest place of the light.
        slope = dr.dot(direction, self.normal)
        offset = self.centre - origin
        parallel = dr.abs(slope) < _PARALLEL
        meets = dr.dot(offset, self.normal) / dr.select(parallel, 1, slope)
        place = (
            origin + direction * dr.select(parallel, dr.dot(offset, direction), meets) - self.centre
        )
        x0, y0 = dr.dot(place, self.across), dr.dot(place, self.up)
        a, b = self.half
        inward = dr.minimum(1, a / dr.maximum(dr.hypot(x0, y0), _LEAST))
        x0, y0 = (
            (x0 * inward, y0 * inward) if self.round else (dr.clip(x0, -a, a), dr.clip(y0, -b, b))
        )
        fraction = _fraction(self._at(x0, y0), max(a, b), origin, direction)

        # v below `fraction` draws about the place: rho = R(phi) v, phi uniform. Else evenly over
        # the light.
        x, y = self._even(u, (v - fraction) / (1 - fraction))
        sine, cosine = dr.sincos(2 * math.pi * u)
        about, distance = v < fraction, self._edge(x0, y0, cosine, sine) * (v / fraction)
        x, y = (
            dr.select(about, x0 + distance * cosine, x),
            dr.select(about, y0 + distance * sine, y),
        )
        rho = dr.hypot(x - x0, y - y0)
        # From a place on the edge the light has no extent outwards: a sample in such a direction is
        # the place itself, and does not count.
        counts = rho > _TOUCHING * max(a, b)
        rho = dr.select(counts, rho, 1)
        edge = self._edge(x0, y0, (x - x0) / rho, (y - y0) / rho)
        density = (1 - fraction) / self.area + _about(fraction, edge, rho)
        return LightSample(self._at(x, y), self.normal, dr.select(counts, density, 0))

    def _at(self, x: "mi.Float64", y: "mi.Float64") -> "mi.Vector3d":
        """Return points of the plane of the light [m]."""
        return self.centre + self.across * x + self.up * y

    def _even(self, u: "mi.Float64", v: "mi.Float64") -> Coordinates:
        """Return even points of the light."""
        a, b = self.half
        if not self.round:
            return a * (2 * u - 1), b * (2 * v - 1)
        sine, cosine = dr.sincos(2 * math.pi * u)
        return a * dr.sqrt(v) * cosine, b * dr.sqrt(v) * sine

    def _edge(
        self, x0: "mi.Float64", y0: "mi.Float64", cosine: "mi.Float64", sine: "mi.Float64"
    ) -> "mi.Float64":
        """Return how far the light reaches from a point of its plane in a direction [m]."""
        a, b = self.half
        if self.round:
            along = x0 * cosine + y0 * sine
            return -along + dr.sqrt(dr.maximum(along * along + a * b - x0 * x0 - y0 * y0, 0))
        # How far it is to the side of the rectangle in each of both directions; the nearer one
        # counts.
        sideways = (a - x0 * dr.sign(cosine)) / dr.maximum(dr.abs(cosine), _LEAST)
        upwards = (b - y0 * dr.sign(sine)) / dr.maximum(dr.abs(sine), _LEAST)
        return dr.maximum(dr.minimum(sideways, upwards), 0)


@dataclass(frozen=True)
class Ball:
    """A sphere that emits outwards."""

    centre: "mi.Vector3d"  #: [m]
    radius: float  #: [m]

    @property
    def area(self) -> float:
        """Its area [m^2]."""
        return 4 * math.pi * self.radius**2

    def facing(self, u: "mi.Float64", v: "mi.Float64", place: "mi.Point3d") -> LightSample:
        """Sample points of the cap that is visible from a place outside, evenly over its projection
        towards the place.
        """
        way = place - self.centre
        distance = dr.maximum(dr.norm(way), _LEAST)
        # From a place on the sphere or in it nothing is visible, wherever the samples are. Closer
        # than 1e-5 of the radius is on the sphere.
        outside = distance > self.radius * (1 + 1e-5)
        edge = dr.select(outside, dr.square(self.radius / distance), 0)
        cosine = dr.sqrt(edge + v * (1 - edge))
        normal = _towards(cosine, 2 * math.pi * u, way / distance)
        density = 4 * cosine / (self.area * (1 - edge))
        return LightSample(self.centre + self.radius * normal, normal, density)

    def towards(
        self, u: "mi.Float64", v: "mi.Float64", origin: "mi.Point3d", direction: "mi.Vector3d"
    ) -> LightSample:
        """Sample points on the side turned to the ray, and about the two places where the ray meets
        the sphere.
        """
        radius = self.radius
        offset = origin - self.centre
        middle = offset - direction * dr.dot(offset, direction)
        height = dr.norm(middle)
        half = dr.sqrt(dr.maximum(radius * radius - height * height, 0))
        side = dr.select(height > _LEAST, middle / dr.maximum(height, _LEAST), _across(direction))
        # A ray that misses the sphere comes nearest to it in one place.
        middle = side * dr.minimum(height, radius)
        places = [dr.normalize(middle + direction * (sign * half)) for sign in (-1, 1)]
        fraction = _fraction(self.centre + radius * places[0], radius, origin, direction)

        # The rest of the points has the density (1 + n . side)/area over the sphere: most of them
        # on the side turned to the ray, none opposite to it.
        angle = 2 * math.pi * u
        normal = _towards(
            2 * dr.sqrt(dr.clip((v - fraction) / (1 - fraction), 0, 1)) - 1, angle, side
        )
        for number, place in enumerate(places):
            # The chord from the place, uniform over the diameter: the height over the place's
            # tangent plane is linear in its square.
            chord = dr.clip(2 * v / fraction - number, 0, 1)  # over the diameter
            chosen = (v < fraction) & ((v < 0.5 * fraction) == (number == 0))
            normal = dr.select(chosen, _towards(1 - 2 * chord * chord, angle, place), normal)
        density = (1 - fraction) * (1 + dr.dot(normal, side)) / self.area
        for place in places:
            chord = dr.maximum(radius * dr.norm(normal - place), _LEAST)
            density = density + 0.5 * fraction / (4 * math.pi * radius * chord)
        return LightSample(self.centre + normal * radius, normal, density)


#: Emitting surfaces: `facing(u, v, place)` samples points for surfaces, `towards(u, v,
#: origin, direction)` for rays.
Emitting = Triangles | Flat | Ball


def emitting(light: ReferenceAreaLight) -> Emitting:
    """Return the emitting surface of an area light, as numbers on the device."""
    centre, across, up, normal = (
        mi.Vector3d(*vector.tolist()) for vector in (light.centre, *light.frame)
    )
    if light.kind in ("rectangle", "disk"):
        return Flat(
            centre,
            across,
            up,
            normal,
            (float(light.half[0]), float(light.half[1])),
            light.kind == "disk",
        )
    if light.kind == "sphere":
        return Ball(centre, light.radius)
    corners = light.triangles
    # A mesh for the ray casts, with the triangles in the order of the tables: the number of a hit
    # is the row of its triangle.
    mesh = mi.Mesh("light", vertex_count=3 * len(corners), face_count=len(corners))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(corners.ravel())
    parameters["faces"] = dr.arange(mi.UInt32, 3 * len(corners))
    parameters.update()
    areas, normals = triangle_areas(corners), triangle_normals(corners)
    below = np.cumsum(areas) / areas.sum()
    # Rounding must not leave a u of nearly 1 without a triangle.
    below[-1] = 1.0
    ways = corners.copy()
    ways[:, 1:] -= corners[:, :1]
    return Triangles(
        scene=mi.load_dict({"type": "scene", "light": mesh}),
        corners=on_device(mi.Float64, ways.ravel()),
        normals=on_device(mi.Float64, (normals / np.linalg.norm(normals, axis=1)[:, None]).ravel()),
        below=on_device(mi.Float64, below),
        count=len(areas),
        area=float(areas.sum()),
    )


def _fraction(
    place: "mi.Vector3d", radius: float, origin: "mi.Point3d", direction: "mi.Vector3d"
) -> "mi.Float64":
    """Return the fraction of points that are about a place of a light: a half where the ray meets
    the place, few where it passes far away.
    """
    offset = place - origin
    gap = dr.norm(offset - direction * dr.dot(offset, direction)) / radius
    # The gap between ray and place over the size of the light: a gap of 1/4 halves the fraction.
    return 0.5 / (1 + 16.0 * gap * gap)


def _about(fraction: "mi.Float64", edge: "mi.Float64", rho: "mi.Float64") -> "mi.Float64":
    """Return the density of points about a place [1/m^2]; rounding puts some points a little beyond
    the edge.
    """
    return fraction / (2 * math.pi * dr.maximum(edge, rho) * rho)


def _edge_of_triangle(
    place: "mi.Point3d", towards: "mi.Vector3d", ends: "list[mi.Vector3d]", normal: "mi.Vector3d"
) -> "mi.Float64":
    """Return how far a triangle, given by its corners, reaches from a place in it in a unit
    direction of its plane [m].
    """
    reach = mi.Float64(dr.inf)
    for one, other in zip(ends, (*ends[1:], ends[0])):
        # A vector across the side, turned to the inside by the triangle's middle. The side is met
        # where the gap to it is used up.
        inward = dr.cross(normal, other - one)
        inward = inward * dr.sign(dr.dot(inward, sum(ends) / 3 - one))
        rate = -dr.dot(inward, towards)
        gap = dr.maximum(dr.dot(inward, place - one), 0)
        reach = dr.select(rate > 0, dr.minimum(reach, gap / dr.select(rate > 0, rate, 1)), reach)
    return reach


def _towards(cosine: "mi.Float64", angle: "mi.Float64", axis: "mi.Vector3d") -> "mi.Vector3d":
    """Return unit vectors at an angle, given by its cosine, from an axis, and turned about the axis
    by another angle [rad].
    """
    sine = dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
    turned_sine, turned_cosine = dr.sincos(angle)
    side = _across(axis)
    up = dr.cross(axis, side)
    return dr.normalize(side * (sine * turned_cosine) + up * (sine * turned_sine) + axis * cosine)


def _across(axis: "mi.Vector3d") -> "mi.Vector3d":
    """Return unit vectors at right angles to an axis."""
    aside = dr.select(dr.abs(axis.x) > 0.6, mi.Vector3d(0, 1, 0), mi.Vector3d(1, 0, 0))
    return dr.normalize(dr.cross(aside, axis))
