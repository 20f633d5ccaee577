# SPDX-License-Identifier: BSD-3-Clause
"""The three adaptive forms against certified values, each other, and the corners of their domain."""

import math

import numpy as np
import pytest

from analytic.cases import read_cases
from analytic.errors import InputError
from analytic.phase import PhaseFunction
from tests.helpers.integral_forms import integrate_angle, integrate_distance, integrate_path

FORMS = [integrate_distance, integrate_angle, integrate_path]
ISOTROPIC = PhaseFunction("isotropic")


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


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("phase", [ISOTROPIC, PhaseFunction("hazy")], ids=["isotropic", "hazy"])
def test_a_ray_through_a_light_beside_the_segment(form, phase):
    # Before the light x + r = foot: J = exp(-sigma_t foot) p(1) (1/2 - 1/7).
    before = form(7.0, 0.0, 0.0, 5.0, 0.21, phase)
    expected = math.exp(-0.21 * 7) * float(phase(1.0)) * (1 / 2 - 1 / 7)
    assert abs(before.value - expected) <= before.error <= 1e-10 * expected
    # Behind it the path is 2 x - foot: in a vacuum J = p(-1) (1/1 - 0).
    behind = form(7.0, 0.0, 8.0, math.inf, 0.0, phase)
    assert behind.value == pytest.approx(float(phase(-1.0)), rel=1e-11)


@pytest.mark.parametrize("form", FORMS)
def test_empty_segments_infinite_values_and_darkness(form):
    assert form(3.0, 0.0, 3.0, 3.0, 0.1, ISOTROPIC).value == 0.0
    for ends in ((0.0, 9.0), (3.0, 9.0), (0.0, 3.0), (0.0, math.inf)):
        assert form(3.0, 0.0, *ends, 0.1, ISOTROPIC).value == math.inf
    dark = form(1e4, 1.0, 0.0, math.inf, 50.0, ISOTROPIC)
    assert dark.value == 0.0
    assert dark.error == 0.0


@pytest.mark.parametrize("form", FORMS)
def test_a_vacuum_without_end(form):
    result = form(2.0, 0.5, 0.0, math.inf, 0.0, ISOTROPIC)
    expected = (math.pi / 2 + math.atan(4.0)) / 0.5
    assert abs(result.value - expected) <= result.error <= 1e-10 * expected


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


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ((math.nan, 1.0, 0.0, 1.0, 0.1), "foot is nan"),
        ((1.0, -1.0, 0.0, 1.0, 0.1), "height is -1.0; wanted a number >= 0"),
        ((1.0, 1.0, 2.0, 1.0, 0.1), "x1 is 1.0; wanted a number >= x0 = 2.0, or inf"),
        ((1.0, 1.0, 0.0, math.nan, 0.1), "x1 is nan"),
        ((1.0, 1.0, 0.0, 1.0, math.inf), "sigma_t is inf"),
    ],
)
def test_refusals(form, inputs, message):
    with pytest.raises(InputError, match=message):
        form(*inputs, ISOTROPIC)
