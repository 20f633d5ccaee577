# SPDX-License-Identifier: BSD-3-Clause
"""Entries of lists of shadow planes: how they are packed and read, and bins of azimuth."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.numerics.diamond_angle import TURN

# An entry: the number of a plane, the layers gained beyond it, and two marks.
NUMBER = (1 << 24) - 1
GAIN_SHIFT, GAIN_ZERO = 24, 32  #: gains from -32 to 31; a plane that gains more is there more than once
FULL = 1 << 30  #: whatever ray the list is for: it lies in the span of the plane; see `Lists` and `Wedges`
FIRST = 1 << 31  #: the first bin that holds the plane

BINS = 64  #: of azimuth, from which tiles draw
ROOM = 32  #: entries for each tile and, fourfold, for each block, on average


@dataclass
class Source:
    """Where to read entries: a run of places."""

    first: Any
    count: Any
    all_before: Any  #: places below this one count even where the entry is not the first of its plane


def entry_at(entries, source: Source, k, active):
    """Return the k-th of the `entries` of a source and whether it counts there."""
    place = source.first + k
    active = active & (k < source.count)
    entry = dr.gather(mi.UInt32, entries, place, active)
    return entry, active & (((entry & FIRST) != 0) | (place < source.all_before))


def entry_words(plane: NDArray[np.int64], gain: NDArray[np.int8], marks: NDArray[np.int64]) -> NDArray[np.uint32]:
    """Return the entries of planes by their numbers, `gain` by plane and `marks` by entry."""
    gained = (gain.astype(np.int64) + GAIN_ZERO) << GAIN_SHIFT
    return (plane + gained[plane] + marks).astype(np.uint32)


def in_bins(
    first: NDArray[np.float32], last: NDArray[np.float32], bins: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return every pair of a plane and a bin of azimuth that it meets, and whether the bin is the plane's first.

    `first` and `last` are the azimuths of the planes, `bins` the bins of a turn, a power of two: then a ray and a plane
    round alike.
    """
    scale = np.float32(bins / TURN)
    low = np.maximum((first * scale).astype(np.int64), 0)
    high = np.minimum((last * scale).astype(np.int64), bins - 1)
    width = high - low + 1
    plane = np.repeat(np.arange(len(width)), width)
    step = np.arange(len(plane)) - np.repeat(np.cumsum(width) - width, width)
    return plane, step + low[plane], step == 0
