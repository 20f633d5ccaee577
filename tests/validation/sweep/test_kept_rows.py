# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the rows that are kept in the repository are whole: every scene has all its cells, with numbers or why not."""

from collections import Counter
from pathlib import Path

import pytest

from validation.sweep.row import COLUMNS
from validation.sweep.study import read_study

pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")

FOLDER = Path(__file__).parents[3] / "validation" / "baselines" / "thousand"


def test_every_scene_has_all_its_cells():
    import pyarrow.parquet as pq

    study = read_study(FOLDER / "study.toml")
    table = pq.read_table(FOLDER / "sweep.parquet")
    columns = {name: table.column(name).to_pylist() for name in ("key", "scene", "label", "status", "reason", "source")}
    assert set(columns["status"]) == {"done", "refused"}
    assert all(reason for status, reason in zip(columns["status"], columns["reason"]) if status == "refused")
    assert len(set(columns["key"])) == len(columns["key"])
    assert len(set(columns["source"])) == 1
    cells = Counter(columns["scene"])
    assert set(cells) <= set(study.scene_names())
    # The run ended within one scene of each of its two workers.
    assert sum(count != study.cells_by_scene for count in cells.values()) <= 2
    assert len(cells) >= 550


def test_the_columns_are_those_of_today():
    import pyarrow.parquet as pq

    names = pq.read_schema(FOLDER / "sweep.parquet").names
    assert [name for name in names if not name.startswith("property.")] == [column.name for column in COLUMNS]
