# SPDX-License-Identifier: BSD-3-Clause
"""What describes the fog of a scene, and how its laws are read: the arguments of the radiance of an image."""

from dataclasses import dataclass, replace
from typing import Any

from reference.scene.read import TruthScene

Colour = tuple[Any, Any, Any]  # numbers, or Dr.Jit numbers that carry derivatives


@dataclass(frozen=True)
class Fog:
    """Media, lights and laws. Tuples have an entry for each medium, that without bounds first, or for each light."""

    sigma_t: tuple[Colour, ...]  #: extinction [1/m]
    albedo: tuple[Colour, ...]  #: single-scattering albedo [1]
    g: tuple[Any, ...]  #: of Henyey and Greenstein's function; None: the phase function of the scene
    intensity: tuple[Any, ...]  #: factors on the lights [1]
    moved: tuple[Colour, ...]  #: how far the lights are from where the paths begin, x, y, z [m]
    exposure: Colour = (1.0, 1.0, 1.0)  #: factor on the image [1]
    camera_leg: Any = 1.0  #: share of the extinction that dims the way to the camera [1]
    light_leg: Any = 1.0  #: share of the extinction that dims the way from the light [1]
    near: Any = 0.0  #: medium without bounds is missing before the plane at this distance along the camera's axis [m]
    distance_power: Any = 2.0  #: the irradiance falls as the distance to this power [1]

    def with_entry(self, name: str, number: int, value: Any) -> "Fog":
        """Return the fog with another entry of one of its tuples, such as the `sigma_t` of a medium."""
        old = getattr(self, name)
        entry: dict[str, Any] = {name: (*old[:number], value, *old[number + 1 :])}
        return replace(self, **entry)


def scene_fog(truth: TruthScene) -> Fog:
    """Return the fog as the scene has it."""
    media = truth.medium, *truth.media
    lights = len(truth.lights) + len(truth.directional) + len(truth.area)
    return Fog(
        sigma_t=tuple(_colour(medium.sigma_t) for medium in media),
        albedo=tuple(_colour(medium.albedo) for medium in media),
        g=tuple(medium.phase.g if medium.phase.name == "hg" else None for medium in media),
        intensity=(1.0,) * lights,
        moved=((0.0, 0.0, 0.0),) * lights,
    )


def _colour(values: Any) -> Colour:
    red, green, blue = (float(value) for value in values)
    return red, green, blue
