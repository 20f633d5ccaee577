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
from functools import partial, reduce
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.numerics.array_types import Metres, PerRay
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.rays import profile
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.light_table import LightTable, lights_apart
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Medium
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


@dataclass(frozen=True)
class LitSurfaces:
    """The surfaces that camera rays meet, with the media before them; any light may fall on them."""

    geometry: Any  #: the Mitsuba scene, for shadow rays; None where none are cast
    visible: VisibleSurface
    medium: Medium  #: that light crosses on its way
    depths: tuple[PerRay, ...]  #: optical depths of the camera rays, by channel

    @property
    def nothing(self) -> PerRay:
        """The radiance of surfaces that no light reaches."""
        return dr.zeros(type(self.medium.albedo), dr.width(self.visible.distance))

    def reflected(self, light: Light, *, shadow_rays: bool) -> PerRay:
        """Return the radiance that the surfaces send to the eye from one light [W/(m^2 sr)].

        `shadow_rays`: whether rays say where the light is blocked; a method that finds out
        otherwise what is lit leaves them out.
        """
        visible, medium = self.visible, self.medium
        # Lambert's law: the surface faces the light, and nothing is between them.
        cosine, r, arriving = _arriving(light, visible)
        lit = visible.seen & (cosine > 0)
        if shadow_rays:
            box = self.geometry.bbox()
            size = float(np.linalg.norm(np.ravel(box.max) - np.ravel(box.min)))
            lit &= ~self.geometry.ray_test(light.shadow_ray_from(visible.interaction, size), lit)
        reflected = (
            visible.albedo
            * arriving
            * (dr.inv_pi * cosine / dr.square(r) if light.w else dr.inv_pi * cosine)
        )
        # One exponential takes the extinction of both segments.
        to_light = medium.depth_to_light(light, visible.point, r, active=lit)
        depths = [camera + beyond for camera, beyond in zip(self.depths, to_light, strict=True)]
        return dr.select(lit, reflected * medium.transmittance(depths), type(medium.albedo)(0))

    def before_shadows(self, light: Light, _: Any = 0) -> PerRay:
        """Return what the surfaces send back of a light whose shadows a method knows.

        The map of a light at infinity covers the media alone, and surfaces beside them are lit too:
        shadows of such a light always come from rays.
        """
        return self.reflected(light, shadow_rays=not light.w)

    def reached(self, tables: Sequence[LightTable], visibility: Sequence[Any]) -> PerRay:
        """Return the radiance of the surfaces where a method knows what reaches them.

        `tables`: the lights; `visibility`: see `realtime.methods.interface.method.Layers`.
        """
        # One entry for each light, or one for all samples of each area light.
        by_source = len(visibility) != sum(table.count for table in tables)
        apart, total = lights_apart(tables, by_source=by_source), self.nothing
        for fraction, lights in zip(visibility, apart, strict=True):
            if callable(fraction):
                total = lights.sum(partial(self._of_sample, fraction), total)
            else:
                color = lights.sum(self.before_shadows, self.nothing)
                total = total + _part(fraction, color)
        return total

    def _of_sample(self, fraction: Callable[[Light, Any], Any], light: Light, number: Any):
        return _part(fraction(light, number), self.before_shadows(light))


def _part(fraction: Any, color: PerRay) -> PerRay:
    """Return a fraction of a colour, or the colour where a mask lets it pass."""
    if isinstance(fraction, bool) or dr.is_mask_v(fraction):
        return dr.select(fraction, color, 0)
    return fraction * color


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


def lit_surfaces(
    geometry,
    facets: Facets | None,
    pixel,
    camera,
    medium: Any,
    cast: Cast,
    *,
    through_media: bool,
) -> LitSurfaces:
    """Return the surfaces that the camera rays of some pixels met.

    `geometry`: the Mitsuba scene, None where no shadow rays will be cast; `facets`: as for
    `cast_rays`; `cast`: from there; `through_media`: whether bounded media dim the surfaces; if
    not, the method says how much they do.
    """
    medium = medium if through_media else replace(medium, bounded_media=())
    direction, _ = ray_directions(camera, pixel)
    visible = visible_surface(cast, facets, camera.origin, direction, color=type(medium.albedo))
    # Rays that meet nothing have no depth: an infinite one would be NaN times 0.
    end = dr.select(visible.seen, cast.distance, 0)
    depths = medium.optical_depth(medium.rays(camera.origin, direction), 0, end)
    return LitSurfaces(geometry, visible, medium, depths)


def surface_stages(
    scene: Scene, *, shadow_rays: bool, through_media: bool
) -> tuple[Frozen, Frozen]:
    """Return the recorded functions that cast the camera rays of a scene, and light what they meet.

    `scene`: the scene; what matters is what cannot move; `shadow_rays`: whether shadow rays say
    which surfaces are lit; if not, the method of the frame does, and nothing is lit here;
    `through_media`: see `lit_surfaces`. Returns `surface`: (geometry, facets, pixel, camera,
    medium, tables) -> a `Cast`, and what `shade` returns; `shade`: (geometry, facets, pixel,
    camera, medium, tables, cast) -> the radiance of the surfaces [W/(m^2 sr)], None where nothing
    is lit.
    """
    features = scene.features  # a function that holds the scene would keep its meshes alive

    def shade(geometry, facets, pixel, camera, medium, tables, cast):
        if not (features.surfaces and shadow_rays):
            return None
        surfaces = lit_surfaces(
            geometry, facets, pixel, camera, medium, cast, through_media=through_media
        )

        def lit(light: Light, _: Any) -> PerRay:
            return surfaces.reflected(light, shadow_rays=True)

        return reduce(lambda total, table: table.sum(lit, total), tables, surfaces.nothing)

    def surface(geometry, facets, pixel, camera, medium, tables):
        if not features.surfaces:
            return Cast(dr.full(type(camera.origin.x), dr.inf, dr.width(pixel))), None
        direction, _ = ray_directions(camera, pixel)
        cast = cast_rays(geometry, facets, camera.origin, direction)
        return cast, shade(geometry, facets, pixel, camera, medium, tables, cast)

    return Frozen(surface), Frozen(shade)
