# SPDX-License-Identifier: BSD-3-Clause
"""Lights: kinds, places, sizes, and how bright they are.

A light that nothing would be seen of, behind ten optical depths of fog, is drawn again or moved
towards what the camera sees: a tenth of the scenes would be black else.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.scenes.random.design import Draws, Ranges
from airlight.validation.scenes.random.media import Medium, depths, unit_airlight, view_rays

AREA_KINDS = ("rectangle", "disk", "sphere")

_DEEPEST = 7.0  # optical depth from a light to the camera by the nearest way

_CLEAR = 0.19  # around the camera nothing of a light is nearer, in radii of the stage


@dataclass(frozen=True)
class Light:
    """A light, first in radii of the stage, then in metres."""

    name: str
    kind: str  #: 'point', 'spot', 'directional' or one of `AREA_KINDS`
    position: Array  #: of a directional light a point on its way
    target: Array  #: a point at which it shines
    colour: Array  #: intensity, irradiance, or radiance
    #: of the airlight that it makes in the middle of the image without shadows [W/(m^2 sr)]
    brightness: float
    size: tuple[float, ...] = ()  #: radius, or half of both sides
    cutoff: float = 0.0  #: of a spot, half angle [degrees]
    beam: float = 0.0  #: of a spot, half angle of full intensity [degrees]
    black: bool = True  #: whether the shape of an area light is opaque

    @property
    def ball(self) -> float:
        """The radius of the ball around what shines."""
        return math.hypot(*self.size) if self.kind == "rectangle" else max(self.size, default=0.0)

    def placed(self, scale: float, centre: Array) -> "Light":
        """Return the light in a stage of a radius and a centre [m].

        Extinction is over a length, so a stage twice as large scatters as much, and its light comes
        from twice as far: intensity [W/sr] grows with the square, radiance and irradiance stay.
        """
        return replace(
            self,
            position=centre + scale * self.position,
            target=centre + scale * self.target,
            colour=self.colour * (scale**2 if self.kind in ("point", "spot") else 1.0),
            size=tuple(scale * value for value in self.size),
        )


def draw_lights(
    draws: Draws, ranges: Ranges, media: list[Medium], camera: Array, target: Array
) -> list[Light]:
    """Return the lights of a scene; their brightness is that on the rays of the camera."""
    rays = view_rays(camera, target)
    # A directional light would pass an unbounded medium of infinite depth: nothing would arrive.
    unbounded = any(medium.bounds == "unbounded" for medium in media)
    kinds = ranges["light_kinds"] | ({"directional": 0.0} if unbounded else {})
    kinds = kinds if any(kinds.values()) else {"point": 1.0}
    return [
        _light(
            draws, ranges, draws.pick(kinds, f"light_kind-{number}"), number, media, camera, rays
        )
        for number in range(1, draws.few(*ranges["lights"], name="lights") + 1)
    ]


def _light(
    draws: Draws,
    ranges: Ranges,
    kind: str,
    number: int,
    media: list[Medium],
    camera: Array,
    rays: Array,
) -> Light:
    stream = draws.of(f"light-{number}")
    size = _size(draws, stream, ranges, kind, number)
    ball = math.hypot(*size) if kind == "rectangle" else max(size, default=0.0)
    # Where the camera sees light best: the middle of the stage, or nearer in thick fog.
    ahead = _ahead(media, camera, rays[0])
    for attempt in range(9):
        # The first try takes the coordinates of the point; later tries are drawn from the light's
        # own stream.
        first = draws if attempt == 0 else stream
        # Evenly over the part of the sphere above -17 degrees: the sine of the elevation is uniform
        # there.
        elevation = math.asin(
            math.sin(math.radians(-17.0))
            + (1 + math.sin(math.radians(17.0)))
            * first.fraction(f"light_elevation-{number}")
            * 0.99
        )
        azimuth = first.between(0, 2 * math.pi, name=f"light_azimuth-{number}")
        across = math.cos(elevation)
        direction = np.array(
            [across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)]
        )
        if kind == "directional":
            # Light from below the floor would reach nothing.
            direction[2] = 0.17 + abs(direction[2])
            # from a thousand radii of the stage away
            position = direction / np.linalg.norm(direction) * 1e3
        else:
            distance = first.logarithmic(*ranges["light_distance"], name=f"light_distance-{number}")
            position = _nearer(media, camera, ahead, (distance + ball) * direction)
        # Half of the tries aim at what the camera sees best, half at the middle of the stage.
        target = (ahead if attempt % 2 == 0 else np.zeros(3)) + 0.29 * stream.in_ball()
        unit = unit_airlight(media, camera, rays, position, directional=kind == "directional")
        # Good enough: not around the camera, and bright enough that the optical depth can be
        # overcome. After the last try the light stays as it is.
        if (
            np.linalg.norm(position - camera) > ball + _CLEAR
            and unit > 0
            and math.log(unit) > -_DEEPEST - 9
        ):
            break
    colour = np.array([stream.between(0.53, 1.0) for _ in range(3)])
    # Further lights are weaker. The intensity follows from the airlight that a unit intensity
    # makes; 1e-7 keeps it finite where nothing arrives.
    brightness = draws.logarithmic(*ranges["brightness"], name=f"brightness-{number}") / (
        1 + 0.5 * (number - 1)
    )
    strength = brightness / max(unit, 1e-7)
    cutoff = beam = 0.0
    if kind == "spot":
        # A narrow cone that begins near by would light next to nothing: at its target it has a
        # radius of 0.37 radii of the stage at least.
        least = math.degrees(math.atan(0.37 / float(np.linalg.norm(target - position))))
        cutoff = max(
            draws.logarithmic(*ranges["cutoff"], name=f"cutoff-{number}"),
            min(least, ranges["cutoff"][1]),
        )
        fraction = draws.fraction(f"beam-{number}")
        beam = cutoff * (1.0 if fraction > 0.6 else 0.07 + 1.4 * fraction)
    if kind in AREA_KINDS:
        # the projected area
        strength /= 4 * size[0] * size[1] if kind == "rectangle" else math.pi * size[0] ** 2
    black = draws.pick(ranges["light_materials"], f"light_material-{number}") == "black"
    return Light(
        f"light-{number}",
        kind,
        position,
        target,
        strength * colour,
        brightness,
        size,
        cutoff,
        beam,
        black,
    )


def _size(draws: Draws, stream: Draws, ranges: Ranges, kind: str, number: int) -> tuple[float, ...]:
    if kind not in AREA_KINDS:
        return ()
    size = draws.logarithmic(*ranges["light_size"], name=f"light_size-{number}")
    return (size, size * stream.between(0.23, 0.97)) if kind == "rectangle" else (size,)


def _ahead(media: list[Medium], camera: Array, axis: Array) -> Array:
    """Return a point on the axis of the camera, the middle of the stage or where the
    optical depth is about 2.
    """
    far = float(np.linalg.norm(camera))
    # From far to near: the first point that is not lost in fog.
    for fraction in (1.0, 0.83, 0.67, 0.51, 0.37, 0.23, 0.13):
        point = camera + fraction * far * axis
        if depths(media, camera, point).mean() < 2:
            return point
    return camera + max(0.07 * far, 1.7 * _CLEAR) * axis


def _nearer(media: list[Medium], camera: Array, ahead: Array, position: Array) -> Array:
    """Return a position from which enough light arrives, moved towards a
    point ahead where needed.
    """
    for fraction in (1.0, 0.71, 0.5, 0.35, 0.25, 0.17, 0.11):
        moved = ahead + fraction * (position - ahead)
        # The way of light: from the light to the point that the camera sees, and on to the camera.
        way = depths(media, moved, ahead).mean() + depths(media, ahead, camera).mean()
        if way < _DEEPEST:
            return moved
    return moved
