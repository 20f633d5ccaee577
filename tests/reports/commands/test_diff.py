# SPDX-License-Identifier: BSD-3-Clause
"""`airlight diff`: what is worse, what is better and what is not compared,
beyond the noise of a machine.
"""

import copy
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from airlight.reports.commands.main import run
from airlight.reports.diff import compare
from airlight.reports.diff.engines import _cell, _layer
from tests.helpers.reports import agreement, checked, errors, method, report, slow_down


def compare_reports(old, new):
    return compare.compare_reports(checked(old), checked(new))


def found(difference, verdict="worse"):
    return [finding for finding in difference.findings if finding.verdict == verdict]


def words(difference, verdict="worse"):
    chosen = found(difference, verdict)
    return [
        " ".join(part for part in (finding.scene, finding.method, finding.what) if part)
        for finding in chosen
    ]


@pytest.fixture
def files(tmp_path):
    """Return a function that writes two reports and returns their paths as
    words: a folder and a file.
    """

    def write(old, new):
        for name, data in (("old", old), ("new", new)):
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / "report.json").write_text(json.dumps(data), encoding="utf-8")
        return [str(tmp_path / "old"), str(tmp_path / "new" / "report.json")]

    return write


@pytest.mark.claim("diff")
def test_the_status_and_the_json_say_what_is_worse(files, capsys):
    assert run(["diff", *files(report(1), report(1))]) == 0
    assert "0 worse, 0 better" in capsys.readouterr().out
    new = report()
    method(new)["error"] = errors(3e-3)
    paths = files(report(), new)
    assert run(["diff", *paths, "--json"]) == 1
    data = json.loads(capsys.readouterr().out)["result"]
    assert {finding["what"] for finding in data["findings"]} >= {
        "relative_rmse",
        "relative_bias",
        "p50",
        "p99",
        "max",
    }
    assert data["worse"] == 5
    assert run(["diff", paths[1], paths[0]]) == 0
    assert "5 better" in capsys.readouterr().out
    method(new, "fog").update(
        status="refused", reason="expected a mesh [obj] in [0, 1]", times=None, error=None
    )
    assert run(["diff", *files(report(), new)]) == 1
    assert "expected a mesh [obj] in [0, 1]" in capsys.readouterr().out  # brackets are words


def test_a_folder_with_a_report_on_engines_too_is_refused_until_one_is_named(files, capsys):
    """Reports on engines were compared, and those on methods passed over in silence."""
    new = report()
    method(new)["error"] = errors(3e-3)
    old, file = files(report(), new)
    for folder in (Path(old), Path(file).parent):
        (folder / "engines.json").write_text("{}")
    assert run(["diff", old, file]) == 2
    said = f"{old} has two reports, on methods and on engines; name report.json or engines.json"
    assert said in capsys.readouterr().err
    assert run(["diff", str(Path(old) / "report.json"), file]) == 1


def test_errors_of_noisy_methods_are_compared_by_their_intervals():
    """Two runs of eight differ by their intervals; a single run, and its quantiles, say nothing."""
    runs = {
        "runs": 8,
        "rmse": 0.2,
        "rmse_within": 0.01,
        "bias": 1e-3,
        "bias_within": 2e-3,
        "root_bias": None,
        "most_bias": 3e-3,
    }
    reports = []
    for rmse, single in ((0.2, 0.2), (0.21, 0.3), (0.25, 0.2)):
        data = report()
        method(data).update(noise=runs | {"rmse": rmse}, error=errors(single))
        reports.append(data)
    old, by_chance, other = reports
    assert words(compare_reports(old, by_chance)) == []
    assert [what.rpartition(" ")[2] for what in words(compare_reports(old, other))] == [
        "relative_rmse"
    ]


