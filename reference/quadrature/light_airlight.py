# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of one light along every ray, by the steps of `reference.quadrature.image`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.fields import field_of
from airlight.reference.quadrature.integrate import Terms
from airlight.reference.quadrature.intervals import Stretches, lit_stretches
from airlight.reference.quadrature.model_terms import (
    Route,
    fade_along,
    lamp_terms,
    largest_law,
    of_lamps,
    ray_factor,
    route_of,
    strength_of,
)
from airlight.reference.scene.convex_bounds import furthest
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import Shapes, read_shapes
from airlight.reference.visibility.candidates import Ball
from airlight.reference.visibility.certificate import LitIntervals, coordinates
from airlight.reference.visibility.lit_intervals import Obstacles, lit_intervals, obstacles, reaches
from airlight.reference.visibility.planes import Rays, cone_interval, rays_at

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LightAirlight:
    """The airlight of one light in the rays."""

    radiance: Array  #: in-scattered, (rays, 3) [W/(m^2 sr)]
    error: Array  #: its error, of the kind of the field, (rays, 3) [W/(m^2 sr)]
    #: between the ray and the direction to the light, pi where that is not before the surface [rad]
    angle: Array
    lit: LitIntervals  #: the intervals that were integrated
    reached: NDArray[np.bool_]  #: whether the light reaches the end of the ray


@dataclass(frozen=True)
class LitRays:
    """The rays in their planes with one light, and which parts of them it reaches."""

    rays: Rays
    lit: LitIntervals  #: up to the surface, in the cone of a spot
    distance: Array  #: to the visible surface, (rays,) [m]
    shapes: Shapes  #: what can stand in the light
    end: Array  #: up to where the rays were looked at, (rays,) [m]


def light_airlight(
    reference: ReferenceScene,
    light: ReferenceLight | DirectionalLight,
    distance: Array,
    *,
    shadow_scale: float = 1.0,
    checks: int = 32,
    shapes: Shapes | None = None,
    route: Route | None = None,
) -> LightAirlight:
    """Compute the airlight of one point, spot or directional light along every ray.

    `reference`, `light`: the scene and one of its lights; `distance`: to the visible surface,
    (rays,), infinite where there is none [m]; `shadow_scale`: see
    `reference.quadrature.image.quadrature_image`; `checks`, `shapes`: see `lit_rays`; `route`:
    where the fog begins and ends, if that is known.
    """
    illumination = lit_rays(reference, light, distance, checks=checks, shapes=shapes)
    reached = reaches(illumination.lit, distance)
    # A model may have fog behind the surface, where other parts are lit.
    route = route_of(reference, distance) if route is None else route
    if np.any(route.end > distance):
        end = np.maximum(route.end, distance)
        illumination = lit_rays(reference, light, end, checks=checks, shapes=shapes)
    rays, lit, angle = illumination.rays, illumination.lit, np.full(len(distance), np.pi)
    # The angle at the camera between ray and light counts where the foot of the light is before
    # the surface.
    if not isinstance(light, DirectionalLight):
        in_front = (rays.foot > 0) & (rays.foot < distance)
        angle = np.where(in_front, np.arctan2(rays.height, rays.foot), angle)
    # A light that the equation leaves out has no integral, which may be infinite.
    strength = strength_of(reference, light)
    if not strength:
        none = np.zeros((len(distance), 3))
        return LightAirlight(none, none, angle, lit, reached)
    if isinstance(light, DirectionalLight):
        radiance, error = _sun_sums(reference, light, illumination, route)
        error = error + worth_of_doubt(reference, rays, lit) * light.irradiance
    else:
        radiance, error = lit_sums(reference, light, rays, lit, route, shadow_scale)
        error = error + worth_of_doubt(reference, rays, lit) * light.intensity
    factor = strength * ray_factor(reference, route)
    return LightAirlight(factor * radiance, factor * error, angle, lit, reached)


def lit_sums(
    reference: ReferenceScene,
    light: ReferenceLight,
    rays: Rays,
    lit: LitIntervals,
    route: Route,
    shadow_scale: float = 1.0,
) -> tuple[Array, Array]:
    """Return the airlight of a point or spot light from the lit intervals of rays, and
    its error, (rays, 3) each.
    """
    lamp = lamp_terms(reference, light, rays, lit_stretches(light, rays, lit), route)
    terms = Terms(lamp.profile, lamp.law, route.paths, shadow_scale, lit.edge)
    field = field_of(of_lamps(reference))
    value, error = field.sums(lamp.rays, lamp.stretches, route.end, terms)
    return value * light.intensity, error * light.intensity


