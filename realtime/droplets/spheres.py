# SPDX-License-Identifier: BSD-3-Clause
"""The amplitudes of light that spheres without absorption scatter (Mie 1908), in real arithmetic.

`analytic.mie` has complex coefficients by Bohren and Huffman's recurrences. Here the coefficients are phase shifts (van
de Hulst 1957, section 10.21): for a real refractive index m and the size x = 2 pi r/wavelength,

    a_n = p_n/(p_n - i q_n),   p_n = psi_n'(y) psi_n(x) - m psi_n(y) psi_n'(x),   y = m x,
                               q_n = psi_n'(y) chi_n(x) - m psi_n(y) chi_n'(x),

and b_n with the factor m at the first terms, where psi_n(x) = x j_n(x) and chi_n(x) = -x y_n(x). Divided by psi_n(y),
each p and q needs the logarithmic derivative D = psi_n'(y)/psi_n(y) alone.

**Ratios.** R_n = psi_n/psi_{n-1} follows from the three-term recurrence as 1/R_n = (2n + 1)/x - R_{n+1}, stable
downwards for any start beyond the transition at n = x (Du 2004, Appl. Opt. 43, 1951, has it for y). Then psi_n'/psi_n =
1/R_n - n/x. chi_n is stable upwards. psi_n itself follows from both by the Wronskian

    psi_{n-1} chi_n - psi_n chi_{n-1} = 1:      psi_{n-1} = 1/(chi_n - R_n chi_{n-1}),

in which nothing cancels beyond n = x and no error is carried from one n to the next.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_WIDTHS, _MARGIN = 8.0, 20  # where downward recurrences start: widths x^(1/3) of the transition, and terms


def term_counts(size: Array) -> NDArray[np.int64]:
    """Return how many terms spheres of the sizes x >= 0.01 need (Wiscombe 1980), (sizes,)."""
    slope = np.where((size > 8) & (size < 4200), 4.05, 4.0)
    return np.floor(size + slope * np.cbrt(size) + np.where(size > 8, 2, 1)).astype(np.int64)


def phase_shift_coefficients(size: Array, index: float) -> tuple[Complex, Complex]:
    """Return a_n and b_n [1], (sizes, terms) each; column n - 1 holds n.

    `size`: x of each sphere [1], (sizes,); `index`: m, the real refractive index relative to the surroundings [1].

    Valid for sizes from 0.01 to 5000. Beyond a sphere's own number of terms its coefficients are 0.
    """
    counts = term_counts(size)
    count = int(counts.max())
    inner, outer = _ratios(index * size, count + 1), _ratios(size, count + 1)
    chi = np.empty((count + 1, len(size)))
    chi[0] = np.cos(size)
    before = -np.sin(size)  # chi_{-1}
    a, b = np.zeros((len(size), count), np.complex128), np.zeros((len(size), count), np.complex128)
    for n in range(1, count + 1):
        used = counts >= n
        chi[n], before = np.where(used, (2 * n - 1) / size * chi[n - 1] - before, 1.0), chi[n - 1]
        # The Wronskian for n, then psi_n by its ratio.
        psi = outer[n] / (chi[n] - outer[n] * chi[n - 1])
        psi_slope = psi * (1 / outer[n] - n / size)
        chi_slope = chi[n - 1] - n / size * chi[n]
        derivative = 1 / inner[n] - n / (index * size)
        for coefficient, first, second in ((a, 1.0, index), (b, index, 1.0)):
            p = first * derivative * psi - second * psi_slope
            q = first * derivative * chi[n] - second * chi_slope
            coefficient[used, n - 1] = (p / (p - 1j * q))[used]
    return a, b


def _ratios(argument: Array, count: int) -> Array:
    """Return R_n = psi_n/psi_{n-1} for n = 0 to count, (count + 1, sizes); row 0 is not used."""
    largest = float(argument.max())
    start = int(max(count, largest + _WIDTHS * largest ** (1 / 3))) + _MARGIN
    ratios = np.ones((count + 1, len(argument)))
    ratio = argument / (2 * start + 1)
    for n in range(start - 1, 0, -1):
        ratio = 1 / ((2 * n + 1) / argument - ratio)
        if n <= count:
            ratios[n] = ratio
    return ratios


def angular_factors(cosine: Array, count: int) -> tuple[Array, Array]:
    """Return (2n + 1)/(n (n + 1)) times pi_n + tau_n, and times pi_n - tau_n [1], (count, angles) each.

    Both obey recurrences of Legendre's derivatives: pi_n = P_n'(cos), and tau_n = cos pi_n - sin^2 P_n'' with sin^2
    P_n'' = 2 cos P_n' - n (n + 1) P_n.

    `cosine`: of the scattering angle, (angles,); `count`: largest n.
    """
    plus, minus = np.empty((count, len(cosine))), np.empty((count, len(cosine)))
    legendre_before, legendre = np.ones_like(cosine), cosine.copy()
    slope_before, slope = np.zeros_like(cosine), np.ones_like(cosine)
    for n in range(1, count + 1):
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
