# SPDX-License-Identifier: BSD-3-Clause
"""Samples along epipolar slices: which of them to compute, and what lies between them.

A slice has a fixed number of samples at equal steps from where it enters the image to where it
leaves. One in `step` is computed, and both sides of every break of the depth between two of them;
the others are interpolated along the slice (Yusov 2013). A bit says whether a sample is computed,
32 bits to a word, so the nearest computed samples are found by counting bits.

A pixel lies between two slices and on each between two samples. It takes the mean of the four,
weighted by their nearness and by how well their depths agree with its own. Where none agrees it has
to be computed by itself.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.epipolar.slices import (
    Slices,
    neighbour,
    pixel_number,
    slice_coordinate,
)
from airlight.realtime.numerics.array_types import four_numbers
from airlight.realtime.numerics.functions import cell_of

WORD = 32  #: samples to a word of bits
AGREES = 0.1  #: relative difference of depths up to which there is no break


@dataclass(frozen=True)
class Samples:
    """The samples of slices."""

    slices: Slices
    count: int  #: of a slice, a multiple of 32
    depth: Any  #: of the pixels, row by row [m]
    bits: Any  #: by word and slice, which samples are computed


def mark_samples(slices: Slices, depth, *, count: int, step: int) -> Samples:
    """Return samples, with those to be computed marked.

    `slices`: the slices; `depth`: distances of the visible surface, pixel by pixel, row by row; may
    be infinite [m]; `count`: samples of a slice, a multiple of 32; `step`: one in so many is
    computed: a power of two up to 32.
    """
    # One lane for each word of bits, word by word, and slice by slice within a word: `bits` has the
    # same order.
    words = count // WORD
    index = dr.arange(mi.UInt32, slices.count * words)
    word = index // slices.count
    number, first = index - word * slices.count, word * WORD
    samples = Samples(slices, count, depth, None)
    ends = _ends(slices, number)

    def depth_at(k):
        return _sample_depth(samples, ends, dr.clip(mi.Int32(k), 0, count - 1))

    def body(b, bits, here, before):
        after = depth_at(first + b + 1)
        # Both sides of a break are computed: sample b differs from the one before it or behind it.
        breaks = _apart(before, here) | _apart(here, after)
        return b + 1, bits | (dr.select(breaks, mi.UInt32(1), 0) << b), after, here

    # Every `step`-th sample is marked from the start, in all words alike.
    # The last sample of all is marked: every other has one behind it.
    initial = sum(1 << b for b in range(0, WORD, step))
    bits = dr.select(first + WORD == count, mi.UInt32(initial | 1 << (WORD - 1)), initial)
    _, bits, _, _ = dr.while_loop(
        state=(
            dr.zeros(mi.UInt32, dr.width(index)),
            bits,
            depth_at(first),
            depth_at(mi.Int32(first) - 1),
        ),
        cond=lambda b, bits, here, before: b < WORD,
        body=body,
        labels=("b", "bits", "here", "before"),
    )
    dr.eval(bits)
    return Samples(slices, count, depth, bits)


def marked_samples(samples: Samples):
    """Return the marked samples, slice times count plus sample, and how many there are.

    They come word by word, and slice by slice within a word: what is next to each other in the list
    then is so in the image too.
    """
    slices = samples.slices.count
    number = dr.popcnt(samples.bits)
    # A word's marks begin in the list behind those of all words before it.
    place = dr.prefix_sum(number)
    marked = dr.empty(mi.UInt32, slices * samples.count)
    index = dr.arange(mi.UInt32, dr.width(samples.bits))
    word = index // slices
    first = (index - word * slices) * samples.count + word * WORD

    def body(bits, place):
        # Take the lowest bit that is set, and clear it.
        dr.scatter(marked, first + dr.tzcnt(bits), place)
        return bits & (bits - 1), place + 1

    dr.while_loop(
        state=(+samples.bits, place),
        cond=lambda bits, place: bits != 0,
        body=body,
        labels=("bits", "place"),
    )
    total = dr.sum(number)
    dr.eval(marked, total)
    return marked, total


def spread(width: int):
    """Return the numbers below `width`, and a few more, in an order that deals
    packets of 16 out evenly.

    A list fills only the first part of its room. Threads take contiguous parts of it, and
    one would get all the work.
    """
    # The lanes are 64 contiguous parts of `row` packets each; part n takes the packets n, n + 64,
    # n + 128, ... of the list.
    packet_size, parts = 16, 64
    row = width // (packet_size * parts) + 1
    lane = dr.arange(mi.UInt32, row * packet_size * parts)
    packet = lane // packet_size
    return ((packet % row) * parts + packet // row) * packet_size + lane % packet_size


def sample_ray(samples: Samples, sample):
    """Return image point, slice and depth of samples by their numbers among all."""
    number = sample // samples.count
    ends = _ends(samples.slices, number)
    k = mi.Int32(sample - number * samples.count)
    return _sample_point(samples, ends, k), number, _sample_depth(samples, ends, k)


def no_value(like):
    """Return the mark in place of a value for a sample whose ray meets no light, an
    array `like` the values; a colour has it in each channel by itself.
    """
    # Fractions are not negative: `_on_slice` tells by the sign.
    return type(like)(-1.0)


def between_samples(samples: Samples, values, point, depth):
    """Return the values of pixels from those of samples.

    `samples`: the samples; `values`: the values of the marked samples, by sample; `point`: image
    points (i, j) of the pixels; `depth`: their distances [m]. Returns `value`: the weighted mean;
    `fits`: by channel, whether enough of the samples agree in their depth.
    """
    # The pixel lies between slice `low` and the next one, by its place on the border.
    place = slice_coordinate(samples.slices, *point)
    low = dr.floor(place)
    total, weights = type(values)(0), type(values)(0)
    for step, fraction in ((0, 1 - (place - low)), (1, place - low)):
        number = neighbour(samples.slices, mi.Int32(low) + step)
        # Two samples on each of two slices: nearness across slices times the weight along the
        # slice.
        for value, weight in _on_slice(samples, values, number, point, depth):
            total += value * (fraction * weight)
            weights += fraction * weight
    # The least sum of weights with which a pixel is interpolated. The bound of the divisor only
    # keeps a pixel without weights finite.
    least_weight = 0.01
    return total / dr.maximum(weights, 1e-20), weights > least_weight


def _on_slice(samples: Samples, values, number, point, depth):
    """Return values and weights of the two samples of a slice on either side of a point."""
    ends = _ends(samples.slices, number)
    # The slice as a segment of the image, and the pixel projected onto it: `along` counts in
    # samples.
    i, j = ends.z - ends.x, ends.w - ends.y
    length = dr.maximum(i * i + j * j, 1e-10)
    along = ((point[0] - ends.x) * i + (point[1] - ends.y) * j) * ((samples.count - 1) / length)
    k, fraction = cell_of(along, samples.count)
    # Samples k and k + 1 enclose the pixel. Those that are not computed lie between the computed
    # ones `left` and `right`.
    left, right = _marked_about(samples, number, k)
    left_value, right_value = (
        dr.gather(type(values), values, number * samples.count + at) for at in (left, right)
    )
    # Where one of the two has no value, since its ray meets no light, the other stands for both;
    # where neither has one, the weights are 0. That is by channel: a ray that meets media without
    # red has values in green and blue alone.
    has_left, has_right = left_value >= 0, right_value >= 0
    left_value, right_value = (
        dr.select(has_left, left_value, right_value),
        dr.select(has_right, right_value, left_value),
    )
    # Interpolate samples k and k + 1 between `left` and `right`, and weigh each by its own depth,
    # which is known for every sample, computed or not.
    pace = dr.rcp(type(along)(right - left))
    weighted = []
    for step, near in ((0, 1 - fraction), (1, fraction)):
        value = left_value + (right_value - left_value) * (type(along)(k + step - left) * pace)
        agreement = _agreement(depth, _sample_depth(samples, ends, mi.Int32(k) + step))
        weight = type(values)(near * agreement)
        weighted.append((value, dr.select(has_left | has_right, weight, 0)))
    return weighted


def _marked_about(samples: Samples, number, k):
    """Return the last marked sample up to k and the first after it."""
    # `left`: of the word of k all bits beyond k are masked out, and the highest that remains is it.
    word, behind = k // WORD, (k + 1) // WORD
    slices = samples.slices.count
    bits = dr.gather(mi.UInt32, samples.bits, word * slices + number)
    left = (
        word * WORD + (WORD - 1) - dr.lzcnt(bits & (mi.UInt32(0xFFFFFFFF) >> (WORD - 1 - k % WORD)))
    )
    # `right`: of the word of k + 1 the bits below it are shifted out, and the lowest that remains
    # is it.
    rest = dr.gather(mi.UInt32, samples.bits, behind * slices + number) >> ((k + 1) % WORD)
    # The first sample of a word is always marked.
    return left, dr.select(rest != 0, k + 1 + dr.tzcnt(rest), (behind + 1) * WORD)


def _ends(slices: Slices, number):
    return dr.gather(four_numbers(type(slices.ends)), slices.ends, number)


def _sample_point(samples: Samples, ends, k):
    t = type(ends.x)(k) * (1.0 / (samples.count - 1))
    return dr.fma(t, ends.z - ends.x, ends.x), dr.fma(t, ends.w - ends.y, ends.y)


def _sample_depth(samples: Samples, ends, k):
    """Return the depth of the pixel that a sample lies in."""
    pixel = pixel_number(samples.slices, *_sample_point(samples, ends, k))
    return dr.gather(type(samples.depth), samples.depth, pixel)


def _difference(first, second):
    """Return the relative difference of two depths, by their inverses: they may be infinite."""
    a, b = dr.rcp(first), dr.rcp(second)
    return dr.abs(a - b) / dr.maximum(dr.maximum(a, b), 1e-20)


def _apart(first, second):
    return _difference(first, second) > AGREES


def _agreement(first, second):
    # 1 up to the difference that is no break; beyond it, it falls with the fourth power.
    close = dr.minimum(AGREES / dr.maximum(_difference(first, second), 1e-6), 1)
    return dr.square(dr.square(close))
