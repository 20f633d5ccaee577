# SPDX-License-Identifier: BSD-3-Clause
import copy
import json
import re
import time
from pathlib import Path

import pytest

from analytic.errors import InputError
from reports.commands.main import run
from validation.frames.baseline_files import (
    ERRORS,
    FIRST,
    FOLDER,
    SCHEMA,
    SIZE,
    baseline_path,
    changelog_line,
    compare_baseline,
    read_baseline,
    stray_baselines,
    updated,
    write_baseline,
)
from validation.scenes.registry import FOG_SCENES

CHANGELOG = Path(__file__).parents[3] / "CHANGELOG.md"


def baseline(revision=None):
    """A baseline by hand: one configuration with a surface, one that is refused."""
    numbers = dict.fromkeys(ERRORS, 1e-3) | {"mean": 0.2, "max": 0.4, "nonfinite": 0, "negative": 5}
    entry = {"airlight": numbers, "surface": {"relative_rmse": 1e-6, "max": 2e-6, "nonfinite": 0}, "frame_ratio": 2.0}
    data = {
        "schema": SCHEMA,
        "scene": "fog",
        "size": [64, 48],
        "truth": {"airlight": {"mean": 0.2}, "surface": {"mean": 0.0}},
        "configurations": {"good (exact)": entry, "bad (exact)": {"refused": "a sphere has no edges"}},
    }
    return data | ({} if revision is None else {"revision": revision, "because": FIRST})


def changed(path, value):
    """A baseline with another value, by the keys that lead to it; a function is given the old value."""
    data = copy.deepcopy(baseline())
    *keys, last = path
    place = data
    for key in keys:
        place = place[key]
    place[last] = value(place[last]) if callable(value) else value
    return data


AIRLIGHT = ("configurations", "good (exact)", "airlight")


def test_the_same_numbers_did_not_move():
    assert compare_baseline(baseline(1), baseline()) == []


@pytest.mark.parametrize("factor", [0.97, 1.03])
@pytest.mark.parametrize("name", ["mean", "relative_rmse", "relative_bias", "p50", "p99"])
def test_errors_are_compared_both_ways(name, factor):
    (move,) = compare_baseline(baseline(1), changed((*AIRLIGHT, name), lambda old: factor * old))
    assert (move.label, move.what) == ("good (exact)", f"airlight {name}")
    assert move.new == pytest.approx(factor * move.old)
    assert move.allowed < abs(move.new - move.old)
    assert compare_baseline(baseline(1), changed((*AIRLIGHT, name), lambda old: old * (1 + (factor - 1) / 2))) == []


def test_the_largest_error_has_twice_the_band():
    assert compare_baseline(baseline(1), changed((*AIRLIGHT, "max"), lambda old: 1.03 * old)) == []
    assert len(compare_baseline(baseline(1), changed((*AIRLIGHT, "max"), lambda old: 1.05 * old))) == 1


def test_rounding_moves_nothing():
    place = ("configurations", "good (exact)", "surface", "relative_rmse")
    assert compare_baseline(baseline(1), changed(place, 2.2e-6)) == []
    assert len(compare_baseline(baseline(1), changed(place, 3e-6))) == 1


@pytest.mark.parametrize(("name", "value", "count"), [("nonfinite", 1, 1), ("negative", 8, 0), ("negative", 9, 1)])
def test_counts(name, value, count):
    # A thousandth of 3072 pixels, and 2 % of 5.
    assert len(compare_baseline(baseline(1), changed((*AIRLIGHT, name), value))) == count


def test_a_number_that_is_none_moved():
    assert len(compare_baseline(baseline(1), changed((*AIRLIGHT, "p99"), None))) == 1
    assert compare_baseline(changed((*AIRLIGHT, "p99"), None), changed((*AIRLIGHT, "p99"), None)) == []


def test_the_truth_has_no_band_but_rounding():
    place = ("truth", "airlight", "mean")
    assert compare_baseline(baseline(1), changed(place, 0.2 * (1 + 1e-6))) == []
    (move,) = compare_baseline(baseline(1), changed(place, 0.2 * (1 + 2e-5)))
    assert move.what == "truth of the airlight mean"


