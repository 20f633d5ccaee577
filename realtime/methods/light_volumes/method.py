# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes: volumetric shadows from a shadow map, without marching (Billeter,
Sintorn, Assarsson 2010).

A light reaches directly the volume between itself and the surface that its shadow map samples. A
camera ray enters and leaves this volume at crossings with its boundary, the height field of
`realtime.shadow_maps.inverse_depth_field`. Each ray descends into a pyramid of heights to the
texels that it may cross (`realtime.methods.light_volumes.walk`); the intervals between crossings
are integrated one by one, which keeps the digits that a difference of two Gammas, the paper's eq.
3, loses. Where the map jumps the boundary stands upright, at a place that rays from the light find
(`realtime.methods.light_volumes.jump_search`). `realtime.methods.published.billeter2010` draws the
boundary as a mesh.
"""

from dataclasses import dataclass

import drjit as dr

from airlight.realtime.methods.interface.method import Method
from airlight.realtime.methods.light_volumes.jump_search import with_walls
from airlight.realtime.methods.light_volumes.walk import sum_lit_intervals
from airlight.realtime.numerics.array_types import bytes_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.inverse_depth_field import inverse_depth_field, level_start
from airlight.realtime.shadow_maps.projection import light_faces
from airlight.realtime.shadow_maps.shadow_map import (
    cast_shadow_map,
    check_maps,
    map_memory,
    map_size,
)


@dataclass(frozen=True)
class LightVolumes(Method):
    """The airlight in light volumes.

    Valid for all lights and any shapes that rays can be cast against; the map of a directional
    light covers the media, and its shadows on surfaces always come from rays. Exact with respect to
    the shadow map: what it misses of the scene falls as the size of a texel. A map without hits
    lights everything; a light inside a closed occluder lights nothing outside it.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, *Real time volumetric shadows using polygonal light volumes*,
    High Performance Graphics.
    """

    name = "light-volumes"
    summary = "the volume between the light and its shadow map, crossed without marching"
    source = "Billeter, Sintorn, Assarsson 2010"
    as_published = "light-volumes-2010"
    prepared_from = frozenset({"geometry", "light"})
    provides_visibility = True
    by_rays = True

    map: int = map_size(512, "texels on a side of a face of the shadow map, a power of two")
    walls: str = parameter(
        "upright",
        "where the map jumps: at a place that rays find, or across one texel as published",
        choices=("upright", "slanted"),
    )

    def check(self, scene):
        """Refuse more memory than the machine has."""
        if scene.features.shadows:
            check_maps(
                scene.lights, self.map, sum(_memory_of(light, self.map) for light in scene.lights)
            )

    def prepare(self, scene, light):
        """Return the height field of a light."""
        heights = inverse_depth_field(cast_shadow_map(scene.geometry, light, self.map))
        return with_walls(heights, scene.geometry, light) if self.walls == "upright" else heights

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray, and whether the light reaches the visible surface."""
        rays = view.lit_by(light, kernel)
        if state is None:
            return rays.radiance(rays.gamma(view.distance)), True
        total, reached = sum_lit_intervals(
            state,
            away=view.origin - light.position,
            direction=view.direction,
            segment=rays.segment(view.distance),
            integral=rays.airlight,
            zero=rays.nothing(dr.width(view.distance)),
        )
        # A surface may be beside the map of a directional light, whose shadows on
        # surfaces come from rays.
        return rays.radiance(total), reached if light.w else True

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        return (("map", None),)


def _memory_of(light: Light, size: int) -> int:
    """Return about how much the volume of a light takes [bytes]."""
    number, faces = bytes_of(type(light.position.x)), light_faces(light)
    # Distances and heights at the corners, four heights and walls a texel, two bounds a node.
    numbers = 4 * size**2 + 2 * level_start(size.bit_length())
    return 2 * map_memory(light, size) + faces * (number * numbers + 4 * size**2)
