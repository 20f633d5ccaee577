# SPDX-License-Identifier: BSD-3-Clause
"""All single-scattering paths of some pixels of a scene."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.quadrature.light_points import PointPlan, light_points, square_points
from reference.quadrature.surface import SurfaceHits, surface_hits
from reference.scene.area_light import TruthAreaLight, is_area
from reference.scene.camera import camera_matrix, film_directions, pixel_centres
from reference.scene.directional_light import DirectionalLight, is_directional
from reference.scene.read import TruthLight, TruthScene
from reference.scene.shapes import read_shapes
from reference.visibility.before_light import before_light
from reference.visibility.exact_distance import exact_distance
from validation.fog_model.directional_paths import directional_nodes
from validation.fog_model.paths import LightPaths, Nodes, ScatteringPaths, SurfacePoints
from validation.fog_model.point_paths import point_nodes
from validation.fog_model.surface_paths import surface_points

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Progress = Callable[[float, str], None]

_POINTS = 16  # of lights with extent


def scattering_paths(
    truth: TruthScene,
    *,
    pixels: Index | None = None,
    rays_per_side: int = 0,
    offset: tuple[float, float] = (0.0, 0.0),
    zoom: float = 1.0,
    radius: float = 0.0,
    blend: float = 0.0,
    near: float = 0.0,
    shadows: bool = True,
    airlight: bool = True,
    surface: bool = True,
    points: int = _POINTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> ScatteringPaths:
    """Return the paths of some pixels.

    Parameters
    ----------
    pixels
        Numbers of the pixels, row by row; all by default.
    rays_per_side
        0: one ray through the centre of each pixel. n: n x n rays, one through the middle of each cell of a grid,
        whose mean is that over the pixel.
    offset
        Moves all rays on the film, to the right and down [pixels].
    zoom
        Factor on the distance of all rays from the middle of the film, before they are moved.
    radius
        Of spheres that take the place of point lights, of the same intensity [m].
    blend
        Share of 1 - cos(cut-off), from the cut-off inwards, in which spots fall off smoothly, besides their own edge.
    near
        Distance along the camera's axis before which point and spot lights have no nodes [m].
    shadows
        False where surfaces hide nothing from the lights.
    points
        How many points stand for a light with extent.
    seed
        Of the points on lights with extent.
    """
    size = truth.width, truth.height
    pixels = np.arange(size[0] * size[1]) if pixels is None else np.unique(pixels)
    positions = _positions(pixel_centres(size)[pixels], rays_per_side)
    middle = 0.5 * np.array(size)
    positions = middle + zoom * (positions - middle) + np.asarray(offset)
    directions = film_directions(truth.scene.sensors()[0], positions, size)
    rays = replace(truth, direction=directions)
    shapes = read_shapes(truth.occluders)
    hits = surface_hits(rays)
    hits = SurfaceHits(exact_distance(rays, hits.interaction, hits.distance, shapes), hits.interaction)
    open_rays = rays if shadows else replace(rays, occluders=mi.load_dict({"type": "scene"}))
    how: dict[str, Any] = {"shapes": shapes if shadows else None}
    if shapes.others is None:
        how["checks"] = 0  # intervals by geometry are what they are: random checks only say how far to trust them
    axis = camera_matrix(truth.scene.sensors()[0])[:3, 2]
    begin = near / (directions @ axis) if near > 0 else None
    sources = light_sources(truth, points, seed, radius)
    lights = []
    for number, given in enumerate(sources):
        source = _spots_whole_within(given, blend) if blend else given
        before, known = (open_rays, how) if source.area is None else _without(open_rays, source.area, how)
        nodes = [_nodes(before, light, hits.distance, known, begin) for light in source.lights] if airlight else []
        lit = [surface_points(rays, light, hits, shadows=shadows) for light in source.lights] if surface else []
        if blend:
            edges = [partial(_blended, light=light) for light in source.lights]
            nodes = [replace(part, weight=part.weight * edge(part.towards)) for part, edge in zip(nodes, edges)]
            lit = [
                replace(part, radiance=part.radiance * edge(part.towards)[:, None]) for part, edge in zip(lit, edges)
            ]
        if source.centre is not None:
            nodes = [
                replace(part, weight=part.weight / _level(part, at, source)) for part, at in zip(nodes, source.lights)
            ]
            lit = [
                replace(part, radiance=part.radiance / _level(part, at, source)[:, None])
                for part, at in zip(lit, source.lights)
            ]
        lights.append(_light_paths(source.name, source.intensity, nodes, lit, len(truth.media) + 1))
        if progress is not None:
            progress((number + 1) / len(sources), "lit intervals")
    return ScatteringPaths(
        shape=(truth.height, truth.width),
        pixels=pixels,
        ray_pixel=np.repeat(np.arange(len(pixels)), max(1, rays_per_side) ** 2),
        rays_per_pixel=max(1, rays_per_side) ** 2,
        direction=directions,
        axis=axis,
        media=(truth.medium, *truth.media),
        media_names=("medium", *(medium.name for medium in truth.media)),
        lights=tuple(lights),
    )


def _without(truth: TruthScene, light: TruthAreaLight, how: dict[str, Any]) -> tuple[TruthScene, dict[str, Any]]:
    """Return a scene without the shape of a light, whose own points it does not shadow, and how to ask it."""
    if how["shapes"] is None:
        return truth, how
    truth, shapes = before_light(truth, light)
    return truth, {"shapes": shapes} | ({"checks": 0} if shapes.others is None else {})


def _positions(centres: Array, rays_per_side: int) -> Array:
    """Return places on the film, those of a pixel one after another."""
    if not rays_per_side:
        return centres
    row, column = np.divmod(np.arange(rays_per_side**2), rays_per_side)
    cells = np.stack([column, row], axis=1)
    # The middles: where the image is smooth, random places would err by its slope, these by its curvature.
    return (centres[:, None, :] - 0.5 + (cells + 0.5) / rays_per_side).reshape(-1, 2)


@dataclass(frozen=True)
class Source:
    """A light of the scene."""

    name: str  #: its id
    intensity: Array  #: what multiplies the paths from it, (3,)
    lights: Sequence[TruthLight | DirectionalLight]  #: that stand for it
    centre: Array | None = None  #: of a sphere, (3,) [m]
    area: TruthAreaLight | None = None  #: that has this extent in the scene


def light_sources(truth: TruthScene, points: int = _POINTS, seed: int = 0, radius: float = 0.0) -> list[Source]:
    """Return the lights of a scene: point and spot lights, directional ones, then those with extent.

    The parameters are those of `scattering_paths`.
    """
    emitters = truth.scene.emitters()
    far_names = [emitter.id() for emitter in emitters if is_directional(emitter)]
    near_names = [emitter.id() for emitter in emitters if not is_directional(emitter) and not is_area(emitter)]
    near = [
        _as_sphere(name, light, points, seed, radius)
        if radius > 0 and light.axis is None
        else Source(name, light.intensity, (light,))
        for name, light in zip(near_names, truth.lights, strict=True)
    ]
    far = [Source(name, light.irradiance, (light,)) for name, light in zip(far_names, truth.directional, strict=True)]
    plan = PointPlan(most=points, seed=seed)
    wide = [
        Source(
            light.name,
            light.radiance * light.area / points,
            light_points(light, square_points(plan, number, 0, light.kind)),
            light.centre if light.kind == "sphere" else None,
            light,
        )
        for number, light in enumerate(truth.area)
    ]
    return [*near, *far, *wide]


def _as_sphere(name: str, light: TruthLight, points: int, seed: int, radius: float) -> Source:
    """Return a sphere of a point light's intensity.

    Seen from anywhere, a sphere of the radiance L has the intensity L pi R^2; one of N points on it stands for the area
    4 pi R^2/N, of the intensity L 4 pi R^2/N along its normal: four times that of the light over N.
    """
    plan = PointPlan(most=points, seed=seed)
    wide = TruthAreaLight("sphere", light.position, np.eye(3), np.full(2, radius), np.zeros(3), False, None)
    return Source(
        name, 4 * light.intensity / points, light_points(wide, square_points(plan, 0, 0, "sphere")), light.position
    )


def _level(points: Nodes | SurfacePoints, light: TruthLight | DirectionalLight, sphere: Source) -> Array:
    """Return what the points on a sphere together send to places, as a multiple of what the sphere sends there, (n,).

    At the distance r from its centre a sphere of the radius R and the radiance L has the solid angle
    2 pi (1 - sqrt(1 - (R/r)^2)), and an area that faces it the irradiance pi L (R/r)^2. N points with the normals n_i
    at the distances d_i along v_i stand for the area 4 pi R^2/N each, and give 4 pi R^2 L/N sum max(n_i.v_i, 0)/d_i^2,
    each times the cosine to the way from the centre on such an area. Sixteen points are 10 % off.
    """
    if not isinstance(light, TruthLight) or sphere.centre is None:
        return np.ones(len(points.r))
    own = [each for each in sphere.lights if isinstance(each, TruthLight)]
    place = light.position - sphere.centre + points.r[:, None] * points.towards
    radius, r = float(np.linalg.norm(light.position - sphere.centre)), np.linalg.norm(place, axis=1)
    starts = np.stack([each.position - sphere.centre for each in own])
    normals = np.stack([np.asarray(each.axis) for each in own])
    d = np.sqrt(np.maximum(r[:, None] ** 2 - 2 * place @ starts.T + radius**2, np.finfo(float).tiny))
    sent = np.maximum(place @ normals.T - (starts * normals).sum(axis=1), 0) / d**3
    if isinstance(points, SurfacePoints):
        whole = 1 / r**2
        sent *= (r[:, None] - (place / r[:, None]) @ starts.T) / d
    else:
        whole = 2 * (1 - np.sqrt(1 - np.minimum(radius / r, 1.0) ** 2)) / radius**2
    return np.asarray(4 * sent.mean(axis=1) / whole)


def _spots_whole_within(source: "Source", blend: float) -> "Source":
    """Return a light whose spots end their full intensity where that of Blender's `spot_blend` ends, a kink."""

    def spot(light: TruthLight | DirectionalLight) -> TruthLight | DirectionalLight:
        if isinstance(light, DirectionalLight) or light.axis is None or light.cosine:
            return light
        return replace(light, beam=float(np.arccos(min(blend + (1 - blend) * np.cos(light.cutoff), 1.0))))

    return replace(source, lights=[spot(light) for light in source.lights])


