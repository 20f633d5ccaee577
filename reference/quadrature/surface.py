# SPDX-License-Identifier: BSD-3-Clause
"""Lit surfaces, area lights and the background, as the camera sees them through the medium.

**Lit surfaces** have Mitsuba's own materials and lights, attenuated in float64:

    L = f(w_i, w_o) cos I / r^2 exp(-sigma_t (distance + s r)),

with f cos by `BSDF.eval` and I / r^2 by `Emitter.sample_direction`; s scales the shadow segment
(see `reference.quadrature.image`). Through bounded media the optical depth is the sum over
both ways, piece by piece. A directional light has its irradiance in the place of I / r^2, and an
unbounded shadow segment: only bodies attenuate it.

**The error of a surface** is estimated: Mitsuba computes f cos I / r^2 in single precision. The
place p of a hit is known to a few roundings of its coordinates and of those of the camera o. With
it are the direction to a light at the distance r, and the normal of a sphere of the curvature k, to

    e = 2^-22 (1 + max(|p|, |o|) (1 / r + k)).

The error is the difference that a turn of this direction by e towards the normal makes, which is
large at grazing incidence and in a sharp lobe, and e itself, and 16 roundings, times the radiance.
In the soft edge of a spot Mitsuba takes the angle a to its axis from a cosine, known to 2^-22: with
2^-22/sin(a) and the part of e without k, over the width of the edge, it is a part of the light that
the spot has on its axis.
It is no part of it which point a ray meets, which is Mitsuba's, and whether that point is lit,
which the lit intervals of the ray say.

**Area lights and the background** are seen with their own radiance, a layer beside the others.

**A mirror** has no f that samples of a light could meet: its reflection is one direction. It shows
an area light, or a sky, as a ray from its surface in that direction sees it,

    L = F L_e exp(-depth to the mirror - depth from there to the light),

with the direction and the reflectance F by `BSDF.sample`. That is light of one reflection, and so
part of the surface's layer. Lights without extent have no area that a mirror could show.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.fields import optical_depth
from airlight.reference.quadrature.model_terms import (
    Route,
    depth_of_behind,
    route_of,
    surface_strength,
)
from airlight.reference.scene.area_light import ReferenceAreaLight, is_area
from airlight.reference.scene.device import as_rows, on_device, vectors
from airlight.reference.scene.directional_light import DirectionalLight, is_directional
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene, has_mirrors
from airlight.reference.scene.shape_roles import metre_of, scene_from
from airlight.reference.visibility.distances import half_chord

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: how far the shadow segment of a directional light goes [m]
UNBOUNDED = float(np.finfo(float).max)


@dataclass(frozen=True)
class SurfaceHits:
    """The hits of the pixel-centre rays."""

    distance: Array  #: (pixels,), infinite where nothing is hit [m]
    interaction: Any  #: Mitsuba's surface interactions


def surface_hits(reference: ReferenceScene) -> SurfaceHits:
    """Cast the pixel-centre rays from the pinhole."""
    ray = mi.Ray3f(
        mi.Point3f(*(float(c) for c in reference.origin)),
        dr.normalize(mi.Vector3f(reference.direction.T)),
    )
    dr.make_opaque(ray)  # one kernel for all cameras
    flags = mi.RayFlags.All | mi.RayFlags.dNSdUV  # with the curvature, see `_curvature`
    interaction = reference.occluders.ray_intersect(ray, flags, coherent=True)
    dr.eval(interaction)  # whatever is read of it
    valid = np.array(interaction.is_valid(), dtype=bool)
    return SurfaceHits(
        np.where(valid, np.array(interaction.t, dtype=np.float64), np.inf), interaction
    )


@dataclass(frozen=True)
class Reflection:
    """Mitsuba's materials where rays hit surfaces."""

    interaction: Any  #: Mitsuba's surface interactions

    def __call__(self, ray: Index, towards: Array) -> Array:
        """Return f cos_s, (n, 3) [1/sr], where rays of these numbers hit, for light from
        unit directions, (n, 3).
        """
        at = dr.gather(mi.SurfaceInteraction3f, self.interaction, on_device(mi.UInt32, ray))
        local = at.to_local(dr.normalize(vectors(mi.Vector3f, towards)))
        return as_rows(at.bsdf().eval(mi.BSDFContext(), at, local))


