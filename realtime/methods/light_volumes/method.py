# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes: volumetric shadows from a shadow map, without marching (Billeter, Sintorn, Assarsson 2010).

A light reaches directly the volume between itself and the surface that its shadow map samples. A camera ray enters and
leaves this volume at crossings with its boundary; with Gamma(x) the airlight from the camera to x (the paper's eq. 1),
the airlight of the ray is the signed sum of eq. 3,

    L = sum_n s_n Gamma(min(x_n, x_visible)),   s_n = +1 where it leaves the light, -1 where it enters it,

in any order. The boundary is the height field of `realtime.shadow_maps.inverse_depth_field`, and `evaluation` says
how it is crossed:

* `walk`: each ray descends into a pyramid of heights to the texels that it may cross
  (`realtime.methods.light_volumes.walk`); the intervals between crossings are integrated one by one, which keeps the
  digits that a difference of two Gammas loses. Where the map jumps the boundary stands upright, at a place that rays
  from the light find (`realtime.methods.light_volumes.jump_search`).
* `mesh`, as published: the boundary becomes triangles (`realtime.methods.light_volumes.published.mesh`), each is drawn
  over the pixels that it covers (`realtime.methods.light_volumes.published.raster`), and terms are added up as they
  come (`realtime.methods.light_volumes.published.raster`). The `static` mesh is the height field itself, an
  `adaptive` one has fewer triangles where the map is flat (`realtime.methods.light_volumes.published.tessellation`).
"""

from dataclasses import dataclass

import drjit as dr

from airlight.realtime.errors import InputError
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.methods.light_volumes.jump_search import with_walls
from airlight.realtime.methods.light_volumes.published.mesh import THRESHOLD, memory_needed, volume_mesh
from airlight.realtime.methods.light_volumes.published.raster import mesh_airlight
from airlight.realtime.methods.light_volumes.walk import sum_lit_intervals
from airlight.realtime.numerics.array_types import bytes_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.inverse_depth_field import inverse_depth_field, level_start
from airlight.realtime.shadow_maps.projection import light_faces
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map, check_maps, map_memory, map_size


@dataclass(frozen=True)
class LightVolumes(Method):
    """The airlight in light volumes.

    Valid for all lights and any shapes that rays can be cast against; the map of a directional light covers the media,
    and its shadows on surfaces always come from rays. Exact with respect to the shadow map: what it misses of the scene
    falls as the size of a texel. A map without hits lights everything; a light inside a closed occluder lights nothing
    outside it. Bounded media are for evaluation=walk; they have their own nodes, except with a polynomial kernel.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, *Real time volumetric shadows using polygonal light volumes*, High Performance
    Graphics.
    """

    name = "light-volumes"
    summary = "the volume between the light and its shadow map, crossed without marching"
    source = "Billeter, Sintorn, Assarsson 2010"
    prepared_from = frozenset({"geometry", "light"})

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
        "for `adaptive`: allowed departure from the map, relative to the depth",
        above=0,
        wanted=f"a positive number, for instance {THRESHOLD:g}",
    )
    walls: str = parameter(
        "upright",
        "where the map jumps: at a place that rays find, or across one texel as published; a mesh has slanted ones",
        choices=("upright", "slanted"),
    )

    def _check_together(self) -> None:
        if self.tessellation == "adaptive" and self.evaluation != "mesh":
            raise InputError(
                f"tessellation=adaptive: got evaluation={self.evaluation}, which has no triangles to save; expected "
                "evaluation=mesh with it"
            )

    @property
    def by_rays(self):
        """A mesh is drawn over the whole image."""
        return self.evaluation == "walk"

    @property
    def frozen(self):
        """The crossings of a mesh are counted on the way."""
        return self.evaluation == "walk"

    @property
    def provides_visibility(self):
        """Rays that walk over the map find out which surfaces are lit."""
        return self.evaluation == "walk"

    def check(self, scene):
        """Refuse a mesh in bounded media, and more memory than the machine has."""
        if self.evaluation == "mesh" and scene.features.bounded:
            raise InputError(
                "evaluation=mesh: the scene has a medium with bounds, expected one medium that fills all space; use "
                "evaluation=walk"
            )
        if scene.features.shadows:
            check_maps(
                scene.lights, self.map, sum(_memory_of(light, self.map, self.evaluation) for light in scene.lights)
            )

    def prepare(self, scene, light):
        """Return the height field of a light, or its mesh."""
        shadow_map = cast_shadow_map(scene.geometry, light, self.map)
        if self.evaluation == "walk":
            heights = inverse_depth_field(shadow_map)
            return with_walls(heights, scene.geometry, light) if self.walls == "upright" else heights
        return volume_mesh(shadow_map, light, tessellation=self.tessellation, threshold=self.threshold)

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray, and whether the light reaches the visible surface if that is asked."""
        if self.evaluation == "mesh" and view.features.shadows:
            return mesh_airlight(view, light, state, kernel=kernel)
        airlight, reached = view.lit_by(light, kernel), True
        if view.features.shadows:
            segment, zero = airlight.segment(view.distance), airlight.nothing(dr.width(view.distance))
            ray = {"away": view.origin - light.position, "direction": view.direction, "segment": segment}
            value, reached = sum_lit_intervals(state, **ray, integral=airlight.airlight, zero=zero)
        else:
            value = airlight.gamma(view.distance)
        radiance = airlight.radiance(value)
        # A surface may be beside the map of a directional light, whose shadows on surfaces come from rays.
        return (radiance, reached if light.w else True) if self.provides_visibility else radiance

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        return (("map", None),)


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
