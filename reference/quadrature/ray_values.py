# SPDX-License-Identifier: BSD-3-Clause
"""The reference along camera rays: certified airlight integrals summed over the
lit intervals of every ray.

For each light and each ray, in float64:

1. the visible surface ends the ray (cast in float32, as by every method, so that all share the same
   surface; where that is a polygon or a sphere its distance is computed again in float64);
2. the ray up to there, or its part in the cone of a spot, is cut into lit intervals by exact
   geometry (`reference.visibility.shadows`), which random shadow rays then check
   (`reference.visibility.certificate`);
3. the intervals are integrated and added up, with an error estimate
   (`reference.quadrature.fields`);
4. a light reaches the surface where its last interval does (`reference.quadrature.surface`).

The bound of a ray adds the estimates, the effect of the rounding of each edge between light and
shadow, and the parts that shadow rays left in doubt. Area lights come last
(`reference.quadrature.area_lights`), and the sky (`reference.quadrature.sky`), with their own
standard errors.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.area_lights import area_airlight, area_surface, beams_of
from airlight.reference.quadrature.emission import emitted_light
from airlight.reference.quadrature.light_airlight import light_airlight
from airlight.reference.quadrature.replicates import Keep, PointPlan, keep_nothing
from airlight.reference.quadrature.sky import sky_light
from airlight.reference.quadrature.stretches import BoundKind
from airlight.reference.quadrature.surface import lit_surface, surface_hits
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.read import ReferenceLight, ReferenceScene
from airlight.reference.scene.shapes import Shapes, read_shapes
from airlight.reference.visibility.certificate import RandomChecks, reached_by_shadow_rays
from airlight.reference.visibility.distances import exact_distance

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

_STEPS = 1000  # of progress through the points of area lights, and through their lines


@dataclass(frozen=True)
class ReferenceImage:
    """Radiance of every pixel; arrays of shape (height, width[, 3])."""

    airlight: Array  #: in-scattered radiance [W/(m^2 sr)]
    #: its error without the error of samples: a bound or an estimate, see `bound_kind` [W/(m^2 sr)]
    airlight_bound: Array
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
    left: int = 0  #: contradictions that were not: their worth is in the bound
    #: area lights, or the background, seen directly [W/(m^2 sr)]; None without any
    emitted: Array | None = None
    #: standard error of the airlight of such lights, or of a sky [W/(m^2 sr)]
    airlight_se: Array | None = None
    surface_se: Array | None = None  #: of the surface that they light [W/(m^2 sr)]
    #: means over the image of what area lights add to airlight and surface, by replicate of their
    #: points, (2, replicates, 3) [W/(m^2 sr)]
    replicate_means: Array | None = None
    #: what `airlight_bound` is: 'proven', or 'estimated' in density grids and for means
    #: over the areas of pixels
    bound_kind: BoundKind = "proven"


@dataclass(frozen=True)
class RayValues:
    """Radiance and distance of each ray of a scene."""

    airlight: Array  #: in-scattered radiance, (rays, 3) [W/(m^2 sr)]
    bound: Array  #: of the error of the airlight, (rays, 3) [W/(m^2 sr)]
    surface: Array  #: radiance of the lit surface through the medium, (rays, 3) [W/(m^2 sr)]
    distance: Array  #: as it was cast, in float32, (rays,) [m]
    light_angle: Array  #: (rays,) [rad]
    transitions: int  #: edges between light and shadow
    random_checks: RandomChecks  #: of the lit intervals
    #: area lights or a sky, seen directly, (rays, 3), and for each replicate of their samples
    #: airlight and surface, (rays, 6, replicates) [W/(m^2 sr)]; in other scenes without columns
    emitted: Array = field(default_factory=lambda: np.empty((0, 0)))
    replicates: Array = field(default_factory=lambda: np.empty((0, 0, 0)))


def ray_values(
    reference: ReferenceScene,
    *,
    checks: int = 32,
    shadow_scale: float = 1.0,
    progress: Progress | None = None,
    shapes: Shapes | None = None,
    plan: PointPlan | None = None,
    keep: Keep | None = None,
) -> RayValues:
    """Compute airlight, lit surface and distances of every ray of `reference.direction`.

    `reference`: the scene, with any rays; `checks`, `shadow_scale`, `progress`, `plan`, `keep`: see
    `reference.quadrature.image.quadrature_image`; `shapes`: what
    `reference.scene.shapes.read_shapes` returned for the occluders, if that is known. Returns
    RayValues: radiances, (rays, 3) [W/(m^2 sr)], distances, (rays,) [m], and how the lit intervals
    were checked.
    """
    shapes = read_shapes(reference.occluders) if shapes is None else shapes
    # The cast distance, in float32, is what the caller gets: all methods share that surface. The
    # integrals end at the float64 distance to the same surface.
    hits = surface_hits(reference)
    cast = hits.distance
    hits = replace(hits, distance=exact_distance(reference, hits.interaction, cast, shapes))
    count = len(reference.direction)
    airlight, bound, light_angle = np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, np.pi)
    transitions, reports = 0, list[RandomChecks]()
    reached: list[NDArray[np.bool_]] = []
    # Progress counts a step for each light and `_STEPS` for each layer of area lights and for the
    # sky.
    wide_parts = 2 * bool(reference.area) + (reference.sky is not None)
    total = len(reference.lights) + len(reference.directional) + _STEPS * wide_parts
    lights: list[ReferenceLight | DirectionalLight] = [*reference.lights, *reference.directional]
    for number, light in enumerate(lights):
        received = light_airlight(
            reference, light, hits.distance, shadow_scale=shadow_scale, checks=checks, shapes=shapes
        )
        airlight += received.radiance
        bound += received.bound
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
    surface = lit_surface(reference, hits, reached=reached, shadow_scale=shadow_scale)
    # Area lights and the sky have these; in other scenes they are empty.
    emitted, replicates = np.empty((0, 0)), np.empty((0, 0, 0))
    if reference.area or reference.background is not None:
        emitted = emitted_light(reference, hits.distance)
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
        airlight, surface, bound = (
            airlight + mean[:, :3],
            surface + mean[:, 3:],
            bound + scattered.bound,
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
        airlight, surface, bound = airlight + mean[:, :3], surface + mean[:, 3:], bound + sky.bound
        # Replicates of the sky and of area lights are independent: their sums are replicates of
        # both.
        replicates = replicates + sky.replicates if reference.area else sky.replicates
    return RayValues(
        airlight,
        bound,
        surface,
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
