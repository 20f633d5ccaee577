# SPDX-License-Identifier: BSD-3-Clause
"""Airlight without volumetric shadows: one integral from the camera to the visible surface, for each light."""

from dataclasses import dataclass

from realtime.methods.interface.method import Method


@dataclass(frozen=True)
class Unshadowed(Method):
    """Airlight as if nothing cast a shadow.

    Valid for any scene without occluders between a light and a visible part of the medium; elsewhere it shows how much
    light the volumetric shadows take away. Bounded media have nodes of their own, but for a polynomial kernel.

    References
    ----------
    Biri, Arques, Michelin 2006, eq. 2. Sun, Ramamoorthi, Narasimhan, Nayar 2005.
    """

    name = "unshadowed"
    summary = "one airlight integral a ray and light, no volumetric shadows"
    source = "Biri, Arques, Michelin 2006, section 4.1; Sun et al. 2005"
    shadows = False

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray as if nothing cast a shadow [W/(m^2 sr)]."""
        airlight = view.lit_by(light, kernel)
        return airlight.radiance(airlight.gamma(view.distance))

    def error_causes(self, size):
        """Return shadows, which nothing takes away."""
        return (("shadows", None),)


def unshadowed(view, *, kernel):
    """Return the airlight of all lights of a view as if nothing cast a shadow, for a user's function [W/(m^2 sr)]."""
    return Unshadowed().render(view, (), kernel).in_scattered
