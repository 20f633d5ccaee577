# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from tests.helpers.calibration import power
from validation.statistics.p_values import binomial_p, sidak, student_quantile


def test_power_of_no_effect_is_the_level():
    for freedom in (3.0, 15.0, np.inf):
        assert power(0.0, freedom) == pytest.approx(0.05, rel=1e-9)
        assert power(0.0, freedom, 0.01) == pytest.approx(0.01, rel=1e-9)


@pytest.mark.claim("detectable-bias")
def test_power_of_the_detectable_effect_is_ninety_percent():
    assert power(1.959964 + 1.281552, np.inf) == pytest.approx(0.9, abs=1e-6)
    assert power(-1.959964 - 1.281552, np.inf) == pytest.approx(0.9, abs=1e-6)
    # The shifted law that the detectable bias uses is near the non-central one from some dozens of batches on.
    for freedom, error in ((15.0, 0.02), (1000.0, 3e-4)):
        effect = student_quantile(0.975, freedom) + student_quantile(0.90, freedom)
        assert power(effect, freedom) == pytest.approx(0.9, abs=error)


def test_sidak_and_the_binomial_law_by_hand():
    assert sidak(0.01, 1) == pytest.approx(0.01, rel=1e-12)
    assert sidak(0.19, 2) == pytest.approx(0.1, rel=1e-12)
    assert binomial_p(0, 4, 0.5) == pytest.approx(2 / 16, rel=1e-12)
    assert binomial_p(4, 4, 0.5) == pytest.approx(2 / 16, rel=1e-12)
    assert binomial_p(2, 4, 0.5) == 1
