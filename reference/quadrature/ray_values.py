# SPDX-License-Identifier: BSD-3-Clause
"""The truth along camera rays: certified airlight integrals summed over the lit intervals of every ray.

For each light and each ray, in float64:

1. the visible surface ends the ray (cast in float32, as by every method, so that all share the same surface; where that
   is a polygon or a sphere its distance is computed again in float64);
2. the cone of a spot and the visible surface bound the angle theta at the light (`reference.visibility.spot_cone`);
3. that range is cut into lit intervals, by exact geometry or by ray casting, which random shadow rays then check
   (`reference.visibility.lit_intervals`);
4. the intervals are integrated and added up, with an error estimate (`reference.quadrature.unbounded`).

The bound of a ray adds the estimates, what the rounding of each edge between light and shadow is worth, and what the
shadow rays left in doubt. Lights with extent come last (`reference.quadrature.area_airlight`,
`reference.quadrature.area_surface`), with standard errors of their own. For directional lights the share of a ray takes
the place of the angle (`reference.visibility.parallel_rays`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.area_airlight import Keep, area_airlight
from reference.quadrature.area_surface import area_surface
from reference.quadrature.directional_airlight import directional_airlight
from reference.quadrature.emission import emitted_light
from reference.quadrature.light_airlight import light_airlight
from reference.quadrature.light_points import PointPlan
from reference.quadrature.replicates import standard_error
from reference.quadrature.surface import lit_surface, surface_hits
from reference.scene.read import TruthScene
from reference.scene.shapes import Shapes, read_shapes
from reference.visibility.exact_distance import exact_distance
from reference.visibility.intervals import RandomChecks
from reference.visibility.surface_shadows import reached_by_shadow_rays

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

_STEPS = 1000  # of progress through the points of lights with extent, and through their lines


@dataclass(frozen=True)
class TruthImage:
    """Radiance of every pixel; arrays of shape (height, width[, 3])."""

    airlight: Array  #: in-scattered radiance [W/(m^2 sr)]
    airlight_bound: Array  #: bound of its error; over a pixel's area an estimate [W/(m^2 sr)]
    surface: Array  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Array  #: to the visible surface at the pixel's centre, infinite where there is none [m]
    light_angle: Array  #: smallest angle between the centre's ray and the direction to a light before the surface [rad]
    transitions: int  #: edges between light and shadow
    missed: float  #: share of the first random shadow rays that contradicted the lit intervals
    checked: int = 0  #: random shadow rays that checked the lit intervals
    disagreements: int = 0  #: of these, how many contradicted them
    refined: int = 0  #: contradictions that were settled, by mending the intervals or by a float64 test
    left: int = 0  #: contradictions that were not: their worth is in the bound
    emitted: Array | None = None  #: lights with extent, or the background, seen directly [W/(m^2 sr)]; None without any
    airlight_se: Array | None = None  #: standard error of the airlight of such lights [W/(m^2 sr)]
    surface_se: Array | None = None  #: of the surface that they light [W/(m^2 sr)]
    #: means over the image of what area lights add to airlight and surface, by replicate of their points, which all
    #: pixels share, (2, replicates, 3) [W/(m^2 sr)]
    replicate_means: Array | None = None


@dataclass(frozen=True)
class RayValues:
    """Radiance, distance and lit intervals of each ray of a scene."""

    airlight: Array  #: in-scattered radiance, (rays, 3) [W/(m^2 sr)]
    bound: Array  #: of the error of the airlight, (rays, 3) [W/(m^2 sr)]
    surface: Array  #: radiance of the lit surface through the medium, (rays, 3) [W/(m^2 sr)]
    distance: Array  #: as it was cast, in float32, (rays,) [m]
    light_angle: Array  #: (rays,) [rad]
    intervals: NDArray[np.int64]  #: how many lit intervals a ray has, those of all lights together, (rays,)
    transitions: int  #: edges between light and shadow
    random_checks: RandomChecks  #: of the lit intervals
    #: of scenes that have lights with extent: these seen directly, (rays, 3), and for each replicate of their points
    #: and lines airlight and surface, (rays, 6, replicates) [W/(m^2 sr)]; else without columns
    emitted: Array = field(default_factory=lambda: np.empty((0, 0)))
    replicates: Array = field(default_factory=lambda: np.empty((0, 0, 0)))


def image_of(
    truth: TruthScene,
    centre: RayValues,
    layers: tuple[Array, Array, Array],
    wide: tuple[Array, Array],
) -> TruthImage:
    """Return the image with these layers; its distances, angles and checks are those of the rays through the centres.

    Parameters
    ----------
    truth
        The scene.
    centre
        The values of the rays through the centres of the pixels.
    layers
        Airlight, the bound of its error, and surface, (pixels, 3) each [W/(m^2 sr)].
    wide
        Lights with extent seen directly, (pixels, 3), and the replicates, (pixels, 6, replicates), of a scene that has
        such lights.
    """
    shape, known = (truth.height, truth.width), centre.random_checks
    airlight, bound, surface = (layer.reshape(*shape, 3) for layer in layers)
    extra: dict[str, Array] = {}
    if wide[0].size:
        extra = {"emitted": wide[0].reshape(*shape, 3)}
    if truth.area:
        errors = standard_error(wide[1]).reshape(*shape, 6)
        extra |= {"airlight_se": errors[..., :3], "surface_se": errors[..., 3:]}
        extra["replicate_means"] = wide[1].mean(axis=0).reshape(2, 3, -1).swapaxes(1, 2)
    return TruthImage(
        airlight,
        bound,
        surface,
        centre.distance.reshape(shape),
        centre.light_angle.reshape(shape),
        centre.transitions,
        known.missed,
        known.checked,
        known.disagreements,
        known.refined,
        known.left,
        **extra,
    )


def ray_values(
    truth: TruthScene,
    *,
    samples: int = 256,
    shadow_scale: float = 1.0,
    edges: str = "auto",
    progress: Progress | None = None,
    shapes: Shapes | None = None,
    plan: PointPlan | None = None,
    keep: Keep | None = None,
) -> RayValues:
    """Compute airlight, lit surface, distances and lit intervals of every ray of `truth.direction`.

    Parameters
    ----------
    truth
        The scene, with any rays.
    samples, shadow_scale, edges, progress, plan, keep
        See `reference.quadrature.image.quadrature_image`.
    shapes
        What `reference.scene.shapes.read_shapes` returned for the occluders, if that is known.

    Returns
    -------
    RayValues
        Radiances, (rays, 3) [W/(m^2 sr)], distances, (rays,) [m], and how the lit intervals were checked.
    """
    shapes = read_shapes(truth.occluders) if shapes is None else shapes
    hits = surface_hits(truth)
    cast = hits.distance
    hits = replace(hits, distance=exact_distance(truth, hits.interaction, cast, shapes))
    count = len(truth.direction)
    airlight, bound, light_angle = np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, np.pi)
    intervals, transitions, checks = np.zeros(count, np.int64), 0, []
    reached: list[NDArray[np.bool_] | None] = []
    how = {"samples": samples, "edges": edges, "shapes": shapes}
    total = len(truth.lights) + len(truth.directional) + 2 * _STEPS * bool(truth.area)
    for number, light in enumerate(truth.lights):
        received = light_airlight(truth, light, hits.distance, shadow_scale=shadow_scale, how=how)
        airlight += received.radiance
        bound += received.bound
        light_angle = np.minimum(light_angle, received.angle)
        intervals += np.bincount(received.lit.ray, minlength=count)
        transitions += received.lit.transitions
        checks.append(received.lit.random_checks)
        seen = received.reached
        if seen is not None and shadow_scale != 1:
            what = {"scene": truth.occluders, "shapes": shapes}
            seen = reached_by_shadow_rays(hits.interaction, light.position, seen, **what)
        reached.append(seen)
        if progress is not None:
            progress(number + 1, total, "quadrature")
    for number, far in enumerate(truth.directional, start=len(truth.lights)):
        sent = directional_airlight(truth, far, hits.distance, how)
        if sent is not None:
            airlight += sent.radiance
            bound += sent.bound
            intervals += np.bincount(sent.lit.ray, minlength=count)
            transitions += sent.lit.transitions
            checks.append(sent.lit.random_checks)
        if progress is not None:
            progress(number + 1, total, "quadrature")
    surface = lit_surface(truth, hits, reached=reached, shadow_scale=shadow_scale)
    wide: dict[str, Any] = {}
    if truth.area or truth.background is not None:
        wide = {"emitted": emitted_light(truth, hits.distance)}
    if truth.area:
        plan, done = plan or PointPlan(), total - 2 * _STEPS
        tell = partial(_tell, progress, total)
        how_kept: dict[str, Any] = {"plan": plan, "shadow_scale": shadow_scale} | ({"keep": keep} if keep else {})
        scattered = area_airlight(truth, hits.distance, airlight, how=how, tell=partial(tell, done), **how_kept)
        lit = np.zeros_like(scattered.replicates)
        if plan.surfaces:
            lit = area_surface(truth, hits, surface, tell=partial(tell, done + _STEPS), **how_kept)
        tell(total, 0.0)
        replicates = np.concatenate([scattered.replicates, lit], axis=1)
        mean = replicates.mean(axis=2)
        airlight, surface, bound = airlight + mean[:, :3], surface + mean[:, 3:], bound + scattered.bound
        checks.append(scattered.random_checks)
        wide["replicates"] = replicates
    checked = RandomChecks.of_all(checks)
    return RayValues(airlight, bound, surface, cast, light_angle, intervals, transitions, checked, **wide)


def _tell(progress: Progress | None, total: int, done: int, share: float) -> None:
    if progress is not None:
        progress(done + int(share * _STEPS), total, "quadrature")
