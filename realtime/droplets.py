# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions of the droplets of fog and clouds: Mie series, means over sizes, tables.

**The phase function of droplets as a cosine series of the scattering angle.**

Droplets have the sizes of Bouthors 2008, eq. 3: with u = r/r_n the weight of an average over the
cross sections is u^(gamma + 1) exp(-u), r_n = r_e/(gamma + 2). The rule takes the same midpoints as
`analytic.droplets`: spheres have resonances too narrow for any rule, so the result belongs to these
sizes.

Amplitudes of N terms are polynomials of degree N in the cosine, their squares of degree 2 N at
most. As a function of the angle the square is a sum of cos(k angle), k <= 2 N, and its values at 2
N + 1 equally spaced angles from 0 to 180 degrees give the coefficients exactly (a discrete cosine
transform of type 1). The mean over the sphere of a cosine series is the sum over even k of a_k/(1 -
k^2), which scales it to 1.

**The amplitudes of light that spheres without absorption scatter (Mie 1908), in real arithmetic.**

`analytic.mie` has complex coefficients by Bohren and Huffman's recurrences. Here the coefficients
are phase shifts (van de Hulst 1957, section 10.21): for a real refractive index m and the size x =
2 pi r/wavelength,

    a_n = p_n/(p_n - i q_n),   p_n = psi_n'(y) psi_n(x) - m psi_n(y) psi_n'(x),   y = m x,
                               q_n = psi_n'(y) chi_n(x) - m psi_n(y) chi_n'(x),

and b_n with the factor m at the first terms, where psi_n(x) = x j_n(x) and chi_n(x) = -x y_n(x).
Divided by psi_n(y), each p and q needs the logarithmic derivative D = psi_n'(y)/psi_n(y) alone.

**Ratios.** R_n = psi_n/psi_{n-1} follows from the three-term recurrence as 1/R_n = (2n + 1)/x -
R_{n+1}, stable downwards for any start beyond the transition at n = x (Du 2004, Appl. Opt. 43,
1951, has it for y). Then psi_n'/psi_n = 1/R_n - n/x. chi_n is stable upwards. psi_n itself follows
from both by the Wronskian

    psi_{n-1} chi_n - psi_n chi_{n-1} = 1:      psi_{n-1} = 1/(chi_n - R_n chi_{n-1}),

in which nothing cancels beyond n = x and no error is carried from one n to the next.

**The phase function of droplets as a table that kernels look up, from forward to backward.**

The peak is a degree wide, the glory two, and both ends need angles to more digits than a cosine has
in float32. With a = sin(angle/2) and b = cos(angle/2), which callers know without cancellation, the
table is over

    w = a/(a + b),    0 forward, 1 backward,    angle = 2 atan2(w, 1 - w),    d(angle)/dw = 2/(w^2 + (1 - w)^2),

which near both ends is half the angle from there, and costs two roots and a division. Between
entries the function is Hermite's cubic of their values and slopes. With eight entries for each term
of the series the cubics differ from the series by less than 1e-6 of the value.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]

# refractive index by wavelength [um], Hale and Querry 1973
_WATER = {0.65: 1.331, 0.55: 1.333, 0.45: 1.337}


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
        # d/d(angle) of cos(k angle) is -k sin(k angle).
        k = np.arange(len(self.cosines))
        return -np.sin(np.outer(angle, k)) @ (k * self.cosines)

    def fraction_below(self, angle: float) -> float:
        """Return the fraction of the light [1] that is scattered by less than an angle [rad].

        It is (1/2) int_0^angle p sin t dt, where cos(k t) sin t = (sin((k + 1) t) - sin((k - 1)
        t))/2.
        """
        k = np.arange(len(self.cosines), dtype=np.float64)
        up, down = k + 1, k - 1
        # int_0^angle sin(m t) dt = (1 - cos(m angle))/m, and 0 for m = 0, which k = 1 has.
        with np.errstate(divide="ignore", invalid="ignore"):
            falling = np.where(down == 0, 0.0, (1 - np.cos(down * angle)) / down)
        return float(self.cosines @ (0.25 * ((1 - np.cos(up * angle)) / up - falling)))


