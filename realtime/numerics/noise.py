# SPDX-License-Identifier: BSD-3-Clause
"""Random numbers of a frame: the same in each repetition of a run, others in
each run, frame and pixel.

A generator with a state would need one for each pixel, and the order of its calls would matter. A
hash of where and when a number is wanted needs neither: four whole numbers go in, four come out.

**Patterns** are the numbers by which samples are shifted. Over the runs each number of each pixel
is evenly distributed in [0, 1), so that the mean of runs is the integral; they differ in how pixels
and frames are alike:

* `white`: a hash, independent of all others;
* `blue`: a mask of 64 x 64 pixels in 16 frames, in which neighbours in the image and in time are
  unlike (`docs/tools/blue_noise.py`). A run shifts the mask on its torus by a random offset, and a
  hash fills in the bits below its 256 levels;
* `ign`: interleaved gradient noise, fract(52.9829189 fract(0.06711056 i + 0.00583715 j)) in column
  i of row j: in any 3 x 3 pixels the nine values are about nine equal steps. A frame moves the
  gradient by 5.588238 pixels along both axes; a run adds a random number modulo 1.

With `golden` a pattern does not change from frame to frame in its usual way: frame n adds n times
the golden ratio to the pattern of frame 0.

References
----------
Jarzynski and Olano 2020, *Hash functions for GPU rendering* (JCGT 9:3), `pcg4d`. Jimenez 2014,
*Next generation post processing in Call of Duty: Advanced Warfare* (interleaved gradient noise).
Wolfe, Morrical, Akenine-Moller, Ramamoorthi 2022, *Spatiotemporal blue noise masks* (EGSR).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.numerics.array_types import aligned_array

PATTERNS = ("white", "blue", "ign")


@dataclass(frozen=True)
class Noise:
    """The numbers of a run and of a frame in it; opaque, so that a recorded method has
    new numbers in each frame.
    """

    run: Any  #: number of the run
    frame: Any  #: number of the frame
    mask: Any  #: of blue noise, four levels in a word

    def uniform(self, pixel: Any, stream: int = 0) -> tuple[Any, Any, Any, Any]:
        """Return four independent numbers for each pixel, evenly distributed in [0, 1), of 24 bits.

        `pixel`: numbers of pixels; `stream`: below 2^30; numbers of two streams are independent.
        """
        first, second, third, fourth = map(_number, pcg4d(pixel, self.frame, self.run, stream))
        return first, second, third, fourth

    def of_run(self, stream: int = 0) -> list[Any]:
        """Return four random words that all pixels and frames of the run share."""
        # Streams of `uniform` lie below 2^30, streams of `pattern` below 2^31: these follow.
        return pcg4d(0, 0, self.run, 2**31 + stream)

    def pattern(
        self, kind: str, *, golden: bool, pixel: Any, place: tuple[Any, Any], stream: int = 0
    ) -> Any:
        """Return a number from 0 to 1 for each pixel, by one of `PATTERNS`.

        `golden`: whether frames differ by the golden ratio; `pixel`, `place`: numbers of pixels,
        and their rows and columns; `stream`: below 2^30; patterns of two streams are independent
        over the runs.
        """
        frame = mi.UInt32(0) if golden else self.frame
        row, column = place
        # White noise. Streams of `uniform` lie below 2^30, streams of patterns above.
        hashed = pcg4d(pixel, frame, self.run, 2**30 + stream)[0]
        shared = self.of_run(stream)
        if kind == "blue":
            # The run moves the mask on its torus, along columns, rows and frames.
            side, frames = 64, 16
            x, y, n = (
                base + offset for base, offset in zip((column, row, frame), shared, strict=False)
            )
            index = ((n % frames) * side + y % side) * side + x % side
            # A word of the mask holds four levels of 8 bits; the hash fills in the 24 bits below.
            level = dr.gather(mi.UInt32, self.mask, index >> 2) >> ((index & 3) << 3)
            hashed = (level << 24) | (hashed >> 8)
        elif kind == "ign":
            # Both slopes, and 5.588238 of each a frame, are fractions of 2^32: whole numbers wrap
            # around as fract does, without rounding.
            across, down = (round(2**32 * slope) for slope in (0.06711056, 0.00583715))
            moved = round(2**32 * 5.588238 * (0.06711056 + 0.00583715)) % 2**32
            gradient = column * across + row * down + frame * moved
            fraction = mi.Float64(gradient) * (52.9829189 * 2.0**-32)
            hashed = mi.UInt32((fraction - dr.floor(fraction)) * 2.0**32) + shared[0]
        # n times the golden ratio, 2^32 (sqrt(5) - 1)/2, again modulo 1 by the wrap of 32 bits.
        return _number(hashed + self.frame * 2654435769 if golden else hashed)


def blue_mask() -> Any:
    """Return the mask of `Noise`, evaluated."""
    levels = np.load(Path(__file__).with_name("blue_noise.npy"))
    mask = aligned_array(mi.UInt32, levels.ravel().view("<u4"))
    dr.eval(mask)
    return mask


def pcg4d(*words: Any) -> list[Any]:
    """Return four hashed `mi.UInt32` of four (Jarzynski and Olano 2020)."""
    # A linear congruential step of each word, then two rounds that mix the words; between them the
    # upper bits are folded into the lower ones, which multiplication leaves poor.
    x, y, z, w = (mi.UInt32(word) * 1664525 + 1013904223 for word in words)
    for last in (False, True):
        x = x + y * w
        y = y + z * x
        z = z + x * y
        w = w + y * z
        if not last:
            x, y, z, w = (word ^ (word >> 16) for word in (x, y, z, w))
    return [x, y, z, w]


def _number(word: Any) -> Any:
    bits = 24  # float32 resolves no more
    return mi.Float(word >> (32 - bits)) * 2.0**-bits
