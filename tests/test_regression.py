# SPDX-License-Identifier: BSD-3-Clause
"""Is every method as accurate as it was? Every standard configuration of every scene against its baseline.

`airlight baselines` prints the same as a table; `airlight baselines --update --because ...` writes what moved.
"""

import pytest

from validation.frames.baseline_files import compare_baseline, read_baseline
from validation.frames.baseline_runs import measure_baseline
from validation.scenes.registry import FOG_SCENES

QUICK = ("open-fog", "sphere-spot")  # every method and every kernel; the other scenes take longer


@pytest.mark.claim("baselines", tolerance="the band of each number in its baseline")
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in FOG_SCENES]
)
def test_errors_are_those_of_the_baseline(name, variant):
    # Times are left to the command: a test may share the machine with others.
    moves = compare_baseline(read_baseline(name), measure_baseline(name, times=False))
    assert moves == [], "\n".join(str(move) for move in moves)


@pytest.mark.claim("baselines")
def test_a_fault_of_a_thousandth_is_found(monkeypatch, variant):
    import validation.configurations.methods
    from validation.frames import baseline_runs
    from validation.frames.baseline_runs import YARDSTICK

    find = validation.configurations.methods.find_kernel
    monkeypatch.setattr(
        validation.configurations.methods,
        "find_kernel",
        lambda name: lambda *args, **known: 1.001 * find(name)(*args, **known),
    )
    monkeypatch.setattr(baseline_runs, "baseline_configurations", lambda name, features: (YARDSTICK,))
    moves = compare_baseline(read_baseline("open-fog"), measure_baseline("open-fog", times=False))
    moved = {move.what: move for move in moves if move.label == YARDSTICK.label}
    assert moved["airlight relative_bias"].new == pytest.approx(1e-3, rel=1e-3)
    assert {"airlight relative_rmse", "airlight p50", "airlight p99", "airlight max"} <= set(moved)
    # What was not measured is missed too.
    assert {move.what for move in moves if move.label != YARDSTICK.label} == {"a baseline without its configuration"}
