# SPDX-License-Identifier: BSD-3-Clause
"""The reference of an image: the values of the rays through pixel centres, or means
over the areas of pixels.

A mean over a pixel is a sum over positions in it: eight replicates of a scrambled net, whose spread
is the standard error, and a pilot that says how many positions a pixel needs. Each pixel has
positions of its own, so that errors average out over an image (`reference.quadrature.replicates`).
Near a light the radiance grows as one over the distance to it on the film: the mean over an area is
finite. Under area lights each replicate also has light samples of its own: its spread is the
spread of positions and samples.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.quadrature.fields import field_of
from airlight.reference.quadrature.ray_values import Progress, RayValues, ReferenceImage, ray_values
from airlight.reference.quadrature.replicates import (
    PILOT,
    REPLICATES,
    Keep,
    PointPlan,
    RayPoints,
    replicate_means,
    standard_error,
)
from airlight.reference.quadrature.stretches import BoundKind
from airlight.reference.scene.camera import film_directions, pixel_centres
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import read_shapes
from airlight.reference.visibility.certificate import RandomChecks

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_POSITIONS = PointPlan(first=4, most=128)  # of each replicate in a pixel
_LIGHTS = PointPlan(error=0.0, first=4, most=4)  # of each replicate of a position


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
) -> ReferenceImage:
    """Compute the reference of an image.

    `reference`: the scene; `checks`: random shadow rays to each ray and light, which check the lit
    intervals; `shadow_scale`: attenuate over this fraction [1] of each shadow segment: 1 is the
    reference, 1 - epsilon what a renderer with a shadow-ray epsilon converges to (DESIGN section
    6.1). Such a renderer also starts its shadow rays off the surface, and so do those for `surface`
    then (`reference.visibility.certificate.reached_by_shadow_rays`). `pixel`: "centre": the
    radiance along the ray through the centre. "area": the mean over the pixel. `tolerance`: of a
    mean over a pixel: the standard error over value [1] for which positions are chosen, up to 128
    in each replicate. `airlight_se` and `surface_se` say what was reached. `progress`: called with
    (done, total, what) as the work goes on; `plan`: how many samples stand for area lights, along
    rays through pixel centres; `keep`: called with the name of each part of that work and a
    function that does it: it may keep what it returns, and give it back when the same image is
    computed again. Not for means over pixels. Returns ReferenceImage: radiances, (height, width, 3)
    [W/(m^2 sr)], and what is known of their errors. Raises InputError for another word in `pixel`.

    Valid for homogeneous media, point and spot lights, area lights, opaque surfaces; for
    directional lights where all media have bounds. Their shadow segments have no end, so
    `shadow_scale` leaves them as they are. A pixel whose centre ray meets a point light has an
    infinite airlight; the mean over its area is finite.
    """
    shapes = read_shapes(reference.occluders)
    traced = partial(ray_values, checks=checks, shadow_scale=shadow_scale, shapes=shapes)
    if pixel == "area":
        return _means(reference, tolerance, plan, progress, traced)
    if pixel != "centre":
        raise InputError(f"pixel is '{pixel}'; expected 'centre' or 'area'")
    values = traced(reference, progress=progress, plan=plan, keep=keep)
    # Airlight and surface have three columns each; emitted light three, or none.
    layers = np.concatenate(
        [values.airlight, values.surface, values.emitted.reshape(len(values.airlight), -1)], axis=1
    )
    replicates = values.replicates if reference.is_sampled else None
    return _image(
        reference, values, layers, values.bound, replicates, field_of(reference).bound_kind
    )


def _image(
    reference: ReferenceScene,
    centre: RayValues,
    layers: Array,
    bound: Array,
    replicates: Array | None,
    kind: BoundKind,
) -> ReferenceImage:
    """Return the image of layers, (pixels, 6 or 9); distances, angles and checks
    are those of the centres.
    """
    shape, checked = (reference.height, reference.width), centre.random_checks
    image = ReferenceImage(
        layers[:, :3].reshape(*shape, 3),
        bound.reshape(*shape, 3),
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
        bound_kind=kind,
    )
    if replicates is None:
        return image
    errors = standard_error(replicates[:, :6]).reshape(*shape, 6)
    return replace(
        image,
        airlight_se=errors[..., :3],
        surface_se=errors[..., 3:],
        replicate_means=replicates[:, :6].mean(axis=0).reshape(2, 3, -1).swapaxes(1, 2),
    )


def _means(
    reference: ReferenceScene,
    tolerance: float,
    plan: PointPlan | None,
    progress: Progress | None,
    traced: Callable[..., RayValues],
) -> ReferenceImage:
    """Return the means over the areas of all pixels; `traced`: `ray_values` with what all rays
    have in common.
    """
    size = reference.width, reference.height
    corner = pixel_centres(size) - 0.5  # of each pixel on the film, in pixels
    sensor = reference.scene.sensors()[0]
    seed = plan.seed if plan is not None else 0
    bounds, checks = np.zeros((len(corner), 3)), list[RandomChecks]()
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
                ray = traced(replace(reference, direction=direction), plan=of_lights)
                emitted = ray.emitted.reshape(len(direction), -1)
                values = np.concatenate([ray.airlight, ray.surface, emitted], axis=1)
                parts.append(values.reshape(*square.shape[:3], -1).sum(axis=2))
                # A pilot decides and is not counted, so its bounds are none of the result's.
                if part != PILOT:
                    bounds[pixels] += ray.bound.reshape(len(pixels), -1, 3).sum(axis=1)
                    checks.append(ray.random_checks)
            total.append(np.concatenate(parts))
            done += 1
            if progress is not None:
                progress(done, rounds, "positions in pixels")
        return np.moveaxis(np.concatenate(total, axis=1), 1, 2)

    # Distance and light angle of a pixel are those of its centre. Errors are relative to the means
    # alone: `known` is zero.
    centre = traced(reference, plan=_LIGHTS)
    chosen = replace(_POSITIONS, error=tolerance, seed=seed)
    other_light = np.zeros((len(corner), 6 + 3 * bool(centre.emitted.size)))
    means, counts = replicate_means(len(corner), other_light, chosen, sums)
    if progress is not None:
        progress(rounds, rounds, "positions in pixels")
    checked = replace(centre, random_checks=RandomChecks.of_all([centre.random_checks, *checks]))
    return _image(
        reference,
        checked,
        means.mean(axis=2),
        bounds / (REPLICATES * counts[:, None]),
        means,
        "estimated",
    )