@lru_cache(maxsize=16)
def droplet_series(
    radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55
) -> DropletSeries:
    """Return the phase function of water droplets.

    `radius`: effective radius r_e [um], 2 to 50; `gamma`: how narrow the sizes are distributed [1],
    above 0; `wavelength`: one of 0.65, 0.55, 0.45 [um]. Raises InputError for numbers out of these
    ranges.

    Takes some seconds at 6 um, a minute at 50 um; the results are cached.
    """
    from scipy.fft import dct
    from scipy.special import gammainccinv, gammaincinv

    _check(radius, gamma, wavelength)
    # As many sizes as `analytic.droplets` takes, at the midpoints between the same quantiles of
    # u^(gamma + 1) exp(-u): all 6400 up to r_e = 6 um, and a quarter at least.
    tail, sizes, reference_radius = 1e-9, 6400, 6.0
    count = round(sizes * min(1.0, max(0.25, reference_radius / radius)))
    low, high = gammaincinv(gamma + 2, tail), gammainccinv(gamma + 2, tail)
    u = low + (high - low) * (np.arange(count) + 0.5) / count
    # The weight over its largest value, at u = gamma + 1, as the power of u overflows for large
    # gamma.
    weight = np.exp((gamma + 1) * np.log(u / (gamma + 1)) - (u - gamma - 1))
    weight /= weight.sum()
    scale = radius / (gamma + 2)
    # x = 2 pi r/wavelength in increasing order: the last sphere has the most terms.
    size = 2 * np.pi * scale * u / wavelength
    most = int(term_counts(size[-1:])[0])
    groups = [
        (part, *phase_shift_coefficients(size[part], _WATER[wavelength]))
        for part in _grouped(count)
    ]
    # Q_ext = 2/x^2 sum (2 n + 1) Re(a_n + b_n) of each sphere, in the mean weighted by r^2.
    efficiency = 0.0
    for part, a, b in groups:
        degeneracy = 2 * np.arange(1, a.shape[1] + 1) + 1
        efficiency += float(weight[part] @ (2 * ((a + b).real @ degeneracy) / size[part] ** 2))
    # A polynomial of degree 2 N in the cosine follows from its values at 2 N + 1 angles.
    angle = np.pi * np.arange(2 * most + 1) / (2 * most)
    values = np.zeros_like(angle)
    chunk = 512  # angles at a time
    for start in range(0, len(angle), chunk):
        plus, minus = angular_factors(np.cos(angle[start : start + chunk]), most)
        for part, a, b in groups:
            # A sphere scatters |S_1 + S_2|^2 + |S_1 - S_2|^2 over x^2, up to a factor that the mean
            # over the sphere takes out below.
            fraction = weight[part] / size[part] ** 2
            values[start : start + chunk] += _scattered(fraction, a + b, plus) + _scattered(
                fraction, a - b, minus
            )
    # The transform of type 1 counts the first and the last coefficient twice.
    cosines = dct(values, type=1) / (len(values) - 1)
    cosines[[0, -1]] *= 0.5
    # The mean over the sphere: (1/2) int cos(k t) sin t dt = 1/(1 - k^2) for even k, 0 for odd
    # ones.
    even = np.arange(0, len(cosines), 2)
    mean = float(np.sum(cosines[even] / (1.0 - even**2)))
    # pi <r^2> of the droplets [um^2].
    area = np.pi * gamma * (gamma + 1) * scale**2
    return DropletSeries(cosines / mean, efficiency, area * efficiency)


def _check(radius: float, gamma: float, wavelength: float) -> None:
    if not 2 <= radius <= 50:
        raise InputError(
            f"the effective radius of the droplets is {radius} um; expected 2 to 50 um"
        )
    if not 0 < gamma < np.inf:
        raise InputError(f"gamma of the droplets is {gamma}; expected a number above 0")
    if wavelength not in _WATER:
        raise InputError(
            f"the wavelength is {wavelength} um; expected one of {', '.join(map(str, _WATER))} um"
        )


