# SPDX-License-Identifier: BSD-3-Clause
"""The last frame, where it still holds: accumulation while camera or lights move.

The visible point of a pixel is looked up in the last frame. What is found there counts with the weight `history`,
unless

* the point was outside of that image, or behind another surface: its depth there differs by more than a share;
* it lies outside of what the pixel and its eight neighbours hold now: it is moved to the end of that range, so that
  shadows that moved do not trail (neighbourhood clamping, Karis 2014).

With `interleave` the shares of the pixels of a tile turn from frame to frame, by the place of camera and light: a
camera that moves sees other points of the light at each pixel, and their mean is that of more points and steps.
"""

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters.guides import channels
from realtime.image_filters.raster import Raster
from realtime.methods.interface.layers import GBuffer, History, Layers
from realtime.methods.soft_shafts.parameters import SoftShaftsParameters
from realtime.scene.camera import Camera, ray_directions

_FAR = 1e4  # where the sky stands for the look-up [m]
_DEPTHS = 0.05  # relative difference of depths from which on a surface is another


def accumulate(
    layers: Layers, g_buffer: GBuffer, history: History | None, *, camera: Camera, parameters: SoftShaftsParameters
) -> Layers:
    """Return layers mixed with those of the last frame; a pass over the image, see `Method.passes`."""
    if history is None:
        return layers
    raster = Raster(camera.width, camera.height)
    column, row, was_seen = _last_place(g_buffer, history, camera, raster)
    corners = _corners(column, row, raster)

    def mixed(now: Any, before: Any) -> Any:
        if dr.is_mask_v(now):
            return now
        values = [
            _mixed(own, past, corners, raster, dr.select(was_seen, parameters.history, 0))
            for own, past in zip(channels(now), channels(before), strict=True)
        ]
        return type(now)(*values)

    shares, past = layers.visibility, history.layers.visibility
    if shares is not None and past is not None:
        shares = tuple(mixed(share, before) for share, before in zip(shares, past, strict=True))
    in_scattered = mixed(layers.in_scattered, history.layers.in_scattered)
    return replace(layers, in_scattered=in_scattered, visibility=shares)


def turn(camera: Camera, position: Any) -> Any:
    """Return a whole number from 0 to 15 that changes as camera or light move; `position` [m] is that of the light."""
    seed = dr.dot(camera.origin, type(position)(12.9898, 78.233, 37.719))
    seed += dr.dot(camera.forward, type(position)(39.346, 11.135, 83.155))
    seed += dr.dot(position, type(position)(73.156, 52.235, 9.151))
    waves = dr.abs(seed) * 43.758
    return mi.UInt32(16 * (waves - dr.floor(waves))) & 15


def _last_place(g_buffer: GBuffer, history: History, camera: Camera, raster: Raster) -> tuple[Any, Any, Any]:
    """Return column and row of every visible point in the last frame, and whether it was seen there."""
    direction, _ = ray_directions(camera, dr.arange(mi.UInt32, raster.count))
    there, last = dr.isfinite(g_buffer.depth), history.camera
    away = camera.origin + direction * dr.select(there, g_buffer.depth, _FAR) - last.origin
    ahead = dr.dot(away, last.forward)
    size = dr.squared_norm(last.left)
    across, upward = dr.dot(away, last.left) / (ahead * size), dr.dot(away, last.up) / (ahead * size)
    column, row = 0.5 * (raster.width - 1) - across, 0.5 * (raster.height - 1) - upward
    inside = (ahead > 0) & (column > -0.5) & (column < raster.width - 0.5) & (row > -0.5) & (row < raster.height - 0.5)
    column, row = dr.select(inside, column, 0), dr.select(inside, row, 0)
    nearest = _whole(row + 0.5, raster.height) * raster.width + _whole(column + 0.5, raster.width)
    depth = dr.gather(type(g_buffer.depth), history.g_buffer.depth, nearest)
    alike = dr.abs(depth - dr.norm(away)) <= _DEPTHS * depth
    return column, row, inside & dr.select(there & dr.isfinite(depth), alike, there == dr.isfinite(depth))


def _corners(column: Any, row: Any, raster: Raster) -> list[tuple[Any, Any]]:
    """Return four places in the last frame with their weights."""
    left, above = dr.clip(dr.floor(column), 0, raster.width - 1), dr.clip(dr.floor(row), 0, raster.height - 1)
    x, y = dr.clip(column - left, 0, 1), dr.clip(row - above, 0, 1)
    return [
        (_whole(above + down, raster.height) * raster.width + _whole(left + right, raster.width), across * along)
        for down, along in ((0, 1 - y), (1, y))
        for right, across in ((0, 1 - x), (1, x))
    ]


def _mixed(now: Any, before: Any, corners: list[tuple[Any, Any]], raster: Raster, weight: Any) -> Any:
    column, row = (mi.Int32(place) for place in raster.places())
    least, most = +now, +now
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            place = dr.clip(row + down, 0, raster.height - 1) * raster.width + dr.clip(
                column + right, 0, raster.width - 1
            )
            value = dr.gather(type(now), now, mi.UInt32(place))
            least, most = dr.minimum(least, value), dr.maximum(most, value)
    past = sum(share * dr.gather(type(now), before, place) for place, share in corners)
    return dr.lerp(now, dr.clip(past, least, most), weight)


def _whole(place: Any, count: int) -> Any:
    return mi.UInt32(dr.clip(place, 0, count - 1))
