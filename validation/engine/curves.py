# SPDX-License-Identifier: BSD-3-Clause
"""Encodings and tone curves that engines apply before they write values. Values
below 0 stay, or become 0.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from airlight.validation.arrays import Array


def to_srgb(linear: Array) -> Array:
    """Return values encoded by the curve of IEC 61966-2-1; those below 0 become 0."""
    positive = np.maximum(linear, 0.0)
    return np.where(positive <= 0.0031308, 12.92 * positive, 1.055 * positive ** (1 / 2.4) - 0.055)


def from_srgb(encoded: Array) -> Array:
    """Return linear values, given values encoded by the curve of IEC 61966-2-1."""
    with np.errstate(invalid="ignore"):
        return np.where(
            encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4
        )


def srgb_in_8_bits(radiance: Array) -> Array:
    """Return values encoded by the same curve in 8 bits, as numbers from 0 to 1."""
    return np.round(255 * np.clip(to_srgb(radiance), 0.0, 1.0)) / 255


def to_pq(radiance: Array, white: float) -> Array:
    """Return values encoded by the curve of SMPTE ST 2084, 1 being a luminance [cd/m^2]."""
    power = np.clip(radiance * white / 10_000, 0.0, 1.0) ** (2610 / 16384)
    return np.asarray(((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** (2523 / 32))


def gamma(radiance: Array, exponent: float) -> Array:
    """Return values to the power 1/exponent."""
    return np.asarray(np.maximum(radiance, 0.0) ** (1 / exponent))


def reinhard(radiance: Array) -> Array:
    """Return x/(1 + x) (Reinhard et al. 2002, eq. 3)."""
    return np.asarray(radiance / (1 + np.maximum(radiance, 0.0)))


def exponential(radiance: Array) -> Array:
    """Return 1 - exp(-x), the response of film."""
    return np.asarray(-np.expm1(-np.maximum(radiance, 0.0)))


def filmic(radiance: Array) -> Array:
    """Return Narkowicz's fit of the ACES curve (2015)."""
    x = np.maximum(radiance, 0.0)
    return np.asarray(np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0))


# Blender's view transforms: a curve of log2(x/0.18) at even places, as Blender 5.0.1
# wrote greys into a file.
_STOPS = np.linspace(-10.0, 6.5, 23)
_FILMIC = (
    1.5e-5, 0.003, 0.0074, 0.0136, 0.0224, 0.0348, 0.0522, 0.0764, 0.1095, 0.1538, 0.2113, 0.2833,
    0.3694, 0.4664, 0.5677, 0.6668, 0.7571, 0.8336, 0.8941, 0.9388, 0.9697, 0.9892, 1.0,
)  # fmt: skip
_AGX = (
    0.0, 0.0001, 0.0007, 0.0023, 0.0059, 0.0129, 0.0258, 0.0492, 0.0805, 0.12, 0.171, 0.2369,
    0.3204, 0.4238, 0.5359, 0.6379, 0.7242, 0.7951, 0.8536, 0.9014, 0.9404, 0.9728, 1.0,
)  # fmt: skip
# AgX mixes channels before its curve, and takes that back in linear light after it;
# fitted to colours, to 2e-3.
_AGX_BEFORE = np.array(
    [[0.5691, 0.3314, 0.0995], [0.1191, 0.7372, 0.1437], [0.0934, 0.198, 0.7086]]
)
_AGX_AFTER = np.array(
    [[1.8311, -0.7004, -0.1307], [-0.2281, 1.3306, -0.1025], [-0.1837, -0.3038, 1.4875]]
)


def _by_stops(curve: tuple[float, ...], radiance: Array) -> Array:
    # Stops over middle grey; black, which has no logarithm, is the lowest one.
    stops = np.log2(np.maximum(radiance, 1e-30) / 0.18)
    return np.asarray(PchipInterpolator(_STOPS, curve)(np.clip(stops, _STOPS[0], _STOPS[-1])))


def blender_filmic(radiance: Array) -> Array:
    """Return Blender's view transform Filmic."""
    return _by_stops(_FILMIC, radiance)


def agx(radiance: Array) -> Array:
    """Return Blender's view transform AgX, its default."""
    # The curve is applied to mixed channels and leaves encoded values; mixing back is linear.
    encoded = _by_stops(_AGX, radiance @ _AGX_BEFORE.T)
    linear = from_srgb(encoded)
    return np.clip(to_srgb(linear @ _AGX_AFTER.T), 0.0, 1.0)


# Chromaticities of red, green, blue and white: IEC 61966-2-1, SMPTE EG 432-1, ITU-R
# BT.2020, S-2014-004, ST 2065-1.
_SRGB = (0.64, 0.33), (0.3, 0.6), (0.15, 0.06), (0.3127, 0.329)
_SPACES = {
    "Display P3": ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06), (0.3127, 0.329)),
    "Rec. 2020": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), (0.3127, 0.329)),
    "ACEScg (AP1)": ((0.713, 0.293), (0.165, 0.83), (0.128, 0.044), (0.32168, 0.33767)),
    "ACES 2065-1 (AP0)": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), (0.32168, 0.33767)),
}
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)


def _to_cones(space: Sequence[tuple[float, float]]) -> Array:
    """Return the matrix from colours to Bradford's cone responses over those of white."""
    # Columns are the XYZ of red, green, blue and white at Y = 1. The primaries are scaled so that
    # they add up to white, and the cone responses divided by those of white.
    xyz = np.array([(x / y, 1.0, (1 - x - y) / y) for x, y in space]).T
    cones = _BRADFORD @ xyz
    return (cones[:, :3] * np.linalg.solve(xyz[:, :3], xyz[:, 3])) / cones[:, 3:]


#: Matrices from colours with the primaries of sRGB to colours with others, white to white, by the
#: name of the others.
PRIMARIES: Mapping[str, Array] = {
    name: np.asarray(np.linalg.solve(_to_cones(space), _to_cones(_SRGB)), dtype=np.float64)
    for name, space in _SPACES.items()
}
