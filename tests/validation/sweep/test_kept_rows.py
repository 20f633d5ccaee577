# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the rows that are kept in the repository are whole, and what they found is mended."""

from collections import Counter
from pathlib import Path

import pytest

from realtime.scene.read_scene import read_scene
from validation.sweep.row import COLUMNS
from validation.sweep.study import Cell, read_study
from validation.sweep.truth import cell_truth, load_cell
from validation.sweep.work import cell_row

pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")

FOLDER = Path(__file__).parents[3] / "validation" / "baselines" / "thousand"


def outside_of_bounds():
    """The cells that the sweep found outside of the bound of their method: scene and label."""
    import pyarrow.parquet as pq

    columns = pq.read_table(FOLDER / "sweep.parquet", columns=["scene", "label", "outside_bound"]).to_pylist()
    return [(row["scene"], row["label"]) for row in columns if row["outside_bound"]]


def test_every_scene_has_all_its_cells():
    import pyarrow.parquet as pq

    study = read_study(FOLDER / "study.toml")
    table = pq.read_table(FOLDER / "sweep.parquet")
    columns = {name: table.column(name).to_pylist() for name in ("key", "scene", "label", "status", "reason", "source")}
    assert set(columns["status"]) == {"done", "refused"}
    assert all(reason for status, reason in zip(columns["status"], columns["reason"]) if status == "refused")
    assert len(set(columns["key"])) == len(columns["key"])
    assert len(set(columns["source"])) == 1
    assert Counter(columns["scene"]) == dict.fromkeys(study.scene_names(), study.cells_by_scene)


def test_the_columns_are_those_of_today():
    import pyarrow.parquet as pq

    names = pq.read_schema(FOLDER / "sweep.parquet").names
    assert [name for name in names if not name.startswith("property.")] == [column.name for column in COLUMNS]


@pytest.mark.slow
@pytest.mark.claim("sweep-bounds", tolerance="no pixel of those scenes whose rows in the repository have some")
@pytest.mark.parametrize(("scene", "label"), outside_of_bounds())
def test_what_the_sweep_found_is_mended(variant, own_cache, scene, label):
    study = read_study(FOLDER / "study.toml")
    chosen = next(each for each in study.configurations if each.label == label)
    cell = Cell(scene, study.sizes[0], (), chosen, times="none")
    loaded = load_cell(cell.image)
    truth = cell_truth(loaded)
    row = cell_row(cell, read_scene(loaded.scene), truth, whole=loaded.scene, properties={})
    assert row["status"] == "done"
    assert row["outside_bound"] == 0
