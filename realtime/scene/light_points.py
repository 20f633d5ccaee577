# SPDX-License-Identifier: BSD-3-Clause
"""Lights with extent as light points: what methods render of them."""

from dataclasses import replace

import numpy as np

from realtime.area_lights.points import PlacedPoints, place_points
from realtime.numerics.aligned import aligned_array
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
    lights = []
    for position, normal in zip(placed.positions, placed.normals):
        high, low = with_low(normal, types)
        sizes = (_number(size, types) for size in (placed.lift, placed.chord))
        facing = Facing(_vector(high, types), _vector(low, types), *sizes)
        intensity = types.color(*(_number(value, types) for value in placed.intensity))
        lights.append(Light(_vector(position, types), intensity, facing=facing, source=source))
    return lights


def _vector(values, types: ArrayTypes):
    return types.vector(*(_number(value, types) for value in values))


def _number(value, types: ArrayTypes):
    return aligned_array(types.scalar, np.array([float(value)]))
