# SPDX-License-Identifier: BSD-3-Clause
"""What a method is given: the camera rays of a frame, the lights and the media."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from realtime.bounded_media.airlight import MediaRay, check_form, lit_ray
from realtime.bounded_media.pieces import camera_pieces
from realtime.errors import InputError
from realtime.kernels.bounded import ConstantLeg, bounded_form
from realtime.numerics.array_types import Metres, PerRay
from realtime.rays.ray_light import RayGeometry, ray_geometry
from realtime.scene.camera import Camera, ray_directions
from realtime.scene.features import SceneFeatures
from realtime.scene.lights import Light
from realtime.scene.medium import Medium


@dataclass(frozen=True)
class View:
    """The rays of a frame and all that scatters light into them, as Dr.Jit arrays with one entry per pixel."""

    origin: Any  #: start of the rays [m]
    direction: PerRay  #: unit directions
    direction_low: PerRay  #: what rounding took from their aim; it matters for rays that nearly meet a light
    distance: Metres  #: to the visible surface, infinite where there is none [m]
    lights: tuple[Light, ...]
    medium: Medium
    features: SceneFeatures  #: what the scene needs; a method leaves out the rest
    camera: Camera
    pixel: PerRay  #: pixel number of every ray: row times width plus column
    scene: Any = None  #: the Mitsuba scene, for casting rays; None where the method says that it casts none
    surfaces: tuple[PerRay, ...] | None = None  #: by light, what the visible surface sends back unshadowed
    prepared: Any = ()  #: for a user's plain function: what its `prepare` made
    extra_layers: bool = False  #: whether the image is to have `Layers.extra`
    carried: Any = None  #: the `Layers.carried` of the last frame; None in the first

    def visible(self, point, light: Any, asked=True):
        """Return whether a light, or what else has a `shadow_ray`, reaches points [m], by rays where they are `asked`.

        Raises
        ------
        InputError
            For a method that says that it casts no rays.
        """
        if self.scene is None:
            raise InputError("visible: the method says that it casts no rays, and asks for some; wanted `casts_rays`")
        return ~self.scene.ray_test(light.shadow_ray(point), asked)

    def geometry(self, light: Light) -> RayGeometry:
        """Return where the rays pass a light: foot, height, and what of them it could reach."""
        return ray_geometry(self.origin, self.direction, light, low=self.direction_low)

    def of_pixels(self, pixel: PerRay, distance: Metres) -> "View":
        """Return the view of other pixels of the image; `distance` [m] is that to their visible surfaces."""
        direction, low = ray_directions(self.camera, pixel)
        return replace(self, direction=direction, direction_low=low, distance=distance, pixel=pixel)


def camera_view(
    camera: Camera, pixel: PerRay, distance: Metres, *, features: SceneFeatures, scene, medium: Medium, lights
) -> View:
    """Return what a method is given for some pixels; `distance` [m] is that to the visible surface."""
    direction, low = ray_directions(camera, pixel)
    return View(camera.origin, direction, low, distance, tuple(lights), medium, features, camera, pixel, scene)


def radiance(medium: Medium, light: Light, integral):
    """Return the radiance albedo sigma_t I J / (4 pi) of an airlight integral J (Biri 2006 eq. 1, DESIGN section 2)."""
    sigma_t = medium.sigma_t[0] if len(medium.sigma_t) == 1 else type(medium.albedo)(*medium.sigma_t)
    return medium.albedo * light.intensity * (sigma_t * (integral * (0.25 * dr.inv_pi)))


def ray_in_media(view: View, light: Light, form: str = "kernel", *, kernel: Any = None) -> MediaRay | None:
    """Return the rays of a view in bounded media, lit by one light; None where no media have bounds.

    Parameters
    ----------
    view, light
        The rays, and a light.
    form
        One of `realtime.bounded_media.airlight.FORMS`, or 'kernel': 'paper' for a light that has a place and a kernel
        that has a form for bounded media, otherwise 'exact'.
    kernel
        An airlight kernel, or None. `exact` does not ask it.

    Raises
    ------
    InputError
        For what a published form refuses.
    """
    if not view.features.bounded:
        return None
    medium, polynomial = view.medium, media_polynomial(kernel)
    if form == "kernel":
        form = "exact" if polynomial is None or not light.w else "paper"
        if form != "exact" and not medium.clear:
            raise InputError(
                "kernel: got a polynomial, which has each medium in clear air; wanted clear air around the bounded "
                "media, or another kernel"
            )
    else:
        check_form(medium, form)
    pieces = camera_pieces(medium, view.origin, view.direction)
    place = {"origin": view.origin, "direction": view.direction, "low": view.direction_low, "pieces": pieces}
    if form == "exact":
        return lit_ray(medium, light, **place, form=form)
    ray = lit_ray(medium, light, **place, form=form, polynomial=polynomial)
    if polynomial is not None:
        # What it refuses must be raised here, not in a branch. Nothing is computed that nobody reads.
        zero = type(ray.geometry.height)(0)
        for bounded in medium.bounded_media:
            leg = bounded.medium.sigma_t[0], zero, bounded.mean_distance, form == "printed"
            polynomial(ray.geometry, zero, zero, light, bounded.medium.phase, leg)
    return ray


def media_polynomial(kernel: Any) -> Any:
    """Return the form of a kernel for bounded media, for `realtime.bounded_media.airlight.lit_ray`, or None."""
    bounded = bounded_form(kernel)
    if bounded is None:
        return None
    return lambda geometry, x0, x1, light, phase, leg: bounded(geometry, x0, x1, light, phase, ConstantLeg(*leg))


def bounded_radiance(light: Light, scattered):
    """Return the radiance of `scattered`, what `airlight` of a ray in bounded media returns [W/(m^2 sr)]."""
    return light.intensity * (scattered * (0.25 * dr.inv_pi))
