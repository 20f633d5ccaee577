# SPDX-License-Identifier: BSD-3-Clause
"""Section 4 of Billeter 2010: the mesh of a light volume, its adaptive tessellation, and the clamping of its depths.

*Plain Laplacian.* The paper finds edges by a Laplacian filter of the shadow map; ours takes the terms of the Laplacian
of the inverse depth one by one, at the spacing of every level (`realtime.methods.light_volumes.published.
tessellation`). Here the plain filter, of the depth at the texels alone, stands beside it: its threshold is chosen so
that both meshes have as many triangles, and both are compared with the static mesh of the same map.

*Depths.* With depth testing, what the mesh crosses behind the visible surface is not drawn, and the mesh must be pushed
towards the light so that its own image of the surface stays in front. The paper clamps crossings to the depth of the
surface instead. Both sums are taken from the same crossings.
"""

from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from analytic.geometry import foot_and_height
from analytic.panels import airlight_segments
from analytic.phase import PhaseFunction
from realtime.frame.renderer import FrameRenderer, evaluated, image_frame, run_cast_and_shade, run_method
from realtime.methods.light_volumes.published.mesh import THRESHOLD, VolumeMesh, volume_mesh
from realtime.methods.light_volumes.published.raster import signed_crossings
from realtime.methods.light_volumes.published.tessellation import configuration, divide, edges, quads, triangles
from realtime.scene.read_scene import read_scene
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map, inverse_depth
from reference.scene.read import read_truth
from validation.configurations import methods
from validation.fidelity.plain_laplacian import corner_mesh, departures, plain_edges
from validation.metrics.errors import error_metrics
from validation.scenes.loading import load_scene

Array = NDArray[np.float64]

MAP = 512  #: of the colonnade, six faces [texels]
SIZE = (160, 120)  #: of its images [pixels]
BIASES = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  #: by which the mesh is pushed towards the light, of its depth [1]
_BIAS_MAP, _BIAS_SIZE = 128, (64, 64)  # of omni-box


def tessellation() -> dict[str, Any]:
    """Return what holds of the mesh, and what two filters and two treatments of depths cost.

    Returns
    -------
    dict
        `triangles_1024`, `triangles_4096`
            of a static mesh of one face
        `configurations`, `most_triangles`
            that occur, and of a quad
        `level_steps`
            largest difference of levels between neighbours
        `open_edges`
            of triangles that have not exactly one neighbour there
        `adaptive_triangles`, `static_triangles`
            of six faces
        `flat`, `jump`
            median side of the quads without and with a jump of the map [texels]
        `filters`
            `ours`, `plain`: `triangles`, `error` (relative RMSE of the airlight to that of the static mesh),
            `rms_departure` and `largest_departure` (of the depth [1])
        `biased`
            relative RMSE to the clamped sum, by bias
    """
    scene = read_scene(load_scene("colonnade", SIZE).scene)
    light = scene.lights[0]
    shadow_map = cast_shadow_map(scene.geometry, light, MAP)
    heights = np.array(inverse_depth(shadow_map)).reshape(6, MAP + 1, MAP + 1)
    divided = divide(edges(heights, THRESHOLD))
    corners = triangles(divided)
    quantities = _grid(divided, heights)
    chosen = {"evaluation": "mesh", "map": MAP}
    renderer = methods.prepared(scene, methods.configuration("light-volumes", "exact", chosen))
    return quantities | {
        "triangles_1024": _static_triangles(1024),
        "triangles_4096": _static_triangles(4096),
        "open_edges": open_edges(volume_mesh(shadow_map, light, tessellation="adaptive").triangles),
        "adaptive_triangles": len(corners),
        "static_triangles": 12 * MAP**2,
        "filters": _filters(renderer, shadow_map, heights, divided),
        "biased": biased(),
    }


def _static_triangles(size: int) -> int:
    """Return the triangles of the static mesh of one face, with those that join its border to the light."""
    return 2 * size**2 + 4 * size


def _grid(divided: list[Any], heights: Array) -> dict[str, Any]:
    """Return what holds of the quads of an adaptive mesh."""
    used = {int(level) for _, _, sides in quads(divided) for level in np.unique(sides)}
    level = quad_levels(divided)
    jump = _jumps(heights)
    side = 2 ** len(divided) / 2.0**level
    steps = [np.abs(np.diff(level, axis=axis)).max() for axis in (1, 2)]
    return {
        "configurations": len(used),
        "most_triangles": max(len(configuration(sides)) for sides in used),
        "level_steps": int(max(steps)),
        "flat": float(np.median(side[~jump])),
        "jump": float(np.median(side[jump])),
    }


