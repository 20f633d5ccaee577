# SPDX-License-Identifier: BSD-3-Clause
"""The reference of a scene, from the cache where it was computed before.

Refused are references that are infinite, of rays that meet a light, and what is not
finite for any other reason.

With q = (x - t) + r = h E, t the foot of the light and h its distance from
the ray (DESIGN section 2),

    h J = int_{q0/h}^{q1/h} exp(-sigma_t (t + h E)) p((1 - E^2)/(1 + E^2)) 2/(1 + E^2) dE.

Let h go to 0. On a ray that passes the light q0 = O(h^2) and q1 > 0, so that the range becomes all
E > 0 and the exponential depends on t alone:

    h J -> exp(-sigma_t t) int_0^inf p((1 - E^2)/(1 + E^2)) 2/(1 + E^2) dE > 0,        pi exp(-sigma_t t) for p = 1.

J and the radiance grow like 1/h, without a bound. A ray that ends at the light has E up to 1, one
that begins there, at the camera, E from 1 on: parts of the same integral. A light at the camera is
on every ray. That the samples of an estimator are finite makes no difference: their mean is
infinite.

The mean over the area of a pixel is finite, since int 2 pi h dh / h is: `pixel="area"` is refused
only where the camera is at the light.

How near is on the ray? Mitsuba holds positions as float32 numbers, the largest coordinate of camera
and light known to 2^-24 of it. A smaller h is not known to be anything but 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import stopwatch
from airlight.analytic.geometry import foot_and_height
from airlight.errors import InputError
from airlight.reference.quadrature.height_fog import fog_of
from airlight.reference.quadrature.image import Progress, ReferenceImage, quadrature_image
from airlight.reference.quadrature.replicates import Keep, PointPlan
from airlight.reference.quadrature.replicates import Kept as Part
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.convex_bounds import holds
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.scene.varying import GridMedium, HeightMedium
from airlight.reference.storage.scene_digest import scene_content
from airlight.reference.storage.store import Content, Inputs, Kept, load, store, stored

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ReferenceInputs(Inputs):
    """The inputs of the quadrature reference of a scene at its own size."""

    kind = "quadrature"
    scene: Content
    checks: int = 32  #: see `reference.quadrature.image.quadrature_image`
    shadow_scale: float = 1.0  #: the same
    pixel: str = "centre"  #: the same
    #: samples of area lights of each replicate; None for as many as their error needs
    points: int | None = None
    model: Model = PHYSICAL  #: the equation, whose name counts for nothing

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", replace(self.model, name=""))


def reference_result(
    scene: mi.Scene, inputs: ReferenceInputs | None = None, *, progress: Progress | None = None
) -> Kept[ReferenceImage]:
    """Return the quadrature reference of a scene, and the time that it took, from the cache or
    computed now.

    `inputs`: of this scene; by default with the default settings.

    Raises InputError for radiance that is not finite.
    """
    asked = inputs or ReferenceInputs(scene_content(scene))
    return stored(asked, lambda: _computed(scene, asked, progress), ReferenceImage)


def reference_image(
    scene: mi.Scene,
    *,
    checks: int = 32,
    shadow_scale: float = 1.0,
    pixel: str = "centre",
    points: int | None = None,
    model: Model = PHYSICAL,
    progress: Progress | None = None,
) -> ReferenceImage:
    """Return the quadrature reference of a scene at its own size, from the cache or computed.

    Parameters
    ----------
    scene
        The scene.
    checks, shadow_scale, pixel, points, model
        See `ReferenceInputs`.
    progress
        Called with (done, total, what) as the work goes on.

    Returns
    -------
    ReferenceImage
        Radiances, (height, width, 3) [W/(m^2 sr)], with their errors.

    Raises
    ------
    InputError
        For radiance that is not finite.
    """
    inputs = ReferenceInputs(scene_content(scene), checks, shadow_scale, pixel, points, model)
    return reference_result(scene, inputs, progress=progress).value


def _computed(
    scene: mi.Scene, inputs: ReferenceInputs, progress: Progress | None
) -> ReferenceImage:
    reference, points = read_reference(scene, inputs.model), inputs.points
    # A given number of points is fixed: first and most are the same, and no error is asked for.
    return _checked_image(
        reference,
        PointPlan(error=0.0, first=points, most=points) if points else None,
        checks=inputs.checks,
        shadow_scale=inputs.shadow_scale,
        pixel=inputs.pixel,
        # Only area lights take so long that an interrupted run should go on from its parts.
        keep=_parts(inputs.key) if reference.area and inputs.pixel == "centre" else None,
        progress=progress,
    )


def reference_of_pixels(
    scene: mi.Scene, pixels: NDArray[np.integer], plan: PointPlan | None = None
) -> ReferenceImage:
    """Return the quadrature reference of pixels of a scene, (1, count, 3) [W/(m^2 sr)]; it is not
    cached.

    `pixels`: their numbers, row by row, (count,); `plan`: how many samples stand for area lights.
    """
    whole = read_reference(scene)
    chosen = replace(whole, width=len(pixels), height=1, direction=whole.direction[pixels])
    return _checked_image(chosen, plan)


def reference_of(scene: mi.Scene, model: Model = PHYSICAL) -> ReferenceImage:
    """Return the quadrature reference of a scene at its own size; it is not cached."""
    return _checked_image(read_reference(scene, model), None)


def _checked_image(
    reference: ReferenceScene,
    plan: PointPlan | None,
    *,
    checks: int = 32,
    shadow_scale: float = 1.0,
    pixel: str = "centre",
    keep: Keep | None = None,
    progress: Progress | None = None,
) -> ReferenceImage:
    """Return the image of a reference; refuse a scene, or an image, that is infinite somewhere."""
    check_camera(reference)
    hits = None
    # The mean over a pixel is finite even where its centre ray meets a light.
    if pixel == "centre":
        hits = surface_hits(reference)
        check_rays(reference, hits.distance)
    image = quadrature_image(
        reference,
        checks=checks,
        shadow_scale=shadow_scale,
        pixel=pixel,
        plan=plan,
        keep=keep,
        progress=progress,
        hits=hits,
    )
    check_values(reference, image)
    return image


def _parts(key: str | None) -> Keep:
    """Return a cache for parts of a reference until it is done: a run that was
    interrupted goes on from them.
    """

    def keep(name: str, work: Callable[[], Part]) -> Part:
        part = None if key is None else f"{key}/{name}"
        # Without a key nothing can be cached: the work is done each time.
        cached, took = load(part), stopwatch()
        return (cached or store(part, work(), took())).value

    return keep


def check_camera(reference: ReferenceScene) -> None:
    """Refuse a scene whose camera is at a light, whose every pixel is infinite."""
    if not _is_infinite(reference.model):
        return
    for number, light in enumerate(reference.lights, 1):
        distance = float(np.linalg.norm(light.position - reference.origin))
        if distance <= _uncertainty(reference, light) and _scatters(reference, light):
            raise InputError(
                f"{_name(number, light)} is {distance:.3g} m from the camera: the airlight, which "
                "grows like "
                "1/distance, is infinite in every pixel; move the light or the camera"
            )


def check_rays(reference: ReferenceScene, distance: Array) -> None:
    """Refuse rays through pixel centres that meet a light before the visible surface,
    so far away, (rays,) [m].
    """
    if not _is_infinite(reference.model):
        return
    ends = np.ravel(distance)
    for number, light in enumerate(reference.lights, 1):
        origin = np.broadcast_to(reference.origin, reference.direction.shape)
        foot, height = foot_and_height(origin, reference.direction, light.position)
        # A light counts as on the ray where its distance from the ray is 0 within rounding. It must
        # be in front of the camera, before the surface, and shine along the ray.
        uncertainty = _uncertainty(reference, light)
        meets = (
            (height <= uncertainty)
            & (foot > 0)
            & (foot <= ends + uncertainty)
            & _looks_along(light, reference.direction)
        )
        if meets.any() and _scatters(reference, light):
            pixel = int(np.argmax(meets))
            row, column = divmod(pixel, reference.width)
            raise InputError(
                f"{_name(number, light)} is {height[pixel]:.3g} m from the ray through the centre "
                "of the pixel in "
                f"column {column} of row {row}: the airlight there, which grows like 1/distance, "
                "is infinite; move the "
                "light or the camera, take another size, or the mean over pixels (--pixel area)"
            )


def check_values(reference: ReferenceScene, image: ReferenceImage) -> None:
    """Refuse a reference that is not finite, by its first pixel."""
    for what in ("airlight", "airlight_error", "surface"):
        values: Array = getattr(image, what)
        wrong = ~np.isfinite(values).all(axis=2)
        if wrong.any():
            # The first pixel in reading order.
            row, column = np.argwhere(wrong)[0]
            raise InputError(
                f"the reference has {int(wrong.sum())} of {wrong.size} pixels whose {what} is not "
                "finite, first in "
                f"column {column} of row {row}; a light may lie on its ray, or a number of the "
                "scene be too large: "
                "move the light, or use other units"
            )


def _is_infinite(model: Model) -> bool:
    """Return whether the airlight of lamps grows without a bound beside them."""
    law, (lamps, _, _) = model.law_of(surface=False), model.factors
    return not law.is_finite and model.constant is None and lamps > 0


def _name(number: int, light: ReferenceLight) -> str:
    return f"light {number} at ({', '.join(f'{coordinate:g}' for coordinate in light.position)})"


def _uncertainty(reference: ReferenceScene, light: ReferenceLight) -> float:
    """Return the error of the distance from the camera to a light [m]."""
    # Positions are float32 numbers, known to 2^-24 of the largest coordinate.
    return 2.0**-24 * float(max(np.abs(light.position).max(), np.abs(reference.origin).max()))


def _scatters(reference: ReferenceScene, light: ReferenceLight) -> bool:
    """Return whether a light is in a medium; without one the airlight is finite there."""
    # A light within a bounded medium is in that medium, else in the one around all.
    inside = [medium for medium in reference.media if holds(medium.bounds, light.position)]
    medium = inside[0] if inside else reference.medium
    largest = medium.largest
    # A light above the cap of height fog, or in an empty part of a grid, is in none. Its place is
    # known to the rounding of coordinates.
    if isinstance(medium, HeightMedium | GridMedium):
        corners = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
        places = light.position + _uncertainty(reference, light) * corners
        largest = (
            medium.extinction(places)
            if isinstance(medium, GridMedium)
            else fog_of(medium).density(places @ medium.up)
        ).max()
    return bool(np.any(largest * medium.albedo * light.intensity > 0))


def _looks_along(light: ReferenceLight, direction: Array) -> NDArray[np.bool_]:
    """Return which rays through a light pass its cone, before it or behind it."""
    if light.axis is None:
        return np.ones(len(direction), dtype=bool)
    return np.abs(direction @ light.axis) >= np.cos(light.cutoff)
