# SPDX-License-Identifier: BSD-3-Clause
"""Claim: one command sweeps a study, a killed run goes on, and the same
study twice computes nothing.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="the extra `sweep` is not installed")

from airlight.validation.study.row import FRAME_MS
from airlight.validation.study.rows import ROWS, RowStore

ROOT = Path(__file__).resolve().parents[3]

STUDY = """
scenes = ["open-fog", "random:3"]
sizes = ["16x12"]
methods = ["unshadowed", "ray-march", "light-volumes"]
[parameters.ray-march]
steps = [4, 9]
[parameters.light-volumes]
map = 32
"""
COMMAND = [sys.executable, "-m", "airlight", "sweep"]


def _run(*words, **options):
    return subprocess.run(
        [*COMMAND, *map(str, words)], capture_output=True, text=True, timeout=900, **options
    )


def _rows(folder):
    import pyarrow.parquet as pq

    return pq.read_table(folder / "sweep.parquet").to_pylist()


def _has_a_row(folder, empty):
    """Return whether the file of a sweep that runs has grown, and its journal no longer
    has what would undo that.
    """
    rows, journal = folder / ROWS, folder / f"{ROWS}-journal"
    grown = rows.exists() and rows.stat().st_size > empty
    return grown and (not journal.exists() or not any(journal.read_bytes()[:8]))


@pytest.mark.slow
@pytest.mark.claim(
    "sweeps-go-on", tolerance="none: a row for every cell, none twice, none computed again"
)
def test_a_killed_sweep_goes_on_and_a_second_computes_nothing(tmp_path):
    study, folder = tmp_path / "study.toml", tmp_path / "rows"
    study.write_text(STUDY)
    begun = subprocess.Popen(
        [*COMMAND, study, "-o", folder, "--cluster", "local:1"], stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + 600
    with RowStore(tmp_path / "empty") as store:
        empty = store.path.stat().st_size
    while time.monotonic() < until and not _has_a_row(folder, empty):
        time.sleep(0.05)
    begun.send_signal(signal.SIGKILL)
    begun.wait()
    with RowStore(folder) as store:
        kept = {row["key"]: row["origin.started"] for row in store.rows()}
    assert 1 <= len(kept) <= 8
    ran = _run(study, "-o", folder, "--cluster", "local:2", "--json")
    assert ran.returncode == 0, ran.stderr
    summary = json.loads(ran.stdout)["result"]
    assert (summary["cells"], summary["cached"], summary["computed"], summary["left"]) == (
        8,
        len(kept),
        8 - len(kept),
        0,
    )
    rows = _rows(folder)
    assert len({row["key"] for row in rows}) == len(rows) == 8
    assert {row["status"] for row in rows} == {"done"}
    assert {
        key: value
        for key, value in ((row["key"], row["origin.started"]) for row in rows)
        if key in kept
    } == kept
    assert {row["seed"] for row in rows} == {None, 3}
    assert {row["properties.lights"] is None for row in rows} == {False}
    assert all(row["picture"][:4] == b"RIFF" for row in rows)
    again = json.loads(_run(study, "-o", folder, "--json").stdout)["result"]
    assert (again["cached"], again["computed"]) == (8, 0)
    assert _rows(folder) == rows


@pytest.mark.slow
@pytest.mark.claim("sweep-timed-alone", tolerance="none")
def test_times_of_a_process_alone_are_added_to_the_errors_of_all(tmp_path):
    study, folder = tmp_path / "study.toml", tmp_path / "rows"
    study.write_text(
        'times = "alone"\n' + STUDY.replace(', "light-volumes"', "").split("[parameters.light")[0]
    )
    summary = json.loads(_run(study, "-o", folder, "--cluster", "local:2", "--json").stdout)[
        "result"
    ]
    assert (summary["cells"], summary["computed"], summary["timed_alone"], summary["problems"]) == (
        6,
        6,
        6,
        [],
    )
    rows = _rows(folder)
    assert len({row["key"] for row in rows}) == len(rows) == 6
    assert {(row["status"], row["cost.alone"]) for row in rows} == {("done", True)}
    assert all(row[FRAME_MS] > 0 and row["error.p99"] is not None for row in rows)
    with RowStore(folder) as store:  # a run that ended between the errors and the times
        row = store.row(rows[0]["key"])
        store.add(row | {FRAME_MS: None, "cost.alone": None})
    again = json.loads(_run(study, "-o", folder, "--cluster", "local:2", "--json").stdout)["result"]
    # The three cells of its image: they are compared with one another, so
    # their times are of one run.
    assert (again["cached"], again["computed"], again["timed_alone"]) == (6, 0, 3)
    assert {row["cost.alone"] for row in _rows(folder)} == {True}


@pytest.mark.slow
@pytest.mark.claim("references-from-clusters", tolerance="none: byte for byte")
@pytest.mark.parametrize(
    "words",
    [["--estimator", "single-scatter", "--samples", "1280"], ["--estimator", "quadrature"]],
    ids=lambda words: words[1],
)
def test_a_reference_from_a_cluster_has_the_same_bytes(tmp_path, words):
    files = []
    for where in ([], ["--cluster", "local:2"]):
        file = tmp_path / f"{len(files)}.exr"
        command = [
            sys.executable,
            "-m",
            "airlight",
            "reference",
            "sphere-spot",
            "--size",
            "16x12",
            *words,
        ]
        environment = os.environ | {"AIRLIGHT_CACHE_DIR": str(tmp_path / f"cache-{len(files)}")}
        ran = subprocess.run(
            [*command, *where, "-o", str(file), "--json"],
            capture_output=True,
            text=True,
            timeout=900,
            env=environment,
        )
        assert ran.returncode == 0, ran.stderr
        files.append(file.read_bytes())
    assert files[0] == files[1]
    if words[1] == "single-scatter":
        assert json.loads(ran.stdout)["result"]["how"]["cached"] == 0
