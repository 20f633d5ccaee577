# SPDX-License-Identifier: BSD-3-Clause
"""The lights of a scene by source: the points of a light with extent as a table with their maps, or an ordinary light.

The table makes all points one loop, whatever their number, and lets every pixel take a point of its own.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from realtime.numerics.array_types import aligned_array
from realtime.scene.light_points import LightFrame, light_frames
from realtime.scene.lights import Light
from realtime.shadow_maps.hemisphere_map import HemisphereMaps, cast_hemisphere_maps
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map


@dataclass(frozen=True)
class SourceState:
    """What is made of one source when lights or shapes move."""

    frames: LightFrame | None  #: the points of a light with extent, one a lane
    width: Any  #: of that light, of a square with its mean square extent [m]
    flat: bool  #: whether all points of that light face the same way
    maps: HemisphereMaps | ShadowMap | None  #: None where nobody asks them


def source_state(
    scene: Any, lights: list[Light], size: int, *, with_maps: bool, for_surfaces: bool = True
) -> SourceState:
    """Return the state of a source of some `lights`; `size` [texels] is that of its maps, also `for_surfaces`."""
    Float = type(lights[0].position.x)
    if lights[0].facing is None:
        maps = cast_shadow_map(scene, lights[0], size) if with_maps else None
        return SourceState(None, dr.opaque(Float, 0, 1), True, maps)
    frames = light_frames(lights)
    positions, normals = (np.array(rows, dtype=np.float64).T for rows in (frames.position, frames.normal))
    # Of a square of the side L the mean square distance from the middle is L^2 / 6.
    spread = np.mean(np.sum((positions - positions.mean(axis=0)) ** 2, axis=1))
    hemispheres = None
    if with_maps:
        hemispheres = cast_hemisphere_maps(scene, frames, len(lights), size, for_surfaces=for_surfaces)
    flat = bool(np.all(normals == normals[0]))
    return SourceState(frames, aligned_array(Float, np.array([np.sqrt(6 * spread)])), flat, hemispheres)
