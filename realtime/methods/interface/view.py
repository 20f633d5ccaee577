# SPDX-License-Identifier: BSD-3-Clause
"""What a method is given: the view of a frame."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.bounded_media.airlight import LitRay, lit_ray
from realtime.bounded_media.body_views import MediaSides
from realtime.bounded_media.ray_segments import camera_pieces
from realtime.scene.camera import Camera
from realtime.scene.features import SceneFeatures
from realtime.scene.lights import Light
from realtime.scene.medium import Medium


@dataclass(frozen=True)
class View:
    """The rays of a frame and all that scatters light into them, as Dr.Jit arrays with one entry per pixel.

    A method ``method(view, *, kernel, **parameters)`` returns from it the in-scattered radiance of every pixel
    [W/(m^2 sr)], an RGB colour.
    """

    origin: Any  #: start of the rays [m]
    direction: Any  #: unit directions
    direction_low: Any  #: what rounding took from their aim; it matters for rays that nearly meet a light
    distance: Any  #: to the visible surface, infinite where there is none [m]
    lights: tuple[Light, ...]
    medium: Medium
    features: SceneFeatures  #: what the scene needs; a method leaves out the rest
    visible: Callable[[Any, Light], Any]  #: (point, light) -> whether the light reaches the point
    camera: Camera
    pixel: Any  #: pixel number of every ray: row times width plus column
    rays: Callable[[Any], tuple[Any, Any]]  #: lanes -> the directions of their rays, and their low parts
    square_tiles: bool  #: whether every 16 rays that follow one another are 4 x 4 pixels
    visible_triangle: Callable[[], tuple[Any, Any, Any]]  #: -> corners [m], barycentric weights, whether there is one
    prepared: tuple[Any, ...] = ()  #: by light what the method's `prepare` made: a shadow map, shadow planes
    tiles: tuple[Any, ...] | None = (
        None  #: by light what the method's `tiles` made; None where the method makes its own
    )
    tile: Any = None  #: the number of every ray's tile: of sixteen that follow one another, where all are there
    sides: MediaSides | None = None  #: bodies of media, where they are known before the rays


def radiance(medium: Medium, light: Light, integral):
    """Return the radiance albedo sigma_t I J / (4 pi) of an airlight integral J (Biri 2006 eq. 1, DESIGN section 2)."""
    sigma_t = medium.sigma_t[0] if len(medium.sigma_t) == 1 else type(medium.albedo)(*medium.sigma_t)
    return medium.albedo * light.intensity * (sigma_t * (integral * (0.25 * dr.inv_pi)))


def rays_in_media(view: View, form: str = "exact") -> tuple[LitRay, ...]:
    """Return the rays of a view in bounded media, by light; `form` is one of
    `realtime.bounded_media.airlight.FORMS`.
    """
    pieces = camera_pieces(view.medium, view.origin, view.direction, view.sides.camera if view.sides else None)
    place = {"origin": view.origin, "direction": view.direction, "low": view.direction_low}
    sides = view.sides.lights if view.sides else [None] * len(view.lights)
    return tuple(
        lit_ray(view.medium, light, **place, pieces=pieces, form=form, sides=one)
        for light, one in zip(view.lights, sides, strict=True)
    )


def bounded_radiance(light: Light, scattered):
    """Return the radiance of what `airlight` of a ray in bounded media returns [W/(m^2 sr)]."""
    return light.intensity * (scattered * (0.25 * dr.inv_pi))
