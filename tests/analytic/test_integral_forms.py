# SPDX-License-Identifier: BSD-3-Clause
"""The three adaptive forms against certified values, each other, and the corners of their domain."""

import math

import numpy as np
import pytest

from analytic.cases import read_cases
from analytic.phase import PhaseFunction
from tests.helpers.integral_forms import integrate_angle, integrate_distance, integrate_path

FORMS = [integrate_distance, integrate_angle, integrate_path]


@pytest.mark.claim("integral-certified", "integral-three-forms", tolerance="the estimate, 2e-11 relative at most")
@pytest.mark.parametrize("form", FORMS)
def test_certified_values(data_folder, form):
    cases = read_cases(data_folder / "airlight_integral.csv")
    # The tags come in turns of twelve and the phase functions at random: 41 is prime to both.
    rows = range(0, len(cases.phase), 41)
    assert len({cases.tag[row] for row in rows}) == 12
    for row in rows:
        phase = PhaseFunction(cases.phase[row], g=float(cases.g[row]))
        numbers = (getattr(cases, name)[row] for name in ("foot", "height", "x0", "x1", "sigma_t"))
        result = form(*map(float, numbers), phase)
        expected = cases.value[row]
        assert abs(result.value - expected) <= result.error, (cases.tag[row], row)
        assert result.error <= 2e-11 * expected, (cases.tag[row], row)  # the tolerance of 1e-11, and rounding


@pytest.mark.claim("integral-three-forms")
def test_the_forms_agree_where_no_table_reaches():
    rng = np.random.default_rng(17)
    phases = [
        PhaseFunction("tabulated", table=[1.0, 0.0, 3.0, 0.2, 9.0]),
        PhaseFunction("hg", g=-0.99),
        PhaseFunction("hg", g=0.99),
        PhaseFunction("murky"),
    ]
    for k in range(24):
        foot, height = rng.choice([-2.0, 0.0, 3.0, 50.0]), rng.choice([1e-12, 1e-3, 1.0, 100.0])
        x0 = rng.choice([0.0, 1.0, 10.0])
        x1 = x0 + rng.choice([1e-6, 0.5, 1e4, math.inf])
        sigma_t = rng.choice([0.0, 1e-6, 0.3, 2.0])
        inputs = (foot, height, x0, x1, sigma_t, phases[k % 4])
        a, b, c = (form(*inputs) for form in FORMS)
        assert abs(a.value - b.value) <= a.error + b.error, inputs
        assert abs(b.value - c.value) <= b.error + c.error, inputs
