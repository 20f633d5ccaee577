# SPDX-License-Identifier: BSD-3-Clause
"""Lights with extent as light points: what methods render of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.area_lights.points import PlacedPoints, place_points
from realtime.numerics.array_types import ArrayTypes, aligned_numbers, host_numbers, types_of
from realtime.scene.lights import Facing, Light
from realtime.scene.read_scene import Scene

Array = NDArray[np.float64]


def with_light_points(scene: Scene, points: int, pattern: str) -> Scene:
    """Return a scene whose lights are the ordinary ones, followed by the points of each light with extent in turn.

    `scene`: from `realtime.scene.read_scene.read_scene`; `points`, `pattern`: see
    `realtime.area_lights.points.LightPoints`. Raises InputError for a number or a pattern that there is not.
    """
    ordinary = tuple(light for light in scene.lights if light.source is None)
    return replace(scene, lights=ordinary + light_points(scene, points, pattern))


def light_points(scene: Scene, points: int, pattern: str) -> tuple[Light, ...]:
    """Return the points of the lights with extent of a scene, light after light.

    `scene`: the scene; `points`, `pattern`: see `realtime.area_lights.points.LightPoints`. Raises InputError for a
    number or a pattern that there is not.
    """
    types = types_of(type(scene.camera.origin.x))
    placed = [place_points(light, points, pattern) for light in scene.area_lights]
    return tuple(point for number, of_light in enumerate(placed) for point in _points_of(of_light, number, types))


def source_shape(scene: Scene, light: Light) -> str | None:
    """Return the name of the shape of a light point that casts no shadow in it; None otherwise."""
    area = None if light.source is None else scene.area_lights[light.source]
    return None if area is None or area.folded else area.name


@dataclass(frozen=True)
class HostLightPoints:
    """Light points on the host, one a row, in float64."""

    position: Array  #: (points, 3) [m]
    normal: Array  #: unit normals, (points, 3)
    across: Array  #: unit vectors across them, (points, 3)
    lift: Array  #: how far before the shape rays start, (points, 1) [m]


def read_light_points(points: Sequence[Light]) -> HostLightPoints:
    """Bring light points to the host together, which waits for the device once."""
    each = [(point.position, own.exact_normal, own.lift) for point in points if (own := point.facing)]
    numbers = host_numbers(*(value for of_point in each for value in of_point))
    position, normal, lift = (np.stack(numbers[first::3]) for first in range(3))
    helper = np.where(np.abs(normal[:, :1]) < 0.5, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(helper, normal)
    return HostLightPoints(position, normal, across / np.linalg.norm(across, axis=1, keepdims=True), lift)


def _points_of(placed: PlacedPoints, source: int, types: ArrayTypes) -> list[Light]:
    # What the points have in common is there once: a frame after a light moved makes all arrays again.
    intensity = types.color(*aligned_numbers(types.scalar, placed.intensity))
    lift, chord = aligned_numbers(types.scalar, np.array([placed.lift, placed.chord]))
    alike = len(placed.normals) > 1 and bool(np.all(placed.normals == placed.normals[0]))
    normals = placed.normals[:1] if alike else placed.normals
    facings = [Facing(mi.Vector3d(*aligned_numbers(mi.Float64, normal)), lift, chord) for normal in normals]
    return [
        Light(_vector(position, types), intensity, facing=facings[0 if alike else number], source=source)
        for number, position in enumerate(placed.positions)
    ]


def _vector(values, types: ArrayTypes):
    return types.vector(*aligned_numbers(types.scalar, values))