def _grouped(count: int) -> list[NDArray[np.int64]]:
    """Return the numbers of sizes in groups, each of which shares one number of terms."""
    groups = 24
    return np.array_split(np.arange(count), groups)


def _scattered(fraction: Array, coefficients: NDArray[np.complex128], factors: Array) -> Array:
    """Return the sum over the sizes of fraction |amplitude|^2, (angles,).

    `fraction`: by size; `coefficients`: (sizes, terms); `factors`: of `angular_factors`.
    """
    # The factors are real: real and imaginary parts of the amplitudes are real products.
    used = factors[: coefficients.shape[1]]
    real, imaginary = (
        np.ascontiguousarray(part) @ used for part in (coefficients.real, coefficients.imag)
    )
    return fraction @ (real * real + imaginary * imaginary)


Complex = NDArray[np.complex128]


def term_counts(size: Array) -> NDArray[np.int64]:
    """Return how many terms spheres of the sizes x >= 0.01 need (Wiscombe 1980), (sizes,)."""
    slope = np.where((size > 8) & (size < 4200), 4.05, 4.0)
    return np.floor(size + slope * np.cbrt(size) + np.where(size > 8, 2, 1)).astype(np.int64)


def phase_shift_coefficients(size: Array, index: float) -> tuple[Complex, Complex]:
    """Return a_n and b_n [1], (sizes, terms) each; column n - 1 holds n.

    `size`: x of each sphere [1], (sizes,); `index`: m, the real refractive index relative
    to the surroundings [1].

    Valid for sizes from 0.01 to 5000. Beyond the terms that a sphere needs its coefficients are 0.
    """
    counts = term_counts(size)
    count = int(counts.max())
    # R_n at y = m x and at x, for all spheres as far as the largest needs.
    inner, outer = _ratios(index * size, count + 1), _ratios(size, count + 1)
    chi = np.empty((count + 1, len(size)))
    chi[0] = np.cos(size)
    # chi_0 above, and chi_{-1}: chi_n = (2 n - 1)/x chi_{n-1} - chi_{n-2} goes upwards from them.
    chi_before = -np.sin(size)
    a, b = np.zeros((len(size), count), np.complex128), np.zeros((len(size), count), np.complex128)
    for n in range(1, count + 1):
        # A sphere that has all of its terms rests at chi = 1, as its chi would grow until it
        # overflows.
        used = counts >= n
        chi[n], chi_before = (
            np.where(used, (2 * n - 1) / size * chi[n - 1] - chi_before, 1.0),
            chi[n - 1],
        )
        # psi_{n-1} by the Wronskian, then psi_n by its ratio to it.
        psi = outer[n] / (chi[n] - outer[n] * chi[n - 1])
        # psi_n' = psi_n (1/R_n - n/x), chi_n' = chi_{n-1} - n/x chi_n, and D = psi_n'(y)/psi_n(y).
        psi_slope = psi * (1 / outer[n] - n / size)
        chi_slope = chi[n - 1] - n / size * chi[n]
        derivative = 1 / inner[n] - n / (index * size)
        # In a_n the factor m is at the second terms of p and q, in b_n at the first ones.
        for coefficient, first, second in ((a, 1.0, index), (b, index, 1.0)):
            p = first * derivative * psi - second * psi_slope
            q = first * derivative * chi[n] - second * chi_slope
            coefficient[used, n - 1] = (p / (p - 1j * q))[used]
    return a, b


