# SPDX-License-Identifier: BSD-3-Clause
"""Joint bilateral up-sampling: an image of every `scale`-th pixel becomes one of all, with a depth test.

Kopf, Cohen, Lischinski, Uyttendaele 2007; the depth test of realTiSoftLS (Ali 2016) is reconstructed from captions. A
pixel takes the four pixels of the small image about it with the weights of bilinear interpolation, each times the
weight of the difference of their depths. Where none of the four is like the pixel, as at a bar that is thinner than
`scale` pixels, the one whose depth is nearest stands alone: no weight is made up.

The pixels of the small image are rays through the pixels `scale` i + `scale` // 2 of the large one.
"""

from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters.guides import Guide, channels, falloff, weight
from realtime.image_filters.raster import Raster
from realtime.numerics.array_types import PerRay

_ALIKE = 1e-3  # a sum of weights below this says that no pixel is alike


def upsample(
    small: PerRay, small_guide: Guide, guide: PerRay, raster: Raster, *, scale: int, column: Any, row: Any
) -> PerRay:
    """Return the values of pixels of a large image.

    `small`: a number or a colour per pixel of the small image, row by row, evaluated; `small_guide`: its guide of
    numbers, for instance `realtime.image_filters.guides.depth_guide`, evaluated; `guide`: the values of that guide at
    the pixels that are asked for; `raster`: the size of the small image; `scale`: pixels of the large image from one of
    the small image to the next; `column`, `row`: of the pixels that are asked for, in the large image, in any order.
    """
    Float = type(guide)
    x, left, right = _between(Float, column, scale, raster.width)
    y, above, below = _between(Float, row, scale, raster.height)
    total: Any = Float(0)
    sums: list[Any] = [Float(0) for _ in channels(small)]
    nearest, least = mi.UInt32(0), Float(dr.inf)
    for at_row, vertical in ((above, 1 - y), (below, y)):
        for at_column, horizontal in ((left, 1 - x), (right, x)):
            place = at_row * raster.width + at_column
            difference = dr.gather(Float, small_guide.values, place) - guide
            share = vertical * horizontal * weight(-falloff(small_guide.width) * dr.square(difference))
            total += share
            sums = [
                dr.fma(share, dr.gather(Float, channel, place), so_far)
                for channel, so_far in zip(channels(small), sums)
            ]
            nearer = dr.abs(difference) < least
            least, nearest = dr.select(nearer, dr.abs(difference), least), dr.select(nearer, place, nearest)
    alike = total > _ALIKE
    return type(small)(
        *(
            dr.select(alike, summed / total, dr.gather(Float, channel, nearest))
            for summed, channel in zip(sums, channels(small), strict=True)
        )
    )


def small_pixels(raster: Raster, scale: int, width: int) -> Any:
    """Return the numbers of the pixels of the large image, of a `width` [pixels], that the small image is made of."""
    column, row = raster.places()
    return (scale * row + scale // 2) * width + scale * column + scale // 2


def _between(Float: Any, place: Any, scale: int, size: int) -> tuple[Any, Any, Any]:
    """Return where a pixel lies between two of the small image, from 0 to 1, and these two, which may be the same."""
    along = (Float(place) - scale // 2) / scale
    before = dr.clip(dr.floor(along), 0, size - 1)
    first = mi.UInt32(before)
    return dr.clip(along - before, 0, 1), first, dr.minimum(first + 1, size - 1)