def test_frames_fail_from_three_times_on_and_only_when_slower():
    place = ("configurations", "good (exact)", "frame_ratio")
    assert compare_baseline(baseline(1), changed(place, 5.9)) == []
    assert compare_baseline(baseline(1), changed(place, 0.1)) == []
    (move,) = compare_baseline(baseline(1), changed(place, 6.1))
    assert move.what == "frames of unshadowed (exact) a frame"
    untimed = changed(place, None)
    assert compare_baseline(baseline(1), untimed) == []


def test_a_missing_baseline_fails():
    (move,) = compare_baseline(None, baseline())
    assert "airlight baselines --update" in move.what


def test_configurations_and_baselines_without_each_other_fail():
    fewer = baseline()
    del fewer["configurations"]["good (exact)"]
    assert [difference.what for difference in compare_baseline(baseline(1), fewer)] == [
        "a baseline without its configuration"
    ]
    assert [difference.what for difference in compare_baseline(fewer, baseline())] == [
        "a configuration without baseline"
    ]


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("size",), [32, 24], "size: [64, 48] before, [32, 24] now"),
        (("configurations", "bad (exact)"), {"airlight": {}}, "refused: a sphere has no edges before, None now"),
    ],
)
def test_what_else_moves(path, value, words):
    assert words in [difference.what for difference in compare_baseline(baseline(1), changed(path, value))]


def test_files_are_small_text_with_a_number_on_a_line(tmp_path):
    path = write_baseline(baseline(1), tmp_path)
    assert path == baseline_path("fog", tmp_path)
    assert read_baseline("fog", tmp_path) == baseline(1)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert '    "relative_rmse": 0.001' in [line.rstrip(",") for line in lines]
    keys = [line.split('"')[1] for line in lines if re.match(r' {4}"', line)]
    assert keys[: len(ERRORS)] == sorted(ERRORS)
    assert read_baseline("hall", tmp_path) is None
    assert stray_baselines(["hall"], tmp_path) == ["fog"]


@pytest.mark.parametrize(
    ("text", "message"), [("{", "not valid JSON"), ('{"schema": "other/3"}', "the schema is 'other/3'")]
)
def test_what_is_no_baseline_is_refused(tmp_path, text, message):
    baseline_path("fog", tmp_path).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_baseline("fog", tmp_path)


def test_an_update_without_reason_is_refused_and_nothing_to_update_is_said():
    assert updated(baseline(1), baseline(), None) is None
    moved = changed((*AIRLIGHT, "p99"), 0.5)
    with pytest.raises(InputError, match=r"1 numbers of fog moved; say why with --because"):
        updated(baseline(1), moved, "  ")


def test_an_update_raises_the_revision_and_keeps_what_did_not_move():
    moved = changed((*AIRLIGHT, "p99"), 0.5)
    moved["configurations"]["new (exact)"] = {"airlight": {"mean": 0.2000001}}
    moved["truth"]["airlight"]["mean"] = 0.2000001  # rounding
    other = baseline(3)
    other["configurations"]["other (exact)"] = {"airlight": {"mean": 0.2}}
    moved["configurations"]["other (exact)"] = {"airlight": {"mean": 0.2000001}}
    data = updated(other, moved, "Edges are\n  sharper")
    assert data["revision"] == 4
    assert data["because"] == "Edges are sharper"
    assert data["configurations"]["good (exact)"]["airlight"]["p99"] == 0.5
    assert data["configurations"]["other (exact)"] == {"airlight": {"mean": 0.2}}
    assert "new (exact)" in data["configurations"]
    assert changelog_line(data) == "Baselines of `fog`, revision 4: Edges are sharper."


def test_a_time_stays_where_none_was_taken():
    moved = changed((*AIRLIGHT, "p99"), 0.5)
    del moved["configurations"]["good (exact)"]["frame_ratio"]
    assert updated(baseline(1), moved, "why")["configurations"]["good (exact)"]["frame_ratio"] == 2.0


def test_the_first_revision_needs_no_reason():
    data = updated(None, baseline(), None)
    assert (data["revision"], data["because"]) == (1, FIRST)


@pytest.mark.parametrize("name", FOG_SCENES)
def test_the_changelog_names_every_revision(name):
    data = read_baseline(name)
    assert data is not None, f"no baseline of {name}: write one with `airlight baselines {name} --update`"
    assert data["revision"] >= 1
    said = " ".join(CHANGELOG.read_text(encoding="utf-8").split())
    assert data["revision"] == 1 or changelog_line(data) in said, f"CHANGELOG.md must say: {changelog_line(data)}"