def _ratios(argument: Array, count: int) -> Array:
    """Return R_n = psi_n/psi_{n-1} for n = 0 to count, (count + 1, sizes); row 0 is not used."""
    # The start lies eight widths x^(1/3) of the transition beyond n = x, or at the last ratio that
    # is needed, and 20 terms further: there psi_n/psi_{n-1} is about x/(2 n + 1).
    widths, margin = 8.0, 20
    largest = float(argument.max())
    start = int(max(count, largest + widths * largest ** (1 / 3))) + margin
    ratios = np.ones((count + 1, len(argument)))
    ratio = argument / (2 * start + 1)
    for n in range(start - 1, 0, -1):
        # 1/R_n = (2 n + 1)/x - R_{n+1}.
        ratio = 1 / ((2 * n + 1) / argument - ratio)
        if n <= count:
            ratios[n] = ratio
    return ratios


def angular_factors(cosine: Array, count: int) -> tuple[Array, Array]:
    """Return (2n + 1)/(n (n + 1)) times pi_n + tau_n, and times pi_n - tau_n
    [1], (count, angles) each.

    Both obey recurrences of Legendre's derivatives: pi_n = P_n'(cos), and tau_n = cos pi_n - sin^2
    P_n'' with sin^2 P_n'' = 2 cos P_n' - n (n + 1) P_n.

    `cosine`: of the scattering angle, (angles,); `count`: largest n.
    """
    plus, minus = np.empty((count, len(cosine))), np.empty((count, len(cosine)))
    # P_0 and P_1, P_0' and P_1'.
    legendre_before, legendre = np.ones_like(cosine), cosine.copy()
    slope_before, slope = np.zeros_like(cosine), np.ones_like(cosine)
    for n in range(1, count + 1):
        # tau_n = cos P_n' - (2 cos P_n' - n (n + 1) P_n), as `slope` is P_n' and thus pi_n.
        tau = n * (n + 1) * legendre - cosine * slope
        factor = (2 * n + 1) / (n * (n + 1))
        plus[n - 1], minus[n - 1] = factor * (slope + tau), factor * (slope - tau)
        # P'_{n+1} = P'_{n-1} + (2n + 1) P_n
        slope_before, slope = slope, slope_before + (2 * n + 1) * legendre
        legendre_before, legendre = (
            legendre,
            ((2 * n + 1) * cosine * legendre - n * legendre_before) / (n + 1),
        )
    return plus, minus


CUT = 5.0  #: angle below which the modified phase function has no peak [degrees]


@dataclass(frozen=True)
class DropletTable:
    """Values and slopes at equally spaced w."""

    entries: Array  #: p and dp/dw times the spacing, in turn [1], (2 entries,)
    peak: float  #: E = tan(angle/2) at which p has fallen to half of its forward value
    terms: int  #: of the series


@lru_cache(maxsize=16)
def droplet_table(
    radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55
) -> DropletTable:
    """Return the table of droplets; parameters, errors and times as of `droplet_series`."""
    series = droplet_series(radius, gamma, wavelength)
    entries = 8  # for each term of the series (module docstring, last paragraph)
    cells = entries * len(series.cosines)
    w = np.linspace(0.0, 1.0, cells + 1)
    angle = 2 * np.arctan2(w, 1 - w)
    values, slopes = np.empty_like(w), np.empty_like(w)
    # 1024 angles at a time bound the matrix of all cosines.
    for start in range(0, len(w), 1024):
        part = slice(start, start + 1024)
        values[part], slopes[part] = series.values(angle[part]), series.slopes(angle[part])
    # dp/d(angle) d(angle)/dw, times the spacing of w: what Hermite's cubic takes in a cell.
    slopes *= 2 / (w * w + (1 - w) ** 2) / cells
    # The first angle at which the peak has fallen to half.
    half = angle[np.argmax(values < 0.5 * values[0])]
    return DropletTable(
        np.stack([values, slopes], axis=1).ravel(), float(np.tan(0.5 * half)), len(series.cosines)
    )


def fraction_cut(radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55) -> float:
    """Return the fraction of the light [1] below `CUT`, which the modified phase function lacks."""
    return droplet_series(radius, gamma, wavelength).fraction_below(np.deg2rad(CUT))
