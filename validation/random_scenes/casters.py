# SPDX-License-Identifier: BSD-3-Clause
"""Casters: what casts shadows, and the floor, wall or room that receives them.

All lie within a ball, of which none holds a light or the camera, but for a cage, whose ball a light is the middle of,
and the ground, which is drawn around all else. A kind has these numbers, in shares of the ball where they are lengths:

| kind | numbers |
|---|---|
| `box` | half of three sides |
| `plate` | half of three sides, the last of which is thin |
| `sheet` | half of two sides; an open mesh |
| `tetrahedron` | none |
| `icosphere` | levels of division |
| `gem` | sides, rings |
| `torus` | radius of the tube, cells around and across |
| `star` | points, inner radius, half height |
| `vase` | sides, and radii of its profile |
| `fence` | bars, width of one as a share of its place, half height, half thickness, turn of the bars [degrees] |
| `pierced` | holes across, holes up, share that is hole, half thickness |
| `cage` | bars, radius of one |
| `mesh` | which of the user's files |
| `ball` | none: Mitsuba's sphere, which has no triangles |
| `floor`, `wall` | half of two sides in radii of its ball |
| `room` | half of three sides |
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.random_scenes.design import Draws
from validation.random_scenes.lights import PlacedLight
from validation.random_scenes.ranges import Ranges

Array = NDArray[np.float64]

_TRIES = 24
_CAMERA = 0.31  # a caster is as far from the camera at least, in radii of the stage
_LIGHT = 0.023  # and as far from a light
_SCREENS = ("fence", "pierced", "sheet", "plate")


@dataclass(frozen=True)
class PlacedCaster:
    """A caster in radii of the stage."""

    kind: str
    numbers: tuple[float, ...]
    position: Array
    radius: float
    axis: Array
    angle: float  #: [degrees]
    reflectance: Array


def draw_casters(
    draws: Draws, ranges: Ranges, camera: Array, lights: Sequence[PlacedLight], *, in_shadow: bool
) -> list[PlacedCaster]:
    """Return the casters of a scene.

    Parameters
    ----------
    in_shadow
        Whether a plate keeps the first light from the camera.
    """
    kinds = {kind: weight for kind, weight in ranges.caster_kinds.items() if kind != "mesh" or ranges.meshes}
    kinds = kinds if any(kinds.values()) else {"box": 1.0}
    casters = [_shade(draws.of("shade"), camera, lights[0])] if in_shadow else []
    if draws.pick(ranges.cages, "cages") == "yes":
        near = [light for light in lights if light.kind != "directional"]
        casters += [_cage(draws.of("cage"), camera, near[0])] if near else []
    count = draws.count(*ranges.casters, "casters")
    size = draws.logarithmic(*ranges.caster_size, "caster_size")
    for number in range(1, count + 1):
        stream = draws.of(f"caster-{number}")
        kind = draws.pick(kinds, f"caster_kind-{number}")
        if number == 1 and draws.pick(ranges.spheres, "spheres") == "yes":
            kind = "ball"
        for _ in range(_TRIES):
            position, radius = _place(stream, ranges, kind, size, lights)
            if _is_clear(position, radius, camera, lights):
                casters.append(_caster(stream, kind, position, radius))
                break
    return casters


def _place(stream: Draws, ranges: Ranges, kind: str, size: float, lights: Sequence[PlacedLight]) -> tuple[Array, float]:
    """Return a place for a caster: in the stage, or for a screen before a light too."""
    low, high = ranges.caster_size
    radius = min(max(size * stream.logarithmic(0.41, 2.43), low), high)
    if kind in _SCREENS and stream.share() < 0.4:
        light = lights[int(stream.share() * len(lights))]
        toward = light.position / np.linalg.norm(light.position)
        away = min(float(np.linalg.norm(light.position)), 2.3)
        return stream.between(0.29, 0.83) * away * toward + 0.23 * stream.in_ball(), min(2.1 * radius, 0.9)
    position = stream.in_ball() * np.array([1.0, 1.0, 0.71])
    return position, radius


def _is_clear(position: Array, radius: float, camera: Array, lights: Sequence[PlacedLight]) -> bool:
    if np.linalg.norm(position - camera) < radius + _CAMERA:
        return False
    return all(np.linalg.norm(position - light.position) > radius + light.ball + _LIGHT for light in lights)


def _caster(stream: Draws, kind: str, position: Array, radius: float) -> PlacedCaster:
    reflectance = np.array([stream.between(0.07, 0.83) for _ in range(3)])
    upright = kind in ("fence", "vase", "pierced")
    axis = stream.vector() + (np.array([0.0, 0.0, 4.0]) if upright else 0)
    angle = stream.between(3.0, 357.0)
    return PlacedCaster(kind, _numbers(stream, kind), position, radius, axis / np.linalg.norm(axis), angle, reflectance)


def _numbers(stream: Draws, kind: str) -> tuple[float, ...]:
    def sides(*thin: float) -> tuple[float, ...]:
        half = np.array([stream.between(0.31, 1.0) for _ in range(3 - len(thin))])
        half = half / np.linalg.norm(half)
        return (*(float(value) for value in half), *thin)

    match kind:
        case "box":
            return sides()
        case "plate":
            return sides(stream.logarithmic(0.0013, 0.047))
        case "sheet":
            return sides()[:2]
        case "icosphere":
            return (float(stream.count(0, 3)),)
        case "gem":
            return float(stream.count(5, 17)), float(stream.count(2, 7))
        case "torus":
            tube = stream.between(0.09, 0.37)
            return tube, float(stream.count(17, 53)), float(stream.count(7, 19))
        case "star":
            return float(stream.count(3, 9)), stream.between(0.31, 0.73), stream.logarithmic(0.05, 0.9)
        case "vase":
            return float(stream.count(5, 29)), *(stream.between(0.17, 0.61) for _ in range(stream.count(3, 11)))
        case "fence":
            return (
                float(stream.count(3, 17)),
                stream.between(0.13, 0.71),
                stream.between(0.37, 0.71),
                stream.logarithmic(0.007, 0.11),
                stream.between(-67.0, 67.0),
            )
        case "pierced":
            return (
                float(stream.count(1, 7)),
                float(stream.count(1, 5)),
                stream.between(0.29, 0.79),
                stream.logarithmic(0.011, 0.13),
            )
        case "mesh":
            return (stream.share(),)
    return ()


def _shade(stream: Draws, camera: Array, light: PlacedLight) -> PlacedCaster:
    """Return a plate between the camera and a light, across the way."""
    way = light.position - camera
    length = float(np.linalg.norm(way))
    # Nearer to the camera than a directional light is, and beyond what a light with extent reaches around.
    distance = min(stream.between(0.31, 0.57) * length, stream.between(0.9, 1.7))
    room = min(distance, length - distance - light.ball)
    needed = 1.3 * light.ball * distance / length
    radius = max(min(stream.between(0.29, 0.53), 0.8 * room), min(needed, 0.9 * room))
    forward = way / length + 0.17 * stream.in_ball()
    axis, angle = turning(np.array([0.0, 0.0, 1.0]), forward / np.linalg.norm(forward))
    position = camera + distance * way / length
    reflectance = np.array([stream.between(0.07, 0.53) for _ in range(3)])
    half = 0.69 + 0.03 * stream.share()
    numbers = half, math.sqrt(1 - half**2), stream.logarithmic(0.0017, 0.031)
    return PlacedCaster("plate", numbers, position, radius, axis, angle, reflectance)


def _cage(stream: Draws, camera: Array, light: PlacedLight) -> PlacedCaster:
    """Return upright bars around a light."""
    most = float(np.linalg.norm(light.position - camera)) - _CAMERA
    radius = max(min(max(stream.between(0.13, 0.31), 2.1 * light.ball), most), 1.3 * light.ball)
    numbers = float(stream.count(5, 13)), stream.between(0.029, 0.097)
    reflectance = np.array([stream.between(0.07, 0.61) for _ in range(3)])
    axis = stream.vector()
    return PlacedCaster("cage", numbers, light.position, radius, axis, stream.between(3.0, 357.0), reflectance)


def turning(start: Array, end: Array) -> tuple[Array, float]:
    """Return the axis and the angle [degrees] of the rotation that turns one unit vector into another."""
    axis = np.cross(start, end)
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return np.array([1.0, 0.0, 0.0]), 0.0 if start @ end > 0 else 180.0
    return axis / length, math.degrees(math.atan2(length, float(start @ end)))


def draw_ground(
    draws: Draws, ranges: Ranges, camera: Array, lights: Sequence[PlacedLight], casters: Sequence[PlacedCaster]
) -> list[PlacedCaster]:
    """Return a floor, a floor and a wall, a room around all, or nothing."""
    stream = draws.of("ground")
    kind = draws.pick(ranges.grounds, "grounds")
    if kind == "none":
        return []
    directional = any(light.kind == "directional" for light in lights)
    if kind == "room" and directional:
        kind = "floor-and-wall"
    near = [light for light in lights if light.kind != "directional"]
    balls = [(camera, 0.13), *((light.position, light.ball + 0.07) for light in near)]
    balls += [(caster.position, 0.31 * caster.radius) for caster in casters]
    if kind == "room":
        return [_room(stream, balls)]
    tilt = stream.vector() * stream.between(0.01, 0.11) + np.array([0.0, 0.0, 1.0])
    normal = tilt / np.linalg.norm(tilt)
    ground = [_plane(stream, "floor", normal, balls)]
    if kind == "floor-and-wall":
        toward = camera * np.array([1.0, 1.0, 0.0]) + 0.6 * np.linalg.norm(camera) * stream.vector() * [1.0, 1.0, 0.07]
        if directional:
            # It must not stand between a light from infinity and the stage.
            ways = np.array([light.position / np.linalg.norm(light.position) for light in lights])
            toward += 0.6 * ways.sum(axis=0) * [1, 1, 0]
        ground.append(_plane(stream, "wall", toward / np.linalg.norm(toward), balls))
    return ground


def _plane(stream: Draws, kind: str, normal: Array, balls: Sequence[tuple[Array, float]]) -> PlacedCaster:
    """Return a rectangle below all balls as its normal has it."""
    lowest = min(float(position @ normal) - radius for position, radius in balls)
    lowest = min(lowest, -0.43) - stream.between(0.003, 0.11)
    extent = 1.3 + max(float(np.linalg.norm(position)) + radius for position, radius in balls)
    axis, angle = turning(np.array([0.0, 0.0, 1.0]), normal)
    reflectance = np.array([stream.between(0.11, 0.71) for _ in range(3)])
    half = stream.between(0.71, 1.0), stream.between(0.71, 1.0)
    return PlacedCaster(kind, half, lowest * normal, extent, axis, angle, reflectance)


def _room(stream: Draws, balls: Sequence[tuple[Array, float]]) -> PlacedCaster:
    """Return a closed room, seen from inside, around all balls; its floor is level but for a few degrees."""
    low = np.min([position - radius for position, radius in balls], axis=0) - stream.between(0.11, 0.31)
    high = np.max([position + radius for position, radius in balls], axis=0) + stream.between(0.11, 0.31)
    half = 0.5 * (high - low) * 1.13
    radius = float(np.linalg.norm(half))
    axis = stream.vector()
    reflectance = np.array([stream.between(0.11, 0.61) for _ in range(3)])
    numbers = tuple(float(value) for value in half / radius)
    return PlacedCaster("room", numbers, 0.5 * (low + high), radius, axis, stream.between(0.3, 2.3), reflectance)
