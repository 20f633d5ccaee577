# SPDX-License-Identifier: BSD-3-Clause
r"""Airlight between the corners of tiles, where it is nearly linear.

Most pixels of a frame lie in beams and shadows, few on their edges. So a ray is computed in the first pixel of every
tile of 4 x 4, and all pixels of a tile only where the airlight between these corners cannot be told from them.

Let Delta be the second difference f_(i-1) - 2 f_i + f_(i+1) of the airlight along a row or a column of corners, h
apart. Where f is smooth, linear interpolation misses it by up to |f''| h^2/8, which is Delta/8. Where it has a kink
between two corners, at the share w of the way and with a change of slope s, it misses it by s h w (1 - w), while the
Deltas at the two corners are s h (1 - w) and s h w: the larger is at least twice the error. So a tile is interpolated
where

    |Delta| <= tolerance f

at all four corners, in both directions and all channels, and errs by about the tolerance at most. A jump of f, at an
edge of surfaces, has a Delta of its own size. The corners at the ends of a row have one neighbour and take the Delta of
the corner beside them: there the error of a kink is up to one Delta instead of a half.

A smooth curvature of the opposite sign, whose own Delta is c, hides a kink that is not larger. With both within the
tolerance, s h w <= tolerance f + c, at the ends of a row

    s h w (1 - w) - c/8 <= tolerance f + 7 c/8,

which is the most by which a kink and a curvature together can err.

What no corner sees is missed: beams and shadows thinner than a tile. Surfaces are not, since the pixels of an
interpolated tile and its corners have to be about equally far away, and the light reaches the surface at all four
corners or at none.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.errors import InputError
from realtime.numerics.aligned import aligned_array
from realtime.numerics.array_types import Metres, PerRay, PerTile, four_numbers
from realtime.parameters import parameter
from realtime.scene.camera import Camera
from realtime.tiles.layout import SIDE, TILE, Layout

_DEPTHS = 1.1  # largest to least distance in a tile
_LIGHTS = 32  # one bit each


@dataclass(frozen=True)
class Corners:
    """How the tiles of an image lie: numbers of tiles, by tile."""

    right: PerTile  #: the next tile to the right; itself in the last column
    below: PerTile
    diagonal: PerTile
    row: tuple[
        PerTile, PerTile, PerTile
    ]  #: three that follow one another in a row: it and its neighbours, or those next to an end
    column: tuple[PerTile, PerTile, PerTile]
    inner: PerTile  #: whether there are tiles on the right and below


def tolerance() -> Any:
    """Return the field of the parameter that every method has whose rays can be interpolated."""
    return parameter(
        0.0,
        "what may be interpolated between the corners of tiles, as a share of the airlight; 0: nothing, every pixel is "
        "computed",
        least=0,
        below=1,
        wanted="a share of the airlight from 0 up to 1",
    )


def tile_corners(pixel, camera: Camera, tolerance: float, *, by_rays: bool, lights: int) -> Corners | None:
    """Return how the tiles of an image lie; None for a tolerance of 0, with which every pixel is computed.

    Parameters
    ----------
    pixel
        The pixel numbers of the image in square tiles.
    camera
        Its camera.
    tolerance
        Share of the airlight, see the module.
    by_rays
        Whether the method computes each ray by itself.
    lights
        How many there are.

    Raises
    ------
    InputError
        For a method that draws all pixels together, more lights than a number has bits, and an image whose sides are
        no multiples of four or less than three tiles.
    """
    if not tolerance:
        return None
    if not by_rays:
        raise InputError(
            "tolerance: wanted each ray by itself, which evaluation=mesh and vertex do not; use tolerance=0"
        )
    if lights > _LIGHTS:
        raise InputError(f"tolerance: got a scene of {lights} lights, wanted up to {_LIGHTS}; use tolerance=0")
    width, height = camera.width, camera.height
    across, down = width // SIDE, height // SIDE
    if width % SIDE or height % SIDE or across < 3 or down < 3:
        raise InputError(
            f"tolerance: got an image of {width} x {height}, wanted sides that are multiples of {SIDE}, from "
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
        tuple(aligned_array(mi.UInt32, number[j, middle_i + step]) for step in (-1, 0, 1)),
        tuple(aligned_array(mi.UInt32, number[middle_j + step, i]) for step in (-1, 0, 1)),
        aligned_array(mi.Bool, (i < across - 1) & (j < down - 1)),
    )
    dr.eval(corners)
    return corners


def between_corners(
    corners: Corners,
    pixel: PerRay,
    distance: Metres,
    sample: Callable[..., tuple[tuple[PerRay, ...], tuple[PerRay, ...]]],
    *,
    width: int,
    tolerance: float,
) -> tuple[tuple[PerRay, ...], tuple[PerRay, ...]]:
    """Return of every pixel what a method computes, interpolated between the corners of tiles where that is enough.

    Parameters
    ----------
    corners
        Of the image.
    pixel, distance
        Pixel numbers in square tiles, and the distances to the visible surfaces [m].
    sample
        Function (pixel, distance, tile, layout) -> numbers and colours, the airlight [W/(m^2 sr)] first, and masks, by
        light whether it reaches the surface. Numbers and colours may be interpolated, masks have to be equal.
    width
        Of the image [pixels].
    tolerance
        Largest second difference between corners, as a share of the value.

    Returns
    -------
    values, masks
        As from `sample`.

    Notes
    -----
    Valid in a function that may evaluate arrays; `sample` may not.
    """
    Float = type(distance)
    tiles = dr.width(distance) // TILE
    tile = dr.arange(mi.UInt32, tiles)
    first = tile * TILE
    there = dr.gather(mi.UInt32, pixel, first), dr.gather(Float, distance, first)
    parts, reached = sample(*there, tile, Layout.CORNERS)
    parts = tuple(part + dr.zeros(Float, tiles) for part in parts)
    lit = _bits(reached) + dr.zeros(mi.UInt32, tiles)
    dr.eval(parts, lit)
    bends = [_second_difference(corners, part) for part in parts]
    dr.eval(bends)
    four = tile, corners.right, corners.below, corners.diagonal
    values = [[dr.gather(type(part), part, corner) for part in parts] for corner in four]
    smooth = corners.inner & _depths_alike(distance, four)
    for corner, corner_values in zip(four, values):
        for bend, value in zip(bends, corner_values):
            here = dr.gather(type(bend), bend, corner)
            for limit, least in zip(_channels(here), _channels(value)):
                smooth &= limit <= tolerance * least
        smooth &= dr.gather(mi.UInt32, lit, corner) == lit
    tables = [_bilinear([_channels(value) for value in corner]) for corner in zip(*values)]
    dr.eval(tables, smooth)

    lane = dr.arange(mi.UInt32, dr.width(distance))
    own = lane // TILE
    row = pixel // width
    x, y = (Float(value & (SIDE - 1)) * (1 / SIDE) for value in (pixel - row * width, row))

    def interpolated(kind, part, own):
        channels = []
        for table in part:
            base, across, down, twist = dr.gather(four_numbers(Float), table, own)
            channels.append(dr.fma(y, dr.fma(x, twist, down), dr.fma(x, across, base)))
        return kind(*channels)

    def between(pixel, distance, own):
        blended = tuple(interpolated(type(part), table, own) for part, table in zip(parts, tables))
        return blended, dr.gather(mi.UInt32, lit, own)

    def computed(pixel, distance, own):
        sampled, reached = sample(pixel, distance, own, Layout.SOME)
        return sampled, _bits(reached)

    smooth = dr.gather(mi.Bool, smooth, own)
    colors, bits = dr.if_stmt(args=(pixel, distance, own), cond=smooth, true_fn=between, false_fn=computed)
    return colors, tuple((bits >> number & 1) != 0 for number in range(len(reached)))


def _channels(value) -> list[Any]:
    """Return the channels of a colour, or a number as its only one."""
    return list(value) if dr.depth_v(value) > 1 else [value]


def _bits(reached):
    """Return by light, as one bit each, whether it reaches the surface."""
    bits = mi.UInt32(0)
    for number, reaches in enumerate(reached):
        bits |= dr.select(reaches, mi.UInt32(1 << number), 0)
    return bits


def _bilinear(values) -> list[Any]:
    """Return f = base + x across + y down + x y twist of every tile as four numbers, an array for each channel.

    `values` are f at the corners of the tile, and x and y go from 0 to 1 over it.
    """
    tables = []
    for base, across, down, diagonal in zip(*values):
        Float = type(base)
        table = dr.empty(Float, 4 * dr.width(base))
        form = four_numbers(Float)(base, across - base, down - base, base - across - down + diagonal)
        dr.scatter(table, form, dr.arange(dr.uint32_array_t(Float), dr.width(base)))
        tables.append(table)
    return tables


def _second_difference(corners: Corners, color):
    """Return the larger of the second differences along rows and columns, by channel."""
    largest = type(color)(0)
    for three in (corners.row, corners.column):
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
