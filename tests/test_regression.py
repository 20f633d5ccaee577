# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every method is as accurate as its baseline says, in every scene; a fault
of a thousandth is found.
"""

import copy

import pytest

from tests.evidence import baselines
from tests.evidence.baselines import (
    FOLDER,
    SCATTER_ONCE,
    compare_baseline,
    measure_baseline,
    read_baseline,
    updated,
)

QUICK = ("open-fog", "sphere-spot")  # every method and every kernel; the other scenes take longer


@pytest.mark.claim("baselines", tolerance="the band of each number in its baseline")
@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in SCATTER_ONCE
    ],
)
def test_errors_are_those_of_the_baseline(name, variant):
    moves = compare_baseline(read_baseline(name), measure_baseline(name))
    assert moves == [], "\n".join(str(move) for move in moves)


@pytest.mark.claim("baselines")
def test_a_fault_of_a_thousandth_is_found(monkeypatch, variant):
    import airlight.validation.study.configuration
    from airlight.realtime.kernels.registry import Kernel
    from airlight.validation.study.configuration import Configuration

    plain = Configuration("unshadowed", "exact")
    find = airlight.validation.study.configuration.find_kernel
    monkeypatch.setattr(
        airlight.validation.study.configuration,
        "find_kernel",
        lambda name: Kernel(name, lambda *arguments: 1.001 * find(name)(*arguments), exact=True),
    )
    monkeypatch.setattr(baselines, "baseline_configurations", lambda name, scene: (plain,))
    moves = compare_baseline(read_baseline("open-fog"), measure_baseline("open-fog"))
    moved = {move.what: move for move in moves if move.label == plain.label}
    assert moved["airlight relative_bias"].new == pytest.approx(1e-3, rel=1e-3)
    assert {"airlight relative_rmse", "airlight p50", "airlight p99", "airlight max"} <= set(moved)
    # Configurations that were not measured are missed, too.
    assert {move.what for move in moves if move.label != plain.label} == {
        "a baseline without its configuration"
    }


def test_every_scene_has_a_baseline_and_every_baseline_its_scene():
    assert {path.stem for path in FOLDER.glob("*.json")} == set(SCATTER_ONCE)
    for name in SCATTER_ONCE:
        data = read_baseline(name)
        assert data["scene"] == name
        assert data["because"]
        assert all(
            "refused" in e or e["airlight"]["nonfinite"] == 0
            for e in data["configurations"].values()
        )


LABEL = "unshadowed (uniform)"  # wrong by tens of per cent: far above the floor of rounding


@pytest.mark.parametrize(
    ("layer", "name", "factor", "moves"),
    [
        # The band of an average is 2 %, that of a maximum twice as wide; the reference has
        # none beyond its six digits.
        ("airlight", "p99", 0.97, 1),
        ("airlight", "p99", 1.03, 1),
        ("airlight", "p99", 1.01, 0),
        ("airlight", "max", 1.03, 0),
        ("airlight", "max", 1.05, 1),
        ("reference", "mean", 1 + 1e-6, 0),
        ("reference", "mean", 1 + 2e-5, 1),
    ],
)
def test_what_moves(layer, name, factor, moves):
    kept = read_baseline("open-fog")
    measured = copy.deepcopy(kept)
    place = (
        measured["reference"]["airlight"]
        if layer == "reference"
        else measured["configurations"][LABEL][layer]
    )
    place[name] *= factor
    assert len(compare_baseline(kept, measured)) == moves
    assert (updated(kept, measured, "why") is not None) == bool(moves)


def test_an_update_keeps_what_did_not_move():
    kept = read_baseline("open-fog")
    measured = copy.deepcopy(kept)
    for entry in measured["configurations"].values():
        if "airlight" in entry:
            entry["airlight"]["mean"] *= 1 + 1e-7  # rounding
    measured["configurations"][LABEL]["airlight"]["p99"] *= 2
    data = updated(kept, measured, "Edges are\n  sharper")
    assert (data["revision"], data["because"]) == (kept["revision"] + 1, "Edges are sharper")
    differ = [
        label
        for label, entry in data["configurations"].items()
        if entry != kept["configurations"][label]
    ]
    assert differ == [LABEL]
