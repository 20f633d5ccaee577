# SPDX-License-Identifier: BSD-3-Clause
"""What describes the fog of a scene, and how its laws are read: the arguments of the radiance of an image."""

from dataclasses import dataclass, replace
from typing import Any

from validation.fog_model.paths import ScatteringPaths

Colour = tuple[Any, Any, Any]  # numbers, or Dr.Jit numbers that carry derivatives


@dataclass(frozen=True)
class Fog:
    """Media, lights and laws. Tuples have an entry for each medium, that without bounds first, or for each light."""

    sigma_t: tuple[Colour, ...]  #: extinction [1/m]
    albedo: tuple[Colour, ...]  #: single-scattering albedo [1]
    g: tuple[Any, ...]  #: of Henyey and Greenstein's function; None: the phase function of the scene
    intensity: tuple[Any, ...]  #: factors on the lights [1]
    exposure: Colour = (1.0, 1.0, 1.0)  #: factor on the image [1]
    camera_leg: Any = 1.0  #: share of the extinction that dims the way to the camera [1]
    light_leg: Any = 1.0  #: share of the extinction that dims the way from the light [1]
    distance_power: Any = 2.0  #: the irradiance falls as the distance to this power [1]

    def with_medium(self, name: str, number: int, value: Any) -> "Fog":
        """Return the fog with another `sigma_t`, `albedo` or `g` of one medium."""
        old = getattr(self, name)
        return replace(self, **{name: (*old[:number], value, *old[number + 1 :])})


def scene_fog(paths: ScatteringPaths) -> Fog:
    """Return the fog as the scene has it."""
    return Fog(
        sigma_t=tuple(_colour(medium.sigma_t) for medium in paths.media),
        albedo=tuple(_colour(medium.albedo) for medium in paths.media),
        g=tuple(medium.phase.g if medium.phase.name == "hg" else None for medium in paths.media),
        intensity=(1.0,) * len(paths.lights),
    )


def _colour(values: Any) -> Colour:
    red, green, blue = (float(value) for value in values)
    return red, green, blue