@pytest.mark.parametrize("name", FOG_SCENES)
def test_files_hold_what_they_should(name):
    data = read_baseline(name)
    assert data["scene"] == name
    assert tuple(data["size"]) == SIZE
    for label, entry in data["configurations"].items():
        assert "refused" in entry or set(entry["airlight"]) == set(ERRORS), label
        assert "refused" in entry or entry["airlight"]["nonfinite"] == 0, label


def test_no_baseline_has_lost_its_scene():
    assert stray_baselines(FOG_SCENES) == []
    assert FOLDER.is_dir()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["open-fgo"], "did you mean 'open-fog'?"),
        (["open-fog", "--because", "x"], "--because is for --update"),
    ],
)
def test_wrong_words_are_refused(arguments, message, capsys):
    assert run(["baselines", *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.fixture
def measured(monkeypatch, tmp_path):
    """The command with a folder of its own, and without the work; returns what it will find, to be changed."""
    import reports.machine.environment
    import validation.frames.baseline_files
    import validation.frames.baseline_runs

    measurement = baseline() | {"scene": "open-fog"}
    monkeypatch.setattr(reports.machine.environment, "activate", lambda: "llvm_ad_rgb")
    monkeypatch.setattr(
        validation.frames.baseline_runs, "measure_baseline", lambda name, **_: copy.deepcopy(measurement)
    )
    monkeypatch.setattr(validation.frames.baseline_files, "FOLDER", tmp_path)
    for name in ("read_baseline", "write_baseline"):
        function = getattr(validation.frames.baseline_files, name)
        monkeypatch.setattr(
            validation.frames.baseline_files, name, lambda scene, function=function: function(scene, tmp_path)
        )
    return measurement


def test_the_command_from_the_first_baseline_to_a_moved_one(measured, tmp_path, capsys):
    assert run(["baselines", "open-fog"]) == 1
    assert "no baseline" in capsys.readouterr().out
    assert run(["baselines", "open-fog", "--update"]) == 0
    capsys.readouterr()
    assert run(["baselines", "open-fog"]) == 0
    assert "open-fog: 2 configurations, 0 moved" in capsys.readouterr().out

    measured["configurations"]["good (exact)"]["airlight"]["p99"] = 0.5
    assert run(["baselines", "open-fog", "--json"]) == 1
    (move,) = json.loads(capsys.readouterr().out)["moves"]["open-fog"]
    assert (move["what"], move["old"], move["new"]) == ("airlight p99", 0.001, 0.5)
    assert run(["baselines", "open-fog", "--update"]) == 2
    assert "say why with --because" in capsys.readouterr().err
    assert read_baseline("open-fog", tmp_path)["revision"] == 1

    assert run(["baselines", "open-fog", "--update", "--because", "Edges are blunter"]) == 0
    out = capsys.readouterr().out
    assert "0.5" in out
    assert "- Baselines of `open-fog`, revision 2: Edges are blunter." in out
    assert run(["baselines", "open-fog", "--update"]) == 0
    assert "nothing moved, nothing written" in capsys.readouterr().out


def test_a_frame_that_seems_too_slow_is_timed_again(monkeypatch):
    import numpy as np

    from validation.frames import baseline_runs

    tries, times = [], iter([0.09, *[0.09, 0.01] * 2, *[0.02, 0.01] * 2])
    monkeypatch.setattr(baseline_runs, "_frame", lambda renderer: lambda: tries.append(renderer))
    monkeypatch.setattr(baseline_runs, "_processor_time", lambda work: next(times))
    monkeypatch.setattr(baseline_runs, "_LEAST", 2)
    monkeypatch.setattr(baseline_runs, "_TRIES", (0.0, 0.0, 0.0))
    assert baseline_runs._frame_ratio("one", "yardstick", 3.0) == {"frame_ratio": 2.0}
    assert tries == ["one", "yardstick"] * 4  # two turns of warm-up in each of two tries
    times = iter([0.09, *[0.09, 0.01] * 2])
    assert baseline_runs._frame_ratio("one", "yardstick", np.inf) == {"frame_ratio": 9.0}
    times = iter([2.0])
    assert baseline_runs._frame_ratio("one", "yardstick", np.inf) == {}


def test_processor_time_is_that_of_the_work(variant):
    from validation.frames.baseline_runs import _processor_time

    assert _processor_time(lambda: time.sleep(0.05)) < 0.04  # waiting costs nothing
    assert _processor_time(lambda: sum(range(1_000_000))) > 0.001
