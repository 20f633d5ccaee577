# SPDX-License-Identifier: BSD-3-Clause
import pytest

from tests.helpers.reports import sampled, times
from validation.statistics.noise import (
    ERROR_TOLERANCE,
    FLOORS,
    ROUNDING,
    error_band,
    other_power,
    slower_stages,
    spread,
)


def test_the_band_of_an_error_is_relative_plus_rounding():
    assert error_band("relative_rmse", 0.1) == pytest.approx(0.1 * ERROR_TOLERANCE + 24 * ROUNDING)
    assert error_band("relative_bias", -0.1) == error_band("relative_bias", 0.1)
    assert error_band("max", 0.1) == pytest.approx(0.2 * ERROR_TOLERANCE + FLOORS["max"])
    assert error_band("p99", 0.0) == FLOORS["p99"]


def test_spread_is_the_geometric_mean_of_the_quartiles():
    wide = {"median_ms": 1.0, "low_ms": 1.0, "high_ms": 4.0, "repetitions": 9}
    quiet = {"median_ms": 1.0, "low_ms": 1.0, "high_ms": 1.0, "repetitions": 9}
    assert spread([{"frame": wide, "airlight": quiet}]) == pytest.approx(2.0)
    # A single repetition, and what is shorter than a launch, say nothing of the machine.
    assert spread([{"frame": wide | {"repetitions": 1}, "surface": wide | {"median_ms": 0.002}}]) == 1.0
    assert spread([]) == 1.0


def test_more_work_is_seen_in_all_that_contains_it():
    old, new = times(1.0), times(1.0)
    for stage in ("airlight", "frame", "light_moved", "objects_moved"):
        new[stage] = sampled([old[stage]["median_ms"] + 0.7] * 20)
    assert slower_stages(old, new, least=1.25, scale=1.0) == ["airlight", "frame"]
    assert slower_stages(old, new, least=1.1, scale=1.0) == ["airlight", "frame", "light_moved", "objects_moved"]
    assert slower_stages(new, old, least=1.1, scale=1.0) == []


@pytest.mark.parametrize(
    ("old", "new", "differs"),
    [
        ((0.5, 0.01), (0.69, 0.01), 0.0),  # a fifth
        ((0.5, 0.01), (0.72, 0.01), 0.22),
        ((0.72, 0.01), (0.5, 0.01), -0.22),
        ((0.5, 0.06), (0.72, 0.08), 0.0),  # three standard errors are 0.3
        ((0.5, None), (0.72, None), 0.22),  # two steps lie on a line
        ((None, None), (0.72, 0.01), 0.0),  # one step has no power
    ],
)
def test_another_power_is_beyond_tolerance_and_scatter(old, new, differs):
    fits = [{"exponent": exponent, "standard_error": error} for exponent, error in (old, new)]
    assert other_power(*fits) == pytest.approx(differs)
