# SPDX-License-Identifier: BSD-3-Clause
"""A tangle of tubes in fog before a spot light: after Billeter 2010, Fig. 8c, which shows the mesh "Yeah Right".

The paper says that its mesh is irregular, with 188 000 triangles; it is a sculpture full of holes. The tubes here are
our own.
"""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from validation.scenes.parts import Mesh, camera, fog, grid, joined, mitsuba_mesh, placed, rotation, skin
from validation.scenes.record import Animation, SceneRecord

_MIDDLE = (0.13, 0.09, 1.87)
_LAMP = (-1.73, 3.37, 4.13)


@dataclass(frozen=True)
class _Tube:
    """A tube along a torus knot."""

    turns: tuple[int, int]  #: about the axis of the torus and about its core, coprime
    radii: tuple[float, float]  #: of the core, and from the core to the middle of the tube [m]
    thickness: float  #: mean radius of the tube [m]
    cells: tuple[int, int]  #: along and about the tube
    axis: tuple[float, float, float]  #: about which the torus is turned
    degrees: float  #: by which it is turned [degrees]


_TUBES = (
    _Tube((2, 3), (1.13, 0.37), 0.041, (1249, 11), (0.3, 1.0, 0.2), 23.1),
    _Tube((3, 4), (0.79, 0.43), 0.037, (1259, 10), (1.0, -0.4, 0.3), 71.3),
    _Tube((3, 2), (1.27, 0.31), 0.047, (1117, 12), (0.2, 0.7, -1.0), 117.7),
    _Tube((1, 5), (0.97, 0.53), 0.033, (1151, 9), (-0.6, 1.0, 0.1), 161.9),
    _Tube((2, 5), (0.67, 0.37), 0.039, (1031, 11), (1.0, 0.9, 0.4), 83.3),
    _Tube((1, 3), (1.31, 0.29), 0.051, (877, 13), (0.7, -1.0, 0.6), 47.9),
    _Tube((3, 5), (0.89, 0.47), 0.031, (1277, 9), (-0.2, 0.3, 1.0), 139.1),
    _Tube((1, 4), (1.19, 0.41), 0.043, (883, 11), (1.0, 0.1, -0.8), 101.7),
)
#: Waves that displace all points: displacement [m], wave vector [1/m], phase.
_WAVES = (
    ((0.113, -0.047, 0.071), (0.7, 1.9, 1.1), 0.7),
    ((-0.051, 0.079, 0.043), (2.3, -1.1, 1.7), 2.9),
    ((0.029, 0.037, -0.067), (-1.9, 1.7, 2.7), 4.3),
)


def tangle() -> dict[str, Any]:
    """Return eight closed tubes, 188 080 triangles, and a floor of two, in the cone of a spot light behind them."""
    return {
        "type": "scene",
        "fog": fog(0.263, (0.92, 0.94, 0.95)),
        "sensor": camera((1.37, -5.43, 1.67), (0.17, 0.11, 1.83), fov=49.7, size=(800, 600)),
        "spot": {
            "type": "spot",
            "to_world": mi.ScalarTransform4f().look_at(origin=_LAMP, target=_MIDDLE, up=[0, 0, 1]),
            "cutoff_angle": 26.3,
            "beam_width": 26.3,
            "intensity": {"type": "rgb", "value": [131.0, 143.0, 157.0]},
        },
        "tubes": mitsuba_mesh("tubes", _tubes(), (0.59, 0.47, 0.31)),
        "floor": mitsuba_mesh(
            "floor", grid((-9.3, -8.7, -0.07), (18.9, 0, 0), (0, 17.3, 0), (1, 1)), (0.39, 0.41, 0.43)
        ),
    }


def _tubes() -> Mesh:
    """Return the tubes as one mesh of eight closed parts, 188 080 triangles."""
    vertices, faces = joined([placed(_knot(tube), (0, 0, 0), rotation(tube.axis, tube.degrees)) for tube in _TUBES])
    return placed((_bent(vertices), faces), _MIDDLE)


def _knot(tube: _Tube) -> Mesh:
    """Return a tube of uneven section along a knot on a torus about the z axis: 2 cells[0] cells[1] triangles.

    The normal of the torus is perpendicular to every curve on it. So it orients the sections all the way round, and the
    last section joins the first without a seam.
    """
    (about, across), (radius, core), (rings, sides) = tube.turns, tube.radii, tube.cells
    t = 2 * np.pi * np.arange(rings)[:, None] / rings
    a = 2 * np.pi * np.arange(sides)[None] / sides
    zero = np.zeros_like(t)
    outwards = np.stack([np.cos(about * t), np.sin(about * t), zero], axis=2)
    onwards = np.stack([-np.sin(about * t), np.cos(about * t), zero], axis=2)
    up = np.array([0.0, 0.0, 1.0])
    cos, sin = np.cos(across * t)[:, :, None], np.sin(across * t)[:, :, None]
    normal = cos * outwards + sin * up
    tangent = (radius + core * cos) * about * onwards + core * across * (cos * up - sin * outwards)
    side = np.cross(tangent / np.linalg.norm(tangent, axis=2, keepdims=True), normal)
    swelling = 1 + 0.37 * np.sin((across + 4) * t + 0.7) + 0.19 * np.sin((3 * about + 7) * t + 1.9)
    ridges = 1 + 0.21 * np.cos(3 * a + (about + across) * t) + 0.13 * np.cos(2 * a - 5 * t + 0.9)
    section = (tube.thickness * swelling * ridges)[:, :, None]
    centre = radius * outwards + core * normal
    return skin(centre + section * (np.cos(a)[:, :, None] * normal + np.sin(a)[:, :, None] * side), ring_of_rings=True)


def _bent(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points, (n, 3) [m], displaced by the waves.

    The products of displacement and wave vector sum to 0.33 + 0.32 + 0.30 over the waves. The sum is below 1, so the
    map is one to one: no surface touches another or turns inside out.
    """
    moved = points.copy()
    for displacement, wave, phase in _WAVES:
        moved += np.sin(points @ np.array(wave) + phase)[:, None] * np.array(displacement)
    return moved


SCENE = SceneRecord(
    "tangle",
    tangle,
    "Eight uneven tubes wound through each other before a spot: a shaft through each of many holes, 188 082 triangles.",
    'Billeter, Sintorn, Assarsson 2010, Fig. 8c and Table 1 (the mesh "Yeah Right"): 32 frames/s with a map of 1024',
    Animation(about=_MIDDLE),
)
