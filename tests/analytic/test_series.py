# SPDX-License-Identifier: BSD-3-Clause
"""The power series: against mpmath's Taylor coefficients and the derived column
of the list of misprints.
"""

import numpy as np
import pytest

from airlight.analytic.phase import (
    Hazy,
    HenyeyGreenstein,
    Isotropic,
    Murky,
    Rayleigh,
    phase_from_words,
)
from airlight.analytic.series import taylor_coefficients

PHASES = [
    Isotropic(),
    Rayleigh(),
    Hazy(),
    Murky(),
    HenyeyGreenstein(0.57),
    HenyeyGreenstein(-0.88),
]


@pytest.mark.claim("series-by-two-routes", tolerance="1e-12 relative")
@pytest.mark.parametrize("phase", PHASES, ids=str)
@pytest.mark.parametrize("a", [0.0, 0.31, 4.7])
def test_against_mpmath(phase, a):
    import mpmath

    with mpmath.workdps(40):
        expected = mpmath.taylor(
            lambda theta: (
                mpmath.exp(a - a * mpmath.tan(theta / 2 + mpmath.pi / 4))
                * phase.mp(-mpmath.sin(theta))
            ),
            0,
            9,
        )
    # coefficients are sums of terms up to a^9/9!, of both signs
    np.testing.assert_allclose(
        taylor_coefficients(a, phase, 9), [float(c) for c in expected], rtol=1e-12, atol=1e-13
    )


A = np.array([0.0, 0.13, 1.9])


@pytest.mark.claim("errata-of-biri", tolerance="1e-14 relative")
@pytest.mark.parametrize(
    ("name", "mean", "order", "derived"),
    [
        ("isotropic", 1, 2, (A**2 - A) / 2),
        ("isotropic", 1, 3, -(A**3) / 6 + A**2 / 2 - A / 3),
        ("isotropic", 1, 4, A**4 / 24 - A**3 / 4 + 11 * A**2 / 24 - 5 * A / 24),
        ("rayleigh", 1, 2, 3 * A**2 / 8 - 3 * A / 8 + 3 / 4),
        ("hazy", 2, 1, -265 * A / 256 - 9 / 32),
        ("hazy", 2, 2, 265 * A**2 / 512 - 121 * A / 512 + 63 / 64),
        ("murky", 83 / 33, 1, -2147483673 * A / 2**31 - 25 / 67108864),
    ],
)
def test_derived_forms_of_what_is_printed_wrong(name, mean, order, derived):
    # Biri 2006, annex, as corrected in DESIGN section 3; hazy and murky there are
    # not divided by their means.
    ours = taylor_coefficients(A, phase_from_words(name)) * mean
    assert ours.shape == (3, 5)
    np.testing.assert_allclose(ours[:, order], derived, rtol=1e-14, atol=1e-15)