def _sun_sums(
    reference: ReferenceScene, light: DirectionalLight, found: LitRays, route: Route
) -> tuple[Array, Array]:
    rays, lit = found.rays, found.lit
    _, _, high = stretches = sun_stretches(reference, found)
    # The effect on a ray of the uncertainty of coordinates, of shapes, lit parts and bodies, through
    # an edge or a kink; at most all of the ray.
    bodies = [furthest(medium.bounds, reference.origin) for medium in reference.media]
    far = max(lit.high.max(initial=0.0), *bodies, 0.0)
    scale = np.maximum(coordinates(rays, found.shapes), far / rays.height)
    edge = np.minimum(lit.edge * scale, np.bincount(lit.ray, high - lit.low, len(found.distance)))
    rounding = np.finfo(float).eps * scale
    terms = Terms(fade_along(reference), None, route.paths, edge=edge, rounding=rounding)
    value, error = field_of(reference).sums(rays, route.clipped(stretches), route.end, terms)
    return value * light.irradiance, error * light.irradiance


def lit_rays(
    reference: ReferenceScene,
    light: ReferenceLight | DirectionalLight,
    distance: Array,
    *,
    shapes: Shapes | None = None,
    known: Obstacles | None = None,
    checks: int = 32,
) -> LitRays:
    """Return which parts of the rays a point, spot or directional light reaches.

    `reference`, `light`, `distance`: see `light_airlight`; `shapes`: what
    `reference.scene.shapes.read_shapes` returned, if known; `known`: what can stand in a point
    light, if that was found for a ball that holds it; `checks`: random shadow rays to each ray.
    """
    normal = None
    if isinstance(light, DirectionalLight):
        rays, ball = (
            rays_at(reference.origin, reference.direction, -light.direction, w=0),
            Ball(-light.direction, w=0),
        )
        shapes = read_shapes(reference.occluders) if shapes is None else shapes
        # No shadow falls on a ray where it has left the light's cylinder about all shapes. `height`
        # is the sine between ray and sun. Along rays without an end shadows are looked for up to
        # 1e4 times as far as shapes reach, and 1e4 m at least.
        clear = coordinates(rays, shapes)
        leave = field_of(reference).leave(reference.origin, reference.direction)
        most = np.where(np.isinf(leave), 1e4 * np.maximum(clear * rays.height, 1.0), np.inf)
        last = np.minimum(np.minimum(leave, clear), most)
        far = np.where(np.isfinite(distance), distance, last)
        ends = np.zeros_like(far), far
    else:
        rays, ball, far = (
            rays_at(reference.origin, reference.direction, light.position),
            Ball(light.position),
            distance,
        )
        # Only the part of a ray in the cone of a spot is lit; a ray that misses the cone gets an
        # empty interval.
        cone = cone_interval(rays, light, light.cutoff)
        none = cone[0] > cone[1]
        ends = np.maximum(rays.distance(cone[0]), 0.0), np.minimum(rays.distance(cone[1]), distance)
        ends = np.where(none, 0.0, ends[0]), np.where(none, 0.0, ends[1])
        # A sample of an area light sends light to one side of its plane.
        if light.cosine and light.axis is not None:
            normal = np.broadcast_to(light.axis, reference.direction.shape)
    known = obstacles(reference, ball, far, shapes) if known is None else known
    lit = lit_intervals(rays, ends, known, checks=checks, normal=normal)
    return LitRays(rays, lit, distance, known.shapes, ends[1])


def sun_stretches(reference: ReferenceScene, found: LitRays) -> Stretches:
    """Return which parts of rays a directional light reaches; the last may end where
    its ray leaves the media.
    """
    lit = found.lit
    # Behind all that could stand in the light, a ray is lit or not, as it is at the end of the part
    # that was looked at. It then goes on to where it leaves the media.
    goes_on = (reaches(lit, found.end) & np.isinf(found.distance))[lit.ray]
    # An interval that ends within 1e-6 of where its ray was looked at ends there.
    last = lit.high * (1 + 1e-6) >= found.end[lit.ray]
    leaves = np.where(
        goes_on & last,
        field_of(reference).leave(reference.origin, reference.direction)[lit.ray],
        lit.high,
    )
    return lit.ray, lit.low, np.maximum(lit.high, leaves)


def worth_of_doubt(reference: ReferenceScene, rays: Rays, lit: LitIntervals) -> Array:
    """Return the largest airlight of the parts that shadow rays left in doubt, for a light
    of strength 1, (rays, 3).

    In theta the integrand of J is exp(-sigma_t (x + r)) p / height; the exponential is at most one,
    and the phase function at most its largest value. For a directional light it is exp(-tau) p, in
    the distance. A distance law has its largest r^2 f(r), a fade is largest at the camera.
    """
    worth = np.zeros((len(rays.foot), 3))
    ray, part = lit.doubt
    field = field_of(of_lamps(reference) if rays.w else reference)
    part = part / rays.height[ray] * largest_law(reference, rays)[ray] if rays.w else part
    if reference.model.fade_of is not None:
        full, end = reference.model.fade_of
        part = part * (end / (end - full))
    np.add.at(worth, ray, part[:, None] * field.strongest / (4 * np.pi))
    return worth
