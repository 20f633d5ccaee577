# SPDX-License-Identifier: BSD-3-Clause
"""Light points: a light with extent as N point lights of equal power.

Each stands for the part A/N of the area: a point light with the intensity I(w) = I0 max(0, n . w), I0 = Le A/N [W/sr],
n the normal of the shape there. Its power, pi I0, is an N-th of that of the light.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from realtime.area_lights.patterns import PATTERNS, ring, spiral, square
from realtime.area_lights.shape import AreaLight
from realtime.parameters import Parameters, parameter

Array = NDArray[np.float64]

_NEAR = 4e-6  #: of the largest coordinate: how far off the shape rays start, some dozen units in the last place


@dataclass(frozen=True)
class LightPoints(Parameters):
    """How a method renders lights with extent; without effect where there are none."""

    points: int = parameter(16, "points of equal power that stand for each light with extent", least=1, most=4096)
    pattern: str = parameter(
        "sobol",
        "where they lie: on a ring, as in Ali 2016; in the middles of a grid; Sobol's sequence; or the grid in the "
        "order in which neighbouring pixels take them",
        choices=PATTERNS,
    )


@dataclass(frozen=True)
class PlacedPoints:
    """The light points of one light, on the host."""

    positions: Array  #: (points, 3) [m]
    normals: Array  #: unit vectors, (points, 3)
    intensity: Array  #: of each along its normal, RGB (3,) [W/sr]
    lift: float  #: how far before the shape rays start [m]
    chord: float  #: how long a ray is in the shape that comes along the normal from behind [m]


def place_points(light: AreaLight, points: int, pattern: str) -> PlacedPoints:
    """Return the light points of a light.

    `light`: the light with extent; `points`: how many, 1 to 4096; `pattern`: one of
    `realtime.area_lights.patterns.PATTERNS`. Raises InputError for a number or a pattern that there is not.

    Valid for all lights. One point of a sphere lights a half space alone; a few points are needed there.
    """
    LightPoints(points, pattern)
    if light.kind == "sphere":
        positions, normals = _on_sphere(light, points, pattern)
    else:
        u, v = _on_disk(points, pattern) if light.kind == "disk" else _on_rectangle(points, pattern)
        positions = light.middle + u[:, None] * light.across + v[:, None] * light.up
        normals = np.broadcast_to(light.normal, (points, 3))
    lift = _NEAR * float(np.abs(light.middle).max() + np.linalg.norm(light.across) + np.linalg.norm(light.up))
    chord = 2 * light.radius if light.kind == "sphere" else 0.0
    return PlacedPoints(positions, normals, light.radiance * (light.area / points), lift, chord)


def _on_rectangle(points: int, pattern: str) -> tuple[Array, Array]:
    if pattern == "ring":
        u, v = np.sqrt(2 / 3) * ring(points).T
        return u, v
    u, v = 2 * square(pattern, points).T - 1
    return u, v


def _on_disk(points: int, pattern: str) -> tuple[Array, Array]:
    if pattern == "ring":
        u, v = np.sqrt(1 / 2) * ring(points).T
        return u, v
    return _concentric(square(pattern, points))


def _concentric(places: Array) -> tuple[Array, Array]:
    """Return the unit square mapped to the unit disk, square rings to round ones (Shirley and Chiu 1997)."""
    a, b = 2 * places.T - 1
    steep = np.abs(b) > np.abs(a)
    radius = np.where(steep, b, a)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(steep, 0.5 * np.pi - 0.25 * np.pi * a / b, 0.25 * np.pi * b / a)
    angle = np.where(radius == 0, 0, angle)
    return radius * np.cos(angle), radius * np.sin(angle)


def _on_sphere(light: AreaLight, points: int, pattern: str) -> tuple[Array, Array]:
    if pattern == "ring":
        own = spiral(points)
    else:
        u, v = square(pattern, points).T
        z, angle = 1 - 2 * v, 2 * np.pi * u
        across = np.sqrt(1 - z * z)
        own = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    axes = np.stack([light.across, light.up, np.cross(light.across, light.up) / light.radius]) / light.radius
    normals = own @ axes
    return light.middle + light.radius * normals, normals
