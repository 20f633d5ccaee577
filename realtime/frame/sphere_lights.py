# SPDX-License-Identifier: BSD-3-Clause
r"""The airlight of light samples on a sphere, scaled to the airlight of the sphere
where nothing is in the way.

A sample at the height h over a ray sends J ~ 1/h into it, so that samples at fixed places leave a
peak beside the sphere wherever a ray passes close to one. With J_i of the N samples and their
shadowed V_i, a frame has

    sum V_i J_i  *  U / sum J_i,           U = (N / A) int J dA over the sphere:

the fraction of the light that is not in shadow, as the samples see it, of the whole light, exactly.
Without occluders that is U. J is that of unshadowed samples, by the same kernel.

U by places that suit the ray. In half planes about the ray at the azimuth phi from the centre, at
the height H over the ray, the sphere of radius R is a circle: its middle at the height m = H cos
phi, its radius rho, rho^2 = R^2 - H^2 sin^2 phi. With b the angle on it, the point at the height
h = m + rho cos b stands for dA = R h dphi db, and h J is bounded. Where the line of the ray misses
the sphere, sin phi goes up to S = R/H; with sin phi = S sin g the integrand is periodic in g and b,
and the midpoint rule converges faster than any power. In an even medium nothing changes at -phi, so
that half of the azimuths do. A line that meets the sphere has all azimuths, and the circle ends at
the line; a ray that ends at the sphere sees of it what its beginning sees.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.area_lights.points import LightSamples, place_points
from airlight.realtime.area_lights.shape import AreaLight
from airlight.realtime.methods.interface.method import Method, View, camera_view
from airlight.realtime.numerics.array_types import aligned_array, types_of
from airlight.realtime.numerics.functions import summed
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.scene.lights import Facing
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.read_scene import Scene

_AZIMUTHS, _ANGLES = 4, 8  # places for a ray


@dataclass(frozen=True)
class SampledSphere:
    """A sphere light and its samples on the device."""

    centre: Any  #: [m]
    radius: Any  #: [m]
    count: Any  #: of the samples
    normals: Any  #: of the samples, one a lane


def sphere_scales(scene: Scene, method: Method) -> Frozen | None:
    """Return a function for the scale of a sphere light's samples; None where scene,
    method or medium have no use.

    Valid for methods that render samples one by one with a kernel in a
    homogeneous medium without bounds.
    """
    if not any(light.kind == "sphere" for light in scene.area_lights):
        return None
    # Bodies of fog are on one side of a ray or the other: half of the azimuths would not do.
    even = type(scene.medium) is Homogeneous
    if method.at_once or not method.uses_kernel or not even:
        return None
    features = scene.features

    def scale(camera, pixel, medium, light, sphere, distance, kernel):
        view = camera_view(
            camera, pixel, distance, features=features, scene=None, medium=medium, tables=()
        )
        Float = type(distance)

        def integral(normal, exact_normal):
            facing = Facing(exact_normal, light.facing.lift, light.facing.chord)
            sample = replace(
                light, position=dr.fma(normal, sphere.radius, sphere.centre), facing=facing
            )
            return view.lit_by(sample, kernel).gamma(distance)

        def of_sample(number):
            normal = dr.gather(type(sphere.normals), sphere.normals, number)
            return integral(normal, mi.Vector3d(normal))

        suited = _places(view, sphere)

        def of_place(number):
            normal, weight = suited(number)
            return integral(normal, mi.Vector3d(normal)) * weight

        nothing = view.lit_by(light, kernel).nothing(dr.width(distance))
        every = summed(sphere.count, of_sample, nothing)
        whole = summed(_AZIMUTHS * _ANGLES, of_place, nothing)
        return dr.select(every > 0, whole * Float(sphere.count) / every, 1)

    return Frozen(scale)


def sampled_sphere(light: AreaLight, points: LightSamples, Float: Any) -> SampledSphere:
    """Return a sphere light as `sphere_scales` asks for it."""
    normals = place_points(light, points.points, points.pattern).normals
    Vector = types_of(Float).vector
    made = SampledSphere(
        Vector(*map(float, light.middle)),
        Float(light.radius),
        mi.UInt32(len(normals)),
        Vector(*(aligned_array(Float, column) for column in normals.T)),
    )
    dr.make_opaque(made)
    return made


def _places(view: View, sphere: SampledSphere):
    """Return a function of the number of a place: its normal, and its fraction of
    the area times the places.
    """
    Float, pi = type(sphere.radius), dr.pi
    direction, radius = view.direction, sphere.radius
    way = sphere.centre - view.origin
    along = dr.dot(way, direction)
    away = dr.fma(direction, -along, way)
    # Near the middle most of it may be rounding, which lies along the ray as well.
    away = dr.fma(direction, -dr.dot(away, direction), away)
    height = dr.norm(away)
    # A ray through the middle leaves no direction to it: then any across the ray serves.
    helper = dr.select(dr.abs(direction.x) < 0.5, type(away)(1, 0, 0), type(away)(0, 1, 0))
    up = dr.normalize(dr.select(height > 0, away, dr.cross(direction, helper)))
    side = dr.cross(direction, up)
    meets = height < radius
    front = along - dr.safe_sqrt(radius * radius - height * height)
    ends = meets & (front > 0) & (view.distance <= 0.5 * (front + along))
    sine = dr.minimum(radius / height, 1)

    def place(number):
        row, column = number // _ANGLES, number % _ANGLES
        g = (Float(row) + 0.5) / _AZIMUTHS
        part = (Float(column) + 0.5) / _ANGLES
        s = sine * dr.sin(0.5 * pi * g)
        phi = dr.select(meets, pi * g, dr.asin(s))
        rate = dr.select(
            meets, pi, 0.5 * pi * sine * dr.cos(0.5 * pi * g) * dr.rsqrt((1 - s) * (1 + s))
        )
        beside, middle = height * dr.sin(phi), height * dr.cos(phi)
        rho = dr.safe_sqrt((radius - beside) * (radius + beside))
        reach = dr.select(meets, dr.safe_acos(-middle / rho), pi)
        seen = dr.safe_acos(rho / dr.hypot(middle, along))
        last = dr.select(ends, dr.clip(dr.atan2(-along, -middle) + seen, -reach, reach), reach)
        b = dr.fma(part, last + reach, -reach)
        z, h = rho * dr.sin(b), dr.fma(rho, dr.cos(b), middle)
        across = dr.fma(up, dr.cos(phi), side * dr.sin(phi))
        normal = dr.fma(direction, z, dr.fma(across, h, -away)) / radius
        # Both halves of the azimuths over 4 pi R^2.
        weight = dr.maximum(h, 0) * rate * (last + reach) / (2 * pi * radius)
        return normal, weight / (_AZIMUTHS * _ANGLES)

    return place
