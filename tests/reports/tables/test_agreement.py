# SPDX-License-Identifier: BSD-3-Clause
"""Whether a comparison confirms the truth, and that its table says so."""

import pytest

from reports.tables.agreement import agreement_table, verdict
from reports.tables.drawing import markdown


def compared(interval, *, equivalent=False, finished=True):
    statistics = {"equivalent": equivalent, "relative_bias": 0.001, "relative_bias_ci": interval, "margin": 0.005}
    sizes = {"width": 100, "height": 100, "batches": 10, "samples": 20, "uncorrected_bias": -0.002}
    return {"estimator": "volpath", "finished": finished, "statistics": statistics | {"detectable_bias": 1e-4}} | sizes


@pytest.mark.parametrize(
    ("comparison", "good", "words"),
    [
        (compared([-0.001, 0.003], equivalent=True), True, "yes"),
        (compared([-0.001, 0.03]), False, "NO"),
        (compared([-0.001, 0.03], finished=False), None, "not decided in time"),
        (compared([0.006, 0.03], finished=False), False, "NO"),  # outside as a whole
        (compared([None, None], finished=False), False, "NO"),
    ],
)
def test_the_verdict_stands_in_the_table(comparison, good, words):
    assert verdict(comparison) is good
    row = markdown(agreement_table("", [("fog, airlight", comparison)])).splitlines()[-1]
    low, high = comparison["statistics"]["relative_bias_ci"]
    interval = "-" if low is None else f"{100 * low:+.3f}..{100 * high:+.3f} %"
    shown = f"| fog, airlight | volpath | 2 M | +0.100 % | {interval} | 0.5 % | 0.01 % | -0.200 % | {words} |"
    assert row == shown