def lit_surface(
    reference: ReferenceScene,
    hits: SurfaceHits,
    route: Route,
    *,
    reached: Sequence[NDArray[np.bool_]],
    shadow_scale: float = 1.0,
) -> tuple[Array, Array]:
    """Return the radiance of the surface at each pixel centre that point, spot and directional
    lights give it, and an estimate of its error, (pixels, 3) each [W/(m^2 sr)].

    `reference`, `hits`, `route`: the scene, what its rays hit, and where their fog is; `reached`:
    by light, the directional ones last, whether it reaches the surface at the end of each ray, as
    its lit intervals say; `shadow_scale`: see `reference.quadrature.image`.
    """
    interaction = hits.interaction
    total, error = np.zeros((2, len(hits.distance), 3))
    if not reference.occluders.shapes():
        return total, error
    far = np.where(np.isfinite(hits.distance), hits.distance, 0.0)
    point = reference.origin + far[:, None] * reference.direction
    size = np.maximum(np.abs(point), np.abs(reference.origin)).max(axis=1)
    bent = size * _curvature(interaction)
    to_camera, light_scale = depth_of_behind(reference, route), reference.model.surface_paths[1]
    # The emitters are sorted like `lights`: places first, then directions.
    emitters = [emitter for emitter in reference.scene.emitters() if not is_area(emitter)]
    emitters = sorted(emitters, key=is_directional)
    facing = interaction.is_valid()
    lights: list[ReferenceLight | DirectionalLight] = [*reference.lights, *reference.directional]
    for emitter, light, reaches in zip(emitters, lights, reached, strict=True):
        if isinstance(light, DirectionalLight):
            way, r = np.broadcast_to(-light.direction, point.shape), np.full(len(point), UNBOUNDED)
        else:
            way = light.position - point
            distance = np.linalg.norm(way, axis=1)
            way = way / np.maximum(distance, np.finfo(float).tiny)[:, None]
            r = shadow_scale * distance
        # I / r^2 of this emitter, or its irradiance, without visibility: the lit intervals say
        # that.
        towards, arriving = emitter.sample_direction(interaction, mi.Point2f(0.5))
        reflected = interaction.bsdf().eval(
            mi.BSDFContext(), interaction, interaction.to_local(towards.d), facing
        )
        radiance = as_rows(reflected * arriving)
        # The same from a direction that is turned towards the normal by its uncertainty: e of the
        # derivation, at most 45 degrees, for a light on the surface.
        nearest = 2.0**-22 * size + np.finfo(float).tiny
        turn = 2.0**-22 * (1 + bent + size / np.maximum(r, nearest))
        normal = mi.Vector3f(interaction.n)
        turned = dr.normalize(towards.d + normal * on_device(mi.Float, turn))
        other = interaction.bsdf().eval(
            mi.BSDFContext(), interaction, interaction.to_local(turned), facing
        )
        with np.errstate(invalid="ignore"):  # inf - inf where a light lies on a surface
            doubt = np.abs(as_rows(other * arriving) - radiance)
            doubt += (turn + 16 * 2.0**-24)[:, None] * np.abs(radiance)
        # Where the turn gives no number, the radiance may be wrong altogether.
        doubt = np.where(np.isfinite(doubt), doubt, np.abs(radiance))
        if isinstance(light, ReferenceLight) and light.axis is not None and light.is_soft:
            shift = 2.0**-22 * (1 + size / np.maximum(distance, nearest))
            edge = _edge_doubt(light, light.axis, way, shift) / np.maximum(distance, nearest) ** 2
            doubt += edge[:, None] * np.abs(as_rows(reflected)) * light.intensity
        # A directional light's segment goes to the end of all floats: only bounded media can be on
        # it.
        depth = to_camera
        if light_scale:
            to_light = optical_depth(reference, point, way, np.zeros(len(point)), r)
            depth = depth + light_scale * to_light
        factor = surface_strength(reference, light, point)[:, None]
        radiance, doubt = factor * radiance, factor * doubt
        lit = (np.array(facing, dtype=bool) & reaches)[:, None]
        transmittance = np.exp(-depth)
        total += np.where(lit, radiance * transmittance, 0.0)
        error += np.where(lit, doubt * transmittance, 0.0)
    return total, error


