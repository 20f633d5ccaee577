# SPDX-License-Identifier: BSD-3-Clause
"""Twelve small scenes of fog whose airlight is certified (`tests.evidence.certified.fog`).

Every number is exact in float32, so that renderers in single precision render the very scene that was certified:
coordinates are rounded to multiples of 1/1024 m, which makes the corners of boxes exact as well. What cannot be exact
is a rotation; the matrices of cameras and spots are rounded to float32, and count as given. Occluders are black, hence
all light in an image is airlight.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tests.evidence.certified.model import FogBox, FogLight, FogScene, FogScreen, FogSphere, Matrix, unit

_GRID = 1024  # coordinates are multiples of its reciprocal


def _grid(values: Sequence[float]) -> Any:
    return tuple(round(value * _GRID) / _GRID for value in values)


def _look(origin: Sequence[float], target: Sequence[float]) -> Matrix:
    """Return the float32 matrix with columns left, up, forward and origin; up is as close to +z as it can be."""
    place = _grid(origin)
    forward = unit([t - o for t, o in zip(target, place)])
    left = unit([-forward[1], forward[0], 0.0])  # +z cross forward
    up = np.cross(forward, left)
    rows = [[float(np.float32(column[axis])) for column in (left, up, forward, place)] for axis in range(3)]
    return (*(tuple(row) for row in rows), (0.0, 0.0, 0.0, 1.0))


def _sphere(centre: Sequence[float], radius: float) -> FogSphere:
    return FogSphere(_grid(centre), _grid([radius])[0])


def _box(centre: Sequence[float], *half_edges: Sequence[float]) -> FogBox:
    u, v, w = (_grid(edge) for edge in half_edges)
    return FogBox(_grid(centre), (u, v, w))


def _post(x: float, y: float, height: float) -> FogBox:
    """Return a needle 1/64 m wide that stands on z = 0 and leans a little."""
    return _box([x, y, height / 2], [1 / 128, 0, 0], [0, 1 / 128, 0], [0.05, 0.02, height / 2])


def _screen(centre: Sequence[float], *half_edges: Sequence[float]) -> FogScreen:
    u, v = (_grid(edge) for edge in half_edges)
    return FogScreen(_grid(centre), (u, v))


def _point(position: Sequence[float], intensity: Sequence[float]) -> FogLight:
    return FogLight(_grid(position), _grid(intensity))


def _spot(
    position: Sequence[float], target: Sequence[float], *, intensity: Sequence[float], cutoff: float, beam: float
) -> FogLight:
    return FogLight(_grid(position), _grid(intensity), _look(position, target), cutoff, beam)


def _view(
    origin: Sequence[float] = (0.2, -4.3, 1.4), target: Sequence[float] = (0.1, 0.0, 0.7), fov: float = 52.0
) -> dict[str, Any]:
    return {"camera": _look(origin, target), "fov": fov}


def _fog(sigma_t: Sequence[float], albedo: Sequence[float], phase: str = "isotropic", g: float = 0.0) -> dict[str, Any]:
    """Return the medium; one number for the extinction counts for all three colours."""
    extinction = tuple(float(np.float32(value)) for value in sigma_t) * (3 // len(sigma_t))
    return {"sigma_t": extinction, "albedo": _grid(albedo), "phase": phase, "g": g}


def _scene(
    name: str,
    words: str,
    view: dict[str, Any],
    fog: dict[str, Any],
    *,
    lights: Sequence[FogLight],
    occluders: Sequence[FogSphere | FogBox | FogScreen] = (),
) -> FogScene:
    return FogScene(name, words, **view, **fog, lights=tuple(lights), occluders=tuple(occluders))


_FLOOR = _screen([0.3, 0.5, 0.0], [6.25, 1.5, 0], [-1.5, 6.25, 0])


def fog_scenes() -> tuple[FogScene, ...]:
    """Return the twelve scenes."""
    return (
        _scene(
            "thin-open",
            "Thin grey haze without end, a point light in front of the camera, nothing else. Every ray is endless.",
            _view([0.2, -4.3, 1.4], [0.1, 0.0, 1.2]),
            _fog([0.004], [0.9, 0.8, 0.7]),
            lights=[_point([0.37, 0.61, 1.53], [5.0, 4.0, 3.0])],
        ),
        _scene(
            "near-light",
            "Coloured, forward scattering fog; a point light 0.3 m before the camera, which one ray passes at 13 mm.",
            _view([1.1, 0.4, 0.9], [1.3, 0.9, 1.0]),
            _fog([0.21, 0.34, 0.55], [0.95, 0.85, 0.75], "hg", 0.625),
            lights=[_point([1.22, 0.67, 0.963], [0.31, 0.27, 0.22])],
        ),
        _scene(
            "light-behind",
            "A point light behind the camera, in fog that scatters by Rayleigh's law: light is only scattered back.",
            _view([0.2, -1.3, 1.4], [0.4, 2.0, 1.1]),
            _fog([0.37], [0.99, 0.98, 0.97], "rayleigh"),
            lights=[_point([-0.45, -2.17, 2.03], [7.0, 8.0, 9.0])],
        ),
        _scene(
            "sphere-shadow",
            "A sphere between the camera and a point light: the camera looks along the cone of its shadow.",
            _view(fov=25.0),
            _fog([0.31], [0.9, 0.8, 0.7]),
            lights=[_point([0.33, 2.41, 1.17], [11.0, 9.0, 8.0])],
            occluders=[_sphere([0.21, 0.43, 0.92], 0.57)],
        ),
        _scene(
            "thick-spheres",
            "Thick fog: two spheres, the larger one 3, 5 and 8 mean free paths from the camera in the three colours.",
            _view([0.1, -2.9, 1.2], [0.2, 0.0, 0.8], fov=37.0),
            _fog([1.3, 2.1, 3.4], [0.5, 0.75, 0.98]),
            lights=[_point([-0.83, -1.12, 1.74], [900.0, 800.0, 700.0])],
            occluders=[_sphere([0.27, 0.12, 0.71], 0.63), _sphere([-0.62, -0.71, 1.33], 0.21)],
        ),
        _scene(
            "three-spheres",
            "Three spheres about a point light, one of them a hand's breadth from it, in backward scattering fog.",
            _view(fov=29.0),
            _fog([0.23], [0.7, 0.8, 0.9], "hg", -0.3125),
            lights=[_point([0.16, 0.22, 1.08], [4.0, 4.5, 5.0])],
            occluders=[
                _sphere([0.52, -0.31, 0.97], 0.24),
                _sphere([-0.61, 0.93, 0.55], 0.41),
                _sphere([0.1, 0.3, 1.31], 0.13),
            ],
        ),
        _scene(
            "box-floor",
            "A leaning box on a floor, a point light above and to the side.",
            _view(fov=37.0),
            _fog([0.19], [0.9, 0.9, 0.8]),
            lights=[_point([1.41, 0.37, 2.23], [8.0, 7.0, 6.0])],
            occluders=[_FLOOR, _box([0.13, 0.11, 0.62], [0.41, 0.13, 0], [-0.11, 0.37, 0.06], [0.09, 0.04, 0.55])],
        ),
        _scene(
            "needles",
            "Nine leaning needles, each 1/64 m wide, before a point light: shadows that a coarse march steps over.",
            _view(fov=42.0),
            _fog([0.27], [0.85, 0.9, 0.95], "hg", 0.75),
            lights=[_point([0.31, 0.72, 1.19], [6.0, 6.0, 7.0])],
            occluders=[_post(-1.13 + 0.27 * k, -0.42 + 0.031 * k * k, 1.61 + 0.07 * k) for k in range(9)],
        ),
        _scene(
            "camera-in-shadow",
            "A screen hides the light from the camera, and the fog up to 1 to 5 m before it; Rayleigh scattering.",
            _view([0.4, -2.2, 1.1], [0.1, 1.0, 0.9]),
            _fog([0.12, 0.18, 0.41], [0.99, 0.95, 0.9], "rayleigh"),
            lights=[_point([-1.93, 2.31, 1.87], [12.0, 14.0, 18.0])],
            occluders=[_screen([-1.37, 0.24, 1.04], [0.93, 0.42, 0.03], [0.11, -0.21, 1.17])],
        ),
        _scene(
            "hard-spot",
            "A spot with a hard edge shines on a sphere over a floor.",
            _view(fov=41.0),
            _fog([0.33], [0.9, 0.7, 0.6], "rayleigh"),
            lights=[_spot([1.52, -0.83, 2.74], [0.1, 0.2, 0.5], intensity=[21.0, 19.0, 17.0], cutoff=23.5, beam=23.5)],
            occluders=[_FLOOR, _sphere([0.24, 0.07, 0.81], 0.37)],
        ),
        _scene(
            "soft-spot",
            "A spot that fades from 11 to 29 degrees off its axis shines on a box and a needle; no floor.",
            _view(fov=39.0),
            _fog([0.29], [0.8, 0.9, 0.95], "hg", 0.5),
            lights=[_spot([-1.24, 0.73, 2.47], [0.3, -0.1, 0.6], intensity=[16.0, 18.0, 20.0], cutoff=29.0, beam=11.0)],
            occluders=[
                _box([-0.22, 0.31, 1.21], [0.21, 0.02, 0], [0.01, 0.17, 0.03], [0, -0.05, 0.24]),
                _post(0.3, 0.1, 1.3),
            ],
        ),
        _scene(
            "many-lights",
            "Two point lights, one behind the camera, and a spot about a box, a sphere, a needle and a floor.",
            _view(fov=41.0),
            _fog([0.16], [0.95, 0.9, 0.85]),
            lights=[
                _point([1.17, 0.84, 1.71], [5.0, 1.0, 0.5]),
                _point([-0.92, -4.93, 2.31], [2.0, 9.0, 3.0]),
                _spot([-1.31, 0.21, 2.93], [-0.2, 0.1, 0.4], intensity=[3.0, 4.0, 23.0], cutoff=31.0, beam=31.0),
            ],
            occluders=[
                _FLOOR,
                _box([0.61, 0.24, 0.47], [0.31, -0.12, 0], [0.1, 0.33, 0.02], [0.02, 0.03, 0.43]),
                _sphere([-0.47, 0.13, 0.68], 0.33),
                _post(0.05, -1.1, 1.52),
            ],
        ),
    )
