# SPDX-License-Identifier: BSD-3-Clause
import json

from reports.commands.main import DONE, WRONG_INPUT, run
from validation.certified import generate as certified_fog


def test_writes_the_file(tmp_path, monkeypatch, data_folder, capsys):
    """With the data taken from the file: to compute it takes ten minutes, which a slow test does."""
    text = (data_folder / "certified_fog.json").read_text()
    told = []

    def data(*, progress):
        progress(0.5, "thin-open")
        told.append(progress)
        return json.loads(text)

    monkeypatch.setattr(certified_fog, "certified_data", data)
    target = tmp_path / "fog.json"
    assert run(["certify", "-o", str(target)]) == DONE
    assert target.read_text() == text
    assert told
    assert capsys.readouterr().out == f"{target}: 12 scenes, 768 rays\n"


def test_a_place_that_cannot_be_written_costs_no_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(certified_fog, "certified_data", lambda **_: 1 / 0)
    assert run(["certify", "-o", str(tmp_path)]) == WRONG_INPUT
    assert "is a folder" in capsys.readouterr().err