def _blended(towards: Array, light: TruthLight | DirectionalLight) -> Array:
    """Return Blender's edge over that of a spot with the same ends, (n,): smoothstep of the cosine, linear in angle."""
    if isinstance(light, DirectionalLight) or light.axis is None or light.cosine:
        return np.ones(len(towards))
    cosine = np.clip(towards @ light.axis, -1.0, 1.0)
    share = np.clip((cosine - np.cos(light.cutoff)) / (np.cos(light.beam) - np.cos(light.cutoff)), 0.0, 1.0)
    linear = np.clip((light.cutoff - np.arccos(cosine)) / (light.cutoff - light.beam), 0.0, 1.0)
    return np.divide(share * share * (3 - 2 * share), linear, out=np.zeros(len(cosine)), where=linear > 0)


def _nodes(
    truth: TruthScene, light: TruthLight | DirectionalLight, distance: Array, how: dict[str, Any], begin: Array | None
) -> Nodes:
    if isinstance(light, DirectionalLight):
        if not truth.media:
            return _light_paths("", np.zeros(3), [], [], 1).nodes  # nothing scatters
        return directional_nodes(truth, light, distance, how)
    return point_nodes(truth, light, distance, how, begin)


def _light_paths(
    name: str, intensity: Array, nodes: list[Nodes], surface: list[SurfacePoints], media: int
) -> LightPaths:
    empty, none, lengths, vectors = np.empty(0), np.empty(0, np.int64), np.empty((0, media)), np.empty((0, 3))
    no_nodes = Nodes(none, none, empty, empty, empty, empty, lengths, lengths, vectors)
    no_surface = SurfacePoints(none, vectors, empty, lengths, lengths, vectors)
    return LightPaths(
        name, np.asarray(intensity), Nodes.joined([no_nodes, *nodes]), SurfacePoints.joined([no_surface, *surface])
    )
