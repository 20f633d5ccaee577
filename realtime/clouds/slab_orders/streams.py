# SPDX-License-Identifier: BSD-3-Clause
"""Directions of a slab: double-Gauss streams, and scattering between them by mode of the azimuth.

With the Legendre moments chi_l of the phase function (mean 1 over the sphere, chi_0 = 1) the addition theorem gives

    P(cos Theta) = sum_m exp(i m (phi - phi')) K_m(mu, mu'),
    K_m(mu, mu') = sum_{l >= |m|} (2 l + 1) chi_l L_l^m(mu) L_l^m(mu'),    L_l^m = sqrt((l - m)!/(l + m)!) P_l^m.

N cosines in each hemisphere integrate polynomials of degree 2 N - 1, so only l < 2 N can be kept. What is left out is
close to forward and becomes an exact peak (delta-M, Wiscombe 1977): with f = chi_{2N}

    P = 2 f delta(1 - cos Theta) + (1 - f) P',    (1 - f) chi'_l = chi_l - f.

Light that meets the peak goes on in its direction, and yet was scattered: f stays a scattering here, so that orders are
orders of the true phase function. Delta-M's usual form takes f out of the medium and would lose the count.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Streams:
    """Cosines and weights of a double-Gauss rule."""

    mu: Array  #: (2 N,), first upwards (mu > 0), then downwards
    weights: Array  #: (2 N,), those of each hemisphere sum to 1

    @property
    def sines(self) -> Array:
        """Sines of the zenith angles of the streams."""
        return np.sqrt((1 - self.mu) * (1 + self.mu))


def double_gauss(count: int) -> Streams:
    """Return `count` streams in each hemisphere."""
    nodes, weights = leggauss(count)
    half = (nodes + 1) / 2
    return Streams(mu=np.concatenate([half, -half]), weights=np.concatenate([weights, weights]) / 2)


def legendre_table(m: int, degrees: int, mu: Array) -> Array:
    """Return L_l^m(mu) for l = 0 .. degrees - 1, (degrees, J); zero for l < m.

    The recurrence in l is stable: sqrt((l+1)^2 - m^2) L_{l+1} = (2 l + 1) mu L_l - sqrt(l^2 - m^2) L_{l-1}.
    """
    table = np.zeros((degrees, mu.size))
    if m >= degrees:
        return table
    sines = np.sqrt((1 - mu) * (1 + mu))
    # sqrt(1/(2m)!) (2m-1)!! sin^m as a product, which neither overflows nor underflows early
    first = np.ones_like(mu)
    for k in range(1, m + 1):
        first = first * (sines * math.sqrt((2 * k - 1) / (2 * k)))
    table[m] = first
    for degree in range(m, degrees - 1):
        previous = table[degree - 1] * math.sqrt(degree**2 - m**2) if degree > m else 0.0
        table[degree + 1] = ((2 * degree + 1) * mu * table[degree] - previous) / math.sqrt((degree + 1) ** 2 - m**2)
    return table


def mode_kernel(m: int, moments: Array, to: Array, source: Array) -> Array:
    """Return K_m between the cosines `to` and `source`, (to, source), for the moments that are given."""
    degrees = moments.size
    strengths = (2 * np.arange(degrees) + 1) * moments
    return (legendre_table(m, degrees, to).T * strengths) @ legendre_table(m, degrees, source)
