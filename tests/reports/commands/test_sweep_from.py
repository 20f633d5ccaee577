# SPDX-License-Identifier: BSD-3-Clause
"""`airlight sweep --from DIR`: what a sweep says, from its Parquet alone, and how it refuses what is no sweep."""

import json

import pytest

from reports.commands.main import run
from reports.sweep.read import FILE
from tests.helpers.sweeps import METHODS, rows, write_rows


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with rows, and no figures: they take longer than everything else."""
    monkeypatch.setattr("reports.sweep.page.drawn_figures", lambda said: iter(()))
    write_rows(tmp_path / FILE, rows(30))
    return tmp_path


def test_page_and_claims_are_written_beside_the_rows(folder, capsys):
    assert run(["sweep", "--from", str(folder)]) == 0
    assert METHODS[0][0] in capsys.readouterr().out
    assert {path.name for path in folder.iterdir()} == {FILE, "sweep.html", "sweep.json"}


def test_json_holds_the_claims_and_is_what_is_written(folder, capsys):
    assert run(["sweep", "--from", str(folder / FILE), "--json", "-o", str(folder / "said")]) == 0
    data = json.loads(capsys.readouterr().out)
    assert len(data["claims"]) == 3 * len(METHODS)
    assert data == json.loads((folder / "said" / "sweep.json").read_text())
