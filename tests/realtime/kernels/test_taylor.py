# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `taylor` is the integral of the series about the foot, and `taylor-printed` differs by the misprints alone."""

from functools import partial

import mpmath
import numpy as np
import pytest

from analytic.phase import PhaseFunction
from realtime.kernels.exact import exact
from realtime.kernels.taylor import PRINTED_PHASES, taylor
from tests.helpers.kernel_values import kernel_values

pytestmark = pytest.mark.usefixtures("variant")

N = 2147483673
taylor_printed = partial(taylor, printed=True)

#: What the print has too much, before e^-a and before the division by the mean: DESIGN section 3, printed - derived.
EXCESS = {
    ("isotropic", 2): lambda a: (a**2 - a) / 2,
    ("isotropic", 3): lambda a: -2 * a / 3,
    ("rayleigh", 2): lambda a: 3 * a / 8,
    ("hazy", 1): lambda a: np.full_like(a, 9 / 36 + 9 / 32),
    ("hazy", 2): lambda a: 265 * a**2 / 512,
    ("murky", 1): lambda a: 2 * N * a / 2**31 - 25 / 367108864 + 25 / 67108864,
}
MEANS = {"isotropic": 1.0, "rayleigh": 1.0, "hazy": 2.0, "murky": 83 / 33}


def rays_near_the_foot():
    rng = np.random.default_rng(2)
    foot, height, sigma_t = rng.uniform(0.3, 3, 200), rng.uniform(0.2, 2, 200), rng.uniform(0, 1, 200)
    x0 = foot + height * rng.uniform(-1.2, 0.2, 200)
    return foot, height, x0, x0 + height * rng.uniform(0.01, 1, 200), sigma_t


@pytest.mark.claim("series-by-two-routes", tolerance="1e-12 relative")
@pytest.mark.parametrize("phase", ["isotropic", "rayleigh", "hazy", "murky", "hg"])
def test_it_is_the_integral_of_the_series(phase):
    """Against mpmath: its own Taylor series of the integrand, integrated term by term in 30 digits."""
    g, (t, h, x0, x1, sigma_t) = 0.37, (1.3, 0.7, 0.0, 2.9, 0.43)
    value = kernel_values(taylor, (t, h, x0, x1, sigma_t), phase, g, precision="double")[0]
    with mpmath.workdps(30):
        p = PhaseFunction(phase, g=g if phase == "hg" else 0.0)

        def integrand(theta):
            return mpmath.exp(-sigma_t * h * (mpmath.sin(theta) + 1) / mpmath.cos(theta)) * p.mp(-mpmath.sin(theta))

        series = mpmath.taylor(integrand, 0, 4)
        low, high = mpmath.atan2(x0 - t, h), mpmath.atan2(x1 - t, h)
        total = sum(c * (high ** (n + 1) - low ** (n + 1)) / (n + 1) for n, c in enumerate(series))
        expected = float(total * mpmath.exp(-sigma_t * t) / h)
    assert value == pytest.approx(expected, rel=1e-12)  # float64 rounding of a dozen operations


@pytest.mark.claim("taylor-near-the-foot")
def test_it_converges_to_the_integral_near_the_foot():
    ray = (1.0, 2.0, 0.3, 1.9, 0.3)
    true = kernel_values(exact, ray, precision="double")[0]
    errors = [abs(kernel_values(taylor, ray, precision="double", degree=n)[0] / true - 1) for n in (2, 4, 8, 16)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-7
    # Far from it degree 4 is wrong by more than the light itself.
    far = (1.0, 1.0, 8.0, 60.0, 0.3)
    degree_4, true = (kernel_values(kernel, far, precision="double")[0] for kernel in (taylor, exact))
    assert abs(degree_4 / true - 1) > 0.1


@pytest.mark.parametrize("name", PRINTED_PHASES)
def test_it_differs_from_taylor_by_the_integral_of_the_misprints(name):
    rays = foot, height, x0, x1, sigma_t = rays_near_the_foot()
    a, low, high = sigma_t * height, np.arctan2(x0 - foot, height), np.arctan2(x1 - foot, height)
    terms = [f(a) * (high ** (n + 1) - low ** (n + 1)) / (n + 1) for (p, n), f in EXCESS.items() if p == name]
    expected = sum(terms) * np.exp(-sigma_t * foot - a) / height / MEANS[name]
    printed, derived = (kernel_values(kernel, rays, name, precision="double") for kernel in (taylor_printed, taylor))
    # differences of numbers of order 1, whose rounding is 1e-16
    np.testing.assert_allclose(printed - derived, expected, rtol=1e-11, atol=1e-14)
    assert np.max(np.abs(printed - derived)) > 1e-2
