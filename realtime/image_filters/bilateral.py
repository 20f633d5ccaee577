# SPDX-License-Identifier: BSD-3-Clause
"""The bilateral and the joint bilateral filter as they are defined: every pixel, every tap.

Tomasi and Manduchi 1998; Petschnigg et al. 2004 and Eisemann and Durand 2004 for guides. A tap gathers each channel of
image and guides and takes one exponential; there are (2 r + 1)^2 taps with r = ceil(support hd).
"""

import math
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters.guides import Guide, falloff
from realtime.image_filters.raster import Raster, taps_of, with_margin
from realtime.numerics.array_types import PerRay


def reach(hd: float, support: float) -> int:
    """Return how many pixels a filter reaches: `support` standard deviations of `hd` pixels each."""
    return math.ceil(support * hd)


def bilateral(image: PerRay, raster: Raster, *, hd: float, guides: tuple[Guide, ...], support: float = 3.0) -> PerRay:
    """Return an image filtered, see `realtime.image_filters`.

    `image`: a number or a colour per pixel, row by row; `raster`: its size; `hd`: standard deviation of the weights in
    the image [pixels], above 0; `guides`: what says that pixels are alike; with none it is the Gaussian; `support`:
    half side of the square of taps [`hd`].

    Valid for finite images. Reconstructed from captions of Ali 2016 where the guide is the image itself (his SBFS) or a
    depth (his SoftBiF-VS).
    """
    r, across = reach(hd, support), falloff(hd)
    taps = taps_of(with_margin(image, guides, raster, right=r, down=r))
    wide = taps.wide
    Float = type(wide.values[0])

    def add_row(down: Any, start: Any, total: Any, sums: Any):
        begin = -across * Float(down * down)
        for right in range(2 * r + 1):
            total, sums = taps.add(begin - across * (right - r) ** 2, start + right, total, sums)
        return down + 1, start + wide.row, total, sums

    nothing = dr.zeros(Float, raster.count)
    _, _, total, sums = dr.while_loop(
        state=(mi.Int32(-r), wide.place - (r * wide.row + r), nothing, [+nothing for _ in taps.here]),
        cond=lambda down, start, total, sums: down <= r,
        body=add_row,
        labels=("down", "start", "total", "sums"),
    )
    return taps.filtered(type(image), total, sums)
