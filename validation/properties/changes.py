# SPDX-License-Identifier: BSD-3-Clause
r"""How far off the airlight is without shadows, and with the usual points in the place of each light with extent.

A small image is marched with the same steps each time. What two such images differ by is a sum over the same places, so
the steps' own error enters it as a share, not as a term. With L_i the airlight of ray i, of many points for each light
with extent, and L'_i that of as many as methods have by default, with or without shadows,

    change = sqrt(mean_i (L'_i - L_i)^2) / mean_i L_i,

the relative RMSE of a method in which nothing else is wrong.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import Scene
from validation.configurations.methods import Configuration, prepared
from validation.properties.view import grid_camera

Array = NDArray[np.float64]

GRID = (80, 60)  #: rays across and down the image: shadows that fewer do not meet count as none
STEPS = 16  #: of a ray and light
POINTS, MORE_POINTS = 16, 64  #: for each light with extent: as methods have by default, and against it
ROUNDING = 1e-5  #: changes that are smaller are those of sums of float32
MOST = 1e3  #: of a change: where hardly any airlight is left it has no meaning


def change_properties(scene: Scene) -> dict[str, float]:
    """Return `change_without_shadows` and `change_with_points`, relative RMSE of the airlight [1], and `shadows_seen`.

    Lights with extent have `POINTS` points in the first too. Without them the second is 0, and without shadows the
    first is the second. The third is 1 where any shadow shows, and 0 where none does.
    """
    small = replace(scene, camera=grid_camera(scene, GRID))
    usual = _marched(small, POINTS, "ray")
    airlight = _marched(small, MORE_POINTS, "ray") if scene.area_lights else usual
    unshadowed = _marched(small, POINTS, "none") if scene.features.shadows else usual
    return {
        "change_without_shadows": _change(unshadowed, airlight),
        "change_with_points": _change(usual, airlight),
        "shadows_seen": float(_change(unshadowed, usual) > ROUNDING),
    }


def _marched(scene: Scene, points: int, shadow: str) -> Array:
    settings: dict[str, int | float | str] = {"steps": STEPS, "shadow": shadow}
    if scene.area_lights:
        settings["points"] = points
    chosen = Configuration("ray-march", None, tuple(settings.items()))
    return np.array(render_frame(prepared(scene, chosen)).airlight, np.float64)


def _change(changed: Array, airlight: Array) -> float:
    difference, mean = float(np.sqrt(np.mean((changed - airlight) ** 2))), float(np.mean(airlight))
    if difference == 0:
        return 0.0
    return min(difference / mean, MOST) if mean > 0 and math.isfinite(difference) else MOST
