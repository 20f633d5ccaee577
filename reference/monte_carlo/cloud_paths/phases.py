# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions of the walk, in Dr.Jit: values by half the angle, and
scattering angles at random.

Both work with down = sin^2(angle/2), which two unit vectors give without cancellation, |a - b|^2/4.
Values have the mean 1 over the sphere, so down is distributed with the density p on [0, 1].
"""

from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic import phase as analytic
from airlight.errors import InputError

Array = NDArray[np.float64]


class WalkPhase(Protocol):
    """A phase function."""

    def value(self, down: "mi.Float", up: "mi.Float") -> "mi.Float":
        """Return p at sin^2 and cos^2 of half the scattering angle."""

    def down(self, sampler: "mi.Sampler", active: "mi.Bool") -> "mi.Float":
        """Return sin^2 of half a random scattering angle."""


class HenyeyGreenstein:
    """Henyey and Greenstein's function, isotropic for g = 0.

    The distribution's inverse is down = (1 - g) (1 - u) (r + 1 - g) / (2 (1 - g + 2 g u)), r = (1 -
    g^2)/(1 - g + 2 g u): the usual formula of the cosine without its cancellations.
    """

    def __init__(self, g: float):
        self._g = g

    def value(self, down: "mi.Float", up: "mi.Float") -> "mi.Float":
        """Return p, as `WalkPhase` says."""
        g = self._g
        # 1 + g^2 - 2 g cos from sin^2 or cos^2 of half the angle: the sum has no negative term.
        base = (1 - g) ** 2 + 4 * g * down if g >= 0 else (1 + g) ** 2 - 4 * g * up
        return (1 - g * g) * dr.rsqrt(base) / base

    def down(self, sampler: "mi.Sampler", active: "mi.Bool") -> "mi.Float":
        """Return sin^2 of half a random scattering angle."""
        g, u = self._g, sampler.next_1d(active)
        below = dr.rcp(1 - g + 2 * g * u)
        return dr.clip(0.5 * (1 - g) * (1 - u) * below * ((1 - g * g) * below + 1 - g), 0.0, 1.0)


class Rayleigh:
    """Rayleigh's function; its cosines by Cardano's formula."""

    def value(self, down: "mi.Float", up: "mi.Float") -> "mi.Float":
        """Return p, as `WalkPhase` says."""
        return 0.75 + 0.75 * dr.square(up - down)

    def down(self, sampler: "mi.Sampler", active: "mi.Bool") -> "mi.Float":
        """Return sin^2 of half a random scattering angle."""
        # The distribution of the cosine c is a cubic: c^3 + 3 c = 2 z for z uniform in [-2, 2].
        z = 4 * sampler.next_1d(active) - 2
        root = dr.cbrt(dr.abs(z) + dr.sqrt(dr.fma(z, z, 1.0)))
        return dr.clip(0.5 - 0.5 * dr.copysign(root - dr.rcp(root), z), 0.0, 1.0)


class Tabulated:
    """Values at regularly spaced cosines, linear between them.

    A cell is drawn by the alias method (Walker 1977; Vose 1991), a place in it by the
    inverse of the linear density.

    `values`: (A,), from backward to forward, of mean 1.
    """

    def __init__(self, values: Array):
        self._last = len(values) - 1
        self._values = mi.Float(values)
        fraction, other = _aliases(0.5 * (values[1:] + values[:-1]))
        self._fraction, self._other = mi.Float(fraction), mi.UInt32(other)

    def value(self, down: "mi.Float", up: "mi.Float") -> "mi.Float":
        """Return p, as `WalkPhase` says."""
        # Rounding may have `up` above 1, where a table that ends in 0 would be negative.
        place = dr.minimum(up, 1) * self._last
        cell = dr.clip(mi.Int32(place), 0, self._last - 1)
        low, high = (
            dr.gather(mi.Float, self._values, cell),
            dr.gather(mi.Float, self._values, cell + 1),
        )
        return dr.lerp(low, high, place - cell)

    def down(self, sampler: "mi.Sampler", active: "mi.Bool") -> "mi.Float":
        """Return sin^2 of half a random scattering angle."""
        number = dr.minimum(mi.UInt32(sampler.next_1d(active) * self._last), self._last - 1)
        # The alias method: a fraction of the draws of a cell stays with it, the rest go to its
        # alias.
        stays = sampler.next_1d(active) < dr.gather(mi.Float, self._fraction, number, active)
        cell = dr.select(stays, number, dr.gather(mi.UInt32, self._other, number, active))
        low = dr.gather(mi.Float, self._values, cell, active)
        high = dr.gather(mi.Float, self._values, cell + 1, active)
        u = sampler.next_1d(active)
        # Within the cell the distribution is a quadratic; this form of its inverse has no
        # cancellation where both values are alike.
        root = dr.sqrt(dr.lerp(dr.square(low), dr.square(high), u))
        fraction = u * (low + high) / dr.maximum(low + root, dr.smallest(mi.Float))
        return dr.clip((self._last - cell - fraction) / self._last, 0.0, 1.0)


def _aliases(weights: Array) -> tuple[Array, NDArray[np.uint32]]:
    """Return for each cell the fraction of its draws that stay with it, and the
    cell that gets the others.
    """
    count = len(weights)
    fraction = weights * (count / weights.sum())
    other = np.arange(count, dtype=np.uint32)
    small, large = list(np.flatnonzero(fraction < 1)), list(np.flatnonzero(fraction >= 1))
    while small and large:
        # A cell below the mean is filled up from a cell above it, which may then be below the mean.
        low, high = small.pop(), large[-1]
        other[low] = high
        fraction[high] -= 1 - fraction[low]
        if fraction[high] < 1:
            small.append(large.pop())
    fraction[small + large] = 1.0
    return fraction, other


def walk_phase(phase: analytic.PhaseFunction) -> WalkPhase:
    """Return a phase function of the scene for the walk.

    Raises InputError for one that no scene has.
    """
    if isinstance(phase, analytic.Isotropic):
        return HenyeyGreenstein(0.0)
    if isinstance(phase, analytic.HenyeyGreenstein):
        return HenyeyGreenstein(phase.g)
    if isinstance(phase, analytic.Rayleigh):
        return Rayleigh()
    if isinstance(phase, analytic.Tabulated):
        values = np.asarray(phase.table)
        return Tabulated(values / (0.5 * (values[1:] + values[:-1])).mean())
    raise InputError(
        f"the walk has no phase function '{phase.name}'; expected isotropic, hg, rayleigh or "
        "tabulated"
    )
