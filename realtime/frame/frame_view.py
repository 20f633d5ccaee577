# SPDX-License-Identifier: BSD-3-Clause
"""The view of a frame, from its camera and what was found before the method's turn."""

import drjit as dr
import mitsuba as mi

from realtime.frame.surface import visible_triangle
from realtime.methods.interface.view import View
from realtime.scene.camera import Camera, ray_directions
from realtime.scene.features import SceneFeatures
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.tiles.layout import TILE


def frame_view(
    camera: Camera,
    pixel,
    distance,
    *,
    features: SceneFeatures,
    geometry,
    medium: Medium,
    lights: tuple[Light, ...],
    prepared,
    tiles=None,
    tile=None,
    sides=None,
) -> View:
    """Return what a method is given for some pixels.

    `geometry` may be None where the method casts no rays, and `tile` where sixteen pixels that follow one another are a
    tile.
    """
    direction, low = ray_directions(camera, pixel)
    return View(
        origin=camera.origin,
        direction=direction,
        direction_low=low,
        distance=distance,
        lights=lights,
        medium=medium,
        features=features,
        visible=lambda point, light: ~geometry.ray_test(light.shadow_ray(point)),
        camera=camera,
        pixel=pixel,
        rays=_rays(camera, pixel),
        square_tiles=_in_square_tiles(camera, pixel),
        visible_triangle=lambda: visible_triangle(geometry, camera.origin, direction),
        prepared=prepared,
        tiles=tiles,
        tile=dr.arange(mi.UInt32, dr.width(pixel)) // TILE if tile is None else tile,
        sides=sides,
    )


def _rays(camera: Camera, pixel):
    """Return the function from lanes to the directions of their rays."""
    return lambda lane: ray_directions(camera, dr.gather(mi.UInt32, pixel, lane))


def _in_square_tiles(camera: Camera, pixel) -> bool:
    return camera.width % 4 == 0 and camera.height % 4 == 0 and dr.width(pixel) > 1
