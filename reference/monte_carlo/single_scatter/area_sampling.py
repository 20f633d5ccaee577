# SPDX-License-Identifier: BSD-3-Clause
r"""Sampling points on area lights, in Dr.Jit: evenly over the area, and towards the ray.

For one point y of a light, the distances along a camera ray come from
`reference.monte_carlo.single_scatter.distance_sampling`, as for a lamp at y. The value of such a sample is bounded by
range/h, h the distance of y from the ray. If y were uniform over the area, the mean square of the value would be the
integral of 1/h^2 over the area, which diverges where a ray meets the light. Half of the points are therefore spread
about the place c where the ray meets the light, or comes nearest to it, with a density that goes as 1/rho, rho = \|y -
c\|: the mean square is then the integral of 1/rho over the area, which is finite.

In the plane of a rectangle or disk, seen from c, with R(phi) how far the light reaches in the direction phi:

    rho = R(phi) v,  phi uniform        pdf = 1 / (2 pi R(phi) rho)

On a sphere of radius R the chord rho from c to y is uniform in [0, 2 R], and so is the angle about the axis through c.
With an area of rho d(rho) d(phi) (Archimedes: equal slices have equal areas, and rho^2 is linear in the height),

    pdf = 1 / (4 pi R rho).

A ray may meet a sphere twice: each of both places has a quarter of the points. On a mesh half of the points are spread
so in the one triangle that the ray meets first, if any, and the others evenly over all triangles. The density of a
point is the mean over the techniques, each with its fraction (the balance heuristic with one sample, Veach 1997,
section 9.2.4).

References
----------
E. Veach 1997, Robust Monte Carlo methods for light transport simulation, chapter 9.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from analytic.errors import InputError

SHAPES = ("Rectangle", "Disk", "Sphere")
_MESH = "Mesh"
_PARALLEL = 1e-9  # sine of the angle between ray and plane below which they count as parallel
_FADE = 16.0  # how soon points about the ray become fewer as it passes further from the light
_TOUCHING = 1e-12  # of a light's size: no direction is known over a shorter way
_LEAST = 1e-30
_SHEAR = 1e-5  # relative: a transform in float32 rounds to 1e-6


@dataclass(frozen=True)
class AreaLight:
    """An area light as sampling must know it; vectors of double precision."""

    shape: str  #: of `SHAPES`, or 'Mesh'
    centre: Any  #: [m]
    across: Any  #: unit vector, in the plane of a rectangle or disk
    up: Any  #: another, at right angles
    normal: Any  #: unit vector to the side that shines; for a sphere and a mesh any
    reach: tuple[float, float]  #: half of the sides along `across` and `up`, or the radius twice [m]
    radiance: Any  #: RGB [W/(m^2 sr)]
    mesh: "_Mesh | None" = None  #: of a mesh its triangles

    @property
    def area(self) -> float:
        """The area of the side that shines [m^2]."""
        if self.mesh is not None:
            return self.mesh.area
        a, b = self.reach
        return {"Rectangle": 4 * a * b, "Disk": math.pi * a * b, "Sphere": 4 * math.pi * a * b}[self.shape]


@dataclass(frozen=True)
class _Mesh:
    """The triangles of a light: nine, three and one number for each, of double precision."""

    scene: Any  #: an `mi.Scene` of the shape alone
    corners: Any  #: a corner, and the ways from it to both others [m]
    normals: Any  #: unit vectors to the side that shines
    below: Any  #: the fraction of the area of all triangles up to each, itself included
    count: int  #: how many there are
    area: float  #: of all [m^2]

    def corner(self, number, which: int):
        """Return a corner of triangles, for 0, or the way to another, for 1 and 2 [m]."""
        return self._vector(self.corners, number * 9 + 3 * which)

    def normal(self, number):
        """Return the unit normals of triangles."""
        return self._vector(self.normals, number * 3)

    def choose(self, u):
        """Return triangles chosen by area, and the numbers spread over 0 to 1 in each."""
        number = dr.binary_search(0, self.count - 1, lambda i: dr.gather(mi.Float64, self.below, i) <= u)
        before = dr.gather(mi.Float64, self.below, dr.maximum(number, 1) - 1)
        before = dr.select(number == 0, 0, before)
        return number, (u - before) / (dr.gather(mi.Float64, self.below, number) - before)

    def _vector(self, numbers, base):
        return mi.Vector3d(*(dr.gather(mi.Float64, numbers, base + axis) for axis in range(3)))


@dataclass(frozen=True)
class LightSample:
    """Points on a light, of double precision."""

    position: Any  #: [m]
    normal: Any  #: unit vector
    density: Any  #: of the points over the area [1/m^2]; 0 where a point does not count


def is_area(emitter) -> bool:
    """Return whether an emitter of Mitsuba is an area light."""
    return str(emitter.class_name()) == "AreaLight"


def read_area(emitter) -> AreaLight:
    """Read an area light from Mitsuba: its shape from the transform, which side shines by asking for a normal.

    Raises InputError for a shape other than a rectangle, a disk or a sphere, for a sheared one, and for a radiance that
    varies.
    """
    shape = emitter.get_shape()
    name, kind = f"single-scatter: light '{shape.id()}'", shape.class_name()
    if kind not in SHAPES and not shape.is_mesh():
        raise InputError(f"{name} is a {kind}; wanted an 'area' emitter on a rectangle, a disk, a sphere or a mesh")
    parameters = mi.traverse(emitter)
    if "radiance.value" not in parameters:
        raise InputError(f"{name} has a textured radiance; wanted a constant one")
    given = np.broadcast_to(np.array(parameters["radiance.value"], dtype=np.float64).reshape(-1), 3)
    radiance = mi.Color3f(*(float(c) for c in given))
    if kind not in SHAPES:
        box = shape.bbox()
        centre, half = (np.array(part, dtype=np.float64).ravel() for part in (box.center(), 0.5 * box.extents()))
        x, y, z = (mi.Vector3d(*(float(c) for c in axis)) for axis in np.eye(3))
        reach = float(half[0]), float(half[1])
        return AreaLight(
            _MESH, mi.Point3d(*(float(c) for c in centre)), x, y, z, reach, radiance, _read_mesh(shape, name)
        )
    matrix = np.array(mi.traverse(shape)["to_world"].matrix, dtype=np.float64).reshape(4, 4)
    axes = matrix[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    # The third axis of a rectangle or disk is that of its normal: its length says nothing.
    sides = 3 if kind == "Sphere" else 2
    unit = axes[:, :sides] / lengths[:sides]
    uneven = kind != "Rectangle" and np.ptp(lengths[:sides]) > _SHEAR * lengths[0]
    if uneven or np.abs(unit.T @ unit - np.eye(sides)).max() > _SHEAR:
        raise InputError(f"{name} is sheared or stretched; wanted right angles, and one radius of a disk or sphere")
    across, up = axes[:, 0] / lengths[0], axes[:, 1] / lengths[1]
    normal = np.cross(across, up)
    there = np.array(shape.sample_position(0.0, mi.Point2f(0.5)).n, dtype=np.float64).reshape(3)
    if kind != "Sphere" and normal @ there < 0:
        normal = -normal
    vectors = [mi.Vector3d(*(float(c) for c in vector)) for vector in (across, up, normal)]
    return AreaLight(
        kind,
        mi.Point3d(*(float(c) for c in matrix[:3, 3])),
        across=vectors[0],
        up=vectors[1],
        normal=vectors[2],
        reach=(float(lengths[0]), float(lengths[0 if kind == "Sphere" else 1])),
        radiance=radiance,
    )


def _read_mesh(shape, name: str) -> _Mesh:
    """Read the triangles of a mesh; a point that Mitsuba samples on each says which side shines."""
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    corners: np.ndarray = vertices[np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)]
    corners[:, 1:] -= corners[:, :1]
    normals = np.cross(corners[:, 1], corners[:, 2])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    if not areas.sum() > 0:
        raise InputError(f"{name} has no area; wanted a mesh with triangles that have one")
    normals /= np.maximum(2 * areas, _LEAST)[:, None]
    middle = dr.zeros(mi.PreliminaryIntersection3f, len(areas))
    middle.t, middle.prim_index, middle.prim_uv = 1, dr.arange(mi.UInt32, len(areas)), mi.Point2f(1 / 3)
    middle.shape = mi.ShapePtr(shape)
    found = middle.compute_surface_interaction(
        dr.zeros(mi.Ray3f, len(areas)), mi.RayFlags.Minimal | mi.RayFlags.ShadingFrame
    )
    shining = np.array(found.sh_frame.n, dtype=np.float64).T
    normals[np.sum(normals * shining, axis=1) < 0] *= -1
    below = np.cumsum(areas) / areas.sum()
    below[-1] = 1.0
    own = shape.id()
    scene = mi.load_dict({"type": "scene", "light": shape})
    shape.set_id(own)  # the key became its name
    one, two, three = (mi.Float64(np.ascontiguousarray(part).ravel()) for part in (corners, normals, below))
    return _Mesh(scene, one, two, three, len(areas), float(areas.sum()))


def sample_point(u, v, light: AreaLight, *, origin, direction) -> LightSample:
    """Sample points on a light for camera rays.

    `u`, `v`: uniform in [0, 1); `light`: the light; `origin`, `direction`: the rays, of double precision.

    Valid for any ray.
    """
    u, v = mi.Float64(u), mi.Float64(v)
    if light.mesh is not None:
        return _on_mesh(u, v, light.mesh, origin, direction)
    return (_on_sphere if light.shape == "Sphere" else _on_plane)(u, v, light, origin, direction)


def sample_evenly(u, v, light: AreaLight) -> LightSample:
    """Sample points evenly over the area of a light, for u and v uniform in [0, 1)."""
    u, v = mi.Float64(u), mi.Float64(v)
    density = mi.Float64(1 / light.area)
    if light.mesh is not None:
        number, u = light.mesh.choose(u)
        return LightSample(_even_in_triangle(u, v, light.mesh, number), light.mesh.normal(number), density)
    if light.shape == "Sphere":
        normal = _towards(1 - 2 * v, 2 * math.pi * u, mi.Vector3d(0, 0, 1))
        return LightSample(light.centre + light.reach[0] * normal, normal, density)
    x, y = _even_in_plane(u, v, light)
    return LightSample(light.centre + light.across * x + light.up * y, light.normal, density)


def _even_in_plane(u, v, light: AreaLight) -> tuple[Any, Any]:
    a, b = light.reach
    if light.shape == "Rectangle":
        return a * (2 * u - 1), b * (2 * v - 1)
    sine, cosine = dr.sincos(2 * math.pi * u)
    return a * dr.sqrt(v) * cosine, b * dr.sqrt(v) * sine


def _on_plane(u, v, light: AreaLight, origin, direction) -> LightSample:
    """Sample points evenly and about the place where the ray meets the plane, moved onto the light."""
    a, b = light.reach
    slope = dr.dot(direction, light.normal)
    offset = light.centre - origin
    parallel = dr.abs(slope) < _PARALLEL
    meets = dr.dot(offset, light.normal) / dr.select(parallel, 1, slope)
    place = origin + direction * dr.select(parallel, dr.dot(offset, direction), meets) - light.centre
    x0, y0 = dr.dot(place, light.across), dr.dot(place, light.up)
    if light.shape == "Rectangle":
        x0, y0 = dr.clip(x0, -a, a), dr.clip(y0, -b, b)
    else:
        inward = dr.minimum(1, a / dr.maximum(dr.hypot(x0, y0), _LEAST))
        x0, y0 = x0 * inward, y0 * inward
    fraction = _fraction(light.centre + light.across * x0 + light.up * y0, light, origin, direction)

    about = v < fraction
    x, y = _even_in_plane(u, (v - fraction) / (1 - fraction), light)
    sine, cosine = dr.sincos(2 * math.pi * u)
    distance = _edge(x0, y0, cosine, sine, light) * (v / fraction)
    x, y = dr.select(about, x0 + distance * cosine, x), dr.select(about, y0 + distance * sine, y)
    rho = dr.hypot(x - x0, y - y0)
    # At a place on the edge the light has no extent outwards: the sample drawn there is the place itself.
    counts = rho > _TOUCHING * max(a, b)
    rho = dr.select(counts, rho, 1)
    edge = _edge(x0, y0, (x - x0) / rho, (y - y0) / rho, light)
    # A point that rounding puts a little beyond the edge is at the edge.
    density = (1 - fraction) / light.area + fraction / (2 * math.pi * dr.maximum(edge, rho) * rho)
    density = dr.select(counts, density, 0)
    return LightSample(light.centre + light.across * x + light.up * y, light.normal, density)


def _even_in_triangle(u, v, mesh: _Mesh, number):
    root = dr.sqrt(u)
    return mesh.corner(number, 0) + mesh.corner(number, 1) * (root * (1 - v)) + mesh.corner(number, 2) * (root * v)


def _on_mesh(u, v, mesh: _Mesh, origin, direction) -> LightSample:
    """Sample points evenly, and half of those of a ray that meets the mesh about the place where it does."""
    hit = mesh.scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction)))
    meets = hit.is_valid()
    met = dr.select(meets, hit.prim_index, 0)
    fraction = mi.Float64(dr.select(meets, 0.5, 0))
    number, within = mesh.choose(u)
    even = _even_in_triangle(within, (v - fraction) / (1 - fraction), mesh, number)

    # The place in the triangle that was met, in the axes of its first side and across it.
    corner, first, second, normal = (*(mesh.corner(met, which) for which in range(3)), mesh.normal(met))
    across = dr.normalize(first)
    up = dr.cross(normal, across)
    slope = dr.dot(direction, normal)
    reach = dr.dot(corner - origin, normal) / dr.select(dr.abs(slope) < _PARALLEL, 1, slope)
    place = origin + direction * reach
    ends = [corner, corner + first, corner + second]
    sine, cosine = dr.sincos(2 * math.pi * u)
    edge = _edge_of_triangle(place, across * cosine + up * sine, ends, normal)
    about = meets & (v < fraction)
    position = dr.select(about, place + (across * cosine + up * sine) * (edge * v / dr.maximum(fraction, _LEAST)), even)
    number = dr.select(about, met, number)

    way = position - place
    rho = dr.norm(way)
    here = meets & (number == met)
    counts = ~here | (rho > _TOUCHING * dr.norm(first))
    rho = dr.select(here & counts, rho, 1)
    edge = _edge_of_triangle(place, way / rho, ends, normal)
    pdf = (1 - fraction) / mesh.area
    pdf += dr.select(here, fraction / (2 * math.pi * dr.maximum(edge, rho) * rho), 0)
    return LightSample(position, mesh.normal(number), dr.select(counts, pdf, 0))


def _edge_of_triangle(place, towards, ends, normal):
    """Return how far a triangle reaches from a place in it in a unit direction of its plane [m]."""
    reach = mi.Float64(dr.inf)
    for one, other in zip(ends, (*ends[1:], ends[0])):
        inward = dr.cross(normal, other - one)
        inward = inward * dr.sign(dr.dot(inward, sum(ends) / 3 - one))
        rate = -dr.dot(inward, towards)
        gap = dr.maximum(dr.dot(inward, place - one), 0)
        reach = dr.select(rate > 0, dr.minimum(reach, gap / dr.select(rate > 0, rate, 1)), reach)
    return reach


def _fraction(place, light: AreaLight, origin, direction):
    """Return the fraction of points about a place of a light: a half where the ray meets it, few where it is far."""
    offset = place - origin
    gap = dr.norm(offset - direction * dr.dot(offset, direction)) / max(light.reach)
    return 0.5 / (1 + _FADE * gap * gap)


def _edge(x0, y0, cosine, sine, light: AreaLight):
    """Return how far a rectangle or disk reaches from a point of its plane in a direction [m]."""
    a, b = light.reach
    if light.shape == "Disk":
        along = x0 * cosine + y0 * sine
        return -along + dr.sqrt(dr.maximum(along * along + a * b - x0 * x0 - y0 * y0, 0))
    sideways = (a - x0 * dr.sign(cosine)) / dr.maximum(dr.abs(cosine), _LEAST)
    upwards = (b - y0 * dr.sign(sine)) / dr.maximum(dr.abs(sine), _LEAST)
    return dr.maximum(dr.minimum(sideways, upwards), 0)


def _on_sphere(u, v, light: AreaLight, origin, direction) -> LightSample:
    """Sample points on the side that is turned to the ray, and about the two places where the ray meets the sphere."""
    radius = light.reach[0]
    offset = origin - light.centre
    middle = offset - direction * dr.dot(offset, direction)
    height = dr.norm(middle)
    half = dr.sqrt(dr.maximum(radius * radius - height * height, 0))
    side = dr.select(height > _LEAST, middle / dr.maximum(height, _LEAST), _across(direction))
    # A ray that misses the sphere comes nearest to it in one place.
    middle = side * dr.minimum(height, radius)
    places = [dr.normalize(middle + direction * (sign * half)) for sign in (-1, 1)]
    fraction = _fraction(light.centre + radius * places[0], light, origin, direction)

    angle = 2 * math.pi * u
    normal = _towards(2 * dr.sqrt(dr.clip((v - fraction) / (1 - fraction), 0, 1)) - 1, angle, side)
    for number, place in enumerate(places):
        chord = dr.clip(2 * v / fraction - number, 0, 1)  # over the diameter
        chosen = (v < fraction) & ((v < 0.5 * fraction) == (number == 0))
        normal = dr.select(chosen, _towards(1 - 2 * chord * chord, angle, place), normal)
    density = (1 - fraction) * (1 + dr.dot(normal, side)) / light.area
    for place in places:
        chord = dr.maximum(radius * dr.norm(normal - place), _LEAST)
        density = density + 0.5 * fraction / (4 * math.pi * radius * chord)
    return LightSample(light.centre + normal * radius, normal, density)


def _towards(cosine, angle, axis):
    """Return unit vectors at an angle, by its cosine, from an axis, and turned about it."""
    sine = dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
    turned_sine, turned_cosine = dr.sincos(angle)
    side = _across(axis)
    up = dr.cross(axis, side)
    return dr.normalize(side * (sine * turned_cosine) + up * (sine * turned_sine) + axis * cosine)


def _across(axis):
    """Return unit vectors at right angles to others."""
    aside = dr.select(dr.abs(axis.x) > 0.6, mi.Vector3d(0, 1, 0), mi.Vector3d(1, 0, 0))
    return dr.normalize(dr.cross(aside, axis))
