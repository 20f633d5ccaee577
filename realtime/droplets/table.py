# SPDX-License-Identifier: BSD-3-Clause
"""The phase function of droplets as a table that kernels look up, from forward to backward.

The peak is a degree wide, the glory two, and both ends need angles to more digits than a cosine has in float32. With
a = sin(angle/2) and b = cos(angle/2), which callers know without cancellation, the table is over

    w = a/(a + b),    0 forward, 1 backward,    angle = 2 atan2(w, 1 - w),    d(angle)/dw = 2/(w^2 + (1 - w)^2),

which near both ends is half the angle from there, and costs two roots and a division. Between entries the function is
Hermite's cubic of their values and slopes: with eight entries for each term of the series it differs from it by less
than 1e-6 of the value.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from realtime.droplets.series import droplet_series

Array = NDArray[np.float64]

_ENTRIES = 8  # for each term of the series
CUT = 5.0  #: angle below which the modified phase function has no peak [degrees]


@dataclass(frozen=True)
class DropletTable:
    """Values and slopes at equally spaced w."""

    entries: Array  #: p and dp/dw times the spacing, in turn [1], (2 entries,)
    peak: float  #: E = tan(angle/2) at which p has fallen to half of its forward value
    terms: int  #: of the series


@lru_cache(maxsize=16)
def droplet_table(radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55) -> DropletTable:
    """Return the table of droplets; parameters, `Raises` and times are those of `droplet_series`."""
    series = droplet_series(radius, gamma, wavelength)
    cells = _ENTRIES * len(series.cosines)
    w = np.linspace(0.0, 1.0, cells + 1)
    angle = 2 * np.arctan2(w, 1 - w)
    values, slopes = np.empty_like(w), np.empty_like(w)
    for start in range(0, len(w), 1024):
        part = slice(start, start + 1024)
        values[part], slopes[part] = series.values(angle[part]), series.slopes(angle[part])
    slopes *= 2 / (w * w + (1 - w) ** 2) / cells
    half = angle[np.argmax(values < 0.5 * values[0])]
    return DropletTable(np.stack([values, slopes], axis=1).ravel(), float(np.tan(0.5 * half)), len(series.cosines))


def share_cut(radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55) -> float:
    """Return the share of the light [1] below `CUT`, which the modified phase function lacks."""
    return droplet_series(radius, gamma, wavelength).share_below(np.deg2rad(CUT))
