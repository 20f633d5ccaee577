# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of one light along camera rays, whatever fills the scene: what methods sum over lit pieces."""

from dataclasses import dataclass
from typing import Any

from realtime.bounded_media import bounded_airlight
from realtime.geometry import RayGeometry
from realtime.kernels import airlight_integral, gamma
from realtime.lights import Light
from realtime.media_rays import MediaRay
from realtime.view import View, bounded_radiance, radiance


@dataclass(frozen=True)
class RayAirlight:
    """The airlight of one light along the rays of a view."""

    view: View
    light: Light
    geometry: RayGeometry
    kernel: Any
    media: MediaRay | None  #: where media are bounded

    @property
    def number(self) -> Any:
        """The type of an integral: a number for a grey medium, a colour otherwise."""
        grey = len(self.view.medium.sigma_t) == 1 and not self.media
        return type(self.view.distance) if grey else type(self.view.medium.albedo)

    def integral(self, x0, x1):
        """Return the integral over a segment; `radiance` knows its units."""
        if self.media:
            return bounded_airlight(self.media, x0, x1)
        return airlight_integral(self.kernel, self.geometry, x0, x1, medium=self.view.medium, light=self.light)

    def radiance(self, integral):
        """Return the radiance of an integral [W/(m^2 sr)]."""
        return (
            bounded_radiance(self.light, integral) if self.media else radiance(self.view.medium, self.light, integral)
        )

    def gamma(self, x):
        """Return the integral from the camera on."""
        if self.media:
            return self.integral(type(x)(0), x)
        return gamma(self.kernel, self.geometry, x, medium=self.view.medium, light=self.light)
