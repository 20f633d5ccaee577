# SPDX-License-Identifier: BSD-3-Clause
"""`airlight sweep`: what becomes of each cell is counted, said and kept; what went
wrong is computed again.

The workers are a stub, which ends each task as the test says:
`tests/reports/cluster` has the processes.
"""

import json
from contextlib import contextmanager

import pytest

pytest.importorskip("distributed", reason="the extra `sweep` is not installed")

from airlight.reports.cluster.cells import row_without_numbers, times_of
from airlight.reports.cluster.run import Outcome
from airlight.reports.commands.main import run
from airlight.validation.study.row import FRAME_MS

STUDY = """
scenes = ["open-fog", "omni-box"]
sizes = ["16x12"]
methods = ["unshadowed", "ray-march"]
times = "{}"
"""


class Workers:
    """Stubs of a cluster and of what it makes of tasks: done, unless `ends` has a
    status for a method or a kind.
    """

    def __init__(self, folder):
        self.folder, self.ends, self.places, self.seen = folder, {}, [], []

    @contextmanager
    def connected(self, place, *, quick=False):
        self.places.append((place, quick))
        yield self

    def run_groups(self, cluster, groups, *, made, retries):
        assert cluster is self
        for group in groups:
            for task in group.tasks:
                yield self.outcome(task)
                self.seen.append((self.folder / "sweep.parquet").exists())

    def outcome(self, task):
        if task.function is times_of:
            status = self.ends.get("times", "done")
            values = {key: {FRAME_MS: 1.5, "cost.alone": True} for key in task.arguments[0]}
            return Outcome(task, status, values if status == "done" else None, f"why {status}")
        cell, key = task.arguments
        status = self.ends.get(cell.chosen.method, "done")
        done = Outcome(task, status, reason=None if status == "done" else f"why {status}")
        return Outcome(task, status, row_without_numbers(cell, key, done), done.reason, attempts=2)


@pytest.fixture
def workers(variant, tmp_path, monkeypatch):
    stub = Workers(tmp_path / "rows")
    monkeypatch.setattr("airlight.reports.cluster.connect.connected", stub.connected)
    monkeypatch.setattr("airlight.reports.cluster.run.run_groups", stub.run_groups)
    monkeypatch.chdir(tmp_path)
    return stub


@pytest.fixture
def sweep(workers, tmp_path, capsys):
    """Sweep the study; return the outcome as text, or as JSON."""
    path = tmp_path / "small.toml"
    path.write_text(STUDY.format("none"))

    def run_command(*words, status=0):
        assert run(["sweep", str(path), "-o", str(workers.folder), *words]) == status
        printed = capsys.readouterr().out
        return json.loads(printed)["result"] if "--json" in words else printed

    return run_command


def rows(folder):
    return [json.loads(line) for line in (folder / "sweep.jsonl").read_text().splitlines()]


@pytest.mark.claim(
    "sweeps-go-on", tolerance="none: a row for every cell, none twice, none computed again"
)
def test_every_cell_becomes_a_row_and_the_same_study_computes_none_again(sweep, workers):
    printed = sweep("--cluster", "local:3")
    assert printed.splitlines() == [
        f"{workers.folder}: 4 cells of 2 scenes",
        "  0 were there, 4 computed, 0 left",
        "  done: 4",
        f"  rows in {workers.folder / 'sweep.parquet'}",
        f"  what they say: airlight sweep --from {workers.folder}",
    ]
    assert workers.places == [(3, True)]  # images that nobody times are compiled quickly
    found = [
        (row["scene"], row["method"], row["study"], row["attempts"]) for row in rows(workers.folder)
    ]
    assert found == [
        (scene, name, "small", 2)
        for scene in ("open-fog", "omni-box")
        for name in ("unshadowed", "ray-march")
    ]
    again = sweep("--json")
    assert (again["cached"], again["computed"], again["left"], again["counts"]) == (4, 0, 0, {})
    assert len(workers.places) == 1


@pytest.mark.parametrize("status", ["failed", "hung", "aborted"])
def test_cells_that_went_wrong_are_named_end_with_one_and_are_computed_again(
    sweep, workers, status
):
    workers.ends["ray-march"] = status
    printed = sweep(status=1)
    assert f"  {status}: 2\n" in printed
    assert f"  {status}: open-fog, ray-march: why {status}\n" in printed
    wrong = [row for row in rows(workers.folder) if row["method"] == "ray-march"]
    assert [row["reason"] for row in wrong] == [f"why {status}"] * 2
    # Without a date an older row of the cell, by other code, would count in its place.
    assert all(row["origin.started"].startswith("20") for row in wrong)
    workers.ends.clear()
    again = sweep("--json")
    assert (again["cached"], again["computed"], again["counts"], again["problems"]) == (
        2,
        2,
        {"done": 2},
        [],
    )


def test_a_refusal_is_a_result(sweep, workers):
    workers.ends["ray-march"] = "refused"
    data = sweep("--json")
    assert (data["counts"], data["problems"], data["left"]) == ({"done": 2, "refused": 2}, [], 0)
    assert sweep("--json")["cached"] == 4


def test_cells_that_are_lost_with_the_scheduler_are_left_and_make_no_row(sweep, workers):
    workers.ends["ray-march"] = "lost"
    data = sweep("--json", status=1)
    assert (data["computed"], data["left"], len(data["problems"])) == (2, 2, 2)
    assert {row["method"] for row in rows(workers.folder)} == {"unshadowed"}
    workers.ends["unshadowed"] = "lost"
    (workers.folder / "rows.sqlite").unlink()
    (workers.folder / "sweep.parquet").unlink()
    printed = sweep(status=1)
    assert "  0 were there, 0 computed, 4 left\n" in printed
    assert "rows in" not in printed  # there is none
    assert not (workers.folder / "sweep.parquet").exists()


def test_rows_can_be_read_while_others_are_computed(sweep, workers, monkeypatch):
    sweep()
    assert workers.seen == [False] * 4  # a small sweep is written once
    (workers.folder / "rows.sqlite").unlink()
    (workers.folder / "sweep.parquet").unlink()
    workers.seen.clear()
    monkeypatch.setattr("airlight.reports.api.sweep._EVERY", -1.0)
    sweep()
    assert workers.seen == [True] * 4


@pytest.mark.claim("sweep-timed-alone", tolerance="none")
def test_images_are_timed_by_one_process_after_all_errors(sweep, workers, tmp_path):
    (tmp_path / "small.toml").write_text(STUDY.format("alone"))
    workers.ends["times"] = "hung"
    printed = sweep("--cluster", "local:3", status=1)
    assert "  hung: open-fog, times of 2 methods: why hung\n" in printed
    assert workers.places == [(3, True), (1, False)]  # alone, and compiled as users run it
    assert [row.get(FRAME_MS) for row in rows(workers.folder)] == [None] * 4
    workers.ends.clear()
    assert "  4 were there, 0 computed, 0 left\n  4 timed alone\n" in sweep()
    assert {(row[FRAME_MS], row["cost.alone"]) for row in rows(workers.folder)} == {(1.5, True)}


def test_without_a_study_a_number_of_random_scenes_is_swept_into_a_folder_of_its_name(
    workers, tmp_path, capsys
):
    workers.ends["unshadowed"] = "refused"
    assert run(["sweep", "2", "--cluster", "local:1", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)["result"]
    assert (data["study"], data["scenes"], data["output"]) == ("random-2", 2, "sweep-random-2")
    assert data["cells"] == len(rows(tmp_path / "sweep-random-2")) > 2 * 8
    assert {row["seed"] for row in rows(tmp_path / "sweep-random-2")} == {0, 1}
