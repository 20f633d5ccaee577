# SPDX-License-Identifier: BSD-3-Clause
"""Whether light reaches what the camera sees: rays against triangles in float64, the same on every machine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.random_scenes.drawn import DrawnScene

Array = NDArray[np.float64]

_ACROSS, _UP, _ALONG = 7, 5, 3  # rays of the camera, and points on each


@dataclass(frozen=True)
class Reach:
    """What of a scene the camera sees, and what of it is lit."""

    lit: float  #: share of points in view that a light reaches
    near: float  #: share of rays that meet a surface before half of the way to the middle of the stage
    camera_lit: bool  #: whether the first light reaches the camera

    @property
    def enough(self) -> bool:
        """Whether the scene is worth rendering."""
        return self.lit >= 0.23 and self.near <= 0.31


def reach(drawn: DrawnScene, triangles: Sequence[Array], aspect: float = 0.75) -> Reach:
    """Return what light reaches.

    Parameters
    ----------
    triangles
        The corners of every caster, in their order, (n, 3, 3) [m].
    aspect
        Height of the image over its width.
    """
    camera, target = np.array(drawn.camera.origin), np.array(drawn.camera.target)
    directions = _directions(target - camera, drawn.camera.fov, aspect)
    away = float(np.linalg.norm(np.array(drawn.centre) - camera))
    most = away + drawn.scale
    bodies = [_Body.of(corners) for corners in triangles if len(corners)]
    free = np.array([min(most, _nearest(bodies, camera, direction * most) * most) for direction in directions])
    share = (np.arange(_ALONG) + 0.5) / _ALONG
    points = (camera + (free[:, None] * share)[..., None] * directions[:, None]).reshape(-1, 3)
    lit = np.zeros(len(points), dtype=bool)
    for light in drawn.lights:
        for number in np.flatnonzero(~lit):
            lit[number] = _sees(drawn, bodies, points[number], light)
    first = _sees(drawn, bodies, camera, drawn.lights[0])
    return Reach(float(lit.mean()), float((free < 0.5 * away).mean()), first)


def _directions(forward: Array, fov: float, aspect: float) -> Array:
    forward = forward / np.linalg.norm(forward)
    left = np.cross([0.0, 0.0, 1.0], forward)
    left /= np.linalg.norm(left)
    up = np.cross(forward, left)
    tangent = np.tan(0.5 * np.deg2rad(fov))
    x = tangent * (2 * (np.arange(_ACROSS) + 0.5) / _ACROSS - 1)
    y = tangent * aspect * (2 * (np.arange(_UP) + 0.5) / _UP - 1)
    rays = (forward + x[:, None, None] * left + y[None, :, None] * up).reshape(-1, 3)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _sees(drawn: DrawnScene, bodies: Sequence["_Body"], point: Array, light) -> bool:
    """Return whether a light reaches a point: its middle, within its cone or on the side on which it shines."""
    place, target = np.array(light.position), np.array(light.target)
    way = place - point
    if light.kind in ("spot", "rectangle", "disk"):
        axis = (target - place) / np.linalg.norm(target - place)
        cosine = float(-way @ axis / max(np.linalg.norm(way), 1e-30))
        if cosine <= (np.cos(np.deg2rad(light.cutoff)) if light.kind == "spot" else 0.0):
            return False
    return _nearest(bodies, point + 1e-4 * way, way * (1 - 2e-4)) >= 1


@dataclass(frozen=True)
class _Body:
    """The triangles of a caster, and a ball around them."""

    corner: Array
    first: Array  #: edge from the corner
    second: Array
    centre: Array
    radius: float

    @classmethod
    def of(cls, corners: Array) -> "_Body":
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        centre = 0.5 * (low + high)
        radius = float(np.linalg.norm(corners - centre, axis=2).max())
        return cls(corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], centre, radius)


def _nearest(bodies: Sequence[_Body], start: Array, way: Array) -> float:
    """Return the share of a segment before its first triangle, infinity where it meets none."""
    nearest = np.inf
    length = float(way @ way)
    for body in bodies:
        closest = min(max(float((body.centre - start) @ way) / length, 0.0), 1.0)
        if np.linalg.norm(start + closest * way - body.centre) > body.radius:
            continue
        nearest = min(nearest, _first_hit(body, start, way))
    return float(nearest)


def _first_hit(body: _Body, start: Array, way: Array) -> float:
    """Return the same for one body (Moeller and Trumbore 1997)."""
    p = np.cross(way, body.second)
    determinant = np.einsum("ij,ij->i", body.first, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / determinant
        offset = start - body.corner
        u = np.einsum("ij,ij->i", offset, p) * inverse
        q = np.cross(offset, body.first)
        v = q @ way * inverse
        t = np.einsum("ij,ij->i", body.second, q) * inverse
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9) & (t < 1)
    return float(t[met].min()) if met.any() else np.inf
