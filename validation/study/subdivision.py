# SPDX-License-Identifier: BSD-3-Clause
r"""The meshes of a scene with four times the triangles at each level, and with bumps that these resolve.

A flat triangle cut into four has no new silhouette. So all vertices move by one smooth map of space,

    u(p) = p + sum_i a_i sin(k_i . p + i),     |a_i| |k_i| = 0.15,     i = 1 .. 4,

with wavelengths from a quarter to a thirtieth of the scene's size. The norms of its derivative less the identity add
up to 0.6 < 1: it is one to one, so that closed meshes stay closed, and what was disjoint is disjoint. Its bumps turn
smooth outlines into silhouettes of which more and more edges are found as triangles shrink below the wavelengths, about
the root of their number. Equal places move equally, so that seams of doubled vertices stay closed.

Bounds of media and lights with extent stay as they are: they must be convex, or of their shape.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from realtime.area_lights.shape import is_area_light
from realtime.scene.mesh_adjacency import mesh_triangles
from realtime.scene.named_shapes import scene_of
from validation.scenes.meshes import divided
from validation.scenes.parts import mesh_with_material

_WAVES = ((3.1, 2.3, -1.1), (-5.3, 6.7, 3.7), (11.3, -7.9, 9.1), (-17.3, 15.1, 13.9))  # along the size of the scene
_STEEPNESS = 0.15


def triangles_of(scene) -> int:
    """Return how many triangles the meshes of a Mitsuba scene have that `subdivided` cuts."""
    return sum(int(shape.face_count()) for shape in scene.shapes() if _is_cut(shape))


def subdivided(scene, levels: int) -> Any:
    """Return a Mitsuba scene whose opaque meshes, if any, have 4^levels times the triangles, and bumps."""
    if not triangles_of(scene):
        raise InputError("triangles: the scene has no opaque meshes, which alone can have more triangles; use another")
    box = scene.bbox()
    low, high = (np.array(corner, dtype=np.float64) for corner in (box.min, box.max))
    shapes = [_cut(shape, levels, low, float(np.linalg.norm(high - low))) for shape in scene.shapes()]
    return with_shapes(scene, shapes)


def with_shapes(scene, shapes: Iterable[Any]) -> Any:
    """Return a Mitsuba scene of other shapes, with the camera and the lights without extent of one."""
    emitters = (emitter for emitter in scene.emitters() if not is_area_light(emitter))
    parts = {f"emitter-{number}": emitter for number, emitter in enumerate(emitters)}
    return scene_of(list(shapes), {"sensor": scene.sensors()[0]} | parts)


def _cut(shape, levels: int, corner: NDArray[np.float64], size: float) -> Any:
    if not _is_cut(shape):
        return shape
    mesh = mesh_triangles(shape)
    for _ in range(levels):
        mesh = divided(mesh)
    vertices, faces = mesh
    cut = mesh_with_material(shape.id(), (bumpy(vertices, corner, size), faces), shape.bsdf())
    cut.set_id(shape.id())
    return cut


def bumpy(points: NDArray[np.float64], corner: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Return points (n, 3) after the map of space above, for a scene of a `size` from a `corner` on [m]."""
    moved = points.copy()
    for number, wave in enumerate(np.asarray(_WAVES) * (2 * np.pi / size), 1):
        across = np.cross(wave, (0.31, 0.53, 0.79))
        height = _STEEPNESS / np.linalg.norm(wave)
        moved += height * across / np.linalg.norm(across) * np.sin((points - corner) @ wave + number)[:, None]
    return moved


def _is_cut(shape) -> bool:
    return shape.is_mesh() and not shape.is_emitter() and shape.bsdf().class_name() != "Null"
