# SPDX-License-Identifier: BSD-3-Clause
"""Faults of an image as a whole that need no number: how it is turned, in which order its channels are, its curve.

`engine_hints` takes them back from an image that is compared, and the hypotheses of `validation.diagnosis` put them
into what they predict. What turns an image undoes itself.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Change = Callable[[Array], Array]

TURNS: Mapping[str, Change] = {
    "upside down (flip it vertically)": lambda image: image[::-1],
    "mirrored left to right (a left-handed camera or an axis of the scene)": lambda image: image[:, ::-1],
    "turned by 180 degrees": lambda image: image[::-1, ::-1],
}  #: by what is said of an image, (height, width, 3)

SRGB = "encoded by the sRGB curve (write linear values)"


def channel_order(order: tuple[int, ...]) -> tuple[str, Change]:
    """Return what is said of an image whose channels are in another order, and the image with them so."""
    return f"in the channel order {', '.join('RGB'[channel] for channel in order)}", lambda image: image[..., order]


def to_srgb(linear: Array) -> Array:
    """Return values encoded by the curve of IEC 61966-2-1; those below 0 become 0."""
    positive = np.maximum(linear, 0.0)
    return np.where(positive <= 0.0031308, 12.92 * positive, 1.055 * positive ** (1 / 2.4) - 0.055)


def from_srgb(encoded: Array) -> Array:
    """Return the linear values of those encoded by that curve."""
    with np.errstate(invalid="ignore"):
        return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4)
