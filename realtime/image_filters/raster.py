# SPDX-License-Identifier: BSD-3-Clause
"""How the pixels of an image lie, images with a margin, from which taps beside the image read, and sums over taps."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters.guides import Guide, channels, falloff, weight

#: What stands in the margin of a guide: unlike all pixels.
_UNLIKE = 1e15


@dataclass(frozen=True)
class Raster:
    """The size of an image whose pixels lie row by row."""

    width: int  #: [pixels]
    height: int  #: [pixels]

    @property
    def count(self) -> int:
        """How many pixels there are."""
        return self.width * self.height

    def places(self) -> tuple[Any, Any]:
        """Return column and row of every pixel."""
        index = dr.arange(mi.UInt32, self.count)
        row = index // self.width
        return index - row * self.width, row


@dataclass(frozen=True)
class Margined:
    """Images with a margin of `right` and `down` pixels on each side, evaluated."""

    values: list[Any]  #: channels of the image, 0 in the margin
    guides: list[tuple[Any, float]]  #: channels of the guides, each with its width; unlike all pixels in the margin
    inside: Any  #: without guides 1 in the image and 0 in the margin, otherwise None
    place: Any  #: where the pixels of the image are
    row: int  #: from one row to the next


def with_margin(image: Any, guides: tuple[Guide, ...], raster: Raster, *, right: int, down: int) -> Margined:
    """Return an image and its guides with a margin in which no pixel is like one of the image."""
    Float = type(channels(image)[0])
    width = raster.width + 2 * right
    column, row = raster.places()
    place = (row + down) * width + column + right

    def wide(channel: Any, margin: float) -> Any:
        whole = dr.full(Float, margin, width * (raster.height + 2 * down))
        dr.scatter(whole, Float(channel), place)
        return whole

    values = [wide(channel, 0) for channel in channels(image)]
    wide_guides = [(wide(channel, _UNLIKE), guide.width) for guide in guides for channel in channels(guide.values)]
    inside = None if guides else wide(dr.full(Float, 1, raster.count), 0)
    dr.eval(values, [channel for channel, _ in wide_guides], inside)
    return Margined(values, wide_guides, inside, place, width)


@dataclass(frozen=True)
class Taps:
    """The sums of a filter, tap by tap."""

    wide: Margined
    here: list[Any]  #: the image at the pixels
    guide_here: list[Any]  #: the guides there

    def add(self, exponent: Any, place: Any, total: Any, sums: list[Any]) -> tuple[Any, list[Any]]:
        """Return the sums of weights and of weighted differences with one more tap.

        `exponent`: to base 2 of the weight by distance, at most 0; `place`: where the tap of every pixel is; `total`,
        `sums`: so far, of the weights and by channel.
        """
        Float = type(self.here[0])
        for (channel, width), middle in zip(self.wide.guides, self.guide_here, strict=True):
            difference = dr.gather(Float, channel, place) - middle
            exponent = dr.fma(-falloff(width) * difference, difference, exponent)
        if self.wide.inside is not None:
            # Of a number the weight is a number: then a tap costs no exponential.
            share = dr.gather(Float, self.wide.inside, place) * weight(exponent)
        else:
            share = weight(exponent)
        sums = [
            dr.fma(share, dr.gather(Float, channel, place) - middle, so_far)
            for channel, middle, so_far in zip(self.wide.values, self.here, sums, strict=True)
        ]
        return total + share, sums

    def filtered(self, kind: Any, total: Any, sums: list[Any]) -> Any:
        """Return the image that the sums make, of the type `kind`."""
        return kind(*(middle + change / total for middle, change in zip(self.here, sums, strict=True)))


def taps_of(wide: Margined) -> Taps:
    """Return what adds up the taps of images with a margin."""
    Float = type(wide.values[0])
    return Taps(
        wide,
        [dr.gather(Float, channel, wide.place) for channel in wide.values],
        [dr.gather(Float, channel, wide.place) for channel, _ in wide.guides],
    )
