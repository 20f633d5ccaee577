# SPDX-License-Identifier: BSD-3-Clause
"""What is seen behind clouds: surfaces that light reaches through clouds, and a sky."""

from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr

from realtime.clouds.single_scattering.march import CloudRays
from realtime.numerics.array_types import PerRay
from realtime.scene.lights import Light


def light_on_surfaces(rays: CloudRays, leg: Callable[[Any, Any], tuple[Any, ...]]) -> PerRay:
    """Return the share of a light that clouds let through to the visible surfaces, a colour [1]; 1 where there is none.

    `rays`: rays up to the surfaces; `leg`: (point [m], active) -> the depth of the leg to a point, by channel [1].
    """
    Color = type(rays.clouds.albedo)
    seen = dr.isfinite(rays.end)
    place = rays.origin + rays.direction * dr.select(seen, rays.end, 0)
    return dr.select(seen, Color(*(dr.exp(-depth) for depth in leg(place, seen))), 1)


def sky_behind(lights: Sequence[Light], distance, Color) -> PerRay | None:
    """Return the radiance of the sky where there is no surface, a `Color` [W/(m^2 sr)]; None without a sky.

    `lights`: of the scene, the beam of the sky among them; `distance`: to the visible surface, infinite where there is
    none [m].
    """
    for light in lights:
        if light.sky is not None:
            return dr.select(dr.isfinite(distance), Color(0), light.sky)
    return None
