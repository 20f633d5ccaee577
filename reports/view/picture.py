# SPDX-License-Identifier: BSD-3-Clause
"""Frames as pictures, made on the device: the curve of
`reports.plotting.pictures.tone_mapped`, read from a table.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.numerics.recorded import Frozen
from airlight.reports.plotting.pictures import NOT_FINITE, tone_mapped

#: weights of airlight and surface
LAYERS = {"total": (1.0, 1.0), "airlight": (1.0, 0.0), "surface": (0.0, 1.0)}
_BRIGHTEST = 8.0  # times white: the table ends here
_ENTRIES = 2**16  # so that a step is at most half a level of the picture, in the dark


def tone_table() -> NDArray[np.uint8]:
    """Return the level of each of `_ENTRIES` values from 0 to `_BRIGHTEST`."""
    ramp = np.linspace(0, _BRIGHTEST, _ENTRIES)
    return tone_mapped(np.repeat(ramp[None, :, None], 3, axis=2), 1.0)[0, :, 0]


class Pictures:
    """Makes pictures of frames of one size."""

    def __init__(self) -> None:
        self._table = tone_table()
        self._levels = mi.UInt32(self._table.astype(np.uint32))
        self._draw: Callable[..., Any] = Frozen(_drawn)

    def of_frame(self, pixel, surface, airlight, *, layer: str, factor: float) -> memoryview:
        """Return the picture of a frame on the device, 8-bit RGBA row by row;
        `pixel` numbers its lanes.
        """
        # Opaque numbers, so that a new exposure or layer compiles nothing.
        weights = [dr.opaque(mi.Float, factor * weight) for weight in LAYERS[layer]]
        return np.array(self._draw(self._levels, pixel, surface, airlight, *weights)).data.cast("B")

    def of_image(self, radiance: NDArray[np.float64], factor: float) -> bytes:
        """Return the picture of an image on the host, (height, width, 3)
        [W/(m^2 sr)], in the same form.
        """
        finite = np.asarray(np.isfinite(radiance).all(axis=-1))
        # The nearest entry: half a step is added before the fraction is cut off.
        place = (
            np.clip(np.where(finite[..., None], radiance, 0) * factor, 0, _BRIGHTEST) * _PER_ENTRY
            + 0.5
        )
        picture = self._table[place.astype(np.int64)]
        picture[~finite] = NOT_FINITE
        return rgba(picture)


def rgba(picture: NDArray[np.uint8]) -> bytes:
    """Return an 8-bit picture, (height, width, 3), as bytes with a fourth channel that is full."""
    return np.concatenate(
        [picture, np.full((*picture.shape[:2], 1), 255, np.uint8)], axis=2
    ).tobytes()


_PER_ENTRY = (_ENTRIES - 1) / _BRIGHTEST


def _drawn(levels, pixel, surface, airlight, airlight_weight, surface_weight):
    # The levels of the three channels are packed into one integer, with an opaque alpha in its
    # upper byte. One channel that is not finite makes the pixel magenta, where its layer is shown.
    color = dr.select(surface_weight > 0, surface * surface_weight, 0) + dr.select(
        airlight_weight > 0, airlight * airlight_weight, 0
    )
    picture, finite = mi.UInt32(0xFF000000), mi.Bool(True)
    wrong = mi.UInt32(0xFF000000)
    for channel, value in enumerate(color):
        value = mi.Float(value)
        finite &= dr.isfinite(value)
        place = mi.UInt32(
            dr.fma(dr.clip(dr.select(dr.isfinite(value), value, 0), 0, _BRIGHTEST), _PER_ENTRY, 0.5)
        )
        picture |= dr.gather(mi.UInt32, levels, place) << (8 * channel)
        wrong |= int(NOT_FINITE[channel]) << (8 * channel)
    # Lanes are not in the order of the image.
    image = dr.zeros(mi.UInt32, dr.width(pixel))
    dr.scatter(image, dr.select(finite, picture, wrong), pixel)
    return image
