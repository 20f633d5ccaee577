# SPDX-License-Identifier: BSD-3-Clause
"""The phase function of droplets as a cosine series of the scattering angle.

The sizes are those of Bouthors 2008, eq. 3: with u = r/r_n the weight of an average over the cross sections is
u^(gamma + 1) exp(-u), r_n = r_e/(gamma + 2). The rule takes the same midpoints as `analytic.droplets`: spheres have
resonances too narrow for any rule, so the sizes are part of what is computed.

Amplitudes of N terms are polynomials of degree N in the cosine, their squares of degree 2 N at most. As a function of
the angle the square is a sum of cos(k angle), k <= 2 N, and its values at 2 N + 1 equally spaced angles from 0 to 180
degrees give the coefficients exactly (a discrete cosine transform of type 1). The mean over the sphere of a cosine
series is the sum over even k of a_k/(1 - k^2), which scales it to 1.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.special import gammainccinv, gammaincinv

from realtime.droplets.spheres import angular_factors, phase_shift_coefficients, term_counts
from realtime.errors import InputError

Array = NDArray[np.float64]

_WATER = {0.65: 1.331, 0.55: 1.333, 0.45: 1.337}  # refractive index by wavelength [um], Hale and Querry 1973
_TAIL, _SIZES, _REFERENCE_RADIUS = 1e-9, 6400, 6.0  # as `analytic.droplets` has them
_GROUPS = 24  # of sizes with one number of terms each
_CHUNK = 512  # angles at a time


@dataclass(frozen=True)
class DropletSeries:
    """p(angle) = sum_k a_k cos(k angle), of mean 1 over the sphere."""

    cosines: Array  #: a_k [1], (terms,)
    efficiency: float  #: <Q_ext r^2>/<r^2> [1]
    extinction_per_droplet: float  #: mean extinction cross section [um^2]

    def values(self, angle: Array) -> Array:
        """Return p [1] at scattering angles [rad], (angles,)."""
        return np.cos(np.outer(angle, np.arange(len(self.cosines)))) @ self.cosines

    def slopes(self, angle: Array) -> Array:
        """Return dp/d(angle) [1/rad] at scattering angles [rad], (angles,)."""
        k = np.arange(len(self.cosines))
        return -np.sin(np.outer(angle, k)) @ (k * self.cosines)

    def share_below(self, angle: float) -> float:
        """Return the share of the light [1] that is scattered by less than an angle [rad].

        It is (1/2) int_0^angle p sin: of cos(k t) sin t the integral is that of (sin((k + 1) t) - sin((k - 1) t))/2.
        """
        k = np.arange(len(self.cosines), dtype=np.float64)
        up, down = k + 1, k - 1
        with np.errstate(divide="ignore", invalid="ignore"):
            falling = np.where(down == 0, 0.0, (1 - np.cos(down * angle)) / down)
        return float(self.cosines @ (0.25 * ((1 - np.cos(up * angle)) / up - falling)))


@lru_cache(maxsize=16)
def droplet_series(radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55) -> DropletSeries:
    """Return the phase function of water droplets.

    `radius`: effective radius r_e [um], 2 to 50; `gamma`: how narrow the sizes are distributed [1], above 0;
    `wavelength`: one of 0.65, 0.55, 0.45 [um]. Raises InputError for numbers out of these ranges.

    Takes some seconds at 6 um, a minute at 50 um; the results are kept.
    """
    _check(radius, gamma, wavelength)
    count = round(_SIZES * min(1.0, max(0.25, _REFERENCE_RADIUS / radius)))
    low, high = gammaincinv(gamma + 2, _TAIL), gammainccinv(gamma + 2, _TAIL)
    u = low + (high - low) * (np.arange(count) + 0.5) / count
    weight = np.exp((gamma + 1) * np.log(u / (gamma + 1)) - (u - gamma - 1))
    weight /= weight.sum()
    scale = radius / (gamma + 2)
    size = 2 * np.pi * scale * u / wavelength
    most = int(term_counts(size[-1:])[0])
    groups = [(part, *phase_shift_coefficients(size[part], _WATER[wavelength])) for part in _grouped(count)]
    efficiency = 0.0
    for part, a, b in groups:
        degeneracy = 2 * np.arange(1, a.shape[1] + 1) + 1
        efficiency += float(weight[part] @ (2 * ((a + b).real @ degeneracy) / size[part] ** 2))
    angle = np.pi * np.arange(2 * most + 1) / (2 * most)
    values = np.zeros_like(angle)
    for start in range(0, len(angle), _CHUNK):
        plus, minus = angular_factors(np.cos(angle[start : start + _CHUNK]), most)
        for part, a, b in groups:
            share = weight[part] / size[part] ** 2
            values[start : start + _CHUNK] += _scattered(share, a + b, plus) + _scattered(share, a - b, minus)
    cosines = dct(values, type=1) / (len(values) - 1)
    cosines[[0, -1]] *= 0.5
    even = np.arange(0, len(cosines), 2)
    mean = float(np.sum(cosines[even] / (1.0 - even**2)))
    area = np.pi * gamma * (gamma + 1) * scale**2
    return DropletSeries(cosines / mean, efficiency, area * efficiency)


def _check(radius: float, gamma: float, wavelength: float) -> None:
    if not 2 <= radius <= 50:
        raise InputError(f"the effective radius of the droplets is {radius} um; wanted 2 to 50 um")
    if not 0 < gamma < np.inf:
        raise InputError(f"gamma of the droplets is {gamma}; wanted a number above 0")
    if wavelength not in _WATER:
        raise InputError(f"the wavelength is {wavelength} um; wanted one of {', '.join(map(str, _WATER))} um")


def _grouped(count: int) -> list[NDArray[np.int64]]:
    return np.array_split(np.arange(count), _GROUPS)


def _scattered(share: Array, coefficients: NDArray[np.complex128], factors: Array) -> Array:
    """Return the sum over the sizes of share |amplitude|^2, (angles,)."""
    used = factors[: coefficients.shape[1]]
    real, imaginary = (np.ascontiguousarray(part) @ used for part in (coefficients.real, coefficients.imag))
    return share @ (real * real + imaginary * imaginary)
