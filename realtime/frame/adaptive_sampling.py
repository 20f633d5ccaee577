# SPDX-License-Identifier: BSD-3-Clause
r"""Airlight between the corners of tiles, where it is nearly linear: a wrapper around any function that renders some
pixels.

Most pixels of a frame lie in beams and shadows, few on their edges. A ray is therefore computed in the first pixel of
every tile of 4 x 4, and all pixels only where these corners do not determine the airlight between.

Let Delta be the second difference f_(i-1) - 2 f_i + f_(i+1) of the airlight along a row or a column of corners, h
apart. Where f is smooth, linear interpolation misses it by up to |f''| h^2/8, which is Delta/8. Where it has a kink
between two corners, at the fraction w of the way and with a change of slope s, it misses it by s h w (1 - w), while the
Deltas at the two corners are s h (1 - w) and s h w: the larger is at least twice the error. A tile is therefore
interpolated where

    |Delta| <= tolerance f

at all four corners, in both directions and all channels, and errs by about the tolerance at most. A jump of f, at an
edge of surfaces, has a Delta of its own size. The corners at the ends of a row have one neighbour and take the Delta of
the corner beside them: there the error of a kink is up to one Delta instead of a half.

A smooth curvature of the opposite sign, with the second difference c, hides a kink that is not larger. With both within
the tolerance, s h w <= tolerance f + c, at the ends of a row

    s h w (1 - w) - c/8 <= tolerance f + 7 c/8,

which is the most by which a kink and a curvature together can err.

Beams and shadows thinner than a tile are missed if no corner sees them. Surfaces are not missed, since the pixels of an
interpolated tile and its corners have to be about equally far away, and the light has to reach the surface at all four
corners or at none.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.errors import InputError
from airlight.realtime.image_filters import channels
from airlight.realtime.methods.interface.method import Layers, Method, View, camera_view
from airlight.realtime.numerics.array_types import Metres, PerRay, PerTile, aligned_array
from airlight.realtime.numerics.recorded import Frozen, refusals
from airlight.realtime.scene.camera import SIDE, TILE, Camera, tiled_pixels
from airlight.realtime.scene.read_scene import Scene

_DEPTHS = 1.1  # largest to least distance in a tile

#: (pixel, distance, what the last frame handed on) -> the layers of some pixels, evaluated or not.
Render = Callable[[PerRay, Metres, Any], Layers]


@dataclass(frozen=True)
class Corners:
    """How the tiles of an image lie: numbers of tiles, by tile."""

    right: PerTile  #: the next tile to the right; itself in the last column
    below: PerTile
    diagonal: PerTile
    #: Three that follow one another in a row: it and its neighbours, or those next to an end; and in a column.
    lines: tuple[tuple[PerTile, PerTile, PerTile], tuple[PerTile, PerTile, PerTile]]
    inner: PerTile  #: whether there are tiles on the right and below


def tile_corners(pixel, camera: Camera, *, by_rays: bool) -> Corners:
    """Return how the tiles of an image lie; `pixel` are its pixel numbers in square tiles.

    Raises InputError for a method that draws all pixels together and not `by_rays`, and an image whose sides are no
    multiples of four or less than three tiles.
    """
    if not by_rays:
        raise InputError(
            "tolerance: needs each ray by itself, which evaluation=mesh and vertex do not; use tolerance=0"
        )
    width, height = camera.width, camera.height
    across, down = width // SIDE, height // SIDE
    if width % SIDE or height % SIDE or across < 3 or down < 3:
        raise InputError(
            f"tolerance: got an image of {width} x {height}, expected sides that are multiples of {SIDE}, from "
            f"{3 * SIDE} on"
        )
    rows, columns = np.divmod(np.array(pixel)[::TILE], width)
    i, j = (columns // SIDE).astype(np.int64), (rows // SIDE).astype(np.int64)
    number = np.empty((down, across), dtype=np.uint32)
    number[j, i] = np.arange(len(i), dtype=np.uint32)
    right, below = np.minimum(i + 1, across - 1), np.minimum(j + 1, down - 1)
    middle_i, middle_j = np.clip(i, 1, across - 2), np.clip(j, 1, down - 2)
    corners = Corners(
        aligned_array(mi.UInt32, number[j, right]),
        aligned_array(mi.UInt32, number[below, i]),
        aligned_array(mi.UInt32, number[below, right]),
        (
            tuple(aligned_array(mi.UInt32, number[j, middle_i + step]) for step in (-1, 0, 1)),
            tuple(aligned_array(mi.UInt32, number[middle_j + step, i]) for step in (-1, 0, 1)),
        ),
        aligned_array(mi.Bool, (i < across - 1) & (j < down - 1)),
    )
    dr.eval(corners)
    return corners


@dataclass(frozen=True)
class BetweenCorners:
    """A method that computes some rays of an image, and is the one that it wraps in all else."""

    method: Method
    corners: Corners
    layers_of: Callable[..., Layers]  #: recorded where the method can be

    by_rays, frozen = False, False  # how many rays are computed follows from those at the corners

    def __getattr__(self, name: str) -> Any:
        return getattr(self.method, name)

    def render(self, view: View, state: Any, kernel: Any) -> Layers:
        """Return the layers of every ray."""

        def some(pixel, distance, last):
            shown = view.scene, pixel, view.camera, view.medium, view.lights, state, distance, kernel
            return self.layers_of(*shown, last, view.noise, view.extra_layers)

        rays = view.pixel, view.distance
        width, tolerance = view.camera.width, self.method.interpolated
        return adaptive_layers(some, self.corners, *rays, width=width, tolerance=tolerance, last=view.carried)


def between_corners(method: Method, scene: Scene) -> Method:
    """Return a method that interpolates as its parameters say; raises InputError as `tile_corners` does."""
    camera, features = scene.camera, scene.features

    def layers_of(geometry, pixel, camera, medium, lights, state, distance, kernel, last, noise, extra_layers):
        shown = {"features": features, "scene": geometry, "medium": medium, "lights": lights}
        view = camera_view(camera, pixel, distance, **shown)
        with refusals():
            return method.render(replace(view, carried=last, noise=noise, extra_layers=extra_layers), state, kernel)

    corners = tile_corners(tiled_pixels(camera.width, camera.height), camera, by_rays=method.by_rays)
    return cast(Method, BetweenCorners(method, corners, Frozen(layers_of) if method.frozen else layers_of))


def adaptive_layers(
    render: Render, corners: Corners, pixel: PerRay, distance: Metres, *, width: int, tolerance: float, last: Any
) -> Layers:
    """Return the image of a method, interpolated between the corners of tiles where that is enough.

    `render`: renders some pixels; `corners`, `pixel`, `width`: of the image: its pixel numbers in square tiles, and how
    many pixels a row has; `distance`: to the visible surfaces [m]; `tolerance`: largest second difference between
    corners, as a fraction of the value; `last`: what the last frame handed on, by tile; None for the first.
    """
    Float, lanes = type(distance), dr.width(pixel)
    tiles = lanes // TILE
    first = dr.arange(mi.UInt32, tiles) * TILE
    at_corners = render(dr.gather(mi.UInt32, pixel, first), dr.gather(Float, distance, first), last)
    numbers, masks = _parts(at_corners, Float)
    numbers, masks = ([part + dr.zeros(Float, tiles) for part in parts] for parts in (numbers, masks))
    dr.eval(numbers, masks, at_corners.carried)
    smooth = _smooth(corners, distance, numbers, masks, tolerance)
    dr.eval(smooth)

    lane = dr.arange(mi.UInt32, lanes)
    own, row = lane // TILE, pixel // width
    x, y = (Float(value & (SIDE - 1)) * (1 / SIDE) for value in (pixel - row * width, row))
    blended = [_between(part, corners, own, x, y) for part in (*numbers, *masks)]
    dr.eval(blended)
    rough = dr.compress(~dr.gather(mi.Bool, smooth, own))
    if dr.width(rough):
        # Whole tiles of lanes, the last one again, so that no recorded function finds an array of one entry.
        count = dr.width(rough)
        rough = dr.gather(mi.UInt32, rough, dr.minimum(dr.arange(mi.UInt32, -(-count // TILE) * TILE), count - 1))
        carried = at_corners.carried
        handed_on = None if carried is None else dr.gather(type(carried), carried, rough // TILE)
        asked = dr.gather(mi.UInt32, pixel, rough), dr.gather(Float, distance, rough)
        some, some_masks = _parts(render(*asked, handed_on), Float)
        for image, values in zip(blended, (*some, *some_masks), strict=True):
            dr.scatter(image, values + dr.zeros(Float, dr.width(rough)), rough)
    return _with_parts(at_corners, blended[: len(numbers)], [part > 0.5 for part in blended[len(numbers) :]])


def _is_mask(fraction: Any) -> bool:
    return isinstance(fraction, bool) or dr.is_mask_v(fraction)


def _parts(layers: Layers, Float: Any) -> tuple[list[Any], list[Any]]:
    """Return the numbers and colours of layers, the airlight first, and the masks as 0 or 1."""
    fractions, extra = layers.visibility or (), (layers.extra or {}).values()
    more = (
        layers.transmittance,
        layers.background,
        *extra,
        *(fraction for fraction in fractions if not _is_mask(fraction)),
    )
    numbers = [layers.in_scattered, *(value for value in more if value is not None)]
    return numbers, [dr.select(fraction, Float(1), 0) for fraction in fractions if _is_mask(fraction)]


def _with_parts(layers: Layers, numbers: list[Any], masks: list[Any]) -> Layers:
    """Return layers with the numbers and masks of `_parts` in place of their own."""
    number, mask = iter(numbers), iter(masks)
    in_scattered = next(number)
    transmittance = None if layers.transmittance is None else next(number)
    background = None if layers.background is None else next(number)
    extra = None if layers.extra is None else {name: next(number) for name in layers.extra}
    fractions = layers.visibility
    if fractions is not None:
        fractions = tuple(next(mask) if _is_mask(fraction) else next(number) for fraction in fractions)
    return Layers(in_scattered, fractions, transmittance, background, extra, layers.carried)


def _smooth(corners: Corners, distance: Metres, numbers: list[Any], masks: list[Any], tolerance: float) -> PerTile:
    """Return which tiles may be interpolated."""
    bends = [_second_difference(corners, number) for number in numbers]
    dr.eval(bends)
    tile = dr.arange(mi.UInt32, dr.width(corners.right))
    four = tile, corners.right, corners.below, corners.diagonal
    smooth = corners.inner & _depths_alike(distance, four)
    for corner in four:
        for bend, number in zip(bends, numbers):
            limits, values = (channels(dr.gather(type(part), part, corner)) for part in (bend, number))
            for limit, value in zip(limits, values):
                smooth &= limit <= tolerance * value
        for mask in masks:
            smooth &= dr.gather(type(mask), mask, corner) == mask
    return smooth


def _between(number, corners: Corners, own, x, y):
    """Return the values between the corners of tiles, bilinear in x and y, which go from 0 to 1 over a tile."""
    others = (dr.gather(mi.UInt32, tiles, own) for tiles in (corners.right, corners.below, corners.diagonal))
    base, across, down, diagonal = (dr.gather(type(number), number, tile) for tile in (own, *others))
    return dr.lerp(dr.lerp(base, across, x), dr.lerp(down, diagonal, x), y)


def _second_difference(corners: Corners, color):
    """Return the larger of the second differences along rows and columns, by channel."""
    largest = type(color)(0)
    for three in corners.lines:
        before, here, behind = (dr.gather(type(color), color, sample) for sample in three)
        largest = dr.maximum(largest, dr.abs(before + behind - 2 * here))
    return largest


def _depths_alike(distance, four):
    """Return whether the pixels of a tile and its four corners are about equally far away."""
    tile, *others = four
    places = [tile * TILE + k for k in range(TILE)] + [other * TILE for other in others]
    least = largest = dr.gather(type(distance), distance, places[0])
    for place in places[1:]:
        depth = dr.gather(type(distance), distance, place)
        least, largest = dr.minimum(least, depth), dr.maximum(largest, depth)
    return largest <= _DEPTHS * least
