# SPDX-License-Identifier: BSD-3-Clause
"""Random numbers of a frame: the same in each repetition of a run, others in each run, frame and pixel.

A generator with a state would need one for each pixel, and the order of its calls would matter. A hash of where and
when a number is wanted needs neither: four whole numbers go in, four come out.

References
----------
Jarzynski and Olano 2020, *Hash functions for GPU rendering* (JCGT 9:3), `pcg4d`.
"""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi

_BITS = 24  # of a number: float32 resolves no more


@dataclass(frozen=True)
class Noise:
    """The numbers of a run and of a frame in it; opaque, so that what is recorded once draws anew in each frame."""

    run: Any
    frame: Any

    def uniform(self, pixel: Any, stream: int = 0) -> tuple[Any, Any, Any, Any]:
        """Return four independent numbers for each pixel, evenly distributed in [0, 1), of 24 bits.

        `pixel`: numbers of pixels; `stream`: numbers of two streams are independent.
        """
        hashed = pcg4d(pixel, self.frame, self.run, mi.UInt32(stream))
        first, second, third, fourth = (mi.Float(word >> (32 - _BITS)) * 2.0**-_BITS for word in hashed)
        return first, second, third, fourth


def pcg4d(*words: Any) -> list[Any]:
    """Return four hashed `mi.UInt32` of four (Jarzynski and Olano 2020)."""
    x, y, z, w = (mi.UInt32(word) * 1664525 + 1013904223 for word in words)
    for last in (False, True):
        x = x + y * w
        y = y + z * x
        z = z + x * y
        w = w + y * z
        if not last:
            x, y, z, w = (word ^ (word >> 16) for word in (x, y, z, w))
    return [x, y, z, w]
