# SPDX-License-Identifier: BSD-3-Clause
"""Claim: one thing that is changed in the shader of a real engine, from where that is right on, is
named first.

The captures need Chromium: here the record is read, and the tool runs with an engine that is not
there. `docs/tools/changed_shaders.py` makes the record.
"""

import importlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import airlight
from airlight.validation.engine.faults import FAULTS

TOOLS = Path(__file__).resolve().parents[3] / "docs/tools"
sys.path.insert(0, str(TOOLS))
changed_shaders = importlib.import_module("changed_shaders")
sys.path.remove(str(TOOLS))
NO_FAULT = changed_shaders.NO_FAULT


@pytest.mark.claim("diagnosis-engines")
def test_each_change_of_the_record_is_named_first():
    record = json.loads(changed_shaders.RECORD.read_text(encoding="utf-8"))
    assert record["schema"] == changed_shaders.SCHEMA
    assert [row["scene"] for row in record["base"]] == list(changed_shaders.SCENES)
    assert all(row["right"] and row["blocks"] < 0.01 for row in record["base"])
    assert [row["name"] for row in record["changes"]] == [
        change.name for change in changed_shaders.CHANGES
    ]
    for row, change in zip(record["changes"], changed_shaders.CHANGES, strict=True):
        assert row["first"] in change.names, row["headline"]
        assert row["injected"] == change.injected
    faulty = [row for row in record["changes"] if row["injected"] not in NO_FAULT]
    assert len(faulty) >= 10
    # The record has what was added to the base, and what was taken from it.
    by_name = {row["name"]: row for row in record["changes"]}
    assert by_name["no-light-path"]["without"] == [changed_shaders.LIGHT_PATH]
    assert by_name["no-4-pi"]["edits"] == ["volumetricFogLocalPS~12.56637~1.0"]


def test_each_change_differs_from_the_base_and_has_a_name_of_the_catalogue():
    names = {fault.name for fault in FAULTS}
    changes = changed_shaders.CHANGES
    assert len({change.name for change in changes}) == len(changes)
    for change in changes:
        assert change.injected in names or change.injected in NO_FAULT
        assert change.scene in changed_shaders.SCENES
        assert change.edits != changed_shaders.BASE or change.settings or change.changes
        assert all(edit.count("~") == 2 for edit in change.edits)


@pytest.fixture
def engine(monkeypatch, tmp_path):
    """Return what was asked of an engine that is not there; the diagnosis finds what it is told."""
    asked, found = [], {}

    def capture(name, scene, **how):
        asked.append((name, scene, how))
        return SimpleNamespace(engine="E", version="1", device="D", pixel="centre")

    def compare(scene, path, *, layer, diagnose=False, pixel=None):
        first = found.get(path.stem, "right")
        row = SimpleNamespace(words="words", together=())
        said = SimpleNamespace(
            first=first,
            ranked=(row,),
            lines=("file", "headline"),
            residual=0.1,
            left=0.01,
            rest="little",
            place="",
        )
        verdict = SimpleNamespace(right=first == "right", block_error=0.002, words="right")
        return SimpleNamespace(diagnoses=(said,), compared=SimpleNamespace(verdict=verdict))

    monkeypatch.setattr(airlight, "capture", capture)
    monkeypatch.setattr(airlight, "compare", compare)
    monkeypatch.setattr("airlight.reports.machine.environment.activate", lambda: None)

    def run(*words):
        out = tmp_path / "record.json"
        monkeypatch.setattr(sys, "argv", ["changed_shaders.py", "--out", str(out), *words])
        with pytest.raises(SystemExit) as ended:
            changed_shaders.main()
        return ended.value.code, json.loads(out.read_text(encoding="utf-8"))

    return SimpleNamespace(run=run, asked=asked, found=found)


def test_the_status_is_one_where_a_change_or_the_base_is_not_what_it_is(engine):
    engine.found |= {change.name: change.injected for change in changed_shaders.CHANGES}
    status, record = engine.run()
    assert status == 0
    assert (record["engine"], record["version"], record["device"]) == ("E", "1", "D")
    assert len(record["base"]) == 3
    assert len(record["changes"]) == len(changed_shaders.CHANGES)
    assert all("engine" not in row for row in (*record["base"], *record["changes"]))
    # The shadows of one scene need a setting, in its base and in its changes.
    settings = {how["output"].stem: how["settings"] for _, _, how in engine.asked}
    assert settings["base-colonnade"] == settings["g-sign"] == ("shadowResolution=4096",)
    # One that is wrong is told; others keep their rows, and the base does.
    engine.asked.clear()
    engine.found["green"] = "factor"
    status, record = engine.run("--only", "green")
    assert status == 1
    assert [scene for _, scene, _ in engine.asked] == ["sphere-spot"]
    by_name = {row["name"]: row for row in record["changes"]}
    assert (by_name["green"]["first"], by_name["green"]["right"]) == ("factor", False)
    assert by_name["no-shadow"]["right"]
    assert len(record["base"]) == 3
    engine.found |= {"green": "colour", "base-open-fog": "factor"}
    assert engine.run()[0] == 1
    # Half the resolution is no fault of physics: both names say so.
    assert engine.run("--only", "half-size")[0] == 0
    engine.found["half-size"] = "right"
    assert engine.run("--only", "half-size")[0] == 0
    engine.found["half-size"] = "extinction"
    assert engine.run("--only", "half-size")[0] == 1
