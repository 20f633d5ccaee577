# SPDX-License-Identifier: BSD-3-Clause
"""The plain Laplacian filter of Billeter 2010, section 4.1, and meshes between chosen corners of texels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.methods.light_volumes.published.mesh import VolumeMesh, adaptive_mesh
from realtime.methods.light_volumes.published.tessellation import RING, configuration, divide, quads, triangles
from realtime.scene.lights import Light
from realtime.shadow_maps.shadow_map import ShadowMap, inverse_depth

Array = NDArray[np.float64]

_HALVINGS = 24  # of the interval of the threshold


def laplacian(heights: Array) -> Array:
    """Return |sum of the four neighbours - 4 times the corner| of the depth, (faces, N + 1, N + 1), edges repeated.

    Parameters
    ----------
    heights
        Inverse depths at the corners of texels [1/m]; where they are 0 the depth is that of the farthest other corner.
    """
    depth = 1 / np.maximum(heights, heights[heights > 0].min())
    wide = np.pad(depth, ((0, 0), (1, 1), (1, 1)), mode="edge")
    around = wide[:, :-2, 1:-1] + wide[:, 2:, 1:-1] + wide[:, 1:-1, :-2] + wide[:, 1:-1, 2:]
    return np.abs(around - 4 * depth)


def plain_edges(heights: Array, wanted: int) -> list[Any]:
    """Return the nodes of each level that hold a texel beyond the threshold that gives a number of triangles.

    Parameters
    ----------
    heights
        Inverse depths, (faces, N + 1, N + 1) [1/m].
    wanted
        Triangles of the mesh; the threshold is found by bisection, so their number is close to it.
    """
    response = laplacian(heights)
    low, high = -20.0, float(np.log(response.max() + 1))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if len(triangles(divide(_marked(response > np.exp(middle))))) > wanted:
            low = middle
        else:
            high = middle
    return _marked(response > np.exp(high))


def _marked(corners: NDArray[np.bool_]) -> list[Any]:
    """Return the nodes of each level that have a marked corner."""
    marked = corners[:, :-1, :-1] | corners[:, 1:, :-1] | corners[:, :-1, 1:] | corners[:, 1:, 1:]
    levels = []
    while marked.shape[1] > 1:
        marked = marked[:, ::2, ::2] | marked[:, 1::2, ::2] | marked[:, ::2, 1::2] | marked[:, 1::2, 1::2]
        levels.append(marked)
    return levels[::-1]


def corner_mesh(shadow_map: ShadowMap, light: Light, corners: Any) -> VolumeMesh:
    """Return the closed mesh of triangles between corners of texels, as `tessellation.triangles` numbers them."""
    side = shadow_map.size + 1
    heights = np.array(inverse_depth(shadow_map)).reshape(shadow_map.faces, side, side)
    return adaptive_mesh(shadow_map, light, heights, corners)


def departures(heights: Array, divided: list[Any]) -> Array:
    """Return at every corner of a texel |inverse depth of the mesh over that of the map - 1|, (faces, N + 1, N + 1).

    Parameters
    ----------
    heights
        Inverse depths of the map, (faces, N + 1, N + 1) [1/m]; where one is 0, at infinity, any other departs by 1.
    divided
        Which nodes are divided, see `realtime.methods.light_volumes.published.tessellation.divide`.
    """
    mesh = np.array(heights, dtype=np.float64)
    side = mesh.shape[1]
    flat, true = mesh.reshape(-1), np.asarray(heights, dtype=np.float64).reshape(-1)
    for level, numbers, sides in quads(divided):
        step = (side - 1) >> level
        if step < 2:
            continue
        face, rest = np.divmod(numbers, 4**level)
        row, column = np.divmod(rest, 2**level)
        first = (face * side + row * step) * side + column * step
        for sides_now in np.unique(sides):
            for three in configuration(int(sides_now)):
                corners = np.array([RING[k] for k in three]) * step // 2  # (column, row)
                inside, weights = _barycentric(corners, step)
                ends = first[sides == sides_now][:, None] + corners[:, 1] * side + corners[:, 0]
                at = first[sides == sides_now][:, None] + inside[:, 1] * side + inside[:, 0]
                flat[at] = true[ends] @ weights
    seen = heights > 0
    return np.where(seen, np.abs(mesh / np.where(seen, heights, 1) - 1), mesh > 0)


def _barycentric(corners: Any, step: int) -> tuple[Any, Array]:
    """Return the whole points in a triangle, (n, 2), and the weights of its corners there, (3, n)."""
    points = np.stack(np.meshgrid(np.arange(step + 1), np.arange(step + 1)), axis=-1).reshape(-1, 2)
    system = np.vstack([corners.T, np.ones(3)])
    weights = np.linalg.solve(system, np.vstack([points.T, np.ones(len(points))]))
    kept = np.all(weights > -1e-9, axis=0)
    return points[kept], weights[:, kept]