def _edge_doubt(light: ReferenceLight, axis: Array, towards: Array, shift: Array) -> Array:
    """Return how far Mitsuba's soft edge of a spot may be off in single precision, (rays,) [1].

    `axis`: of the light; `towards`: unit directions to it, (rays, 3); `shift`: the uncertainty of
    their angles, (rays,) [rad].
    """
    angle = np.arccos(np.clip(-(towards @ axis), -1.0, 1.0))
    # On the axis the angle of a cosine that is known to 2^-22 is known to 2^-11.
    shift = shift + 2.0**-22 / np.maximum(np.sin(angle), 2.0**-11)
    off = np.minimum(shift / (light.cutoff - light.beam), 1.0)
    return np.where(angle > light.beam - shift, off, 0.0)


def _curvature(interaction: "mi.SurfaceInteraction3f") -> Array:
    """Return how fast the normals of spheres turn where rays meet them, one over the radius,
    (rays,) [1/m]; 0 on other shapes, and where nothing is met.
    """
    turned, moved = (
        np.array(dr.norm(each), dtype=np.float64) for each in (interaction.dn_dv, interaction.dp_dv)
    )
    # The parameters of a mesh are not those of its interpolated normals.
    curved = np.array(interaction.is_valid() & ~interaction.shape.is_mesh(), dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(curved & (moved > 0), turned / moved, 0.0)


def mirrored_light(reference: ReferenceScene, hits: SurfaceHits) -> Array:
    """Return the radiance of area lights and the sky that mirrors show at the pixel centres,
    (pixels, 3) [W/(m^2 sr)]; of mirrors in mirrors the first alone reflects.
    """
    total, seen = np.zeros((len(hits.distance), 3)), hits.interaction
    if not has_mirrors(reference):
        return total
    mirrors = mi.has_flag(seen.bsdf().flags(), mi.BSDFFlags.DeltaReflection) & seen.is_valid()
    rows = np.flatnonzero(np.array(mirrors, dtype=bool))
    if not len(rows):
        return total
    at = dr.gather(mi.SurfaceInteraction3f, seen, on_device(mi.UInt32, rows))
    # The direction that a mirror reflects to, and its reflectance; no numbers are drawn for these.
    context = mi.BSDFContext()
    context.type_mask = int(mi.BSDFFlags.DeltaReflection)
    sample, reflectance = at.bsdf().sample(context, at, 0.5, mi.Point2f(0.5))
    onwards = as_rows(dr.normalize(at.to_world(sample.wo)))
    # An image around the scene lights nothing, and no mirror either; a sky does.
    background = None if reference.sky is None else reference.background
    origin, direction = reference.origin, reference.direction[rows]
    far = hits.distance[rows]
    point = origin + far[:, None] * direction
    # Rays start a step along their way, a thousand roundings, so as not to meet the mirror itself.
    step = 1e-4 * (metre_of(reference.occluders) + np.abs(point).max(axis=1))
    start = point + step[:, None] * onwards
    ray = mi.Ray3f(vectors(mi.Point3f, start), vectors(mi.Vector3f, onwards))
    next_surface = step + np.array(reference.occluders.ray_intersect(ray).t, dtype=np.float64)
    shown = emitted_light(
        replace(reference, origin=point, direction=onwards, background=background), next_surface
    )
    depth = optical_depth(reference, origin, direction, np.zeros(len(rows)), far)
    total[rows] = as_rows(reflectance) * shown * np.exp(-depth)
    return total


def emitted_light(reference: ReferenceScene, distance: Array, route: Route | None = None) -> Array:
    """Return the radiance of area lights before the visible surface, and of the
    background where there is none.

    In W/(m^2 sr), (rays, 3).

    `reference`: the scene, whose rays may have an origin each, (rays, 3); `distance`: to the
    visible surface, (rays,), infinite where there is none [m]; `route`: where the fog of rays
    begins and ends, by default from the origin to the surface.

    Valid for the side that emits; a light of material `null` is seen with what is behind it,
    a black one ends the ray.
    """
    total = np.zeros((len(distance), 3))
    origin = np.broadcast_to(reference.origin, total.shape)
    for light in reference.area:
        places = (
            _mesh_distances(light, reference)
            if light.kind == "mesh"
            else [_distance(light, reference)]
        )
        for at, slope in places:
            # A surface that is before a light by no more than single precision, across both, is the
            # light's own, or touches it: 16 roundings of all lengths, and of a sphere 4 of the
            # square in its equation. NaN, where the ray misses the light, compares as false.
            largest = np.abs(origin).max(axis=1) + np.abs(light.centre).max() + light.radius + at
            if light.kind == "sphere":
                largest += 0.25 * at * at / light.radius
            rows = np.flatnonzero((at - distance) * slope <= 1e-6 * largest)
            depth = optical_depth(
                reference, origin[rows], reference.direction[rows], np.zeros(len(rows)), at[rows]
            )
            total[rows] += light.radiance * np.exp(-depth)
    if reference.background is not None:
        rows = np.flatnonzero(np.isinf(distance))
        route = route_of(reference, distance) if route is None else route
        depth = depth_of_behind(reference, route)[rows]
        interaction = dr.zeros(mi.SurfaceInteraction3f, len(rows))
        interaction.wi = vectors(mi.Vector3f, -reference.direction[rows])
        total[rows] += as_rows(reference.background.eval(interaction)) * np.exp(-depth)
    return total


def _mesh_distances(
    light: ReferenceAreaLight, reference: ReferenceScene
) -> Iterator[tuple[Array, Array]]:
    """Yield where rays meet a mesh from the side that emits, crossing after
    crossing, and the cosines to its normals there, as `_distance` does.
    """
    mesh = scene_from([light.shape])
    start, walking = np.zeros(len(reference.direction)), np.ones(len(reference.direction), bool)
    while walking.any():
        place = reference.origin + start[:, None] * reference.direction
        hit = mesh.ray_intersect(
            mi.Ray3f(vectors(mi.Point3f, place), vectors(mi.Vector3f, reference.direction))
        )
        at = start + np.array(hit.t, dtype=np.float64)
        walking &= np.isfinite(at)
        # A black mesh hides what is behind its first crossing; through one of material `null` the
        # ray goes on, and may meet the emitting side again.
        emits = walking & np.array(mi.Frame3f.cos_theta(hit.wi) > 0)
        slope = np.abs(np.sum(as_rows(mi.Vector3f(hit.n)) * reference.direction, axis=1))
        yield np.where(emits, at, np.nan), slope
        walking &= not light.opaque
        # The next crossing is looked for 1e-5 of the distance and 1e-5 m beyond this one, which
        # float32 rays would otherwise meet again.
        start = np.where(walking, at * (1 + 1e-5) + 1e-5 * metre_of(mesh), start)


def _distance(light: ReferenceAreaLight, reference: ReferenceScene) -> tuple[Array, Array]:
    """Return where rays meet the side of a light that emits, (rays,) [m], NaN where they do not,
    and the cosines to its normal there, (rays,).
    """
    origin, direction = reference.origin, reference.direction
    away = light.centre - origin
    if light.kind == "sphere":
        middle = np.sum(direction * away, axis=-1)
        miss = np.linalg.norm(away - middle[:, None] * direction, axis=1)
        half = half_chord(light.radius, miss)
        at = middle - half
        return np.where((miss < light.radius) & (at > 0), at, np.nan), half / light.radius
    rate = direction @ light.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        at = (away @ light.normal) / rate
        x, y = ((at[:, None] * direction - away) @ light.frame[:2].T).T
    a, b = light.half
    inside = (
        (np.abs(x) <= a) & (np.abs(y) <= b) if light.kind == "rectangle" else x * x + y * y <= a * a
    )
    return np.where((rate < 0) & (at > 0) & inside, at, np.nan), np.abs(rate)
