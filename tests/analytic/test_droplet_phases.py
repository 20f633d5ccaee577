# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions of droplets by their names: means, moments, words, the same in mpmath, certified values, refusals."""

import numpy as np
import pytest
from mpmath import workdps

from analytic.errors import InputError
from analytic.phase import PhaseFunction, phase_from_words
from tests.evidence.certified.integral import integrate_certified
from tests.helpers.hg_draine import hg_draine_moments, legendre_moments
from validation.certified.files import certified_data
from validation.kernels.case_files import integrate_cases, read_cases

FILE = certified_data("airlight_integral_droplets.csv")


@pytest.mark.claim("hg-draine", tolerance="1e-8: quadrature across a peak of g = 0.99")
@pytest.mark.parametrize("diameter", [12, *(pytest.param(d, marks=pytest.mark.slow) for d in (5, 23.5))])
def test_hg_draine_has_mean_one_and_its_moments(diameter):
    phase = PhaseFunction("hg-draine", diameter=diameter)
    expected = legendre_moments(phase, 8, breaks=(1.0, 10.0), degree=2000)
    assert expected[0] == pytest.approx(1, abs=1e-8)
    assert hg_draine_moments(diameter, 8) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("words", ["hg-draine:5", "hg-draine:50", "mie:2:8", "mie-modified:2:8"])
def test_mpmath_twin_agrees(words):
    phase = phase_from_words(words)
    cosines = np.array([-1.0, -0.77, 0.0, 0.6, 0.99, 0.998, 1.0])
    with workdps(30):
        expected = [float(phase.mp(c)) for c in cosines]
    assert phase(cosines) == pytest.approx(expected, rel=2e-8, abs=1e-14)


@pytest.mark.claim("droplets-certified", tolerance="3e-8 relative: of the spline through Mie's series")
def test_certified_values():
    cases = read_cases(FILE)
    found, _ = integrate_cases(cases)
    assert found == pytest.approx(cases.value, rel=3e-8)
    lobes = np.array([name.startswith("hg-draine") for name in cases.phase])
    assert found[lobes] == pytest.approx(cases.value[lobes], rel=1e-10)


@pytest.mark.claim("droplets-certified", tolerance="1e-13: processors round the moments of Mie's series differently")
@pytest.mark.parametrize("number", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_a_certified_value_is_certified_again(number):
    header, *lines = FILE.read_text().splitlines()
    row = dict(zip(header.split(","), lines[number].split(",")))
    ray = (float(row[name]) for name in ("t", "h", "x0", "x1", "sigma_t"))
    again = integrate_certified(*ray, phase_from_words(row["phase"]), digits=18)
    assert float(again) == pytest.approx(float(row["value"]), rel=1e-13)


@pytest.mark.claim("droplets-refused")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("mie:51", "effective radius"),
        ("mie:6:2:0.55:3", "at most 3 numbers"),
        ("hg-draine:4.9", "5 to 50 um"),
        ("me", "no phase function is called 'me'"),
    ],
)
def test_wrong_words_are_refused(words, message):
    with pytest.raises(InputError, match=message):
        phase_from_words(words)
