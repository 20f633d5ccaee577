# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions as the slab needs them: values and Legendre moments, mean 1 over the sphere.

Moments are chi_l = (1/2) int_{-1}^{1} P(c) P_l(c) dc, chi_0 = 1, chi_1 the mean cosine g; P(c) = sum (2 l + 1) chi_l
P_l(c). Henyey and Greenstein's function has chi_l = g^l.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss, legval
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class SlabPhase:
    """A phase function: its values and its moments."""

    def moments(self, count: int) -> Array:
        """Return chi_0 .. chi_{count - 1}."""
        raise NotImplementedError

    def values(self, cosines: ArrayLike) -> Array:
        """Return P at cosines of the scattering angle."""
        raise NotImplementedError


@dataclass(frozen=True)
class HenyeyGreensteinPhase(SlabPhase):
    """The phase function of Henyey and Greenstein 1941; isotropic for g = 0.

    Parameters
    ----------
    g
        Mean cosine, in (-1, 1).
    """

    g: float

    def moments(self, count: int) -> Array:
        """Return g^l."""
        return np.float64(self.g) ** np.arange(count)

    def values(self, cosines: ArrayLike) -> Array:
        """Return (1 - g^2)/(1 + g^2 - 2 g c)^(3/2), free of cancellation near c = 1."""
        g = self.g
        down = (1 - np.asarray(cosines, dtype=np.float64)) / 2
        return (1 - g * g) / ((1 - g) ** 2 + 4 * g * down) ** 1.5


@dataclass(frozen=True, eq=False)
class SeriesPhase(SlabPhase):
    """A phase function by its moments, all others being zero.

    Parameters
    ----------
    chi
        (L,), chi_0 = 1.
    """

    chi: Array

    def moments(self, count: int) -> Array:
        """Return the moments, zero after the last."""
        moments = np.zeros(count)
        kept = min(count, self.chi.size)
        moments[:kept] = self.chi[:kept]
        return moments

    def values(self, cosines: ArrayLike) -> Array:
        """Return the series."""
        return np.asarray(legval(np.asarray(cosines, dtype=np.float64), (2 * np.arange(self.chi.size) + 1) * self.chi))


@dataclass(frozen=True, eq=False)
class TabulatedPhase(SlabPhase):
    """A phase function linear in the angle between values, divided by its mean.

    Parameters
    ----------
    angles
        (A,), increasing from 0 to pi [rad].
    heights
        (A,), not negative, in any unit.
    """

    angles: Array
    heights: Array

    def _nodes(self) -> tuple[Array, Array, Array]:
        """Return angles, weights of (1/2) sin theta d theta and values, by six Gauss nodes in each interval."""
        nodes, weights = leggauss(6)
        width = np.diff(self.angles)[:, None]
        angles = (self.angles[:-1, None] + width * (nodes + 1) / 2).reshape(-1)
        return (
            angles,
            np.sin(angles) / 2 * (width / 2 * weights).reshape(-1),
            np.interp(angles, self.angles, self.heights),
        )

    def mean(self) -> float:
        """Return the mean of the heights over the sphere."""
        _, weights, heights = self._nodes()
        return float(weights @ heights)

    def moments(self, count: int) -> Array:
        """Return the moments by quadrature between the values."""
        angles, weights, heights = self._nodes()
        cosines = np.cos(angles)
        # Where an interval is wider than the wave of P_l, six nodes are not enough: the caller gives a fine table.
        measure = weights * heights / (weights @ heights)
        moments = np.empty(count)
        before, now = np.zeros_like(cosines), np.ones_like(cosines)
        for degree in range(count):
            moments[degree] = measure @ now
            before, now = now, ((2 * degree + 1) * cosines * now - degree * before) / (degree + 1)
        return moments

    def values(self, cosines: ArrayLike) -> Array:
        """Return the values, linear in the angle."""
        angles = np.arccos(np.clip(np.asarray(cosines, dtype=np.float64), -1.0, 1.0))
        return np.interp(angles, self.angles, self.heights) / self.mean()
