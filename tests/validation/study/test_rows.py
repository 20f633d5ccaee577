# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a finished row is never lost and never there twice, whatever ends
the process or the disk.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from airlight.errors import InputError
from airlight.validation.study.rows import PICTURES, ROWS, RowStore

pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")


def row(key, status="done", **values):
    names = {"p99": "error.p99", "max": "error.max", "relative_rmse": "error.relative_rmse"}
    return {
        "key": key,
        "status": status,
        "label": "m",
        **{names.get(name, name): values[name] for name in values},
    }


def keys(folder):
    with RowStore(folder) as store:
        return [each["key"] for each in store.rows()]


def test_rows_stay_and_later_ones_replace(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a", p99=0.5))
        store.add(row("b", "hung"))
        store.add(row("b", max=0.25, picture=b"\x00\xff"))
        assert "b" in store
        assert (store.status("a"), store.status("b"), store.status("c")) == ("done", "done", None)
    with RowStore(tmp_path) as store:
        again = list(store.rows())
    assert [
        (each["key"], each["error.p99"], each["error.max"], each["picture"]) for each in again
    ] == [
        ("a", 0.5, None, None),
        ("b", None, 0.25, b"\x00\xff"),
    ]


KILLED = """
import os, sys
from pathlib import Path
from airlight.validation.study.rows import RowStore
with RowStore(Path(sys.argv[1])) as store:
    for key in "ab":
        store.add({"key": key, "status": "done", "picture": bytes(50_000)})
    os.kill(os.getpid(), 9)
"""


@pytest.mark.claim("sweeps-go-on", tolerance="none")
def test_what_was_added_outlives_a_killed_process(tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path)], cwd=Path(__file__).parents[3], check=False
    )
    assert ran.returncode == -9
    assert keys(tmp_path) == ["a", "b"]


@pytest.mark.claim("sweeps-go-on", tolerance="none")
def test_a_full_disk_leaves_what_was_there(tmp_path):
    """A file that may not grow stands for the disk."""
    resource = pytest.importorskip("resource", reason="Windows has no limit of the size of files")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with RowStore(tmp_path) as store:
        store.add(row("a"))
        size = (tmp_path / ROWS).stat().st_size
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        try:
            with pytest.raises(OSError, match=r"1 rows are kept: .*rows\.sqlite"):
                store.add(row("b", picture=bytes(100_000)))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        store.add(row("c"))
    assert keys(tmp_path) == ["a", "c"]


def test_one_run_at_a_time_writes(tmp_path):
    with RowStore(tmp_path), pytest.raises(InputError, match="another sweep writes into"):
        RowStore(tmp_path)
    assert keys(tmp_path) == []


def test_the_parquet_has_every_row_once_and_the_worst_pictures(tmp_path):
    import pyarrow.parquet as pq

    count = 2 * PICTURES
    with RowStore(tmp_path) as store:
        for number in range(count):
            store.add(row(f"{number:02d}", p99=0.0, picture=b"old"))
        for number in range(count):
            worst = {"relative_rmse": number / 10, "p99": number / 10, "max": number / 10}
            store.add(row(f"{number:02d}", picture=b"new", **worst, **{"properties.depth": 1.5}))
        store.add(row("none", "refused", reason="no", seed=2**40))
        table = pq.read_table(store.write_parquet())
        lines = store.write_json().read_text().splitlines()
    assert table["key"].to_pylist() == [*(f"{number:02d}" for number in range(count)), "none"]
    for line, kept in zip(lines, table.drop_columns(["picture"]).to_pylist(), strict=True):
        assert json.loads(line) == {
            name: value for name, value in kept.items() if value is not None
        }
    assert table["picture"].to_pylist() == [None] * (count - PICTURES) + [b"new"] * PICTURES + [
        None
    ]
    assert table["properties.depth"].to_pylist()[-2:] == [1.5, None]
    assert table["seed"].to_pylist()[-1] == 2**40
    assert table["error.p99"].null_count == 1
