# SPDX-License-Identifier: BSD-3-Clause
"""Guides: images whose differences between two pixels say how alike these are, in units of a width."""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.numerics.array_types import Metres, PerRay
from realtime.numerics.fast_exp import exp2_bounded

_LEAST, _MOST = 1e-30, 1e30  # depths beyond stand for one another: a depth of 0, the sky [m]
_SCALE = 0.8493218002880191  # sqrt(log2(e) / 2): exp(-t^2/2) = 2^-(_SCALE t)^2
_FAINTEST = -120.0  # the exponent at which weights stop to fall: 2^-120 = 8e-37 changes no sum in float32


@dataclass(frozen=True)
class Guide:
    """An image, finite everywhere, and the difference at which a weight has fallen to exp(-1/2)."""

    values: PerRay  #: a number, a colour or a vector per pixel, row by row
    width: float  #: in units of the values


def depth_guide(depth: Metres, width: float) -> Guide:
    """Return the guide of a depth [m]: its logarithm, so that the `width` is a relative difference of depths [1].

    The sky, at infinity, is like itself and unlike all surfaces, and so are depths that are 0 or no numbers.
    """
    finite = dr.select(depth < _MOST, dr.maximum(depth, _LEAST), _MOST)
    return Guide(dr.log(dr.select(dr.isnan(depth), _LEAST, finite)), width)


def airlight_guide(airlight: PerRay, width: float) -> Guide:
    """Return the guide of a radiance that spans decades, log(1 + L / mean L); the `width` is one of that logarithm."""
    summed = sum(channels(airlight))
    mean = dr.mean(summed)
    return Guide(dr.log(1 + summed / dr.maximum(mean, 1e-30)), width)


def channels(value: Any) -> list[Any]:
    """Return the channels of a colour or vector, or a number as its only one."""
    return list(value) if dr.depth_v(value) > 1 else [value]


def falloff(width: Any) -> Any:
    """Return c of 2^(-c d^2) = exp(-d^2 / (2 width^2))."""
    return (_SCALE / width) ** 2 if isinstance(width, float | int) else dr.square(_SCALE / width)


def weight(exponent: Any) -> Any:
    """Return 2^exponent for an exponent of at most 0, an array or a number."""
    if isinstance(exponent, float | int):
        return 2.0 ** max(exponent, _FAINTEST)
    return exp2_bounded(dr.maximum(exponent, _FAINTEST))
