# SPDX-License-Identifier: BSD-3-Clause
"""Airlight without volumetric shadows: one integral from the camera to the visible surface, for each light."""

from realtime.kernels.registry import airlight_integral
from realtime.methods.interface.layers import Layers
from realtime.methods.interface.view import View, bounded_radiance, radiance, rays_in_media
from realtime.parameters import Parameters
from realtime.rays.ray_light import ray_geometry


def unshadowed(view: View, *, kernel):
    """Return the airlight of every ray as if nothing cast a shadow [W/(m^2 sr)].

    Parameters
    ----------
    view
        The frame.
    kernel
        An airlight kernel, see `realtime.kernels`.

    Notes
    -----
    Valid for any scene without occluders between a light and a visible part of the medium; elsewhere it shows how much
    light the volumetric shadows take away. Bounded media have nodes of their own, but for a polynomial kernel.

    References
    ----------
    Biri, Arques, Michelin 2006, eq. 2. Sun, Ramamoorthi, Narasimhan, Nayar 2005.
    """
    total = type(view.medium.albedo)(0)
    start = type(view.distance)(0)
    if view.features.bounded:
        rays = rays_in_media(view, kernel=kernel)
        return sum(bounded_radiance(ray.light, ray.airlight(start, view.distance)) for ray in rays)
    for light in view.lights:
        geometry = ray_geometry(view.origin, view.direction, light, low=view.direction_low)
        integral = airlight_integral(kernel, geometry, start, view.distance, medium=view.medium, light=light)
        total += radiance(view.medium, light, integral)
    return total


def render_unshadowed(view: View, state, lists, *, kernel, parameters: Parameters) -> Layers:
    """Return `unshadowed` as the layers of a method."""
    return Layers(unshadowed(view, kernel=kernel))
