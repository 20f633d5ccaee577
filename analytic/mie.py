# SPDX-License-Identifier: BSD-3-Clause
"""Scattering of a plane wave by a homogeneous sphere (Mie 1908), in NumPy.

A sphere of radius r has the size x = 2 pi r / wavelength and the refractive index m = n + i k
relative to its surroundings, k >= 0 where it absorbs. With the Riccati-Bessel functions psi_n(x) =
x j_n(x), chi_n(x) = -x y_n(x) and xi_n = psi_n - i chi_n, and the logarithmic derivative D_n =
psi_n'/psi_n, the fields outside have the coefficients (Bohren and Huffman 1983, eq. 4.88)

    a_n = [(D_n(m x)/m + n/x) psi_n(x) - psi_{n-1}(x)] / [(D_n(m x)/m + n/x) xi_n(x) - xi_{n-1}(x)]
    b_n = [(m D_n(m x) + n/x) psi_n(x) - psi_{n-1}(x)] / [(m D_n(m x) + n/x) xi_n(x) - xi_{n-1}(x)].

**Recurrences.** psi and chi obey f_{n+1} = (2n + 1)/x f_n - f_{n-1} (eq. 4.83). Upwards chi grows
and is stable; psi falls beyond n = x and takes up an error of about epsilon chi_n, which is epsilon
in a_n. D_n is stable downwards (eq. 4.89), D_{n-1} = n/z - 1/(D_n + n/z): a step divides an error
by (D_n + n/z)^2, which is about 1 up to n = |z| and grows beyond. The transition is |z|^(1/3) wide,
so the start, from zero, is eight such widths beyond |z| and 16 terms more. (Bohren and Huffman's
own program starts at |z| + 15; *measured*, that loses 1e-5 of Q_ext at x = 100, m = 1.33.)

**Terms.** The coefficients fall fast beyond n = x; Wiscombe (1980, Appl. Opt. 19, 1505) found the
numbers of terms that serve, x + 4 x^(1/3) + 1 up to x = 8, x + 4.05 x^(1/3) + 2 up to 4200, x + 4
x^(1/3) + 2 above.

**Sums** (eqs 4.61, 4.62, 4.82, p. 120). With Q the cross section over pi r^2,

    Q_ext  = 2/x^2 sum (2n + 1) Re(a_n + b_n)              Q_sca = 2/x^2 sum (2n + 1) (|a_n|^2 + |b_n|^2)
    Q_back = 1/x^2 |sum (2n + 1) (-1)^n (a_n - b_n)|^2
    g Q_sca = 4/x^2 [sum n (n + 2)/(n + 1) Re(a_n a*_{n+1} + b_n b*_{n+1}) + sum (2n + 1)/(n (n + 1)) Re(a_n b*_n)].

**Angles** (eqs 4.47, 4.74). With pi_n = P_n^1/sin and tau_n = dP_n^1/d theta,

    S_1 = sum (2n + 1)/(n (n + 1)) (a_n pi_n + b_n tau_n)        S_2 = the same with a_n and b_n exchanged

    pi_n = (2n - 1)/(n - 1) cos pi_{n-1} - n/(n - 1) pi_{n-2}    tau_n = n cos pi_n - (n + 1) pi_{n-1},

and unpolarised light is scattered as 2 (|S_1|^2 + |S_2|^2) / (x^2 Q_sca), whose
mean over the sphere is 1.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Efficiencies:
    """Cross sections of spheres over their geometric cross sections; arrays
    of the shape of the sizes.
    """

    extinction: Array  #: Q_ext [1]
    scattering: Array  #: Q_sca [1]
    back: Array  #: Q_back [1], Bohren and Huffman's radar back scattering over pi r^2
    g: Array  #: mean cosine of the scattering angle [1]


def terms(size: float) -> int:
    """Return how many terms a sphere of a size x [1] needs (Wiscombe 1980)."""
    root = size ** (1 / 3)
    if size <= 8:
        return int(size + 4 * root + 1)
    return int(size + (4.05 if size < 4200 else 4.0) * root + 2)


def coefficients(size: ArrayLike, index: complex) -> tuple[Complex, Complex]:
    """Return the coefficients a_n and b_n of spheres [1], (terms, sizes) each; row n - 1 holds n.

    `size`: x = 2 pi r / wavelength of each sphere [1], (sizes,); `index`: m = n + i k, the
    refractive index relative to the surroundings [1], k >= 0. Raises InputError for a size outside
    1e-6 to 2e4 or an index that is no refractive index.

    Valid for all numbers that are not refused. Beyond the number of terms that a sphere needs
    (`terms`) its coefficients are 0.
    """
    x, m = checked(size, index)
    # All spheres share arrays that are as long as the largest needs.
    counts = np.array([terms(each) for each in x])
    count = int(counts.max())
    # Without absorption m x is real, and so is the whole recurrence of D_n.
    inner = m if m.imag else m.real
    derivative = _logarithmic_derivative(count, inner * x)
    a = np.zeros((count, len(x)), dtype=np.complex128)
    b = np.zeros_like(a)
    # psi_0 and psi_{-1}, chi_0 and chi_{-1}, with which the upward recurrences start.
    psi, psi_before = np.sin(x), np.cos(x)
    chi, chi_before = np.cos(x), -np.sin(x)
    for n in range(1, count + 1):
        # A sphere that has all of its terms rests at psi = 0 and chi = 1, as its chi would grow
        # until it overflows.
        needed = counts >= n
        psi, psi_before = np.where(needed, (2 * n - 1) / x * psi - psi_before, 0.0), psi
        chi, chi_before = np.where(needed, (2 * n - 1) / x * chi - chi_before, 1.0), chi
        xi, xi_before = psi - 1j * chi, psi_before - 1j * chi_before
        # The brackets of a_n and of b_n in eq. 4.88.
        electric, magnetic = derivative[n] / inner + n / x, derivative[n] * inner + n / x
        a[n - 1] = np.where(
            needed, (electric * psi - psi_before) / (electric * xi - xi_before), 0.0
        )
        b[n - 1] = np.where(
            needed, (magnetic * psi - psi_before) / (magnetic * xi - xi_before), 0.0
        )
    return a, b


def efficiencies(size: ArrayLike, index: complex) -> Efficiencies:
    """Return the efficiencies and mean cosines of spheres.

    Parameters, refused numbers and validity are as for `coefficients`; the digits of published
    values are met for sizes up to 1e4.
    """
    x, _ = checked(size, index)
    return summed(x, *coefficients(x, index))


def summed(x: Array, a: Complex, b: Complex) -> Efficiencies:
    """Return the efficiencies of spheres of sizes x, (sizes,) [1], from their
    coefficients, (terms, sizes) each.
    """
    n = np.arange(1, len(a) + 1)[:, None]
    extinction = 2 * np.sum((2 * n + 1) * (a + b).real, axis=0) / x**2
    scattering = 2 * np.sum((2 * n + 1) * (np.abs(a) ** 2 + np.abs(b) ** 2), axis=0) / x**2
    # 1 - 2 (n % 2) is (-1)^n.
    back = np.abs(np.sum((2 * n + 1) * (1 - 2 * (n % 2)) * (a - b), axis=0)) ** 2 / x**2
    # The first sum of g Q_sca pairs n with n + 1, so that it has one term less.
    neighbours = (a[:-1] * a[1:].conj() + b[:-1] * b[1:].conj()).real
    n_less = n[:-1]
    asymmetry = np.sum(n_less * (n_less + 2) / (n_less + 1) * neighbours, axis=0)
    asymmetry += np.sum((2 * n + 1) / (n * (n + 1)) * (a * b.conj()).real, axis=0)
    return Efficiencies(extinction, scattering, back, 4 * asymmetry / x**2 / scattering)


def angular_functions(cos_scatter: Array, count: int) -> tuple[Array, Array]:
    """Return pi_n and tau_n [1] at cosines of the scattering angle, (count, cosines)
    each; row n - 1 holds n.
    """
    pi = np.empty((count, len(cos_scatter)))
    tau = np.empty_like(pi)
    # pi_0 = 0 and pi_1 = 1; the recurrence begins with n = 2.
    pi_before, pi_n = np.zeros_like(cos_scatter), np.ones_like(cos_scatter)
    for n in range(1, count + 1):
        if n > 1:
            pi_before, pi_n = pi_n, ((2 * n - 1) * cos_scatter * pi_n - n * pi_before) / (n - 1)
        pi[n - 1] = pi_n
        tau[n - 1] = n * cos_scatter * pi_n - (n + 1) * pi_before
    return pi, tau


def intensities(a: Complex, b: Complex, pi: Array, tau: Array) -> Array:
    """Return |S_1|^2 + |S_2|^2 [1] of spheres, (sizes, cosines).

    `a`, `b`: of `coefficients`, (terms, sizes) each; `pi`, `tau`: of `angular_functions`, at least
    as many terms, (terms or more, cosines) each.
    """
    n = np.arange(1, len(a) + 1)[:, None]
    weight = (2 * n + 1) / (n * (n + 1))
    # S_1 + S_2 takes a + b with pi + tau, S_1 - S_2 takes a - b with pi - tau, and the two squares
    # add up to 2 (|S_1|^2 + |S_2|^2).
    plus, minus = ((weight * each).T for each in (a + b, a - b))
    sums, differences = pi[: len(a)] + tau[: len(a)], pi[: len(a)] - tau[: len(a)]
    total = np.zeros((len(plus), pi.shape[1]))
    # pi and tau are real: the real and the imaginary part of an amplitude are real products.
    for amplitudes, functions in ((plus, sums), (minus, differences)):
        for part in (amplitudes.real, amplitudes.imag):
            total += np.square(np.ascontiguousarray(part) @ functions)
    return 0.5 * total


def checked(size: ArrayLike, index: complex) -> tuple[Array, complex]:
    """Return sizes [1] and a refractive index [1] that can be computed with.

    Raises InputError as `coefficients` does.
    """
    largest = 2e4  # up to which the recurrences were tried
    x = np.atleast_1d(np.asarray(size, dtype=np.float64))
    if not x.size or not np.all((x >= 1e-6) & (x <= largest)):
        raise InputError(
            f"the size 2 pi r/wavelength is {size!r}; expected numbers from 1e-6 to {largest:g}"
        )
    m = complex(index)
    if (
        not (math.isfinite(m.real) and math.isfinite(m.imag) and m.real > 0 and m.imag >= 0)
        or m == 1
    ):
        raise InputError(
            f"the refractive index is {index}; expected n + ik with n > 0 and k >= 0, not 1 "
            "(absorption is positive k)"
        )
    return x, m


def _logarithmic_derivative(count: int, z: NDArray[Any]) -> NDArray[Any]:
    """Return D_n(z) for n = 0 to count, (count + 1, sizes)."""
    # The start: eight widths |z|^(1/3) of the transition beyond |z|, or the last term that is
    # needed, and 16 terms more, in which an error of the zero there dies out.
    widths, margin = 8.0, 16
    largest = float(np.abs(z).max())
    start = max(count, int(largest + widths * largest ** (1 / 3))) + margin
    derivative = np.zeros((count + 1, len(z)), dtype=z.dtype)
    d_n = np.zeros_like(z)
    for n in range(start, 0, -1):
        # D_{n-1} = n/z - 1/(D_n + n/z), eq. 4.89.
        d_n = n / z - 1 / (d_n + n / z)
        if n - 1 <= count:
            derivative[n - 1] = d_n
    return derivative