def quad_levels(divided: list[Any]) -> NDArray[np.int64]:
    """Return the level of the quad in which each texel lies, (faces, size, size); 0 is a whole face.

    Parameters
    ----------
    divided
        From `realtime.methods.light_volumes.published.tessellation.divide`.
    """
    size = 2 ** len(divided)
    level = np.zeros((len(divided[0]), size, size), dtype=np.int64)
    for number, numbers, _ in quads(divided):
        step = size >> number
        face, rest = np.divmod(numbers, 4**number)
        row, column = np.divmod(rest, 2**number)
        down = (row * step)[:, None, None] + np.arange(step)[:, None]
        level[face[:, None, None], down, (column * step)[:, None, None] + np.arange(step)] = number
    return level


def _jumps(heights: Array) -> NDArray[np.bool_]:
    """Return the texels whose corners differ by more than a tenth."""
    corners = np.stack([heights[:, a : a - 1 or None, b : b - 1 or None] for a in (0, 1) for b in (0, 1)])
    return np.ptp(corners, axis=0) > 0.1 * corners.max(axis=0)


def open_edges(corners: Any) -> int:
    """Return how many directed edges of triangles have not exactly one opposite: 0 for a closed mesh, no T-junction."""
    pairs = np.concatenate([corners[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]).astype(np.int64)
    count = int(corners.max()) + 1
    there, back = (np.sort(pairs[:, a] * count + pairs[:, b]) for a, b in ((0, 1), (1, 0)))
    return int(np.sum(there != back))


def _filters(renderer: FrameRenderer, shadow_map: ShadowMap, heights: Array, ours: Any) -> dict[str, Any]:
    """Return triangles and errors of both filters."""
    light = renderer.scene.lights[0]
    cast, by_light = run_cast_and_shade(renderer)
    dr.eval(cast, by_light)

    def airlight(mesh: VolumeMesh) -> Array:
        return image_frame(renderer, evaluated(cast, by_light, run_method(renderer, (mesh,), cast, by_light))).airlight

    static = airlight(volume_mesh(shadow_map, light))
    meshes = {}
    for name, divided in (("ours", ours), ("plain", divide(plain_edges(heights, len(triangles(ours)))))):
        corners = triangles(divided)
        error = error_metrics(static, airlight(corner_mesh(shadow_map, light, corners)))
        departure = departures(heights, divided)
        meshes[name] = {
            "triangles": len(corners),
            "error": error.relative_rmse,
            "rms_departure": float(np.sqrt(np.mean(departure**2))),
            "largest_departure": float(departure.max()),
        }
    return meshes


def biased() -> list[dict[str, float]]:
    """Return for each bias the relative RMSE of the sum with depth testing to the sum with clamped depths."""
    loaded = load_scene("omni-box", _BIAS_SIZE).scene
    scene, truth = read_scene(loaded), read_truth(loaded)
    light = scene.lights[0]
    chosen = {"evaluation": "mesh", "map": _BIAS_MAP}
    renderer = methods.prepared(scene, methods.configuration("light-volumes", "exact", chosen))
    cast, by_light = run_cast_and_shade(renderer)
    distance = image_frame(
        renderer, evaluated(cast, by_light, run_method(renderer, renderer.prepare(scene), cast, by_light))
    )
    depth = np.asarray(distance.distance, dtype=np.float64).ravel()
    foot, height = foot_and_height(truth.origin, truth.direction, truth.lights[0].position)
    sigma = float(truth.medium.sigma_t[0])
    mesh = volume_mesh(cast_shadow_map(scene.geometry, light, _BIAS_MAP), light)

    def summed(shown: VolumeMesh, clamp: bool) -> Array:
        total = np.zeros(len(depth))
        for batch in signed_crossings(shown, scene.camera):
            pixel = np.array(batch.pixel)
            x, sign = np.array(batch.distance), np.array(batch.sign)
            kept = np.ones(len(x), dtype=bool) if clamp else x < depth[pixel]
            pixel, sign, end = pixel[kept], sign[kept], np.minimum(x, depth[pixel])[kept]
            J, _ = airlight_segments(foot[pixel], height[pixel], 0.0, end, sigma, PhaseFunction("isotropic"))
            np.add.at(total, pixel, sign * J)
        return total

    clamped = summed(mesh, True)
    return [
        {
            "bias": bias,
            "error": error_metrics(_image(clamped), _image(summed(_pushed(mesh, light, bias), False))).relative_rmse,
        }
        for bias in BIASES
    ]


def _image(values: Array) -> Array:
    return np.repeat(values.reshape(_BIAS_SIZE[::-1])[:, :, None], 3, axis=2)


def _pushed(mesh: VolumeMesh, light: Any, bias: float) -> VolumeMesh:
    """Return a mesh pushed towards the light by a share of its depth: vertices are (light s + k, s)."""
    place = np.array(light.position, dtype=np.float64).ravel()
    s = mesh.vertices[:, 3:]
    nearer = s / (1 - bias)
    return VolumeMesh(np.hstack([mesh.vertices[:, :3] + place * (nearer - s), nearer]), mesh.triangles)