def test_options_choose_what_counts(files, capsys):
    gone = report()
    gone["scenes"] = gone["scenes"][:2]
    assert run(["diff", *files(report(), gone)]) == 1
    slow = files(report(), report(machine=5.0))
    assert [
        run(["diff", *slow, *more])
        for more in ([], ["--time-tolerance", "inf"], ["--time-tolerance", "6"])
    ] == [
        1,
        0,
        0,
    ]
    for factor, status in ((1.01, 0), (1.05, 1)):
        new = report()
        method(new)["error"] = errors(factor * 1e-3)
        assert run(["diff", *files(report(), new)]) == status
    capsys.readouterr()
    assert run(["diff", *slow, "--time-tolerance", "-1"]) == 2
    assert "--time-tolerance: got -1" in capsys.readouterr().err


@pytest.mark.claim("diff")
@pytest.mark.parametrize(("busy", "alarms"), [(0.0, 0), (0.2, 1)])
def test_the_same_code_on_the_same_machine_does_not_fail(busy, alarms):
    """Pairs with other noise: none fails on a quiet machine, hardly any where 20 %
    of the timings were hit.
    """
    pairs = [(report(seed, busy=busy), report(seed + 1, busy=busy)) for seed in range(0, 80, 2)]
    assert sum(bool(compare_reports(*pair).worse) for pair in pairs) <= alarms


@pytest.mark.claim("diff")
def test_twice_the_time_is_found_on_a_quiet_machine():
    for seed in range(0, 20, 2):
        new = report(seed + 1)
        slow_down(method(new), 2.0)
        difference = compare_reports(report(seed), new)
        assert {finding.method for finding in found(difference)} == {"shadow-planes (exact)"}
        assert {finding.what for finding in found(difference)} >= {"frame [ms]", "airlight [ms]"}


@pytest.mark.claim("diff")
def test_a_quarter_of_a_time_is_the_tolerance_that_nobody_set(files, capsys):
    """Without an option: 20 % slower in all stages is noise of a quiet machine, 40 % is not."""
    for factor, status in ((1.2, 0), (1.4, 1)):
        new = report()
        slow_down(method(new), factor)
        assert run(["diff", *files(report(), new)]) == status, factor
    assert "shadow-planes (exact)" in capsys.readouterr().out


def test_another_machine_is_compared_beside_the_median_of_all():
    new = report(machine=2.0)
    # the same machine: everything is slower, which is one finding
    (finding,) = found(compare_reports(report(), new))
    assert "every frame" in finding.what
    assert finding.new == pytest.approx(2.0)
    new["environment"]["threads"] = 16
    difference = compare_reports(report(), new)
    assert words(difference) == []
    assert "threads: 2 -> 16" in words(difference, "note")
    slow_down(method(new), 2.5)  # more than 1 + 4 times the tolerance
    assert words(compare_reports(report(), new))[0].startswith("hall shadow-planes (exact)")


def _refused(new):
    method(new).update(
        status="refused",
        reason="too many planes",
        times=None,
        error=None,
        surface_error=None,
        flip=None,
    )


#: A change of a report, and what of it is worse; None where something must be and
#: the words do not matter.
CHANGES = [
    # The 99 % quantile, three times as large, grows by 1.2e-6, which rounding was seen to do.
    (lambda new: method(new).update(error=errors(1.0008e-3)), []),
    (lambda new: method(new).update(surface_error=errors(1e-3)), None),
    (lambda new: method(new)["flip"].update(value=0.06), ["hall shadow-planes (exact) HDR-FLIP"]),
    (
        lambda new: method(new)["error"].update(nonfinite=1),
        ["hall shadow-planes (exact) nonfinite"],
    ),
    (lambda new: method(new)["error"].update(negative=60), []),  # of 76800: less than a thousandth
    (lambda new: method(new)["error"].update(negative=90), None),
    (lambda new: new["scenes"][0]["methods"].pop(1), ["fog ray-march (steps=100) gone"]),
    (_refused, ["hall shadow-planes (exact) refused: too many planes"]),
    # a decision of who measured
    (lambda new: (_refused(new), method(new).update(status="left out")), []),
    (
        lambda new: new["scenes"][0]["agreement"].update({"volpath airlight": agreement(False)}),
        None,
    ),
    (
        lambda new: new["scenes"][0]["reference"].update(
            mean=1.001 * new["scenes"][0]["reference"]["mean"]
        ),
        None,
    ),
    (lambda new: new["scenes"][1]["reference"].update(disagreements=2), None),
    (lambda new: new["stability"][0].update(broken=["float32 maximum 0.1 > 0.01"]), None),
]


