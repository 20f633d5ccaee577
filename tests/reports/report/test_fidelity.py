# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report holds the verdicts whose experiments its effort measures, and measures them once."""

from dataclasses import replace

import pytest

from reports.report import fidelity
from reports.report.fidelity import fidelity_parts, fidelity_rows, measure_fidelity
from reports.report.papers import published_data
from tests.helpers.published import BILLETER, BIRI
from validation.fidelity.catalogue import EXPERIMENTS, ROWS, Experiment
from validation.frames.result_cache import CachedResult, result_cache
from validation.frames.scene_study import EFFORTS

MACHINE = {"processor": "abacus"}


@pytest.fixture
def cache(own_cache):
    return result_cache(MACHINE)


def names(effort, scenes, cache):
    parts = fidelity_parts(effort, scenes, cache)
    assert {part.kind for part in parts} <= {"fidelity"}
    return len(parts)


def test_efforts_measure_what_they_say(cache):
    measured = list(EXPERIMENTS.values())
    without_images = [experiment for experiment in measured if experiment.report and not experiment.images]
    reported = [experiment for experiment in measured if experiment.report]
    quick, default, full = (EFFORTS[name] for name in ("quick", "default", "full"))
    assert names(quick, quick.scenes, cache) == len(without_images) > 0
    assert names(default, default.scenes, cache) == names(full, full.scenes, cache) == len(reported) < len(measured)
    assert names(default, ["open-fog"], cache) == 0
    assert names(replace(quick, scenes=()), ["my-scene.xml"], cache) == 0


def kept(data):
    return CachedResult(data, {}, "2026-11-22 20:00:00 +0000", 1.0, False)


def test_rows_follow_the_results_of_a_run():
    equations = {"experiment": "nothing", "data": {}}
    rows = fidelity_rows({"fidelity": [kept(equations)]})
    assert {row["item"] for row in rows} == {row.item for row in ROWS if row.experiment == "nothing"}
    tables = fidelity_rows({"billeter": [kept(BILLETER)]})
    assert {row["item"] for row in tables} == {row.item for row in ROWS if row.experiment == "billeter tables"}
    assert fidelity_rows({}) == []


def test_published_figures_lie_beside_the_tables():
    data = published_data({"biri": [kept(BIRI | {"constant_distance": []})]})
    figures = {(figure["paper"], figure["item"]): figure for figure in data["figures"]}
    assert figures["biri", "Table 2, Fig. 7a, FPS"]["value"] == 23
    assert figures["billeter", "Fig. 7c, FPS"] == {
        "paper": "billeter",
        "item": "Fig. 7c, FPS",
        "claim": "light volume",
        "value": 96,
        "unit": "frames/s",
    }


def test_an_experiment_runs_once_for_all_its_rows_and_is_kept(cache, monkeypatch):
    runs = []

    def compute():
        runs.append(1)
        return {}

    monkeypatch.setattr(fidelity, "EXPERIMENTS", dict.fromkeys(EXPERIMENTS, Experiment(compute, 1.0, images=False)))
    rows = [row for row in ROWS if row.experiment == "nothing"]
    told = []
    for _ in range(2):
        results = measure_fidelity(rows, cache, quick=True, progress=lambda share, what: told.append(what))
        assert len(results) == len(rows) > 3
    assert runs == [1]
    assert told == ["nothing, claims of papers"]
    assert len(measure_fidelity(rows, replace(cache, fresh=True), quick=True)) == len(rows)
    assert len(runs) == 2
