# SPDX-License-Identifier: BSD-3-Clause
"""Froxel fog as a method: what engines ship for volumetric light, by the parameters that they have.

A frame injects the scattered light into a grid along the view, averages it with what the frames before found, sums it
front to back, and looks the sum up at the depth of every pixel. Three kernels: over froxels, columns and pixels. The
cost of the first two does not depend on the image.

References
----------
Wronski 2014, *Volumetric fog: unified, compute shader based solution to atmospheric scattering*. Hillaire 2015,
*Physically-based and unified volumetric rendering in Frostbite*.
"""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.memory import check_memory
from realtime.methods.froxel_fog.accumulation import accumulated, airlight_at_pixels
from realtime.methods.froxel_fog.grid import view_grid
from realtime.methods.froxel_fog.history import averaged, frame_shift
from realtime.methods.froxel_fog.injection import Visibility, scattered_light
from realtime.methods.froxel_fog.light_points import LightPointTable, tabulated
from realtime.methods.froxel_fog.media import column_pieces
from realtime.methods.interface.layers import Layers
from realtime.methods.interface.method import ErrorCause
from realtime.methods.interface.view import View
from realtime.numerics.array_types import bytes_of
from realtime.parameters import Parameters, parameter
from realtime.scene.lights import Light
from realtime.scene.read_scene import Scene
from realtime.shadow_maps.hemisphere_map import maps_memory
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map, lit_in_map, map_memory, map_size

_NUMBERS = 16  # of a froxel: scattered light, airlight, history, four each, and as much on the way


@dataclass(frozen=True)
class FroxelFogParameters(Parameters):
    """The parameters of froxel fog."""

    width: int = parameter(160, "froxels across the image", least=1, most=4096)
    height: int = parameter(90, "froxels down the image", least=1, most=4096)
    slices: int = parameter(64, "froxels in depth", least=1, most=4096)
    distribution: str = parameter(
        "exponential",
        "slices that grow with their depth, or equally thick ones",
        choices=("exponential", "linear"),
    )
    near: float = parameter(
        0.0, "depth up to which exponential slices are about equally thick; 0: far/8", least=0, unit="m"
    )
    far: float = parameter(
        0.0, "depth where the grid ends; 0: that of the farthest surface, or where light fades", least=0, unit="m"
    )
    jitter: str = parameter(
        "none", "samples in the middle of froxels, or moved from frame to frame", choices=("none", "frames")
    )
    history: float = parameter(0.0, "weight of the frames before; 0: each frame for itself", least=0, below=1)
    shadow: str = parameter("map", "a look-up in a shadow map a froxel, or a shadow ray", choices=("map", "ray"))
    map: int = map_size(
        512,
        "texels on a side of a face of the map, with `shadow=map`; half as many for each point of a light with extent",
    )

    def _check_together(self) -> None:
        if self.far and self.near >= self.far:
            raise InputError(f"near: got {self.near:g} with far={self.far:g}, wanted a depth before it")
        if self.distribution == "linear" and self.near:
            raise InputError(f"near: got {self.near:g} with distribution=linear, wanted 0: all slices are equal")

    @property
    def point_map(self) -> int:
        """Texels on a side of the map of a light point: the errors of many maps average, and a froxel is no smaller."""
        return max(self.map // 2, 4)

    @property
    def grid_size(self) -> tuple[int, int, int]:
        """Froxels across, down and in depth."""
        return self.width, self.height, self.slices


@dataclass(frozen=True)
class FroxelShadows:
    """What the froxels of a frame need of its lights."""

    maps: tuple[ShadowMap, ...]  #: of the lights without extent; () where rays are cast
    tables: tuple[LightPointTable, ...]  #: of the others


def prepare_froxel_fog(scene: Scene, parameters: FroxelFogParameters) -> Callable[[Scene], FroxelShadows]:
    """Return the function that casts a shadow map for every light of a frame, if they are asked for.

    Raises
    ------
    InputError
        If grid and maps need more memory than the machine has.
    """
    across, down, deep = parameters.grid_size
    number = bytes_of(type(scene.camera.origin.x))
    froxels = _NUMBERS * number * across * down * deep
    check_memory(f"a grid of {across} x {down} x {deep} froxels", froxels, "use fewer")
    if parameters.shadow != "map" or not scene.features.shadows:
        return lambda scene: FroxelShadows((), tabulated(scene.lights))
    map = parameters.map
    points = sum(light.source is not None for light in scene.lights)
    needed = froxels + maps_memory(type(scene.camera.origin.x), points, parameters.point_map)
    needed += sum(map_memory(light, map) for light in scene.lights if light.source is None)
    check_memory(f"map: {map} texels for {len(scene.lights)} light(s)", needed, "use a smaller map")

    def cast(scene: Scene) -> FroxelShadows:
        ordinary = [light for light in scene.lights if light.source is None]
        first = {light.source: light for light in scene.lights}
        tables = (
            table.with_maps(scene.geometry, first[table.source], parameters.point_map)
            for table in tabulated(scene.lights)
        )
        return FroxelShadows(tuple(cast_shadow_map(scene.geometry, light, map) for light in ordinary), tuple(tables))

    return cast


def froxel_fog(view: View, state: FroxelShadows, lists, *, kernel, parameters: FroxelFogParameters) -> Layers:
    """Return the airlight of every ray by froxels [W/(m^2 sr)].

    Parameters
    ----------
    view
        The frame.
    state
        From `prepare_froxel_fog`.
    lists, kernel
        Not used.
    parameters
        Values of the parameters.
    """
    last = view.carried
    grid = view_grid(
        view,
        size=parameters.grid_size,
        near=parameters.near,
        far=parameters.far,
        distribution=parameters.distribution,
    )
    dr.eval(grid.far, grid.near)
    pieces = column_pieces(view, grid, dr.arange(mi.UInt32, grid.columns))
    Float = type(view.distance)
    shift = frame_shift(last if parameters.jitter == "frames" else None, Float)
    visible = _visibility(view, state, parameters.shadow)
    scattered = scattered_light(view, grid, pieces, shift=shift, tables=state.tables, visible=visible)
    carried = None
    if hands_on(parameters):
        scattered, carried = averaged(scattered, grid, last, weight=parameters.history)
    dr.eval(scattered, carried)
    volume = accumulated(view, grid, scattered, pieces)
    return Layers(airlight_at_pixels(view, grid, volume), carried=carried)


def hands_on(parameters: FroxelFogParameters) -> bool:
    """Return whether frames hand anything on: what they held, or their number."""
    return parameters.history > 0 or parameters.jitter != "none"


def froxel_errors(parameters: FroxelFogParameters, size: tuple[int, int]) -> tuple[ErrorCause, ...]:
    """Return the causes of its errors, as `realtime.methods.interface.method.Method.error_causes` has them.

    With a column a pixel nothing is left of the columns' error; then what is left is that of the slices.
    """
    return ("map", {"shadow": "ray"}), ("resolution", {"width": size[0], "height": size[1]}), ("steps", None)


def _visibility(view: View, shadows: FroxelShadows, shadow: str) -> Visibility:
    def visible(point, light: Light, number: int):
        if shadow == "ray":
            return view.visible(point, light)
        if light.source is None:
            return lit_in_map(shadows.maps[number], light, point)
        # In bounded media light points come one by one.
        table = next(table for table in shadows.tables if table.source == light.source)
        before = next(index for index, other in enumerate(view.lights) if other.source == light.source)
        return table.lit(mi.UInt32(number - before), light, point)

    return visible
