# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions in Dr.Jit, normalised so that their mean over the sphere is 1.

`cos_scatter` is the cosine of the scattering angle, +1 forward. The lobes "hazy" and "murky" of Biri 2006 (annex, after
Nishita 1987), 1 + 9((1+cos)/2)^8 and 1 + 50((1+cos)/2)^32, have the means 2 and 83/33 and are divided by them.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

NAMES = ("isotropic", "rayleigh", "hazy", "murky", "hg", "tabulated")


@dataclass(frozen=True)
class Phase:
    """A phase function: its name is code, its parameters are data."""

    name: str
    g: Any = None  #: 'hg': mean cosine, in (-1, 1)
    values: Any = None  #: 'tabulated': values of mean 1 at regularly spaced cosines from -1 to 1


def evaluate(phase: Phase, cos_scatter):
    """Evaluate a phase function [1]; divide by 4 pi for 1/sr.

    Notes
    -----
    Valid for -1 <= cos_scatter <= 1.
    """
    c = cos_scatter
    if phase.name == "isotropic":
        return type(c)(1)
    if phase.name == "rayleigh":
        return 0.75 * dr.fma(c, c, 1)
    if phase.name == "hazy":
        return 0.5 + 4.5 * _power(0.5 + 0.5 * c, 3)
    if phase.name == "murky":
        return (33 / 83) * dr.fma(50.0, _power(0.5 + 0.5 * c, 5), 1)
    if phase.name == "hg":
        # 1 + g^2 - 2 g c cancels in the lobe of a sharp g; (1 - |g|)^2 + 2 |g| (1 -+ c) is the same without.
        g = type(c)(phase.g)
        base = dr.fma(2 * dr.abs(g), 1 - dr.mulsign(c, g), dr.square(1 - dr.abs(g)))
        return (1 - g) * (1 + g) * dr.rsqrt(base) / base
    return _interpolate(phase.values, c)


def evaluate_half(phase: Phase, down, up):
    """Evaluate a phase function from sin^2 and cos^2 of half the scattering angle, (1 -+ cos)/2 [1].

    A lobe narrower than the rounding of the cosine, 1e-7, is a matter of `down` alone: with it nothing cancels.
    """
    if phase.name == "isotropic":
        return type(up)(1)
    if phase.name == "rayleigh":
        return 0.75 * dr.fma(up - down, up - down, 1)
    if phase.name == "hazy":
        return 0.5 + 4.5 * _power(up, 3)
    if phase.name == "murky":
        return (33 / 83) * dr.fma(50.0, _power(up, 5), 1)
    if phase.name == "hg":
        g = type(up)(phase.g)
        base = dr.fma(4 * dr.abs(g), dr.select(g >= 0, down, up), dr.square(1 - dr.abs(g)))
        return (1 - g) * (1 + g) * dr.rsqrt(base) / base
    return _interpolate(phase.values, up - down)


def _power(base, doublings: int):
    for _ in range(doublings):
        base = base * base
    return base


def _interpolate(values, c):
    last = dr.width(values) - 1
    position = dr.clip((c + 1) * (0.5 * last), 0, last)
    index = dr.minimum(mi.UInt32(position), last - 1)
    weight = position - type(c)(index)
    low = dr.gather(type(c), values, index)
    high = dr.gather(type(c), values, index + 1)
    return dr.lerp(low, high, weight)
