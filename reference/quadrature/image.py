# SPDX-License-Identifier: BSD-3-Clause
"""The reference of an image: the values of the rays through pixel centres, or means over the areas
of pixels.

For each light and each ray, in float64:

1. the visible surface ends the ray (cast in float32, as by every method, so that all share the same
   surface; where that is a polygon or a sphere its distance is computed again in float64);
2. the ray up to there, or its part in the cone of a spot, is cut into lit intervals by exact
   geometry (`reference.visibility.shadows`), which random shadow rays then check
   (`reference.visibility.certificate`);
3. the intervals are integrated and added up, with an error (`reference.quadrature.fields`);
4. a light reaches the surface where its last interval does (`reference.quadrature.surface`).

The error of a ray adds the errors of the integrals, the effect of the rounding of each edge between
light and shadow, and the parts that shadow rays left in doubt. Area lights come last
(`reference.quadrature.area_lights`), and the sky (`reference.quadrature.sky`), with their own
standard errors.

A mean over a pixel is a sum over positions in it: eight replicates of a scrambled net, whose spread
is the standard error, and a pilot that says how many positions a pixel needs. Each pixel has
positions of its own, so that errors average out over an image (`reference.quadrature.replicates`).
Near a light the radiance grows as one over the distance to it on the film: the mean over an area is
finite. Under area lights each replicate also has light samples of its own: its spread is the
spread of positions and samples.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.quadrature.area_lights import area_airlight, area_surface, beams_of
from airlight.reference.quadrature.fields import field_of
from airlight.reference.quadrature.integrate import ErrorKind
from airlight.reference.quadrature.light_airlight import light_airlight
from airlight.reference.quadrature.model_terms import route_of, with_sources
from airlight.reference.quadrature.replicates import (
    PILOT,
    REPLICATES,
    Keep,
    PointPlan,
    RayPoints,
    keep_nothing,
    replicate_means,
    standard_error,
)
from airlight.reference.quadrature.sky import sky_light
from airlight.reference.quadrature.surface import (
    SurfaceHits,
    emitted_light,
    lit_surface,
    mirrored_light,
    surface_hits,
)
from airlight.reference.scene.camera import film_directions, pixel_centres
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import Shapes, read_shapes
from airlight.reference.visibility.certificate import RandomChecks, reached_by_shadow_rays
from airlight.reference.visibility.distances import exact_distance

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Progress = Callable[[int, int, str], None]
#: the values of the rays of a scene, with so many samples of its area lights
Traced = Callable[[ReferenceScene, PointPlan], "RayValues"]

_POSITIONS = PointPlan(first=4, most=128)  # of each replicate in a pixel
_LIGHTS = PointPlan(error=0.0, first=4, most=4)  # of each replicate of a position
_STEPS = 1000  # of progress through the points of area lights, and through their lines


@dataclass(frozen=True)
class ReferenceImage:
    """Radiance of every pixel; arrays of shape (height, width[, 3]).

    An error says what it is: `airlight_error` is proven or estimated, `surface_error` is estimated,
    and both are without the error of samples, whose standard errors are statistical.
    """

    airlight: Array  #: in-scattered radiance [W/(m^2 sr)]
    airlight_error: Array  #: its error without that of samples, see `airlight_kind` [W/(m^2 sr)]
    surface: Array  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    #: to the visible surface at the pixel's centre, infinite where there is none [m]
    distance: Array
    #: smallest angle between the centre's ray and the direction to a light before the surface [rad]
    light_angle: Array
    transitions: int  #: edges between light and shadow
    missed: float  #: fraction of the first random shadow rays that contradicted the lit intervals
    checked: int = 0  #: random shadow rays that checked the lit intervals
    disagreements: int = 0  #: of these, how many contradicted them
    #: contradictions that were settled, by mending the intervals or by a float64 test
    refined: int = 0
    left: int = 0  #: contradictions that were not: their worth is in the error
    #: area lights, or the background, seen directly [W/(m^2 sr)]; None without any
    emitted: Array | None = None
    #: standard error of the airlight of such lights, or of a sky [W/(m^2 sr)]
    airlight_se: Array | None = None
    surface_se: Array | None = None  #: of the surface that they light [W/(m^2 sr)]
    #: of `emitted` as a mean over pixels [W/(m^2 sr)]; None at centres, where that is exact
    emitted_se: Array | None = None
    #: means over the image of what area lights add to airlight and surface, by replicate of their
    #: points, (2, replicates, 3) [W/(m^2 sr)]
    replicate_means: Array | None = None
    #: what `airlight_error` is: 'proven', or 'estimated' in density grids and for means
    #: over the areas of pixels
    airlight_kind: ErrorKind = "proven"
    #: estimate of the error of the surface that lights without extent give it, by Mitsuba in single
    #: precision [W/(m^2 sr)]; None where it is not known
    surface_error: Array | None = None


@dataclass(frozen=True)
class RayValues:
    """Radiance and distance of each ray of a scene."""

    airlight: Array  #: in-scattered radiance, (rays, 3) [W/(m^2 sr)]
    airlight_error: Array  #: its error without that of samples, (rays, 3) [W/(m^2 sr)]
    surface: Array  #: radiance of the lit surface through the medium, (rays, 3) [W/(m^2 sr)]
    surface_error: Array  #: of lights without extent, (rays, 3) [W/(m^2 sr)]
    distance: Array  #: as it was cast, in float32, (rays,) [m]
    light_angle: Array  #: (rays,) [rad]
    transitions: int  #: edges between light and shadow
    random_checks: RandomChecks  #: of the lit intervals
    #: area lights or a sky, seen directly, (rays, 3), and for each replicate of their samples
    #: airlight and surface, (rays, 6, replicates) [W/(m^2 sr)]; in other scenes without columns
    emitted: Array = field(default_factory=lambda: np.empty((0, 0)))
    replicates: Array = field(default_factory=lambda: np.empty((0, 0, 0)))


def rays_of_pixel(pixel: str) -> tuple[int, int]:
    """Return how many rays a pixel, 'centre' or 'area', takes at least and at most."""
    least, most = _POSITIONS.points if pixel == "area" else (0, 0)
    return least + 1, most + 1  # the centre has the distance and the checks of the pixel


def light_samples_of_ray(pixel: str) -> tuple[int, int]:
    """Return how many samples of an area light a ray of a pixel, 'centre' or 'area',
    takes at least and at most.
    """
    return (_LIGHTS if pixel == "area" else PointPlan()).points


def quadrature_image(
    reference: ReferenceScene,
    *,
    checks: int = 32,
    shadow_scale: float = 1.0,
    pixel: str = "centre",
    tolerance: float = 1e-3,
    progress: Progress | None = None,
    plan: PointPlan | None = None,
    keep: Keep | None = None,
    hits: SurfaceHits | None = None,
) -> ReferenceImage:
    """Compute the reference of an image.

    Valid for homogeneous media, height fog, density grids and opaque surfaces under point, spot,
    directional and area lights and a sky; for directional lights in homogeneous media where all of
    these have bounds. Their shadow segments have no end, so `shadow_scale` leaves them as they are.
    A pixel whose centre ray meets a point light has an infinite airlight; the mean over its area is
    finite.

    Parameters
    ----------
    reference
        The scene.
    checks
        Random shadow rays to each ray and light, which check the lit intervals.
    shadow_scale
        Attenuate over this fraction of each shadow segment [1]: 1 is the reference, 1 - epsilon
        what a renderer with a shadow-ray epsilon converges to (DESIGN section 6.1). Such a renderer
        also starts its shadow rays off the surface, and so do those for `surface` then
        (`reference.visibility.certificate.reached_by_shadow_rays`).
    pixel
        "centre": the radiance along the ray through the centre. "area": the mean over the pixel.
    tolerance
        The standard error over value [1] of a mean over a pixel, for which positions are chosen, up
        to 128 in each replicate. `airlight_se` and `surface_se` say what was reached.
    progress
        Called with (done, total, what) as the work goes on.
    plan
        How many samples stand for area lights, along rays through pixel centres.
    keep
        Called with the name of each part of that work and a function that does it: it may keep what
        it returns, and give it back when the same image is computed again. Not for means over
        pixels.
    hits
        What `surface_hits` returned for the rays through pixel centres, if that is known.

    Returns
    -------
    ReferenceImage
        Radiances, (height, width, 3) [W/(m^2 sr)], and what is known of their errors.

    Raises
    ------
    InputError
        For another word in `pixel`.
    """
    shapes = read_shapes(reference.occluders)
    if pixel == "area":

        def traced(rays: ReferenceScene, lights: PointPlan) -> RayValues:
            return ray_values(
                rays, checks=checks, shadow_scale=shadow_scale, shapes=shapes, plan=lights
            )

        return _means(reference, tolerance, plan, progress, traced)
    if pixel != "centre":
        raise InputError(f"pixel is '{pixel}'; expected 'centre' or 'area'")
    values = ray_values(
        reference,
        checks=checks,
        shadow_scale=shadow_scale,
        progress=progress,
        shapes=shapes,
        plan=plan,
        keep=keep,
        hits=hits,
    )
    replicates = values.replicates if reference.is_sampled else None
    kind = field_of(reference).error_kind
    return _image(reference, values, _layers(values), _errors(values), replicates, kind)


def ray_values(
    reference: ReferenceScene,
    *,
    checks: int = 32,
    shadow_scale: float = 1.0,
    progress: Progress | None = None,
    shapes: Shapes | None = None,
    plan: PointPlan | None = None,
    keep: Keep | None = None,
    hits: SurfaceHits | None = None,
) -> RayValues:
    """Compute airlight, lit surface and distances of every ray of `reference.direction`.

    Parameters
    ----------
    reference
        The scene, with any rays.
    checks, shadow_scale, progress, plan, keep
        See `quadrature_image`.
    shapes
        What `reference.scene.shapes.read_shapes` returned for the occluders, if that is known.
    hits
        What `surface_hits` returned for the rays, if that is known.

    Returns
    -------
    RayValues
        Radiances, (rays, 3) [W/(m^2 sr)], distances, (rays,) [m], and how the lit intervals were
        checked.
    """
    shapes = read_shapes(reference.occluders) if shapes is None else shapes
    # The cast distance, in float32, is what the caller gets: all methods share that surface. The
    # integrals end at the float64 distance to the same surface.
    hits = surface_hits(reference) if hits is None else hits
    cast = hits.distance
    hits = replace(hits, distance=exact_distance(reference, hits.interaction, cast, shapes))
    count, route = len(reference.direction), route_of(reference, hits.distance)
    airlight, error, light_angle = np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, np.pi)
    transitions, reports = 0, list[RandomChecks]()
    reached: list[NDArray[np.bool_]] = []
    # Progress counts a step for each light and `_STEPS` for each layer of area lights and for the
    # sky.
    wide_parts = 2 * bool(reference.area) + (reference.sky is not None)
    total = len(reference.lights) + len(reference.directional) + _STEPS * wide_parts
    lights: list[ReferenceLight | DirectionalLight] = [*reference.lights, *reference.directional]
    for number, light in enumerate(lights):
        received = light_airlight(
            reference,
            light,
            hits.distance,
            shadow_scale=shadow_scale,
            checks=checks,
            shapes=shapes,
            route=route,
        )
        airlight += received.radiance
        error += received.error
        light_angle = np.minimum(light_angle, received.angle)
        transitions += received.lit.transitions
        reports.append(received.lit.random_checks)
        # A renderer with a shadow-ray epsilon (`shadow_scale` below 1) also starts its shadow rays
        # off the surface: the surface is lit where such rays say so.
        lit_ends = received.reached
        if shadow_scale != 1 and not isinstance(light, DirectionalLight):
            lit_ends = reached_by_shadow_rays(
                hits.interaction,
                light.position,
                lit_ends,
                scene=reference.occluders,
                shapes=shapes,
            )
        reached.append(lit_ends)
        if progress is not None:
            progress(number + 1, total, "quadrature")
    airlight, error = with_sources(reference, route, airlight, error)
    surface, surface_error = lit_surface(
        reference, hits, route, reached=reached, shadow_scale=shadow_scale
    )
    # Area lights and the sky have these; in other scenes they are empty.
    emitted, replicates = np.empty((0, 0)), np.empty((0, 0, 0))
    if reference.area or reference.background is not None:
        emitted = emitted_light(reference, hits.distance, route)
    if reference.is_sampled:
        shown = mirrored_light(reference, hits)
        surface = surface + shown
        # In single precision: 16 roundings, as of other surfaces.
        surface_error = surface_error + 16 * 2.0**-24 * shown
    plan, keep = plan or PointPlan(), keep or keep_nothing
    if reference.area:
        done = total - _STEPS * wide_parts
        tell = partial(_tell, progress, total)
        # Area lights: their samples need the airlight and the surface of all other lights, to which
        # errors are relative.
        beams = beams_of(reference, hits.distance)
        scattered = area_airlight(
            reference,
            beams,
            airlight,
            tell=partial(tell, done),
            plan=plan,
            shadow_scale=shadow_scale,
            keep=keep,
        )
        lit = np.zeros_like(scattered.replicates)
        if plan.surfaces:
            lit = area_surface(
                reference,
                hits,
                beams,
                surface,
                tell=partial(tell, done + _STEPS),
                plan=plan,
                shadow_scale=shadow_scale,
                keep=keep,
            )
        tell(done + 2 * _STEPS, 0.0)
        replicates = np.concatenate([scattered.replicates, lit], axis=1)
        # Columns 0 to 2 are the airlight, 3 to 5 the surface.
        mean = replicates.mean(axis=2)
        airlight, surface, error = (
            airlight + mean[:, :3],
            surface + mean[:, 3:],
            error + scattered.error,
        )
        reports.append(scattered.random_checks)
    if reference.sky is not None:
        sky = sky_light(
            reference,
            hits,
            shapes=shapes,
            plan=plan,
            tell=partial(_tell, progress, total, total - _STEPS),
        )
        mean = sky.replicates.mean(axis=2)
        airlight, surface, error = airlight + mean[:, :3], surface + mean[:, 3:], error + sky.error
        # Replicates of the sky and of area lights are independent: their sums are replicates of
        # both.
        replicates = replicates + sky.replicates if reference.area else sky.replicates
    return RayValues(
        airlight,
        error,
        surface,
        surface_error,
        cast,
        light_angle,
        transitions,
        RandomChecks.of_all(reports),
        emitted,
        replicates,
    )


def _tell(progress: Progress | None, total: int, done: int, fraction: float) -> None:
    if progress is not None:
        progress(done + int(fraction * _STEPS), total, "quadrature")


def _image(
    reference: ReferenceScene,
    centre: RayValues,
    layers: Array,
    errors: Array,
    replicates: Array | None,
    kind: ErrorKind,
) -> ReferenceImage:
    """Return the image of layers and errors, see `_layers` and `_errors`.

    Distances, angles and checks come from the values at the `centre`; `kind` says what the error of
    the airlight is.
    """
    shape, checked = (reference.height, reference.width), centre.random_checks
    image = ReferenceImage(
        layers[:, :3].reshape(*shape, 3),
        errors[:, :3].reshape(*shape, 3),
        layers[:, 3:6].reshape(*shape, 3),
        centre.distance.reshape(shape),
        centre.light_angle.reshape(shape),
        centre.transitions,
        checked.missed,
        checked.checked,
        checked.disagreements,
        checked.refined,
        checked.left,
        # Nine columns mean that area lights or a background are seen.
        emitted=layers[:, 6:].reshape(*shape, 3) if layers.shape[1] > 6 else None,
        airlight_kind=kind,
        surface_error=errors[:, 3:].reshape(*shape, 3),
    )
    if replicates is None:
        return image
    by_chance = standard_error(replicates).reshape(*shape, -1)
    return replace(
        image,
        airlight_se=by_chance[..., :3],
        surface_se=by_chance[..., 3:6],
        # Replicates of positions have nine columns as well, those of light samples six.
        emitted_se=by_chance[..., 6:] if by_chance.shape[-1] > 6 else None,
        replicate_means=replicates[:, :6].mean(axis=0).reshape(2, 3, -1).swapaxes(1, 2),
    )


def _layers(values: RayValues) -> Array:
    """Return airlight, surface, and emitted light if there is any, (rays, 6 or 9)."""
    emitted = values.emitted.reshape(len(values.airlight), -1)
    return np.concatenate([values.airlight, values.surface, emitted], axis=1)


def _errors(values: RayValues) -> Array:
    """Return the errors of airlight and surface without those of samples, (rays, 6)."""
    return np.concatenate([values.airlight_error, values.surface_error], axis=1)


def _means(
    reference: ReferenceScene,
    tolerance: float,
    plan: PointPlan | None,
    progress: Progress | None,
    traced: Traced,
) -> ReferenceImage:
    """Return the means over the areas of all pixels; `traced`: `ray_values` with what all rays
    have in common.
    """
    size = reference.width, reference.height
    corner = pixel_centres(size) - 0.5  # of each pixel on the film, in pixels
    sensor = reference.scene.sensors()[0]
    seed = plan.seed if plan is not None else 0
    errors, checks = np.zeros((len(corner), 6)), list[RandomChecks]()
    # All replicates of positions share a call of `ray_values`; under area lights each replicate is
    # a call with light samples of its own, so that its spread is that of positions and samples.
    groups = (
        [[replicate] for replicate in range(REPLICATES)]
        if reference.is_sampled
        else [list(range(REPLICATES))]
    )
    rounds, done = 2 * _POSITIONS.rounds * len(groups), 0

    def sums(part: str, chosen: PointPlan, active: Index) -> Array:
        nonlocal done
        points = RayPoints.of(chosen, 0, len(corner), "pixel")
        step = max(1, (1 << 17) // (len(groups[0]) * chosen.most))  # pixels of 2^17 rays at once
        total = []
        for group in groups:
            parts = []
            for first in range(0, len(active), step):
                pixels = active[first : first + step]
                # Positions of the replicates of this group in each pixel.
                square = points[pixels].reshape(len(pixels), REPLICATES, chosen.most, 2)[:, group]
                positions = (corner[pixels, None, None] + square).reshape(-1, 2)
                # A seed of the light samples for each number of positions, group and block: errors
                # of pixels are independent.
                seeds = np.random.default_rng((chosen.seed, chosen.most, group[0], first))
                of_lights = replace(_LIGHTS, seed=int(seeds.integers(1 << 62)))
                direction = film_directions(sensor, positions, size)
                ray = traced(replace(reference, direction=direction), of_lights)
                parts.append(_layers(ray).reshape(*square.shape[:3], -1).sum(axis=2))
                # A pilot decides and is not counted, so its errors are none of the result's.
                if part != PILOT:
                    errors[pixels] += _errors(ray).reshape(len(pixels), -1, 6).sum(axis=1)
                    checks.append(ray.random_checks)
            total.append(np.concatenate(parts))
            done += 1
            if progress is not None:
                progress(done, rounds, "positions in pixels")
        return np.moveaxis(np.concatenate(total, axis=1), 1, 2)

    # Distance and light angle of a pixel are those of its centre. Errors are relative to the means
    # alone: `known` is zero.
    centre = traced(reference, _LIGHTS)
    chosen = replace(_POSITIONS, error=tolerance, seed=seed)
    other_light = np.zeros((len(corner), 6 + 3 * bool(centre.emitted.size)))
    means, counts = replicate_means(len(corner), other_light, chosen, sums)
    if progress is not None:
        progress(rounds, rounds, "positions in pixels")
    checked = replace(centre, random_checks=RandomChecks.of_all([centre.random_checks, *checks]))
    errors /= REPLICATES * counts[:, None]
    return _image(reference, checked, means.mean(axis=2), errors, means, "estimated")
