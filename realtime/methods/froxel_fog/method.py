# SPDX-License-Identifier: BSD-3-Clause
"""Froxel fog as a method: volumetric light as in game engines, with their parameters.

A frame injects the scattered light into a grid along the view, sums it front to back, and looks the
sum up at the depth of every pixel. Three kernels: over froxels, columns and pixels. The cost of the
first two does not depend on the image.

References
----------
Wronski 2014, *Volumetric fog: unified, compute shader based solution to atmospheric scattering*.
Hillaire 2015, *Physically-based and unified volumetric rendering in Frostbite*.
"""

from dataclasses import dataclass

import drjit as dr

from airlight.realtime.memory import check_memory
from airlight.realtime.methods.froxel_fog.grid import (
    accumulated,
    airlight_at_pixels,
    column_rays,
    view_grid,
)
from airlight.realtime.methods.froxel_fog.injection import Visibility, frame_shift, scattered_light
from airlight.realtime.methods.interface.method import Layers, Method, View, no_state
from airlight.realtime.numerics.array_types import bytes_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.hemisphere_map import (
    HemisphereMaps,
    cast_hemisphere_maps,
    maps_memory,
)
from airlight.realtime.shadow_maps.shadow_map import (
    ShadowMaps,
    cast_shadow_maps,
    check_maps,
    lit_in_map,
    map_memory,
    map_size,
)


@dataclass(frozen=True)
class FroxelFog(Method):
    """The airlight by froxels."""

    name = "froxel-fog"
    summary = "scattered light in a grid along the view, summed front to back, as in game engines"
    source = "Wronski 2014; Hillaire 2015"
    prepared_from = frozenset({"geometry", "light"})
    at_once = True

    width: int = parameter(160, "froxels across the image", least=2, most=4096)
    height: int = parameter(90, "froxels down the image", least=2, most=4096)
    slices: int = parameter(64, "froxels in depth", least=1, most=4096)
    far: float = parameter(
        0.0,
        "depth where the grid ends; 0: at the farthest surface, or where light fades",
        least=0,
        unit="m",
    )
    jitter: str = parameter(
        "none",
        "samples in the middle of froxels, or moved from frame to frame",
        choices=("none", "frames"),
    )
    shadow: str = parameter(
        "map", "a look-up in a shadow map a froxel, or a shadow ray", choices=("map", "ray")
    )
    map: int = map_size(
        512,
        "texels on a side of a face of the map, with `shadow=map`; half as many for each point of "
        "an area light",
    )

    @property
    def point_map(self) -> int:
        """Texels on a side of the map of a light sample: errors of many maps average,
        and a froxel is no smaller.
        """
        return max(self.map // 2, 4)

    @property
    def grid_size(self) -> tuple[int, int, int]:
        """Froxels across, down and in depth."""
        return self.width, self.height, self.slices

    def check(self, scene):
        """Refuse a grid and maps that need more memory than the machine has."""
        # A froxel has 12 numbers: scattered light and airlight, four each, and as much on the way.
        across, down, deep = self.grid_size
        Float = type(scene.camera.origin.x)
        froxels = 12 * bytes_of(Float) * across * down * deep
        check_memory(f"a grid of {across} x {down} x {deep} froxels", froxels, "use fewer")
        # Maps need their room beside the froxels: hemispheres for light samples, cubes or single
        # faces for other lights.
        if self.shadow == "map" and scene.features.shadows:
            samples = sum(light.source is not None for light in scene.lights)
            maps = sum(
                map_memory(light, self.map) for light in scene.lights if light.source is None
            )
            check_maps(
                scene.lights, self.map, froxels + maps + maps_memory(Float, samples, self.point_map)
            )

    def preparation(self, scene):
        """Return a function that casts the shadow maps of each table of
        lights, if they are asked for.
        """
        if self.shadow != "map" or not scene.features.shadows:
            return no_state

        def maps(geometry, table):
            # A table of an area light's samples has one map of a hemisphere for each; other lights
            # have shadow maps.
            if table.rows.facing is None:
                return cast_shadow_maps(geometry, table, self.map)
            return cast_hemisphere_maps(geometry, table, self.point_map, for_surfaces=False)

        return lambda now: tuple(maps(now.geometry, table) for table in now.tables)

    def render(self, view, state, kernel):
        """Return the airlight of every ray by froxels [W/(m^2 sr)]."""
        grid = view_grid(view, size=self.grid_size, far=self.far)
        # Three kernels: over froxels, over columns, over pixels. The depth of the grid and the
        # scattered light are evaluated between them, since each kernel reads what the one before it
        # wrote.
        dr.eval(grid.far)
        shift = frame_shift(view) if self.noisy else (0, 0, 0)
        visible, rays = _visibility(view, state, self.shadow), column_rays(view, grid)
        scattered = scattered_light(view, grid, rays, shift=shift, visible=visible)
        dr.eval(scattered)
        return Layers(airlight_at_pixels(view, grid, accumulated(view, grid, rays, scattered)))

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`.

        With a column for each pixel the columns make no error; the error of the slices remains.
        """
        width, height = (max(side, 2) for side in size)  # a grid has two columns and rows at least
        return (
            ("map", {"shadow": "ray"}),
            ("resolution", {"width": width, "height": height}),
            ("steps", None),
        )


def _visibility(
    view: View, states: tuple[ShadowMaps | HemisphereMaps, ...], shadow: str
) -> Visibility:
    def visible(point, place):
        def reaches(light: Light, number):
            if shadow == "ray":
                return view.visible(point, light)
            maps = states[place]
            if isinstance(maps, HemisphereMaps):
                return maps.of(number, light).lit(point)
            return lit_in_map(maps.of(number, light), light, point)

        return reaches

    return visible
