# SPDX-License-Identifier: BSD-3-Clause
"""Claim: bias and noise of methods are told apart in one table, which methods without noise stand in."""

import math

import numpy as np
import pytest

import airlight
from realtime.kernels.exact import exact
from realtime.methods.unshadowed import unshadowed
from tests.helpers.api import TINY


def speckled(view, *, kernel=exact, bias=0.0):
    """All of the airlight, times a random number of each ray from 0 to 2."""
    return (1 + bias) * 2 * view.uniform()[0] * unshadowed(view, kernel=kernel)


speckled.noisy = True


@pytest.mark.claim("noise-methods")
def test_noise_and_bias_of_methods_are_told_apart(variant, tmp_path):
    runs = 24
    study = airlight.study(
        "noise", "open-fog", runs=runs, size=TINY, method=[airlight.configuration("unshadowed", "exact"), speckled]
    )
    still, noisy = study
    reference = airlight.reference("open-fog", size=TINY).airlight.astype(np.float64)
    assert still["runs"] == 1
    assert still["variance"] == 0
    assert still["relative_rmse"] < 1e-5  # float32 beside the light
    assert still["low_share"] is None
    # A number even in [0, 2] has the variance 1/3. All channels share it: values are a third as many.
    variance = np.mean(reference**2) / reference.mean() ** 2 / 3
    assert noisy["runs"] == runs
    assert abs(noisy["variance"] - variance) < 4 * noisy["variance_se"]
    assert abs(noisy["bias"]) < 4 * noisy["bias_se"]
    assert abs(noisy["squared_bias"]) < 4 * noisy["squared_bias_se"]
    assert noisy["efficiency"] == pytest.approx(1 / (noisy["variance"] * noisy["seconds"]))
    assert study.save(tmp_path / "noise.png").stat().st_size > 1000
    brighter = airlight.study("noise", "open-fog", runs=runs, size=TINY, method=speckled, settings="bias=0.5")[0]
    assert abs(brighter["bias"] - 0.5) < 4 * brighter["bias_se"]
    # The noise is that of the same random numbers, once and a half as large.
    assert math.sqrt(brighter["variance"] / noisy["variance"]) == pytest.approx(1.5, rel=1e-5)
    with pytest.raises(airlight.InputError, match="runs: got 1, wanted at least two"):
        airlight.study("noise", "open-fog", runs=1, size=TINY)
