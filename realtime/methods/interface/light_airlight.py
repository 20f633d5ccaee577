# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of one light along camera rays, whatever fills the scene: what methods sum over lit pieces."""

from dataclasses import dataclass
from typing import Any

from realtime.bounded_media.airlight import MediaRay
from realtime.kernels.registry import airlight_integral, gamma
from realtime.methods.interface.view import View, bounded_radiance, radiance, ray_in_media
from realtime.rays.ray_light import RayGeometry
from realtime.scene.lights import Light


def integral_type(view: View) -> Any:
    """Return the type of an integral: a number for a grey medium, a colour otherwise."""
    grey = len(view.medium.sigma_t) == 1 and not view.features.bounded
    return type(view.distance) if grey else type(view.medium.albedo)


def ray_airlight(
    view: View, light: Light, kernel, *, form: str = "kernel", geometry: RayGeometry | None = None
) -> "RayAirlight":
    """Return the airlight of a light along the rays of a view.

    `form` is that of `realtime.methods.interface.view.ray_in_media`, `geometry` that of the rays if it is known.
    """
    media = ray_in_media(view, light, form, kernel=kernel)
    return RayAirlight(view, light, view.geometry(light) if geometry is None else geometry, kernel, media)


@dataclass(frozen=True)
class RayAirlight:
    """The airlight of one light along the rays of a view."""

    view: View
    light: Light
    geometry: RayGeometry
    kernel: Any
    media: MediaRay | None  #: where media are bounded

    @property
    def segment(self) -> tuple[Any, Any]:
        """The part of the rays that the light could reach: up to the visible surface, in the cone of a spot [m]."""
        return self.geometry.lit_segment(type(self.view.distance)(0), self.view.distance)

    def integral(self, x0, x1):
        """Return the integral over the segment [x0, x1] [m].

        It is J [1/m] in one medium, and albedo sigma_t J [1/m^2] in bounded ones; `radiance` knows which.
        """
        if self.media:
            return self.media.airlight(x0, x1)
        return airlight_integral(self.kernel, self.geometry, x0, x1, medium=self.view.medium, light=self.light)

    def radiance(self, integral):
        """Return the radiance of an integral [W/(m^2 sr)]."""
        if self.media:
            return bounded_radiance(self.light, integral)
        return radiance(self.view.medium, self.light, integral)

    def gamma(self, x):
        """Return the `integral` from the camera to the distance `x` [m]."""
        if self.media:
            return self.integral(type(x)(0), x)
        return gamma(self.kernel, self.geometry, x, medium=self.view.medium, light=self.light)
