# SPDX-License-Identifier: BSD-3-Clause
"""The mean over a tile of 4 x 4 pixels, each of which has another of sixteen samples.

A window of 4 x 4 that is moved to every pixel holds each sample once, but it lies half a pixel to one side. So the
window has 5 x 5 taps with weights 1/2, 1, 1, 1, 1/2 along rows and columns: the two taps at its ends have the same
sample, and each sample has the weight 1. Where a guide leaves out some taps, those that are left are normalised.
"""

import drjit as dr

from realtime.image_filters.guides import Guide
from realtime.image_filters.raster import Raster, taps_of, with_margin
from realtime.numerics.array_types import PerRay

SIDE = 4  #: of a tile [pixels]
_EXPONENTS = (-1, 0, 0, 0, -1)  # of the weights along a row, to base 2


def tile_average(image: PerRay, raster: Raster, *, guides: tuple[Guide, ...] = ()) -> PerRay:
    """Return the mean over the window about every pixel, weighted by guides.

    `image`: a number, a colour or a vector per pixel, row by row; `raster`: its size; `guides`: what says that pixels
    are alike.
    """
    taps = taps_of(with_margin(image, guides, raster, right=2, down=2))
    wide = taps.wide
    total, sums = (
        dr.zeros(type(taps.here[0]), raster.count),
        [dr.zeros(type(taps.here[0]), raster.count) for _ in taps.here],
    )
    for down, vertical in enumerate(_EXPONENTS):
        for right, horizontal in enumerate(_EXPONENTS):
            place = wide.place + (down * wide.row + right) - (2 * wide.row + 2)
            total, sums = taps.add(vertical + horizontal, place, total, sums)
    return taps.filtered(type(image), total, sums)
