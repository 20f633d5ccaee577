# SPDX-License-Identifier: BSD-3-Clause
"""Filters along rows and then along columns: 2 (2 r + 1) taps a pixel in place of (2 r + 1)^2.

The Gaussian is a product, so that this is the same filter, also at the borders, where the taps that are left are
normalised. With guides it is an approximation (Pham and van Vliet 2005): a tap off the row and the column is weighed
through a pixel on the column, by its guide. The two passes do not commute, so neither do filter and transposition.

The width may differ from pixel to pixel. Then a pixel takes as many taps as its own width asks for.
"""

from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters.bilateral import reach
from realtime.image_filters.guides import Guide, falloff
from realtime.image_filters.raster import Margined, Raster, taps_of, with_margin
from realtime.numerics.array_types import PerRay


def separable(
    image: PerRay, raster: Raster, *, hd: Any, guides: tuple[Guide, ...] = (), support: float = 3.0, most: float = 0.0
) -> PerRay:
    """Return an image filtered along rows and then along columns.

    `image`, `raster`, `guides`, `support`: as for `realtime.image_filters.bilateral.bilateral`; `hd`: standard
    deviation [pixels], above 0: one number, or an array with an entry per pixel; `most`: with an array, its upper bound
    [pixels].
    """
    for right in (True, False):
        r = reach(hd if isinstance(hd, float | int) else most, support)
        wide = with_margin(image, guides, raster, right=r if right else 0, down=0 if right else r)
        kind = type(image)
        del image  # what it was made of is not needed any more: two images with margins
        image = _pass(wide, kind, raster, r, hd=hd, support=support, right=right)
    return image


def _pass(wide: Margined, kind: Any, raster: Raster, r: int, *, hd: Any, support: float, right: bool) -> PerRay:
    taps, across = taps_of(wide), falloff(hd)
    Float, step = type(wide.values[0]), 1 if right else wide.row
    total, sums = dr.zeros(Float, raster.count), [dr.zeros(Float, raster.count) for _ in taps.here]
    if isinstance(hd, float | int):
        for offset in range(2 * r + 1):
            # With guides the exponent is an array.
            exponent = -across * (offset - r) ** 2
            total, sums = taps.add(exponent, wide.place - r * step + offset * step, total, sums)
        return taps.filtered(kind, total, sums)
    own = dr.minimum(dr.ceil(support * hd), r)

    def body(offset: Any, total: Any, sums: Any):
        exponent = -across * dr.square(Float(offset))
        total, sums = taps.add(exponent, wide.place + offset * step, total, sums)
        total, sums = taps.add(exponent, wide.place - offset * step, total, sums)
        return offset + 1, total, sums

    total, sums = taps.add(Float(0), wide.place, total, sums)
    _, total, sums = dr.while_loop(
        state=(mi.UInt32(1), total, sums),
        cond=lambda offset, total, sums: Float(offset) <= own,
        body=body,
        labels=("offset", "total", "sums"),
    )
    return taps.filtered(kind, total, sums)
