# SPDX-License-Identifier: BSD-3-Clause
"""The view of a frame, from its camera and what was found before the method's turn."""

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.frame.surface import visible_triangle
from realtime.methods.interface.view import View
from realtime.numerics.array_types import Metres, PerRay
from realtime.scene.camera import Camera, ray_directions
from realtime.scene.features import SceneFeatures
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.tiles.layout import SIDE, TILE, Layout


def frame_view(
    camera: Camera,
    pixel: PerRay,
    distance: Metres,
    *,
    features: SceneFeatures,
    geometry,
    medium: Medium,
    lights: tuple[Light, ...],
    layout: Layout | None = None,
    tile: PerRay | None = None,
) -> View:
    """Return what a method is given for some pixels; `distance` [m] is that to the visible surface.

    `geometry` may be None where the method casts no rays, `layout` where these are the pixels of a whole image or
    of its first tile, and `tile` where sixteen pixels that follow one another are a tile.
    """
    direction, low = ray_directions(camera, pixel)
    shown = {"features": features, "geometry": geometry, "medium": medium, "lights": lights}

    def part():
        return lambda pixel, distance, tile, layout: frame_view(
            camera, pixel, distance, layout=layout, tile=tile, **shown
        )

    return View(
        origin=camera.origin,
        direction=direction,
        direction_low=low,
        distance=distance,
        lights=lights,
        medium=medium,
        features=features,
        visible=_visible(geometry),
        camera=camera,
        pixel=pixel,
        layout=_layout(camera) if layout is None else layout,
        tile=dr.arange(mi.UInt32, dr.width(pixel)) // TILE if tile is None else tile,
        rays=_rays(camera, pixel),
        visible_triangle=lambda: visible_triangle(geometry, camera.origin, direction),
        part=part,
    )


def _visible(geometry):
    """Return the function that says which points [m] a light reaches."""

    def visible(point, light: Light, asked=True):
        if geometry is None:
            raise InputError("visible: the method says that it casts no rays, and asks for some; wanted `casts_rays`")
        return ~geometry.ray_test(light.shadow_ray(point), asked)

    return visible


def _rays(camera: Camera, pixel):
    """Return the function from lanes to the directions of their rays."""
    return lambda lane: ray_directions(camera, dr.gather(mi.UInt32, pixel, lane))


def _layout(camera: Camera) -> Layout:
    """Return how the pixels of a whole image lie, and those of its first tile, with which a method is tried."""
    return Layout.SQUARES if camera.width % SIDE == 0 and camera.height % SIDE == 0 else Layout.LINES
