# SPDX-License-Identifier: BSD-3-Clause
"""Sections 4 to 6 of Billeter 2010: the mesh of a light volume, its adaptive
tessellation, its depths, its map.

*Plain Laplacian.* The paper finds edges by a Laplacian filter of the shadow map; ours takes the
terms of the Laplacian of the inverse depth one by one, at the spacing of every level
(`realtime.methods.published.billeter2010. tessellation`). Here the plain filter, of the depth at
the texels alone, stands beside it: its threshold is chosen so that both meshes have as many
triangles, and both are compared with the static mesh of the same map.

*Depths.* With depth testing, what the mesh crosses behind the visible surface is not drawn, and the
mesh must be pushed towards the light so that its own image of the surface stays in front. The paper
clamps crossings to the depth of the surface instead. Both sums are taken from the same crossings.

*Triangles.* The sphere of `sphere-spot` with ever finer facets. Timed in turns: a frame of shadow
planes after the light moved, and of light volumes what is not the rendering of the view or of the
shadow map, that is the volume.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.panels import airlight_segments
from airlight.analytic.phase import Isotropic
from airlight.realtime.frame.image import image_frame, render_frame
from airlight.realtime.frame.renderer import (
    FrameRenderer,
    evaluated,
    run_cast_and_shade,
    run_method,
)
from airlight.realtime.frame.surface import Cast
from airlight.realtime.methods.published.billeter2010.mesh import (
    THRESHOLD,
    VolumeMesh,
    adaptive_mesh,
    volume_mesh,
)
from airlight.realtime.methods.published.billeter2010.raster import signed_crossings
from airlight.realtime.methods.published.billeter2010.tessellation import (
    divide,
    edges,
    quads,
    triangles,
)
from airlight.realtime.numerics.array_types import PerRay
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map, inverse_depth
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.clock import time_in_turns
from airlight.validation.metrics.errors import error_metrics, known
from airlight.validation.papers.claims import Figure, Figures, quartiles
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.scenes.meshes import lathe, placed
from airlight.validation.scenes.parts import mitsuba_mesh
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study import configuration as methods
from airlight.validation.study.frame_times import moved_light

MAP = 512  #: of the colonnade, six faces, and of the sphere [texels]
SIZE = (160, 120)  #: of images [pixels]
#: by which the mesh is pushed towards the light, of its depth [1]
BIASES = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
_BIAS_MAP, _BIAS_SIZE = 128, (64, 64)  # of omni-box
_MESH = "light-volumes-2010"

#: Marks of the nodes of a quadtree over each face of a map, by level, the whole face first:
#: (faces, 2^level, 2^level) each, as `divide` and `edges` return them.
Levels = list[Bools]


def maps() -> dict[str, float]:
    """Return the errors of the mesh in `omni-box` by size of the map, and of the image of
    128 texels to that of 512.
    """
    loaded = load_scene("omni-box", SIZE).scene
    scene, true = read_scene(loaded), reference_image(loaded).airlight
    # The finest map is the last image, which the one of 128 texels is compared with, too.
    sizes = (32, 128, 512)  # of the maps of Fig. 6 [texels]
    images = {size: render_frame(_renderer(scene, _MESH, size)).airlight for size in sizes}
    errors = {
        str(size): known(error_metrics(true, image).relative_rmse) for size, image in images.items()
    }
    return errors | {"128 to 512": known(error_metrics(images[512], images[128]).relative_rmse)}


def _renderer(scene: Scene, method: str, size: int, **values: str) -> FrameRenderer:
    return methods.prepared(scene, methods.configuration(method, "exact", {"map": size, **values}))


def triangle_times() -> Figures:
    """Return the times of the volume and of a frame of shadow planes with few and
    with many triangles [ms].
    """
    times: dict[str, Figure] = {}
    # Facets of a ring of the sphere: 514 triangles, and half a million.
    for name, facets in {"few": 16, "many": 512}.items():
        scene = _sphere(facets)
        volumes = _renderer(scene, "light-volumes", MAP, walls="slanted")
        state = volumes.prepare(scene)
        # The cast of the view and its shading are evaluated first: the timing of the volume must
        # not contain them.
        cast, lit = run_cast_and_shade(volumes)
        dr.eval(cast, lit)
        planes = methods.prepared(scene, methods.configuration("shadow-planes", "exact"))
        works: list[Callable[[], object]] = [
            partial(_evaluate, volumes, state, cast, lit),
            moved_light(planes),
        ]
        # In turns: both share whatever slows the machine meanwhile.
        volume, frame = time_in_turns(works, seconds=0.3 * len(works))  # for each timing [s]
        medians = {"volume": volume.quartiles, "planes": frame.quartiles}
        times |= {f"{what}, {name}": quartiles(ms) for what, ms in medians.items()}
    return times


def _evaluate(volumes: FrameRenderer, state: object, cast: Cast, lit: PerRay | None) -> None:
    dr.eval(run_method(volumes, state, cast, lit))


def _sphere(facets: int) -> Scene:
    """Return `sphere-spot` with a round sphere of so many facets a ring."""
    described = SCENES["sphere-spot"].build()
    # Rings in the middle of equal bands of the polar angle; fans close the poles.
    polar = np.pi * (1 - (np.arange(facets) + 0.5) / facets)
    mesh = placed(lathe(0.47 * np.sin(polar), 0.47 * np.cos(polar), facets), (0.11, -0.07, 1.93))
    described["sphere"] = mitsuba_mesh("sphere", mesh, (0.57, 0.31, 0.23))
    scene = mi.load_dict(described)
    resize(scene, (512, 512))
    return read_scene(scene)


def tessellation() -> Figures:
    """Return facts on the mesh of the colonnade, and the errors of two filters and
    two treatments of depths.

    `flat` and `jump` are the median sides of the quads without and with a jump of the map [texels].
    `our error` and `plain error` compare the airlight with that of the static mesh; `bias ...` and
    `best bias` are the relative RMSE of the sum with depth testing to the clamped sum.
    """
    scene = read_scene(load_scene("colonnade", SIZE).scene)
    light = scene.lights[0]
    shadow_map = cast_shadow_map(scene.geometry, light, MAP)
    heights = corner_heights(shadow_map)
    divided = divide(edges(heights, THRESHOLD))
    # The side of the quad that holds each texel: a level halves it.
    side, jump = MAP / 2.0 ** quad_levels(divided), _jumps(heights)
    errors = {f"bias {bias:g}": error for bias, error in zip(BIASES, _biased())}
    return {
        "flat": float(np.median(side[~jump])),
        "jump": float(np.median(side[jump])),
        "best bias": min(errors.values()),
        **errors,
        **_filter_errors(_renderer(scene, _MESH, MAP), shadow_map, heights, divided),
    }


def corner_heights(shadow_map: ShadowMap) -> Array:
    """Return the inverse depths at the corners of texels, (faces, N + 1, N + 1) [1/m]."""
    side = shadow_map.size + 1
    return np.array(inverse_depth(shadow_map)).reshape(shadow_map.faces, side, side)


def quad_levels(divided: Levels) -> Index:
    """Return the level of the quad in which each texel lies, (faces, size,
    size); 0 is a whole face.
    """
    size = 2 ** len(divided)
    level = np.zeros((len(divided[0]), size, size), dtype=np.int64)
    for number, numbers, _ in quads(divided):
        # A quad of this level covers step x step texels; its number counts faces, rows and columns.
        step = size >> number
        face, rest = np.divmod(numbers, 4**number)
        row, column = np.divmod(rest, 2**number)
        down = (row * step)[:, None, None] + np.arange(step)[:, None]
        level[face[:, None, None], down, (column * step)[:, None, None] + np.arange(step)] = number
    return level


def _jumps(heights: Array) -> Bools:
    """Return the texels whose corners differ by more than a tenth."""
    # The four corners of every texel, as four shifted views of the map.
    corners = np.stack(
        [heights[:, a : a - 1 or None, b : b - 1 or None] for a in (0, 1) for b in (0, 1)]
    )
    return np.ptp(corners, axis=0) > 0.1 * corners.max(axis=0)


def plain_edges(heights: Array, wanted: int) -> Levels:
    """Return the nodes of each level that hold a texel beyond the threshold of the
    plain Laplacian of the depth.

    The `heights` are inverse depths, (faces, N + 1, N + 1) [1/m]. The threshold is found by
    bisection: the mesh has about `wanted` triangles.
    """
    # Bisection in the logarithm of the threshold, from e^-20 to above the largest response, which
    # no texel exceeds. A higher threshold marks fewer texels, and the mesh has fewer triangles.
    response = laplacian(heights)
    low, high = -20.0, float(np.log(response.max() + 1))
    for _ in range(24):  # halvings of the interval
        middle = 0.5 * (low + high)
        if len(triangles(divide(_marked(response > np.exp(middle))))) > wanted:
            low = middle
        else:
            high = middle
    return _marked(response > np.exp(high))


def laplacian(heights: Array) -> Array:
    """Return |sum of the four neighbours - 4 times the corner| of the depth, (faces, N +
    1, N + 1), edges repeated.

    Where the inverse depths at the corners, `heights` [1/m], are 0, the depth is that of
    the farthest other corner.
    """
    depth = 1 / np.maximum(heights, heights[heights > 0].min())
    # Repeated edges: a border has no neighbour beyond it, and must not look like a jump.
    wide = np.pad(depth, ((0, 0), (1, 1), (1, 1)), mode="edge")
    around = wide[:, :-2, 1:-1] + wide[:, 2:, 1:-1] + wide[:, 1:-1, :-2] + wide[:, 1:-1, 2:]
    return np.abs(around - 4 * depth)


def _marked(corners: Bools) -> Levels:
    """Return the nodes of each level that have a marked corner."""
    marked = corners[:, :-1, :-1] | corners[:, 1:, :-1] | corners[:, :-1, 1:] | corners[:, 1:, 1:]
    levels = []
    # From texels to the whole face: a node is marked if one of its four children is. The coarsest
    # level comes first, as `divide` expects.
    while marked.shape[1] > 1:
        marked = (
            marked[:, ::2, ::2]
            | marked[:, 1::2, ::2]
            | marked[:, ::2, 1::2]
            | marked[:, 1::2, 1::2]
        )
        levels.append(marked)
    return levels[::-1]


def _filter_errors(
    renderer: FrameRenderer, shadow_map: ShadowMap, heights: Array, ours: Levels
) -> dict[str, float]:
    """Return the error of the airlight of both filters, with as many triangles."""
    light = renderer.scene.lights[0]
    cast, lit = run_cast_and_shade(renderer)
    dr.eval(cast, lit)

    def airlight(mesh: VolumeMesh) -> Array:
        return image_frame(
            renderer, evaluated(cast, run_method(renderer, ((mesh,),), cast, lit))
        ).airlight

    def adaptive(divided: Levels) -> VolumeMesh:
        return adaptive_mesh(shadow_map, light, heights, triangles(divided))

    # Both adaptive meshes are compared with the static mesh of the same map, so the map's own error
    # is not counted.
    static = airlight(volume_mesh(shadow_map, light))
    plain = divide(plain_edges(heights, len(triangles(ours))))
    return {
        f"{name} error": known(error_metrics(static, airlight(adaptive(divided))).relative_rmse)
        for name, divided in (("our", ours), ("plain", plain))
    }


def _biased() -> list[float]:
    """Return for each bias the relative RMSE of the sum with depth testing to the
    sum with clamped depths.
    """
    loaded = load_scene("omni-box", _BIAS_SIZE).scene
    scene = read_scene(loaded)
    light = scene.lights[0]
    # A frame gives depths in single precision; the sums are taken in double precision.
    depth = render_frame(_renderer(scene, _MESH, _BIAS_MAP)).distance.astype(np.float64).ravel()
    mesh = volume_mesh(cast_shadow_map(scene.geometry, light, _BIAS_MAP), light)
    sum_of = partial(crossings_sum, loaded, depth)
    clamped = sum_of(mesh, clamp=True)
    pushed = (sum_of(_pushed(mesh, light, bias), clamp=False) for bias in BIASES)
    return [known(error_metrics(clamped, image).relative_rmse) for image in pushed]


def crossings_sum(scene: mi.Scene, depth: Array, mesh: VolumeMesh, *, clamp: bool) -> Array:
    """Return the airlight integral of the first light from the crossings of a
    mesh, (height, width) [1/m].

    `depth`: of the visible surface in each pixel, row by row, (pixels,) [m]; `clamp`: whether a
    crossing behind the surface counts as one at the surface; otherwise it does not count.
    """
    camera, reference = read_scene(scene).camera, read_reference(scene)
    foot, height = foot_and_height(
        reference.origin, reference.direction, reference.lights[0].position
    )
    sigma = float(reference.medium.sigma_t[0])
    total = np.zeros(len(depth))
    # The airlight of a ray is the signed sum of integrals from the camera to each crossing of the
    # volume's boundary.
    for batch in signed_crossings(mesh, camera):
        pixel, x, sign = (np.array(each) for each in (batch.pixel, batch.distance, batch.sign))
        # Clamped: a crossing behind the surface counts with the integral up to the surface. With
        # depth testing it is not drawn at all.
        drawn = np.ones(len(x), dtype=bool) if clamp else x < depth[pixel]
        pixel, sign, end = pixel[drawn], sign[drawn], np.minimum(x, depth[pixel])[drawn]
        J, _ = airlight_segments(foot[pixel], height[pixel], 0.0, end, sigma, Isotropic())
        np.add.at(total, pixel, sign * J)
    return total.reshape(reference.height, reference.width)


def _pushed(mesh: VolumeMesh, light: Light, bias: float) -> VolumeMesh:
    """Return a mesh pushed towards the light by a fraction of its depth:
    vertices are (light s + k, s).
    """
    place = np.array(light.position, dtype=np.float64).ravel()
    s = mesh.vertices[:, 3:]
    # Homogeneous coordinates (light s + k, s) stand for the point light + k/s. A depth k/s that is
    # smaller by the fraction `bias` needs s/(1 - bias), and light s changes with it.
    nearer = s / (1 - bias)
    return VolumeMesh(
        np.hstack([mesh.vertices[:, :3] + place * (nearer - s), nearer]), mesh.triangles
    )
