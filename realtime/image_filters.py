# SPDX-License-Identifier: BSD-3-Clause
"""Filters of whole images: Gaussian, bilateral and joint bilateral, by passes or levels;
means of tiles; up-sampling.

**Guides** are images. The difference of a guide between two pixels, in units of a width, says how
alike the pixels are.

**Margins.** The pixels of an image lie row by row. Taps beside the image read a margin around it,
which no pixel is like; a filter is a sum over taps.

**The bilateral and the joint bilateral filter** as they are defined: every pixel, every tap.
Tomasi and Manduchi 1998; Petschnigg et al. 2004 and Eisemann and Durand 2004 for guides. A tap
gathers each channel of image and guides and takes one exponential; there are (2 r + 1)^2 taps with
r = ceil(support hd).

**Filters along rows and then along columns** take 2 (2 r + 1) taps a pixel in place of (2 r +
1)^2. The Gaussian is a product, so that this is the same filter, also at the borders, where the
remaining taps are normalised. With guides it is an approximation (Pham and van Vliet 2005): a tap
off the row and the column is weighed through a pixel on the column, by the guide of that pixel. The
two passes do not commute, so neither do filter and transposition.

The width may differ from pixel to pixel. Then a pixel takes as many taps as its own width asks for.

**The bilateral filter of an image that takes few values**, exactly, as a sum of Gaussians.

A visibility f by N light samples takes the N + 1 values l / N. With W_l(p) the Gaussian of the
image that is 1 where f is l / N and 0 elsewhere,

    g(p) = f(p) + sum_l G_hr(f(p) - l / N) (l / N - f(p)) W_l(p) / sum_l G_hr(f(p) - l / N) W_l(p):

the same sum as the brute force, in another order. The Gaussians are separable and the range weights
are N + 1 a pixel, so that it costs 2 (2 r + 1) (N + 1) sums and no exponential a tap in place of (2
r + 1)^2 exponentials: for hd = 5 and N = 5 that is 372 in place of 961 taps of ten times the
operations. (Porikli 2008 and Yang, Tan, Ahuja 2009 do the same with quantised images, where it is
an approximation.) A frame of `fence` by `soft-shafts` with 800 x 600 pixels takes 2.9 s of
processor time, and 6.3 s with the brute force (two cores, in turns, 29 November 2026).

**The mean over a tile of 4 x 4 pixels**, where every pixel has another of sixteen samples.

A window of 4 x 4 that is moved to every pixel holds each sample once, but it lies half a pixel to
one side. The window therefore has 5 x 5 taps with weights 1/2, 1, 1, 1, 1/2 along rows and columns:
the two taps at its ends have the same sample, and each sample has the weight 1. Where a guide
leaves out some taps, the other taps are normalised.

**Joint bilateral up-sampling:** an image of every `scale`-th pixel becomes an image of all pixels,
with a depth test.

Kopf, Cohen, Lischinski, Uyttendaele 2007; the depth test of realTiSoftLS (Ali 2016) is
reconstructed from captions. A pixel takes the four pixels of the small image about it with the
weights of bilinear interpolation, each times the weight of the difference of their depths. Where
none of the four is like the pixel, as at a bar that is thinner than `scale` pixels, the one with
the nearest depth stands alone: no weight is made up.

The pixels of the small image are rays through the pixels `scale` i + `scale` // 2 of the large one.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import Metres, PerRay
from airlight.realtime.numerics.functions import exp2_bounded


@dataclass(frozen=True)
class Guide:
    """An image, finite everywhere, and the difference at which a weight has fallen to exp(-1/2)."""

    values: PerRay  #: a number, a colour or a vector per pixel, row by row
    width: float  #: in units of the values


def depth_guide(depth: Metres, width: float) -> Guide:
    """Return the guide of a depth [m]: its logarithm, so that the `width` is a relative
    difference of depths [1].

    The sky, at infinity, is like itself and unlike all surfaces, and so are depths
    that are 0 or no numbers.
    """
    # Depths beyond these stand for one another [m]: a depth of 0 below, the sky above.
    least, most = 1e-30, 1e30
    finite = dr.select(depth < most, dr.maximum(depth, least), most)
    return Guide(dr.log(dr.select(dr.isnan(depth), least, finite)), width)


def airlight_guide(airlight: PerRay, width: float) -> Guide:
    """Return the guide of a radiance that spans decades, log(1 + L / mean L); the `width`
    is one of that logarithm.
    """
    # A black image has the mean 0: the smallest divisor makes its guide 0 everywhere.
    summed = sum(channels(airlight))
    mean = dr.mean(summed)
    return Guide(dr.log(1 + summed / dr.maximum(mean, 1e-30)), width)


def channels(value: Any) -> list[Any]:
    """Return the channels of a colour or vector, or a number as its only one."""
    return list(value) if dr.depth_v(value) > 1 else [value]


def falloff(width: Any) -> Any:
    """Return c of 2^(-c d^2) = exp(-d^2 / (2 width^2))."""
    scale = 0.8493218002880191  # sqrt(log2(e) / 2): exp(-t^2/2) = 2^-(scale t)^2
    return (scale / width) ** 2 if isinstance(width, float | int) else dr.square(scale / width)


def weight(exponent: Any) -> Any:
    """Return 2^exponent for an exponent of at most 0, an array or a number."""
    # Weights stop to fall at 2^-120 = 8e-37, which changes no sum in float32.
    faintest = -120.0
    if isinstance(exponent, float | int):
        return 2.0 ** max(exponent, faintest)
    return exp2_bounded(dr.maximum(exponent, faintest))


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
    """Images with a margin on each side, evaluated."""

    values: list[Any]  #: channels of the image, 0 in the margin
    #: channels of the guides, each with its width; unlike all pixels in the margin
    guides: list[tuple[Any, float]]
    inside: Any  #: without guides 1 in the image and 0 in the margin, otherwise None
    place: Any  #: where the pixels of the image are
    row: int  #: from one row to the next


def with_margin(
    image: Any, guides: tuple[Guide, ...], raster: Raster, *, right: int, down: int
) -> Margined:
    """Return an image and its guides with a margin in which no pixel is like one of the image.

    `right`, `down`: how wide the margin is on each side, along rows and along columns [pixels].
    """
    Float = type(channels(image)[0])
    width = raster.width + 2 * right
    column, row = raster.places()
    place = (row + down) * width + column + right

    # Without a margin taps beside the image would have to be tested, or read from other rows.
    def wide(channel: Any, margin: float) -> Any:
        whole = dr.full(Float, margin, width * (raster.height + 2 * down))
        dr.scatter(whole, Float(channel), place)
        return whole

    # The guides in the margin are unlike all pixels; without guides a second image counts the taps
    # that lie within.
    unlike = 1e15
    values = [wide(channel, 0) for channel in channels(image)]
    wide_guides = [
        (wide(channel, unlike), guide.width)
        for guide in guides
        for channel in channels(guide.values)
    ]
    inside = None if guides else wide(dr.full(Float, 1, raster.count), 0)
    dr.eval(values, [channel for channel, _ in wide_guides], inside)
    return Margined(values, wide_guides, inside, place, width)


@dataclass(frozen=True)
class Taps:
    """The sums of a filter, tap by tap."""

    wide: Margined  #: the images with their margin
    here: list[Any]  #: the image at the pixels
    guide_here: list[Any]  #: the guides at the pixels

    def add(self, exponent: Any, place: Any, total: Any, sums: list[Any]) -> tuple[Any, list[Any]]:
        """Return the sums of weights and of weighted differences with one more tap.

        `exponent`: to base 2 of the weight by distance, at most 0; `place`: index of the tap of
        every pixel; `total`: sum of the weights so far; `sums`: weighted differences so far, by
        channel.
        """
        # The weight falls with the distance and with the difference of every guide: one exponent.
        Float = type(self.here[0])
        for (channel, width), middle in zip(self.wide.guides, self.guide_here, strict=True):
            difference = dr.gather(Float, channel, place) - middle
            exponent = dr.fma(-falloff(width) * difference, difference, exponent)
        if self.wide.inside is not None:
            # If the exponent is a Python number, so is the weight: then a tap costs no exponential.
            fraction = dr.gather(Float, self.wide.inside, place) * weight(exponent)
        else:
            fraction = weight(exponent)
        # Differences from the pixel itself: where all taps are alike nothing is rounded.
        sums = [
            dr.fma(fraction, dr.gather(Float, channel, place) - middle, so_far)
            for channel, middle, so_far in zip(self.wide.values, self.here, sums, strict=True)
        ]
        return total + fraction, sums

    def filtered(self, kind: Any, total: Any, sums: list[Any]) -> Any:
        """Return the image that the sums make, of the type `kind`."""
        return kind(
            *(middle + change / total for middle, change in zip(self.here, sums, strict=True))
        )


def taps_of(wide: Margined) -> Taps:
    """Return the sums of a filter over images with a margin, and the pixels that it filters."""
    Float = type(wide.values[0])
    return Taps(
        wide,
        [dr.gather(Float, channel, wide.place) for channel in wide.values],
        [dr.gather(Float, channel, wide.place) for channel, _ in wide.guides],
    )


def reach(hd: float, support: float) -> int:
    """Return how many pixels a filter reaches: `support` standard
    deviations of `hd` pixels each.
    """
    return math.ceil(support * hd)


def bilateral(
    image: PerRay, raster: Raster, *, hd: float, guides: tuple[Guide, ...], support: float = 3.0
) -> PerRay:
    """Return an image filtered, see `realtime.image_filters`.

    `image`: a number or a colour per pixel, row by row; `raster`: its size; `hd`: standard
    deviation of the weights in the image [pixels], above 0; `guides`: the images that say which
    pixels are alike; with none the filter is the Gaussian; `support`: half side of the square of
    taps [`hd`].

    Valid for finite images. Reconstructed from captions of Ali 2016 where the guide is the image
    itself (his SBFS) or a depth (his SoftBiF-VS).
    """
    # A square of taps about every pixel: a loop over its rows, and the taps of a row side by side.
    r, across = reach(hd, support), falloff(hd)
    taps = taps_of(with_margin(image, guides, raster, right=r, down=r))
    wide = taps.wide
    Float = type(wide.values[0])

    # The exponent by distance is a sum of one for the row and one for the column.
    def add_row(down: Any, start: Any, total: Any, sums: Any):
        begin = -across * Float(down * down)
        for right in range(2 * r + 1):
            total, sums = taps.add(begin - across * (right - r) ** 2, start + right, total, sums)
        return down + 1, start + wide.row, total, sums

    nothing = dr.zeros(Float, raster.count)
    _, _, total, sums = dr.while_loop(
        state=(
            mi.Int32(-r),
            wide.place - (r * wide.row + r),
            nothing,
            [+nothing for _ in taps.here],
        ),
        cond=lambda down, start, total, sums: down <= r,
        body=add_row,
        labels=("down", "start", "total", "sums"),
    )
    return taps.filtered(type(image), total, sums)


def separable(
    image: PerRay,
    raster: Raster,
    *,
    hd: Any,
    guides: tuple[Guide, ...] = (),
    support: float = 3.0,
    most: float = 0.0,
) -> PerRay:
    """Return an image filtered along rows and then along columns.

    `image`, `raster`, `guides`, `support`: as for `realtime.image_filters.bilateral`; `hd`:
    standard deviation [pixels], above 0: one number, or an array with an entry per pixel; `most`:
    with an array, its upper bound [pixels].
    """
    # Along rows, then the result along columns; each pass has a margin on two sides alone.
    for right in (True, False):
        r = reach(hd if isinstance(hd, float | int) else most, support)
        wide = with_margin(image, guides, raster, right=r if right else 0, down=0 if right else r)
        kind = type(image)
        # The result of the first pass still refers to its operands, two images with margins, which
        # are not needed any more.
        del image
        image = _pass(wide, kind, raster, r, hd=hd, support=support, right=right)
    return image


def _pass(
    wide: Margined, kind: Any, raster: Raster, r: int, *, hd: Any, support: float, right: bool
) -> PerRay:
    taps, across = taps_of(wide), falloff(hd)
    Float, step = type(wide.values[0]), 1 if right else wide.row
    total, sums = dr.zeros(Float, raster.count), [dr.zeros(Float, raster.count) for _ in taps.here]
    # One width: all pixels take the same taps, whose weights by distance are constants.
    if isinstance(hd, float | int):
        for offset in range(2 * r + 1):
            # With guides the exponent is an array.
            exponent = -across * (offset - r) ** 2
            total, sums = taps.add(exponent, wide.place - r * step + offset * step, total, sums)
        return taps.filtered(kind, total, sums)
    # A width for each pixel: from the pixel outwards, on both sides, as far as its width reaches.
    farthest = dr.minimum(dr.ceil(support * hd), r)

    def body(offset: Any, total: Any, sums: Any):
        exponent = -across * dr.square(Float(offset))
        total, sums = taps.add(exponent, wide.place + offset * step, total, sums)
        total, sums = taps.add(exponent, wide.place - offset * step, total, sums)
        return offset + 1, total, sums

    total, sums = taps.add(Float(0), wide.place, total, sums)
    _, total, sums = dr.while_loop(
        state=(mi.UInt32(1), total, sums),
        cond=lambda offset, total, sums: Float(offset) <= farthest,
        body=body,
        labels=("offset", "total", "sums"),
    )
    return taps.filtered(kind, total, sums)


def bilateral_of_levels(
    image: PerRay,
    raster: Raster,
    *,
    levels: int,
    hd: float,
    hr: float,
    support: float = 3.0,
    there: PerRay = True,
) -> PerRay:
    """Return `realtime.image_filters.bilateral` of an image of numbers with itself as its guide.

    `image`: numbers l / `levels` with l from 0 to `levels`, row by row; `raster`: its size;
    `levels`: N, the number of light samples; `hd`, `hr`: standard deviations [pixels], [1]; `hr`
    may be infinite; `support`: half side of the square of taps [`hd`]; `there`: which pixels take
    part; the others, for instance the sky, change nothing and stay what they are.
    """
    # The Gaussian of W_l is a product: along rows, then along columns.
    r = reach(hd, support)
    fractions = [math.exp(-0.5 * (offset / hd) ** 2) for offset in range(r + 1)]
    Float = type(image)

    def gaussians(channels: list[Any], step: int, place: Any, of: Any) -> list[Any]:
        sums = [
            of(level, dr.gather(Float, channel, place)) for level, channel in enumerate(channels)
        ]
        for offset in range(1, r + 1):
            for side in (place + offset * step, place - offset * step):
                for level, channel in enumerate(channels):
                    sums[level] = dr.fma(
                        fractions[offset], of(level, dr.gather(Float, channel, side)), sums[level]
                    )
        return sums

    # A pixel of the image holds its level plus 1; the margin holds 0, which is no level.
    rows = with_margin(dr.select(there, image * levels + 1, 0), (), raster, right=r, down=0)
    # Along rows all levels read one image: a level counts the pixels that have it.
    along_rows = gaussians(
        rows.values * (levels + 1),
        1,
        rows.place,
        lambda level, value: dr.select(dr.abs(value - (level + 1)) < 0.5, Float(1), 0),
    )
    # Along columns each level has an image of its own, its count along rows; the result is W_l.
    below = [with_margin(counted, (), raster, right=0, down=r) for counted in along_rows]
    counts = gaussians(
        [margined.values[0] for margined in below],
        below[0].row,
        below[0].place,
        lambda _, value: value,
    )
    # The sums of the module over levels: range weights times W_l, and those times the difference.
    total, change = Float(0), Float(0)
    for level, count in enumerate(counts):
        difference = level / levels - image
        fraction = count if math.isinf(hr) else count * weight(-falloff(hr) * dr.square(difference))
        total += fraction
        change = dr.fma(fraction, difference, change)
    return dr.select(there, image + change / total, image)


def tile_average(image: PerRay, raster: Raster, *, guides: tuple[Guide, ...] = ()) -> PerRay:
    """Return the mean over the window about every pixel, weighted by guides.

    `image`: a number, a colour or a vector per pixel, row by row; `raster`: its size; `guides`:
    the images that say which pixels are alike.
    """
    # The window has 5 x 5 taps with weights 1/2, 1, 1, 1, 1/2 along rows and columns; their
    # exponents to base 2.
    exponents = (-1, 0, 0, 0, -1)
    taps = taps_of(with_margin(image, guides, raster, right=2, down=2))
    wide = taps.wide
    total, sums = (
        dr.zeros(type(taps.here[0]), raster.count),
        [dr.zeros(type(taps.here[0]), raster.count) for _ in taps.here],
    )
    for down, vertical in enumerate(exponents):
        for right, horizontal in enumerate(exponents):
            place = wide.place + (down * wide.row + right) - (2 * wide.row + 2)
            total, sums = taps.add(vertical + horizontal, place, total, sums)
    return taps.filtered(type(image), total, sums)


def upsample(
    small: PerRay,
    small_guide: Guide,
    guide: PerRay,
    raster: Raster,
    *,
    scale: int,
    column: Any,
    row: Any,
) -> PerRay:
    """Return the values of pixels of a large image.

    `small`: a number or a colour per pixel of the small image, row by row, evaluated;
    `small_guide`: its guide of numbers, for instance `realtime.image_filters.depth_guide`,
    evaluated; `guide`: the values of that guide at the pixels that are asked for; `raster`: the
    size of the small image; `scale`: pixels of the large image from one of the small image to the
    next; `column`, `row`: of the pixels that are asked for, in the large image, in any order.
    """
    # The four pixels of the small image about each pixel, and where it lies between them.
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
            # Bilinear interpolation, times the weight of the difference of the guides.
            fraction = (
                vertical * horizontal * weight(-falloff(small_guide.width) * dr.square(difference))
            )
            total += fraction
            sums = [
                dr.fma(fraction, dr.gather(Float, channel, place), so_far)
                for channel, so_far in zip(channels(small), sums)
            ]
            # The pixel of the nearest guide, for where no pixel is alike.
            nearer = dr.abs(difference) < least
            least, nearest = (
                dr.select(nearer, dr.abs(difference), least),
                dr.select(nearer, place, nearest),
            )
    # A sum of weights below 1e-3 says that no pixel is alike.
    alike = total > 1e-3
    return type(small)(
        *(
            dr.select(alike, summed / total, dr.gather(Float, channel, nearest))
            for summed, channel in zip(sums, channels(small), strict=True)
        )
    )


def small_pixels(raster: Raster, scale: int, width: int) -> Any:
    """Return the numbers of the pixels of the large image, of a `width` [pixels], that
    the small image is made of.
    """
    column, row = raster.places()
    return (scale * row + scale // 2) * width + scale * column + scale // 2


def _between(Float: Any, place: Any, scale: int, size: int) -> tuple[Any, Any, Any]:
    """Return where a pixel lies between two of the small image, from 0 to 1, and these
    two, which may be the same.
    """
    # The small image has the pixels `scale` i + `scale` // 2 of the large one. A pixel before the
    # first one, or behind the last one, takes that one alone.
    along = (Float(place) - scale // 2) / scale
    before = dr.clip(dr.floor(along), 0, size - 1)
    first = mi.UInt32(before)
    return dr.clip(along - before, 0, 1), first, dr.minimum(first + 1, size - 1)
