# SPDX-License-Identifier: BSD-3-Clause
"""Primary rays and the lit surface.

Biri, Arques, Michelin 2006, section 5.1.2, with the extinction to the eye of eq. 1:

    L = rho I cos(theta_p) / (pi r_p^2) exp(-sigma_t r_p) exp(-sigma_t distance),

zero where a shadow ray is blocked; of a directional light rho E cos(theta_p) / pi arrives at once. With bounded media
both exponents are sums over the media that the two legs cross (`realtime.bounded_media.pieces`). A one-sided
surface is black from behind, as in Mitsuba's `diffuse`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.pieces import path_transmittance
from realtime.numerics.array_types import Metres, PerRay
from realtime.numerics.fast_exp import exp_bounded
from realtime.rays.ray_light import falloff, ray_geometry
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, per_extinction, transmittance
from realtime.scene.triangle_table import Facets, facet_at, facet_number

_NO_DISTANCE = 1e-12  # what stands for the square of a distance of 0, of which no power is finite [m^2]


@dataclass(frozen=True)
class Cast:
    """What camera rays meet first: all of a frame that depends on the camera and the geometry alone."""

    distance: Metres  #: infinite where there is nothing [m]
    triangle: PerRay | None = None  #: its number in the table of facets, where there is one
    uv: PerRay | None = None  #: barycentric coordinates in it, where its normals are interpolated
    hit: Any = None  #: without a table, Mitsuba's preliminary intersection
    insides: tuple[Metres, ...] = ()  #: what of the ray up to there lies in each bounded medium [m]


@dataclass
class VisibleSurface:
    """What camera rays meet first, with all that its shading needs."""

    distance: Metres  #: infinite where there is nothing [m]
    point: Metres  #: [m]
    normal: PerRay  #: unit normal, on the side of the camera where the surface is lit from both
    albedo: PerRay  #: diffuse reflectance
    seen: PerRay  #: whether there is a surface, seen from a side that reflects
    interaction: Any  #: Mitsuba's, for shadow rays


def cast_rays(scene, facets: Facets | None, origin, direction) -> Cast:
    """Cast the camera rays.

    Parameters
    ----------
    scene
        The Mitsuba scene.
    facets
        Its triangles, or None: then Mitsuba will be asked for the surfaces.
    origin, direction
        Rays in any precision [m] and their unit directions; they are cast in float32.
    """
    Float = type(origin.x)
    hit = scene.ray_intersect_preliminary(_ray(origin, direction), coherent=True)
    valid = hit.is_valid()
    distance = dr.select(valid, Float(hit.t), dr.inf)
    if facets is None:
        return Cast(distance, hit=hit)
    return Cast(distance, facet_number(facets, hit, valid), hit.prim_uv if facets.smooth else None)


def visible_surface(cast: Cast, facets: Facets | None, origin, direction, *, color) -> VisibleSurface:
    """Return the surfaces that camera rays meet; `color` is the type of an albedo.

    `origin` [m] and unit `direction`s as for `cast_rays`.
    """
    Vector = type(direction)
    distance = cast.distance
    valid = dr.isfinite(distance)
    if facets is None:
        interaction = cast.hit.compute_surface_interaction(_ray(origin, direction), ray_flags=mi.RayFlags.All)
        bsdf = interaction.bsdf()
        albedo = color(bsdf.eval_diffuse_reflectance(interaction))
        point, normal = Vector(interaction.p), Vector(interaction.sh_frame.n)
        two_sided = mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)
    else:
        unit, two_sided, reflectance = facet_at(facets, cast.triangle, cast.uv, valid)
        normal, albedo = Vector(*unit), color(*reflectance)
        point = dr.fma(direction, dr.select(valid, distance, 0), origin)
        interaction = dr.zeros(mi.Interaction3f)
        interaction.t, interaction.p, interaction.n = mi.Float(distance), mi.Point3f(point), mi.Normal3f(normal)
    facing = -dr.dot(normal, direction)
    normal = dr.select(two_sided & (facing < 0), -normal, normal)
    return VisibleSurface(distance, point, normal, albedo, valid & (two_sided | (facing > 0)), interaction)


def visible_triangle(scene, origin, direction):
    """Return the triangles of the Mitsuba `scene` that rays from `origin` [m] along unit `direction`s hit first.

    Returns
    -------
    corners
        Three positions [m].
    weights
        Barycentric coordinates of the hit in them.
    seen
        Whether a triangle is hit.
    """
    hit = scene.ray_intersect_preliminary(_ray(origin, direction), coherent=True)
    mesh = mi.MeshPtr(hit.shape)
    seen = hit.is_valid() & hit.shape.is_mesh()
    mesh = dr.select(seen, mesh, dr.zeros(mi.MeshPtr))
    face = mesh.face_indices(hit.prim_index, seen)
    corners = [type(direction)(mesh.vertex_position(vertex, seen)) for vertex in (face.x, face.y, face.z)]
    Float = type(direction.x)
    u, v = Float(hit.prim_uv.x), Float(hit.prim_uv.y)
    return corners, (1 - u - v, u, v), seen


def _ray(origin, direction):
    return mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))


def lit_surface(scene, surface: VisibleSurface, *, medium: Medium, light: Light, depths=None, shadows: bool = True):
    """Return the radiance that the visible surface sends to the eye through the medium, from one light [W/(m^2 sr)].

    Parameters
    ----------
    scene
        The Mitsuba scene, for shadow rays.
    surface
        From `visible_surface`.
    medium, light
        What the light crosses and where it comes from.
    depths
        With bounded media, the optical depths of the camera rays, from
        `realtime.bounded_media.pieces.optical_depths`.
    shadows
        Whether to cast shadow rays; a method that finds out otherwise what is lit leaves them to that.
    """
    cosine, r, arriving = _arriving(light, surface)
    lit = surface.seen & (cosine > 0)
    if shadows:
        lit &= ~scene.ray_test(light.shadow_ray_from(surface.interaction), lit)
    reflected = surface.albedo * arriving * (dr.inv_pi * cosine / dr.square(r) if light.w else dr.inv_pi * cosine)
    if medium.bounded_media:
        kept = path_transmittance(medium, light, depths=depths, point=surface.point, active=lit)
    elif medium.clear:
        kept = 1
    else:
        kept = transmittance(medium, dr.select(lit, surface.distance + r, 0))
    return dr.select(lit, reflected * kept, type(medium.albedo)(0))


def lit_by_points(scene, surface: VisibleSurface, *, medium: Medium, lights: Sequence[Light], shadows: bool):
    """Return the sum of `lit_surface` over the points of a light with extent [W/(m^2 sr)].

    What they have in common is taken out of the sum: their intensity, the albedo and the leg to the eye.

    Parameters
    ----------
    scene, surface, shadows
        As for `lit_surface`.
    medium
        Without bounded media in it.
    lights
        The points of one light.
    """

    def weight(light: Light):
        toward = light.toward(surface.point)
        square = dr.maximum(dr.squared_norm(toward), _NO_DISTANCE)
        inverse = dr.rsqrt(square)
        facing = dr.maximum(-dr.dot(light.normal, toward), 0) * dr.maximum(dr.dot(surface.normal, toward), 0)
        r = square * inverse
        strength = facing * dr.square(dr.square(inverse))
        if shadows:
            reached = surface.seen & (strength > 0)
            reached &= ~scene.ray_test(light.shadow_ray_from(surface.interaction), reached)
            strength = dr.select(reached, strength, 0)
        return per_extinction(medium, lambda sigma_t: strength * exp_bounded(-sigma_t * r))

    total = sum(weight(light) for light in lights)
    kept = transmittance(medium, dr.select(surface.seen, surface.distance, 0))
    reflected = surface.albedo * lights[0].intensity * (dr.inv_pi * kept * total)
    return dr.select(surface.seen, reflected, type(medium.albedo)(0))


def _arriving(light: Light, surface: VisibleSurface):
    """Return the cosine at which a light meets a surface, the distance that it came, and its intensity there.

    Light from infinity has an irradiance for an intensity, and its distance counts nowhere.
    """
    if not light.w:
        return -dr.dot(surface.normal, light.axis), None, light.intensity
    to_light = light.toward(surface.point)
    r = dr.norm(to_light)
    cosine = dr.dot(surface.normal, to_light) / r
    return cosine, r, light.intensity * _profile(light, surface.point, -to_light / r)


def _profile(light: Light, point, away):
    """Return the relative intensity of the light in the unit direction `away`, from the light to a point."""
    if light.facing is not None:
        return dr.maximum(dr.dot(light.normal, away), 0)
    if light.cone is None:
        return type(away.x)(1)
    inside = dr.dot(light.axis, away) > light.cos_cutoff
    if light.beam is None:
        return dr.select(inside, type(away.x)(1), 0)
    # The point lies at x = 0 of a ray that starts there.
    return dr.select(inside, falloff(ray_geometry(point, away, light), light, type(away.x)(0)), 0)
