# SPDX-License-Identifier: BSD-3-Clause
"""The documentation's numbers come from a report, whole or not at all."""

import json
from pathlib import Path

import pytest

from analytic.errors import InputError
from realtime.methods.registry import FOG_METHODS
from reports.docs.data import refresh
from tests.evidence import baselines
from tests.helpers.reports import checked, entry, refused, report_of, scene, timing
from validation.configurations.methods import STANDARD, chosen_configurations

ROOT = Path(__file__).resolve().parents[3]


def stale_scenes(kept):
    """Return a line for each scene whose numbers are older than the accuracy baselines.

    The images of the documentation are larger than those of the baselines, so errors cannot be compared one by one.
    But whatever moves an error gives the baseline of its scene a new revision, and a report notes the revision with
    which it was measured. Which configurations there are, and which of them a scene refuses, must agree as well; what a
    report has no time for is none of these.
    """
    stale = []
    standard = {configuration.label for configuration in STANDARD}
    known = {configuration.label for configuration in chosen_configurations(list(FOG_METHODS))}
    for row in kept["scenes"]:
        name, baseline = row["name"], baselines.read_baseline(row["name"])
        if baseline is None:
            stale.append(f"{name}: there is no such scene any more")
            continue
        if row.get("baseline") != baseline["revision"]:
            measured, now = row.get("baseline"), baseline["revision"]
            stale.append(f"{name}: measured with revision {measured} of its baseline, now it is {now}")
        kept = {label: entry.get("refused") for label, entry in baseline["configurations"].items() if label in standard}
        shown = {entry["label"]: entry["refused"] for entry in row["methods"] if not entry.get("left_out")}
        waited = {entry["label"] for entry in row["methods"]} - set(shown)
        differs = [label for label in kept if label not in waited and kept[label] != shown.get(label, "absent")]
        stale += [f"{name}: {label} is not what it was" for label in differs]
        stale += [f"{name}: {label} is gone" for label in shown if label not in known]
    return stale


def method(label, relative_rmse=0.01, **changes):
    files = {"picture": "open-fog/a.png", "error": "open-fog/b.png"}
    return entry(label, relative_rmse, files=files) | changes


def report(**changes):
    methods = [
        method("unshadowed (taylor)"),
        method("unshadowed (exact)", 1e-6),
        refused("min-max (exact)", "not in this fog"),
        method("mine.py:march", kind="function"),
    ]
    files = {"picture": "open-fog/a.png", "exr": "open-fog/a.exr", "airlight": "open-fog/b.png"}
    fog = scene("open-fog", methods, size=[4, 1], files=files)
    claims = [{"kind": "truth", "text": "All is well.", "good": True}]
    return checked(report_of([fog, {**fog, "name": "own", "path": "own.xml"}], claims=claims)) | changes


@pytest.fixture
def folder(tmp_path):
    target = tmp_path / "results"
    target.mkdir()
    (target / "report.json").write_text(json.dumps(report()))
    return target


def test_a_report_is_kept_without_what_is_not_shown(variant, folder, tmp_path):
    data = tmp_path / "data"
    written = refresh(data, report=folder)
    assert {path.name for path in written} == {path.name for path in data.iterdir()}
    kept = json.loads((data / "report.json").read_text())
    assert kept["schema"] == "airlight-docs/1"
    assert kept["claims"] == ["All is well."]
    (scene,) = kept["scenes"]  # the user's own is nobody's documentation, and so is his method
    assert [shown["method"] for shown in scene["methods"]] == ["unshadowed", "unshadowed", "min-max"]
    assert scene["counts"] == {"shapes": 0, "triangles": 0, "lights": 1}
    assert scene["baseline"] == baselines.read_baseline("open-fog")["revision"]
    assert scene["methods"][2]["refused"] == "not in this fog"
    assert set(scene["methods"][0]["times"]) == {"frame", "airlight", "light_moved"}


def test_costs_of_kernels_come_and_stay(variant, folder, tmp_path):
    data, costs = tmp_path / "data", tmp_path / "kernels.json"
    row = {"kernel": "taylor-4", "family": "taylor", "size": 4, "phase": "isotropic", "g": 0.0, "rays": 9}
    row |= {
        "device": None,
        "wall": timing(2.0),
        "median": 1e-3,
        "p99": 1.0,
        "max": 9.0,
        "nonfinite": 0,
        "refused": None,
    }
    content = {"environment": report()["environment"], "kernels": {"costs": [row], "levels": []}, "convergence": []}
    costs.write_text(json.dumps(content))
    refresh(data, kernels=costs)
    refresh(data, report=folder)
    kept = json.loads((data / "report.json").read_text())["kernels"]["costs"]
    assert [cost["kernel"] for cost in kept] == ["taylor-4"]
    costs.write_text("{}")
    with pytest.raises(InputError, match=r"kernels.json.*bench --kernels --json"):
        refresh(data, kernels=costs)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"schema": "airlight-report/9"}', "wanted 'airlight-report/2'"),
        ("[1]", "has no schema"),
        ("{", "is not valid JSON"),
    ],
)
def test_what_is_no_report_is_refused(content, words, folder, tmp_path):
    (folder / "report.json").write_text(content)
    with pytest.raises(InputError, match=words):
        refresh(tmp_path / "data", report=folder)
    with pytest.raises(InputError, match="No such file"):
        refresh(tmp_path / "data", report=tmp_path / "nowhere")
    assert not (tmp_path / "data").exists()


@pytest.fixture(scope="module")
def committed():
    return json.loads((ROOT / "docs/data/report.json").read_text(encoding="utf-8"))


def test_the_numbers_of_the_documentation_are_not_older_than_the_baselines(committed):
    stale = stale_scenes(committed)
    assert not stale, "\n".join(
        [*stale, "run `airlight report -o DIR` on a quiet machine, `airlight docs --report DIR`"]
    )


def test_stale_numbers_are_told(monkeypatch):
    """An older revision of a baseline, a refusal that is gone, a configuration too many, too few."""
    label = "min-max (exact)"
    accurate, refused = {"airlight": {"relative_rmse": 0.01}}, {"refused": "no such light"}
    configurations = {"unshadowed (exact)": accurate, label: refused, "unshadowed (uniform)": accurate}
    baseline = {"revision": 3, "configurations": configurations}
    monkeypatch.setattr("tests.evidence.baselines.read_baseline", lambda name: baseline if name == "windows" else None)
    # Kernels that only baselines measure are not asked for.
    methods = [{"label": "unshadowed (exact)", "refused": None}, {"label": label, "refused": "no such light"}]
    fresh = {"name": "windows", "baseline": 3, "methods": methods}

    def told(**changes):
        return stale_scenes({"scenes": [fresh | changes]})

    assert told() == []
    assert told(baseline=2) == ["windows: measured with revision 2 of its baseline, now it is 3"]
    assert told(methods=[methods[0], methods[1] | {"refused": None}]) == [f"windows: {label} is not what it was"]
    assert told(methods=methods[:1]) == [f"windows: {label} is not what it was"]
    assert told(methods=[*methods, {"label": "new", "refused": None}]) == ["windows: new is gone"]
    assert told(methods=[*methods, {"label": "froxel-fog", "refused": None}]) == []  # reports have it, baselines not
    late = {"label": label, "refused": "not measured: a frame would take 29 s", "left_out": True}
    assert told(methods=[methods[0], late]) == []
    assert told(name="nowhere") == ["nowhere: there is no such scene any more"]
