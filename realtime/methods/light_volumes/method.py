# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes: volumetric shadows from a shadow map, without marching (Billeter, Sintorn, Assarsson 2010).

What a light reaches directly is the volume between it and the surface that its shadow map samples. A camera ray enters
and leaves that volume at crossings with its boundary; with Gamma(x) the airlight from the camera to x (the paper's eq.
1), the airlight of the ray is the signed sum of eq. 3,

    L = sum_n s_n Gamma(min(x_n, x_visible)),   s_n = +1 where it leaves the light, -1 where it enters it,

in any order. The boundary is the height field of `realtime.shadow_maps.inverse_depth_field`, and `evaluation` says
how it is crossed:

* `walk`: each ray descends into a pyramid of heights to the texels that it may cross
  (`realtime.methods.light_volumes.walk`); the intervals between crossings are integrated one by one, which keeps the
  digits that a difference of two Gammas loses. Where the map jumps the boundary stands upright, at a place that rays
  from the light find (`realtime.methods.light_volumes.jump_search`).
* `mesh`, as published: the boundary becomes triangles (`realtime.methods.light_volumes.published.mesh`), each is drawn
  over the pixels that it covers (`realtime.methods.light_volumes.published.raster`), and terms are added up as they
  come (`realtime.methods.light_volumes.published.signed_sum`). The `static` mesh is the height field itself, an
  `adaptive` one has fewer triangles where the map is flat (`realtime.methods.light_volumes.published.tessellation`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.errors import InputError
from realtime.memory import check_memory
from realtime.methods.interface.layers import Layers
from realtime.methods.interface.light_airlight import RayAirlight, integral_type, ray_airlight
from realtime.methods.interface.view import View, rays_in_media
from realtime.methods.light_volumes.jump_search import with_walls
from realtime.methods.light_volumes.published.mesh import THRESHOLD, memory_needed, volume_mesh
from realtime.methods.light_volumes.published.signed_sum import mesh_airlight
from realtime.methods.light_volumes.walk import sum_lit_intervals
from realtime.numerics.array_types import bytes_of
from realtime.parameters import Parameters, parameter
from realtime.scene.lights import Light
from realtime.scene.read_scene import Scene
from realtime.shadow_maps.inverse_depth_field import InverseDepthField, inverse_depth_field, level_start
from realtime.shadow_maps.projection import light_faces
from realtime.shadow_maps.shadow_map import cast_shadow_map, map_memory, map_size
from realtime.tiles.adaptive_sampling import tolerance


@dataclass(frozen=True)
class LightVolumeParameters(Parameters):
    """The parameters of light volumes."""

    map: int = map_size(512, "texels on a side of a face of the shadow map, a power of two")
    evaluation: str = parameter(
        "walk",
        "how crossings are found: each ray over the map, or each triangle over the image",
        choices=("walk", "mesh"),
    )
    tessellation: str = parameter(
        "static",
        "of the mesh: two triangles a texel, or larger ones where the map is flat",
        choices=("static", "adaptive"),
    )
    threshold: float = parameter(
        THRESHOLD,
        "for `adaptive`: departure from the map that is allowed, relative to the depth",
        above=0,
        wanted=f"a positive number, for instance {THRESHOLD:g}",
    )
    surface: str = parameter(
        "map", "where the shadows on surfaces come from; a mesh always casts rays", choices=("map", "ray")
    )
    walls: str = parameter(
        "upright",
        "where the map jumps: at a place that rays find, or across one texel as published; a mesh has slanted ones",
        choices=("upright", "slanted"),
    )
    tolerance: float = tolerance()

    def _check_together(self) -> None:
        if self.tessellation == "adaptive" and self.evaluation != "mesh":
            raise InputError(
                f"tessellation=adaptive: got evaluation={self.evaluation}, which has no triangles to save; wanted "
                "evaluation=mesh with it"
            )


def light_volumes(view: View, state: tuple[Any, ...], lists, *, kernel, parameters: LightVolumeParameters) -> Layers:
    """Return the airlight of every ray in the light volumes, and by light whether it reaches the visible surface.

    Parameters
    ----------
    view
        The frame.
    state
        By light its height field, or its mesh, from `prepare_light_volumes`.
    lists
        Not used.
    kernel
        An airlight kernel, see `realtime.kernels`.
    parameters
        Values of the parameters.

    Notes
    -----
    Valid for all lights and any shapes that rays can be cast against; the map of a directional light covers the media,
    and its shadows on surfaces always come from rays. Exact with respect to the shadow map:
    what it misses of the scene falls as the size of a texel (`validation.study.maps`). A map that sees nothing
    lights everything; a light inside a closed occluder lights nothing outside it. Bounded media are for
    evaluation=walk; they have nodes of their own, but for a polynomial kernel.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, *Real time volumetric shadows using polygonal light volumes*, High Performance
    Graphics.
    """
    total = type(view.medium.albedo)(0)
    lit = []
    in_media = rays_in_media(view, kernel=kernel) if view.features.bounded else ()
    for number, light in enumerate(view.lights):
        if parameters.evaluation == "mesh" and view.features.shadows:
            total += mesh_airlight(view, light, state[number], kernel=kernel)
            continue
        airlight = ray_airlight(view, light, kernel, in_media[number] if in_media else None)
        if view.features.shadows:
            value, reached = _walk(state[number], airlight)
        else:
            value, reached = airlight.radiance(airlight.integral(*airlight.segment)), True
        total += value
        # A surface may be beside the map of a directional light, whose shadows on surfaces come from rays.
        lit.append(reached if light.w else True)
    return Layers(total, tuple(lit) if finds_lit_surfaces(parameters) else None)


def finds_lit_surfaces(parameters: LightVolumeParameters) -> bool:
    """Return whether the method, with these parameters, says which surfaces are lit."""
    return parameters.evaluation == "walk" and parameters.surface == "map"


def _walk(heights: InverseDepthField, airlight: RayAirlight):
    """Return the airlight of one light along the rays [W/(m^2 sr)], and whether it reaches their ends."""
    view = airlight.view
    zero = dr.zeros(integral_type(view), dr.width(view.distance))
    away = view.origin - airlight.light.position
    place = {"away": away, "direction": view.direction, "segment": airlight.segment}
    value, reached = sum_lit_intervals(heights, **place, integral=airlight.integral, zero=zero)
    return airlight.radiance(value), reached


def prepare_light_volumes(scene: Scene, parameters: LightVolumeParameters) -> Callable[[Scene], tuple[Any, ...]]:
    """Return the function that makes the height field, or the mesh, of every light of a frame.

    Raises
    ------
    InputError
        For a mesh in bounded media, and more memory than the machine has.
    """
    map, evaluation = parameters.map, parameters.evaluation
    if evaluation == "mesh" and scene.features.bounded:
        raise InputError(
            "evaluation=mesh: the scene has a medium with bounds, wanted one medium that fills all space; use "
            "evaluation=walk"
        )
    if not scene.features.shadows:
        return lambda scene: ()
    needed = sum(_memory_of(light, map, evaluation) for light in scene.lights)
    check_memory(f"map: {map} texels for {len(scene.lights)} light(s)", needed, "use a smaller map")

    def volume(scene: Scene, light: Light):
        shadow_map = cast_shadow_map(scene.geometry, light, map)
        if evaluation == "walk":
            heights = inverse_depth_field(shadow_map)
            return with_walls(heights, scene.geometry, light) if parameters.walls == "upright" else heights
        tessellation, threshold = parameters.tessellation, parameters.threshold
        return volume_mesh(shadow_map, light, tessellation=tessellation, threshold=threshold)

    return lambda scene: tuple(volume(scene, light) for light in scene.lights)


def _memory_of(light: Light, size: int, evaluation: str) -> int:
    """Return about how much the volume of a light takes, an upper bound where it is adaptive [bytes]."""
    number = bytes_of(type(light.position.x))
    faces = light_faces(light)
    corners = map_memory(light, size)
    if evaluation == "mesh":
        # Drawing it takes four doubles for each vertex as it is, and four for it in the image.
        return corners + memory_needed(faces, size) + faces * (size + 1) ** 2 * 8 * 8
    # Distances and heights at the corners, four heights and walls a texel, two bounds a node.
    numbers = 4 * size**2 + 2 * level_start(size.bit_length())
    return 2 * corners + faces * (number * numbers + 4 * size**2)
