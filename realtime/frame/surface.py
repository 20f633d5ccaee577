# SPDX-License-Identifier: BSD-3-Clause
"""Primary rays and the lit surface.

Biri, Arques, Michelin 2006, section 5.1.2, with the extinction to the eye of eq. 1:

    L = rho I cos(theta_p) / (pi r_p^2) exp(-sigma_t r_p) exp(-sigma_t distance),

zero where a shadow ray is blocked; for a directional light, rho E cos(theta_p) / pi replaces the
first fraction. With bounded media both exponents are sums over the media that the two segments
cross (`realtime.scene.media.bounded`). A one-sided surface is black from behind, as in Mitsuba's
`diffuse`.

Primary hits depend on camera and geometry alone, and serve many frames
(`realtime.frame.incremental`). There are two recorded functions: one casts and shades, and hands on
its hits at no cost; the other shades the hits of another frame. Casting and shading in two steps
whenever something moved would take up to 7 % longer.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import Metres, PerRay
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.rays import profile
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.light_table import LightTable, lights_apart
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Medium, Rays
from airlight.realtime.scene.read_scene import Scene
from airlight.realtime.scene.triangle_table import Facets, facet_at, facet_number


@dataclass(frozen=True)
class Cast:
    """The first hits of camera rays: all of a frame that depends on the
    camera and the geometry alone.
    """

    distance: Metres  #: infinite where there is nothing [m]
    triangle: PerRay | None = None  #: its number in the table of facets, where there is one
    uv: PerRay | None = None  #: barycentric coordinates in it, where its normals are interpolated
    hit: Any = None  #: without a table, Mitsuba's preliminary intersection
    crossed: tuple[Any, ...] = ()  #: `Rays.crossed`


@dataclass
class VisibleSurface:
    """The first hits of camera rays, with all that their shading needs."""

    distance: Metres  #: infinite where there is nothing [m]
    point: Metres  #: [m]
    normal: PerRay  #: unit normal, on the side of the camera where the surface is lit from both
    albedo: PerRay  #: diffuse reflectance
    seen: PerRay  #: whether there is a surface, seen from a side that reflects
    interaction: Any  #: Mitsuba's, for shadow rays


def cast_rays(scene, facets: Facets | None, origin, direction) -> Cast:
    """Cast the camera rays.

    `scene`: the Mitsuba scene; `facets`: its triangles, or None: then Mitsuba will be asked for the
    surfaces; `origin`, `direction`: rays in any precision [m] and their unit directions; they are
    cast in float32.
    """
    Float = type(origin.x)
    hit = scene.ray_intersect_preliminary(_ray(origin, direction), coherent=True)
    valid = hit.is_valid()
    distance = dr.select(valid, Float(hit.t), dr.inf)
    if facets is None:
        return Cast(distance, hit=hit)
    return Cast(distance, facet_number(facets, hit, valid), hit.prim_uv if facets.smooth else None)


def visible_surface(
    cast: Cast, facets: Facets | None, origin, direction, *, color
) -> VisibleSurface:
    """Return the surfaces that camera rays meet; `color` is the type of an albedo.

    `origin` [m] and unit `direction`s as for `cast_rays`.
    """
    Vector = type(direction)
    distance = cast.distance
    valid = dr.isfinite(distance)
    if facets is None:
        interaction = cast.hit.compute_surface_interaction(
            _ray(origin, direction), ray_flags=mi.RayFlags.All
        )
        bsdf = interaction.bsdf()
        albedo = color(bsdf.eval_diffuse_reflectance(interaction))
        point, normal = Vector(interaction.p), Vector(interaction.sh_frame.n)
        two_sided = mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)
    else:
        unit, two_sided, reflectance = facet_at(facets, cast.triangle, cast.uv, valid)
        normal, albedo = Vector(*unit), color(*reflectance)
        point = dr.fma(direction, dr.select(valid, distance, 0), origin)
        interaction = dr.zeros(mi.Interaction3f)
        interaction.t, interaction.p, interaction.n = (
            mi.Float(distance),
            mi.Point3f(point),
            mi.Normal3f(normal),
        )
    facing = -dr.dot(normal, direction)
    normal = dr.select(two_sided & (facing < 0), -normal, normal)
    return VisibleSurface(
        distance, point, normal, albedo, valid & (two_sided | (facing > 0)), interaction
    )


def _ray(origin, direction):
    return mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))


def lit_surface(
    scene, surface: VisibleSurface, *, medium: Medium, light: Light, depths, shadows: bool = True
):
    """Return the radiance that the visible surface sends to the eye through the medium,
    from one light [W/(m^2 sr)].

    `scene`: the Mitsuba scene, for shadow rays; `surface`: from `visible_surface`; `medium`,
    `light`: what the light crosses and where it comes from; `depths`: the optical depths of the
    camera rays, by channel; `shadows`: whether to cast shadow rays; a method that finds out
    otherwise what is lit leaves them to that.
    """
    cosine, r, arriving = _arriving(light, surface)
    lit = surface.seen & (cosine > 0)
    if shadows:
        lit &= ~scene.ray_test(light.shadow_ray_from(surface.interaction), lit)
    reflected = (
        surface.albedo
        * arriving
        * (dr.inv_pi * cosine / dr.square(r) if light.w else dr.inv_pi * cosine)
    )
    both = zip(depths, medium.depth_to_light(light, surface.point, r, active=lit), strict=True)
    kept = medium.transmittance([camera + own for camera, own in both])
    return dr.select(lit, reflected * kept, type(medium.albedo)(0))


def _arriving(light: Light, surface: VisibleSurface):
    """Return the cosine at which a light meets a surface, the distance that it came,
    and its intensity there.

    Light from infinity has an irradiance for an intensity, and its distance counts nowhere.
    """
    if not light.w:
        return -dr.dot(surface.normal, light.axis), None, light.intensity
    to_light = light.toward(surface.point)
    r = dr.norm(to_light)
    cosine = dr.dot(surface.normal, to_light) / r
    return cosine, r, light.intensity * profile(light, surface.point, -to_light / r)


def surface_stages(
    scene: Scene, *, provides_visibility: bool, by_source: bool = False, through_media: bool = True
) -> tuple[Callable[..., Any], Callable[..., Any], bool]:
    """Return the stages for a scene.

    `scene`: the scene; what matters is what cannot move; `provides_visibility`: whether the method
    finds out which surfaces are lit; `by_source`: whether it does so for all points of an area
    light together; `through_media`: whether the bounded media dim the surfaces; if not, the method
    says how much they do. Returns `surface`: (geometry, facets, pixel, camera, medium, tables) ->
    what camera rays meet, and what `shade` returns; `shade`: (geometry, facets, pixel, camera,
    medium, tables, cast) -> surface radiance by light, or a tuple of their sum; `casts_rays`:
    whether `shade` needs the geometry.
    """

    def apart(tables: Sequence[LightTable]) -> list[LightTable]:
        return list(lights_apart(tables, by_source=by_source))

    if not scene.features.surfaces:
        return *_no_surfaces(lambda tables: len(apart(tables)) if provides_visibility else 1), False

    def cast_all(geometry, facets, pixel, camera, medium) -> Cast:
        direction, _ = ray_directions(camera, pixel)
        cast = cast_rays(geometry, facets, camera.origin, direction)
        return replace(
            cast, crossed=medium.rays(camera.origin, direction).crossed if through_media else ()
        )

    def shade_all(geometry, facets, pixel, camera, medium, tables, cast):
        direction, _ = ray_directions(camera, pixel)
        seen = visible_surface(cast, facets, camera.origin, direction, color=type(medium.albedo))
        medium = medium if through_media else replace(medium, bounded_media=())
        rays = Rays(camera.origin, direction, direction, cast.crossed)
        depths = medium.optical_depth(rays, 0, dr.select(seen.seen, cast.distance, 0))

        def lit(light: Light, number: Any = 0):
            # The map of a light at infinity covers the media alone; surfaces
            # beside them are lit too.
            shadows = not (light.w and provides_visibility)
            return lit_surface(
                geometry, seen, medium=medium, light=light, depths=depths, shadows=shadows
            )

        nothing = dr.zeros(type(medium.albedo), dr.width(pixel))
        if not provides_visibility:
            return (reduce(lambda total, table: table.sum(lit, total), tables, nothing),)
        return tuple(part.sum(lit, nothing) for part in apart(tables))

    @Frozen
    def surface(geometry, facets, pixel, camera, medium, tables):
        cast = cast_all(geometry, facets, pixel, camera, medium)
        return cast, shade_all(geometry, facets, pixel, camera, medium, tables, cast)

    asks = not provides_visibility or any(not light.w for light in scene.lights)
    return surface, Frozen(shade_all), scene.facets is None or asks


def _no_surfaces(
    colors: Callable[[Sequence[LightTable]], int],
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the stages of a scene without surfaces, whose `shade`
    returns so many black colours.
    """

    def shade(geometry, facets, pixel, camera, medium, tables, cast):
        return tuple(dr.zeros(type(medium.albedo), dr.width(pixel)) for _ in range(colors(tables)))

    def surface(geometry, facets, pixel, camera, medium, tables):
        cast = Cast(dr.full(type(camera.origin.x), dr.inf, dr.width(pixel)))
        return cast, shade(geometry, facets, pixel, camera, medium, tables, cast)

    return surface, shade