@pytest.mark.parametrize(("change", "expected"), CHANGES, ids=range(len(CHANGES)))
def test_a_change_is_worse_one_way_and_not_the_other(change, expected):
    new = report()
    change(new)
    worse = words(compare_reports(report(), new))
    if expected is None:
        assert len(worse) >= 1
    else:
        assert worse == expected
    if worse and "reference moved" not in worse[0]:
        assert words(compare_reports(new, report())) == []


def test_what_has_other_sizes_is_not_compared_and_said():
    new = report()
    new["scenes"][0]["size"] = [640, 480]
    method(new, "fog")["error"] = errors(0.9)
    new["scenes"][1]["timed"] = [640, 480]
    slow_down(method(new), 9.0)
    slow_down(method(new, "pens"), 9.0)
    method(new, "pens")["note"] = "timed at 320 x 240: larger frames take minutes"
    difference = compare_reports(report(), new)
    assert words(difference) == []
    notes = " ".join(words(difference, "note"))
    assert "errors not compared: the images are 320x240 and 640x480 pixels" in notes
    assert "times not compared: the frames timed are 320x240 and 640x480 pixels" in notes
    for scene in new["scenes"]:
        scene["size"] = scene["timed"] = [640, 480]
    with pytest.raises(ValueError, match="no number can be compared"):
        compare_reports(report(), new)


def test_a_reference_whose_error_is_not_known_has_not_moved_for_sure():
    """An unknown error counted as none: any other mean was another reference."""
    new = report()
    known = new["scenes"][0]["reference"]
    known.update(mean=1.001 * known["mean"], relative_error=None)
    difference = compare_reports(report(), new)
    assert words(difference) == []
    said = "fog errors not compared: the reference has another mean, and its error is not known"
    assert said in words(difference, "note")


def test_only_numbers_that_both_reports_have_are_compared():
    dark = report()
    for row in dark["scenes"][0]["methods"]:
        row["error"] = errors(None)  # relative to a black reference
    fewer, whole = (compare_reports(each, copy.deepcopy(each)) for each in (dark, report()))
    assert whole.errors_compared - fewer.errors_compared == 4 * 5


def test_an_error_of_an_engine_that_was_not_known_is_better_known():
    known, unknown = (
        SimpleNamespace(layer="airlight", right=True, blocks={"equation": each, "total": each})
        for each in (0.1, None)
    )
    assert [each[0] for each in _layer(unknown, known)] == ["note", "better"]
    assert [each[0] for each in _layer(known, unknown)] == ["worse", "worse"]
    assert [*_layer(unknown, unknown), *_layer(known, known)] == []


def test_a_layer_of_an_engine_that_was_not_judged_before_is_named():
    surface = SimpleNamespace(layer="surface", right=False, blocks={"total": None})
    old, new = (
        SimpleNamespace(
            scene="hall",
            engine="e",
            status="judged",
            title="e",
            headline="",
            layers=layers,
            layer=lambda name, layers=layers: next(iter(layers), None),
        )
        for layers in ((), (surface,))
    )
    findings, compared = _cell(old, new)
    assert [each.words for each in findings] == ["hall, e, surface new, not right by its equation"]
    assert compared == 0
    assert _cell(new, new) == ([], 0)  # no number of it is known


def test_times_that_are_gone_are_said():
    """A method that still runs had lost its times without a word."""
    new = report(1)
    method(new)["times"] = None
    difference = compare_reports(report(), new)
    assert words(difference) == []
    assert "hall times are gone: shadow-planes (exact)" in words(difference, "note")


def test_a_check_that_turns_is_named_where_another_one_had_turned_before():
    old, new = report(), report(1)
    for data, says in ((old, True), (new, False)):
        data["scenes"][0]["agreement"] = {
            "single-scatter airlight": agreement(False),
            "volpath airlight": agreement(says),
        }
    assert words(compare_reports(old, new)) == ["fog volpath airlight contradicts the reference"]
    assert words(compare_reports(new, old)) == []


