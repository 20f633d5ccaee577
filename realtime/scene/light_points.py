# SPDX-License-Identifier: BSD-3-Clause
"""Lights with extent as light points: what methods render of them."""

from dataclasses import replace

import numpy as np

from realtime.area_lights.points import PlacedPoints, place_points
from realtime.numerics.aligned import aligned_numbers
from realtime.numerics.array_types import ArrayTypes, types_of
from realtime.scene.lights import Facing, Light, with_low
from realtime.scene.read_scene import Scene


def with_light_points(scene: Scene, points: int, pattern: str) -> Scene:
    """Return a scene whose lights are the ordinary ones, followed by the points of each light with extent in turn.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene.read_scene`.
    points, pattern
        See `realtime.area_lights.points.LightPoints`.

    Raises
    ------
    InputError
        For a number or a pattern that there is not.
    """
    ordinary = tuple(light for light in scene.lights if light.source is None)
    return replace(scene, lights=ordinary + light_points(scene, points, pattern))


def light_points(scene: Scene, points: int, pattern: str) -> tuple[Light, ...]:
    """Return the points of the lights with extent of a scene, light after light.

    Parameters
    ----------
    scene
        The scene.
    points, pattern
        See `realtime.area_lights.points.LightPoints`.

    Raises
    ------
    InputError
        For a number or a pattern that there is not.
    """
    types = types_of(type(scene.camera.origin.x))
    placed = [place_points(light, points, pattern) for light in scene.area_lights]
    return tuple(point for number, of_light in enumerate(placed) for point in _points_of(of_light, number, types))


def source_shape(scene: Scene, light: Light) -> str | None:
    """Return the name of the shape of a light point, which casts no shadow in it; None for other lights."""
    return None if light.source is None else scene.area_lights[light.source].name


def _points_of(placed: PlacedPoints, source: int, types: ArrayTypes) -> list[Light]:
    # What the points have in common is there once: a frame after a light moved makes all arrays anew.
    intensity = types.color(*aligned_numbers(types.scalar, placed.intensity))
    lift, chord = aligned_numbers(types.scalar, np.array([placed.lift, placed.chord]))
    alike = len(placed.normals) > 1 and bool(np.all(placed.normals == placed.normals[0]))
    normals = placed.normals[:1] if alike else placed.normals
    facings = [
        Facing(_vector(high, types), _vector(low, types), lift, chord)
        for high, low in (with_low(normal, types) for normal in normals)
    ]
    return [
        Light(_vector(position, types), intensity, facing=facings[0 if alike else number], source=source)
        for number, position in enumerate(placed.positions)
    ]


def _vector(values, types: ArrayTypes):
    return types.vector(*aligned_numbers(types.scalar, values))
