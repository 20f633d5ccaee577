# SPDX-License-Identifier: BSD-3-Clause
"""What a method is given: the view of a frame."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.bounded_media.airlight import MediaRay, check_form, lit_ray
from realtime.bounded_media.pieces import camera_pieces
from realtime.errors import InputError
from realtime.kernels.bounded import ConstantLeg, bounded_form
from realtime.numerics.array_types import Metres, PerRay
from realtime.scene.camera import Camera
from realtime.scene.features import SceneFeatures
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.tiles.layout import Layout


@dataclass(frozen=True)
class View:
    """The rays of a frame and all that scatters light into them, as Dr.Jit arrays with one entry per pixel.

    A method's `realtime.methods.interface.method.Method.render` makes `Layers` of it; a user's plain function, the
    in-scattered radiance alone.
    """

    origin: Any  #: start of the rays [m]
    direction: PerRay  #: unit directions
    direction_low: PerRay  #: what rounding took from their aim; it matters for rays that nearly meet a light
    distance: Metres  #: to the visible surface, infinite where there is none [m]
    lights: tuple[Light, ...]
    medium: Medium
    features: SceneFeatures  #: what the scene needs; a method leaves out the rest
    visible: Callable[..., Any]  #: (point, light or what else has a `shadow_ray`, asked=True) -> whether it is lit
    camera: Camera
    pixel: PerRay  #: pixel number of every ray: row times width plus column
    layout: Layout  #: how the rays lie in the image
    tile: PerRay  #: the number of every ray's tile, of sixteen that follow one another where all are there
    rays: Callable[[Any], tuple[Any, Any]]  #: lanes -> the directions of their rays, and their low parts
    visible_triangle: Callable[[], tuple[Any, Any, Any]]  #: -> corners [m], barycentric weights, whether there is one
    part: Callable[[], Callable[..., "View"]]  #: -> (pixel, distance, tile, layout) -> the view of some of the rays
    surfaces: tuple[PerRay, ...] | None = (
        None  #: by light, what the visible surface sends back unshadowed, for a method that provides visibility
    )
    prepared: Any = ()  #: for a user's plain function: what its `prepare` made
    extra_layers: bool = False  #: whether the image is to have `Layers.extra`
    carried: Any = None  #: the `Layers.carried` of the last frame; None in the first


def radiance(medium: Medium, light: Light, integral):
    """Return the radiance albedo sigma_t I J / (4 pi) of an airlight integral J (Biri 2006 eq. 1, DESIGN section 2)."""
    sigma_t = medium.sigma_t[0] if len(medium.sigma_t) == 1 else type(medium.albedo)(*medium.sigma_t)
    return medium.albedo * light.intensity * (sigma_t * (integral * (0.25 * dr.inv_pi)))


def rays_in_media(view: View, form: str = "kernel", *, kernel: Any = None) -> tuple[MediaRay, ...]:
    """Return the rays of a view in bounded media, by light.

    Parameters
    ----------
    view
        The frame.
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
    polynomial = media_polynomial(kernel)
    pieces = camera_pieces(view.medium, view.origin, view.direction)
    place = {"origin": view.origin, "direction": view.direction, "low": view.direction_low}
    return tuple(
        _ray_in_media(view.medium, light, place, pieces=pieces, form=form, polynomial=polynomial)
        for light in view.lights
    )


def media_polynomial(kernel: Any) -> Any:
    """Return the form of a kernel for bounded media, for `realtime.bounded_media.airlight.lit_ray`, or None."""
    bounded = bounded_form(kernel)
    if bounded is None:
        return None
    return lambda geometry, x0, x1, light, phase, leg: bounded(geometry, x0, x1, light, phase, ConstantLeg(*leg))


def _ray_in_media(
    medium: Medium, light: Light, place: dict[str, Any], *, form: str, polynomial: Any, **known
) -> MediaRay:
    if form == "kernel":
        form = "exact" if polynomial is None or not light.w else "paper"
        if form != "exact" and not medium.clear:
            raise InputError(
                "kernel: got a polynomial, which has each medium in clear air; wanted clear air around the bounded "
                "media, or another kernel"
            )
    else:
        check_form(medium, form)
    if form == "exact":
        return lit_ray(medium, light, **place, form=form, **known)
    ray = lit_ray(medium, light, **place, form=form, polynomial=polynomial, **known)
    if polynomial is not None:
        # What it refuses must be raised here, not in a branch. Nothing is computed that nobody reads.
        zero = type(ray.geometry.height)(0)
        for bounded in medium.bounded_media:
            leg = bounded.medium.sigma_t[0], zero, bounded.mean_distance, form == "printed"
            polynomial(ray.geometry, zero, zero, light, bounded.medium.phase, leg)
    return ray


def bounded_radiance(light: Light, scattered):
    """Return the radiance of `scattered`, what `airlight` of a ray in bounded media returns [W/(m^2 sr)]."""
    return light.intensity * (scattered * (0.25 * dr.inv_pi))