def test_times_of_two_devices_are_never_compared():
    old, new = report(), report()
    method(old)["device"], method(new)["device"] = "llvmpipe (LLVM 15.0.6, 256 bits)", "NVIDIA A100"
    slow_down(method(new), 9.0)
    difference = compare_reports(old, new)
    assert words(difference) == []
    assert (
        "times not compared: llvmpipe (LLVM 15.0.6, 256 bits) before, NVIDIA A100 now"
        in words(difference, "note")[0]
    )


@pytest.mark.claim("times-of-one-run")
def test_one_run_is_not_compared_with_itself_and_a_change_of_the_machine_is_named():
    old, new = report(), report(1)
    same = compare_reports(old, copy.deepcopy(old))
    assert same.times.compared == 0
    assert "times not compared: both reports show the run of" in words(same, "note")[0]
    for row in new["scenes"][1]["methods"]:
        row["times"]["run"] |= {"steady": False, "between": 1.9, "within": 1.1}
    different = compare_reports(old, new)
    assert different.times.compared > 0
    changed = [
        each for each in found(different, "note") if "the machine changed while" in each.what
    ]
    assert {(note.scene, note.old, note.new) for note in changed} == {("hall", 1.1, 1.9)}


@pytest.mark.claim("build-named")
def test_reports_of_two_commits_of_one_version_say_so():
    old, new = report(), report()
    old["environment"]["build"] = {
        "airlight": "0.9",
        "commit": "1a2b3c",
        "changed": False,
        "digest": "ab",
    }
    new["environment"]["build"] = old["environment"]["build"] | {"changed": True, "digest": "cd"}
    said = "airlight: 0.9, commit 1a2b3c, files ab -> 0.9, commit 1a2b3c with changes, files cd"
    assert said in words(compare_reports(old, new), "note")
    new["environment"]["build"] = dict(old["environment"]["build"])
    assert not [
        note for note in words(compare_reports(old, new), "note") if note.startswith("airlight")
    ]


def claimed(verdict, measured, *, unit="", published=None, item="eq. 1", interval=""):
    """Return a report with one verdict on a paper."""
    row = {
        "paper": "biri",
        "item": item,
        "words": "words",
        "verdict": verdict,
        "published": published,
    }
    row |= {"measured": measured, "low": measured, "high": measured, "unit": unit, "why": "so"}
    row["interval"] = interval
    return report() | {"papers": [row]}


@pytest.mark.parametrize(
    ("unit", "interval", "kind"),
    [
        ("%", "", "worse"),  # of Mie's theory
        ("times", "", "worse"),  # an error over another one
        ("times", "quartiles", "note"),
        ("times", "quartiles over 95 % interval", "note"),
        ("frames/s", "", "note"),
    ],
)
def test_only_a_verdict_on_times_depends_on_how_busy_the_machine_was(unit, interval, kind):
    good = claimed("reproduced", 1.0, unit=unit, interval=interval)
    bad = claimed("not reproduced", 2.0, unit=unit, interval=interval)
    difference = compare_reports(good, bad)
    assert words(difference, kind) == ["biri, eq. 1: not reproduced, was reproduced"]


def test_verdicts_on_papers_are_compared():
    good, bad = claimed("reproduced", 1.0), claimed("not reproduced", 2.0)
    assert words(compare_reports(good, bad)) == ["biri, eq. 1: not reproduced, was reproduced"]
    assert words(compare_reports(bad, good), "better") == [
        "biri, eq. 1: reproduced, was not reproduced"
    ]
    gone = compare_reports(bad, claimed("impossible", None))
    assert words(gone, "note") == ["biri, eq. 1: impossible, was not reproduced"]
    assert words(compare_reports(good, claimed("reproduced", 1.0, item="eq. 2"))) == [
        "biri, eq. 1: the row is gone"
    ]
    other = claimed("reproduced", 1.0, published=4.0)
    assert words(compare_reports(good, other)) == ["biri, eq. 1: the published figure"]
    assert words(compare_reports(good, report())) == []  # a report of few scenes measures no claims
