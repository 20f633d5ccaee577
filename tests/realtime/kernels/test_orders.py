# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the error of a family of kernels falls with its size as its derivation says.

* Midpoint steps have order 2.
* Gauss's rule with n nodes on [m - H, m + H] has the rate rho^-2 a node, rho = |z + sqrt(z^2 - 1)|
  (the root for which rho > 1) and z = (s - m)/H for the singularity s with the least rho (Trefethen
  2013, *Approximation Theory and Approximation Practice*, theorem 19.3). In w = asinh(q/h) an
  isotropic vacuum has 1/cosh w, singular at +-i pi/2; in terms of theta, q/h = tan(theta/2 + pi/4).
  In the angle theta it is Henyey-Greenstein's 1 + g^2 + 2 g sin theta = 0, at s = -pi/2 +- i
  log(1/g) for g > 0; its power -3/2 there adds a factor N^(1/2) to the error.
* A Taylor series about theta = 0 has the rate |theta1|/|s| a degree, s the singularity closest to 0. The coefficients
  of (1 - theta/s)^(-3/2) grow like n^(1/2), which the integral divides by n: the error falls like N^(-1/2) q^N.

Complex singularities make the error swing below its envelope as N grows, at other N for other rays:
fitted is the largest error of rays that share the rate, at each size or any later one, in float64.
"""

import cmath
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from airlight.validation.study.configuration import find_kernel, sized
from tests.helpers.kernel_values import kernel_values, relative_error, true_values

G = np.linspace(0.45, 0.75, 7)
SINGULAR = -0.5 * math.pi + 1j * np.log(1 / G)  # of Henyey-Greenstein's function


def gauss_rate(singular, low, high):
    """By what factor a further node of Gauss's rule on [low, high] reduces the error."""
    z = (2 * singular - (low + high)) / (high - low)
    root = cmath.sqrt(z * z - 1)
    return max(abs(z + root), abs(z - root)) ** -2


def end_of_rate(singular, rate, begin=0.0):
    """The end of a range from `begin` on that has this rate: below 0 for a
    singularity there, else above.
    """
    side = -1.0 if singular.real < 0 else 1.0
    return brentq(
        lambda end: gauss_rate(singular, begin, end) - rate, begin + 0.01 * side, begin + 30 * side
    )


def between(theta0, theta1, sigma_t=0.0):
    """Segments between angles at a light that is 1 m from the ray, its foot 4 m from the camera."""
    return 4.0, 1.0, 4 + np.tan(theta0), 4 + np.tan(theta1), sigma_t


def panels():
    begin = np.linspace(0.05, 0.6, 7)
    end = np.array([end_of_rate(0.5j * math.pi, 0.24, each) for each in begin])
    return between(*(2 * np.arctan(np.sinh(w)) - 0.5 * math.pi for w in (begin, end)))


def envelope_of(kernel, sizes, rays, phase, g, power):
    expected = true_values(rays, phase, g)
    found = [
        relative_error(
            kernel_values(find_kernel(sized(kernel, n)), rays, phase, g, precision="double"),
            expected,
        ).max()
        for n in sizes
    ]
    found, sizes = np.array(found), np.array(sizes, dtype=float)
    counts = (found > 3e-12) & (
        found < 0.3
    )  # below, the reference and rounding count; above, nothing has converged yet
    assert counts.sum() > 2
    return sizes[counts], np.maximum.accumulate((found / sizes**power)[counts][::-1])[::-1]


@pytest.mark.claim("declared-orders")
@pytest.mark.parametrize("kernel", ["uniform", "equiangular"])
def test_midpoint_steps_have_order_2(variant, kernel):
    sizes, found = envelope_of(
        kernel, (32, 64, 128, 256), between(-0.9, 0.7, 0.4), "isotropic", 0.0, 0.0
    )
    # Nothing is random here; the next order is a hundredth of the first at 32 steps.
    assert -np.polyfit(np.log(sizes), np.log(found), 1)[0] == pytest.approx(2, rel=0.005)


# Errors swing about their envelope by the phase of the singularity: 4 % of a decade
# in three sizes, 1 in 60.
@pytest.mark.claim("declared-orders")
@pytest.mark.parametrize(
    ("kernel", "sizes", "rate", "power", "close"),
    [
        ("quadrature", range(4, 23, 2), 0.24, 0.0, 0.04),
        ("quadrature-theta", range(2, 11), 0.1, 0.5, 0.04),
        ("taylor", range(4, 33, 2), 0.7, -0.5, 0.02),
    ],
)
def test_the_rate_is_that_of_the_nearest_singularity(variant, kernel, sizes, rate, power, close):
    if kernel == "quadrature":
        rays, phase, g = panels(), "isotropic", 0.0
    elif kernel == "taylor":
        rays, phase, g = between(-0.7 * abs(SINGULAR), 0.0), "hg", G
    else:
        rays, phase, g = between([end_of_rate(s, 0.1) for s in SINGULAR], 0.0), "hg", G
    sizes, found = envelope_of(kernel, sizes, rays, phase, g, power)
    assert np.exp(np.polyfit(sizes, np.log(found), 1)[0]) == pytest.approx(rate, rel=close)


@pytest.mark.claim("declared-orders")
def test_a_table_is_interpolated_linearly(variant):
    """Long segments with ends all over the cells, so that its largest error is met; to
    a cell's place by chance.
    """
    u = np.random.default_rng(71).random((3, 2000))
    rays = between(-1.2 + 0.8 * u[0], 0.2 + 0.8 * u[1], 0.2 + 1.5 * u[2])
    sizes, found = envelope_of("table", (32, 64, 128, 256, 512), rays, "isotropic", 0.0, 0.0)
    assert -np.polyfit(np.log(sizes), np.log(found), 1)[0] == pytest.approx(2, abs=0.1)
