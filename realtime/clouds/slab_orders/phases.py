# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions as the slab needs them: values and Legendre moments, mean 1 over the sphere.

Moments are chi_l = (1/2) int_{-1}^{1} P(c) P_l(c) dc, chi_0 = 1, chi_1 the mean cosine g; P(c) =
sum (2 l + 1) chi_l P_l(c). Henyey and Greenstein's function has chi_l = g^l.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class SlabPhase(Protocol):
    """A phase function: its values and its moments."""

    def moments(self, count: int) -> Array:
        """Return chi_0 .. chi_{count - 1}."""

    def values(self, cosines: ArrayLike) -> Array:
        """Return P at cosines of the scattering angle."""


@dataclass(frozen=True)
class HenyeyGreensteinPhase:
    """The phase function of Henyey and Greenstein 1941; isotropic for g = 0."""

    g: float  #: mean cosine, in (-1, 1)

    def moments(self, count: int) -> Array:
        """Return g^l."""
        return np.float64(self.g) ** np.arange(count)

    def values(self, cosines: ArrayLike) -> Array:
        """Return (1 - g^2)/(1 + g^2 - 2 g c)^(3/2), free of cancellation near c = 1."""
        g = self.g
        down = (1 - np.asarray(cosines, dtype=np.float64)) / 2
        return (1 - g * g) / ((1 - g) ** 2 + 4 * g * down) ** 1.5


@dataclass(frozen=True, eq=False)
class AnglePhase:
    """A function of the scattering angle, divided by its mean."""

    #: takes angles [rad], (A,); values are not negative, in any unit
    heights: Callable[[Array], Array]
    #: angles in [0, pi] where the function has a jump or a kink [rad], the ends among them
    breaks: Array

    @cached_property
    def _nodes(self) -> tuple[Array, Array]:
        """Cosines of angles by Gauss nodes between the breaks, and weights of the
        mean of P over the sphere.
        """
        # A wave of P_l is 1.2 degrees long at l = 300: eight nodes in half a degree resolve it.
        panel, panel_nodes = np.deg2rad(0.5), 8
        nodes, weights = leggauss(panel_nodes)
        # Equal panels between every two breaks; the last edge of all is added at the end.
        parts = [
            np.linspace(low, high, max(2, int(np.ceil((high - low) / panel)) + 1))[:-1]
            for low, high in pairwise(self.breaks)
        ]
        edges = np.append(np.concatenate(parts), self.breaks[-1])
        width = np.diff(edges)[:, None]
        angles = (edges[:-1, None] + width * (nodes + 1) / 2).reshape(-1)
        # (1/2) P sin(angle) d(angle), where the map of a panel to [-1, 1] has the factor width/2.
        fractions = np.sin(angles) * (width / 4 * weights).reshape(-1) * self.heights(angles)
        return np.cos(angles), fractions

    @property
    def _mean(self) -> float:
        return float(self._nodes[1].sum())

    def moments(self, count: int) -> Array:
        """Return the moments by quadrature."""
        cosines, fractions = self._nodes
        moments = np.empty(count)
        # P_0 = 1, and P_{-1}, which counts 0 times; (l + 1) P_{l+1} = (2 l + 1) c P_l - l P_{l-1}.
        lower, legendre = np.zeros_like(cosines), np.ones_like(cosines)
        for degree in range(count):
            moments[degree] = fractions @ legendre
            lower, legendre = (
                legendre,
                ((2 * degree + 1) * cosines * legendre - degree * lower) / (degree + 1),
            )
        return moments / self._mean

    def values(self, cosines: ArrayLike) -> Array:
        """Return the values."""
        angles = np.arccos(np.clip(np.asarray(cosines, dtype=np.float64), -1.0, 1.0))
        return self.heights(np.atleast_1d(angles)).reshape(angles.shape) / self._mean
