# SPDX-License-Identifier: BSD-3-Clause
import copy
import json

import pytest

from reports.commands.main import run
from reports.data.reader import read_report
from reports.diff.compare import compare_reports
from tests.helpers.reports import agreement, checked, errors, growth_record, method, report, slow_down


def words(difference, verdict="worse"):
    chosen = [finding for finding in difference.findings if finding.verdict == verdict]
    return [" ".join(part for part in (finding.scene, finding.method, finding.what) if part) for finding in chosen]


@pytest.fixture
def files(tmp_path):
    """Return a function that writes two reports and returns their paths as words."""

    def write(old, new):
        for name, data in (("old", old), ("new", new)):
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / "report.json").write_text(json.dumps(data), encoding="utf-8")
        return [str(tmp_path / "old"), str(tmp_path / "new" / "report.json")]

    return write


def test_the_same_report_has_no_differences(files, capsys):
    assert run(["diff", *files(report(1), report(1))]) == 0
    out = capsys.readouterr().out
    assert "0 worse, 0 better" in out
    assert "12 configurations, one machine" in out


@pytest.mark.claim("diff")
@pytest.mark.parametrize(("busy", "alarms"), [(0.0, 0), (0.05, 1), (0.2, 1)])
def test_the_same_code_on_the_same_machine_does_not_fail(busy, alarms):
    """Pairs with other noise: none fails on a quiet machine, hardly any where 5 or 20 % of the timings were hit."""
    pairs = [(report(seed, busy=busy), report(seed + 1, busy=busy)) for seed in range(0, 80, 2)]
    assert sum(bool(compare_reports(*pair).worse) for pair in pairs) <= alarms


@pytest.mark.claim("diff")
def test_twice_the_time_is_found_on_a_quiet_machine():
    for seed in range(0, 40, 2):
        new = report(seed + 1)
        slow_down(method(new), 2.0)
        difference = compare_reports(report(seed), new)
        assert {finding.method for finding in difference.worse} == {"shadow-planes (exact)"}
        assert {finding.what for finding in difference.worse} >= {"frame [ms]", "airlight [ms]"}


def test_what_cannot_be_seen_on_a_busy_machine_is_said(files, capsys):
    old, new = report(1, busy=0.5), report(2, busy=0.5)
    slow_down(method(new), 1.3)
    assert run(["diff", *files(old, new)]) == 0
    assert "the machine was busy" in capsys.readouterr().out


def test_brackets_are_printed(files, capsys):
    new = report()
    slow_down(method(new), 2.0)
    method(new, "fog").update(refused="wanted a mesh [obj] in [0, 1]", times=None, error=None)
    assert run(["diff", *files(report(), new)]) == 1
    out = capsys.readouterr().out
    assert "frame [ms]" in out
    assert "wanted a mesh [obj] in [0, 1]" in out


def test_everything_slower_is_one_finding():
    new = report(machine=2.0)
    difference = compare_reports(report(), new)
    (finding,) = difference.worse
    assert "every frame" in finding.what
    assert finding.new == pytest.approx(2.0)
    assert words(compare_reports(new, report()), "better") == [finding.what]


def test_two_machines_are_compared_beside_the_median_of_all():
    new = report(machine=3.0)
    new["environment"]["threads"] = 16
    difference = compare_reports(report(), new)
    assert words(difference) == []
    assert not difference.times.same_machine
    assert "threads: 2 -> 16" in words(difference, "note")
    slow_down(method(new), 2.5)  # more than 1 + 4 times the tolerance
    assert words(compare_reports(report(), new))[0].startswith("hall shadow-planes (exact)")


def test_another_version_is_said_and_compared():
    new = report()
    new["environment"]["versions"]["drjit"] = "1.6.0"
    slow_down(method(new), 2.0)
    difference = compare_reports(report(), new)
    assert "drjit: 1.5.0 -> 1.6.0" in words(difference, "note")
    assert difference.worse


@pytest.mark.claim("diff")
def test_three_times_the_error_is_found_and_named(files, capsys):
    new = report()
    method(new)["error"] = errors(3e-3)
    paths = files(report(), new)
    assert run(["diff", *paths, "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert {finding["what"] for finding in data["findings"]} >= {"relative_rmse", "relative_bias", "p50", "p99", "max"}
    assert data["worse"] == 5
    assert run(["diff", paths[1], paths[0]]) == 0
    assert "5 better" in capsys.readouterr().out


@pytest.mark.parametrize(("factor", "tolerance", "status"), [(1.01, "0.02", 0), (1.05, "0.02", 1), (1.05, "0.1", 0)])
def test_the_error_tolerance_decides(files, factor, tolerance, status):
    new = report()
    method(new)["error"] = errors(factor * 1e-3)
    assert run(["diff", *files(report(), new), "--error-tolerance", tolerance]) == status


@pytest.mark.claim("diff")
def test_rounding_is_no_error():
    old, new = report(), report()
    # The 99 % quantile, three times as large, grows by 1.2e-6, which rounding was seen to do.
    method(old)["error"], method(new)["error"] = errors(4e-7), errors(8e-7)
    assert words(compare_reports(old, new)) == []


def test_errors_of_the_surface_and_flip_count():
    new = report()
    method(new)["surface_error"] = errors(1e-3)
    method(new)["flip"]["value"] = 0.06
    worse = words(compare_reports(report(), new))
    assert "hall shadow-planes (exact) surface relative_rmse" in worse
    assert "hall shadow-planes (exact) HDR-FLIP" in worse


def test_a_bias_of_the_other_sign_is_not_worse():
    new = report()
    method(new)["error"]["relative_bias"] *= -1
    assert words(compare_reports(report(), new)) == []


def test_pixels_that_are_not_finite_or_negative():
    new = report()
    method(new)["error"]["nonfinite"] = 1
    method(new, "pens")["error"]["negative"] = 60  # of 76800: less than a thousandth
    assert words(compare_reports(report(), new)) == ["hall shadow-planes (exact) nonfinite"]
    method(new, "pens")["error"]["negative"] = 90
    assert len(compare_reports(report(), new).worse) == 2


def test_an_error_that_is_no_number_any_more():
    new = report()
    method(new)["error"]["max"] = None
    assert words(compare_reports(report(), new)) == ["hall shadow-planes (exact) max"]
    assert words(compare_reports(new, report()), "better") == ["hall shadow-planes (exact) max"]
    assert words(compare_reports(new, new)) == []


def test_what_is_gone_fails_unless_only_the_common_is_compared(files):
    new = report()
    new["scenes"] = new["scenes"][:2]
    del new["scenes"][0]["methods"][1]
    difference = compare_reports(report(), new)
    assert words(difference) == ["fog ray-march (steps=100) gone", "pens the scene is gone"]
    assert run(["diff", *files(report(), new), "--common"]) == 0
    assert {"fog ray-march (steps=100) new", "pens the scene is new"} <= set(
        words(compare_reports(new, report()), "note")
    )


def test_newly_refused():
    new = report()
    method(new).update(refused="too many planes", times=None, error=None, surface_error=None, flip=None)
    assert words(compare_reports(report(), new)) == ["hall shadow-planes (exact) refused: too many planes"]
    assert words(compare_reports(new, report()), "better") == ["hall shadow-planes (exact) no longer refused"]
    method(new)["left_out"] = True  # a decision of who measured
    assert words(compare_reports(report(), new)) == []


def test_a_truth_that_is_no_longer_confirmed(files, capsys):
    new = report()
    new["scenes"][0]["agreement"]["volpath airlight"] = agreement(False)
    assert run(["diff", *files(report(), new)]) == 1
    assert "fog: the truth is no longer confirmed" in capsys.readouterr().out
    assert "fog the truth is confirmed now" in words(compare_reports(new, report()), "better")


def test_a_comparison_of_the_truth_that_is_gone():
    new = report()
    new["scenes"][0]["agreement"] = {}
    assert words(compare_reports(report(), new)) == ["fog the comparison with volpath airlight is gone"]


def test_another_scene_by_the_same_name_is_not_compared():
    new = report()
    new["scenes"][0]["truth"]["mean"] *= 1.001
    method(new, "fog")["error"] = errors(0.9)
    (finding,) = compare_reports(report(), new).worse
    assert "the truth moved" in finding.what


def test_lit_intervals_on_which_shadow_rays_disagree():
    new = report()
    new["scenes"][1]["truth"]["disagreements"] = 2
    assert words(compare_reports(report(), new)) == ["hall lit intervals of the truth: disagreements"]


def test_claims_that_flipped():
    new = report()
    new["claims"] = [{"kind": "truth", "text": "The truth is NOT confirmed.", "good": False}]
    assert words(compare_reports(report(), new)) == ["claim: The truth is NOT confirmed."]
    assert "no longer: The truth is NOT confirmed." in words(compare_reports(new, report()), "better")


def test_kernels():
    new = report()
    new["stability"][0]["broken"] = ["float32 maximum 0.1 > 0.01"]
    worse = words(compare_reports(report(), new))
    assert worse == ["exact breaks its bar: float32 maximum 0.1 > 0.01"]


def test_another_method_is_the_fastest_is_a_note():
    new = report()
    method(new, "fog", "ray-march (steps=100)")["error"] = errors(1e-4)
    notes = words(compare_reports(report(), new), "note")
    assert notes == ["fog fastest within 0.1 %: shadow-planes (exact) before, ray-march (steps=100) now"]


def test_images_of_an_engine_have_no_times():
    old = report()
    method(old).update(kind="image", layer="total", times=None, surface_error=None)
    new = copy.deepcopy(old)
    assert words(compare_reports(old, new)) == []
    method(new)["error"] = errors(0.5)
    assert len(compare_reports(old, new).worse) == 5
    method(new)["layer"] = "airlight"
    assert words(compare_reports(old, new)) == []
    assert any("different layers" in note for note in words(compare_reports(old, new), "note"))


def test_other_sizes_are_not_compared_and_said():
    new = report()
    new["scenes"][0]["size"] = [640, 480]
    method(new, "fog")["error"] = errors(0.9)
    for scene in new["scenes"]:
        scene["timed"] = [640, 480]
    slow_down(method(new), 9.0)
    difference = compare_reports(report(), new)
    assert words(difference) == []
    notes = " ".join(words(difference, "note"))
    assert "errors not compared: the images are 320x240 and 640x480 pixels" in notes
    assert "times not compared: the frames timed are 320x240 and 640x480 pixels" in notes
    for scene in new["scenes"]:
        scene["size"] = [640, 480]
    with pytest.raises(ValueError, match="no number can be compared"):
        compare_reports(report(), new)


def test_a_method_timed_at_another_size_is_not_compared():
    new = report()
    slow_down(method(new), 9.0)
    method(new)["note"] = "timed at 320 x 240: larger frames take minutes"
    difference = compare_reports(report(), new)
    assert words(difference) == []
    assert difference.times.compared == 11
    assert any("times not compared: as usual before, timed at 320 x 240" in note for note in words(difference, "note"))


def test_each_scene_may_have_a_size_of_its_own():
    old, new = report(), report()
    old["scenes"][1]["timed"], new["scenes"][1]["timed"] = [320, 240], [640, 480]
    slow_down(method(new), 9.0)
    difference = compare_reports(old, new)
    assert words(difference) == []
    assert difference.times.compared == 8
    assert "hall times not compared: the frames timed are 320x240 and 640x480 pixels" in words(difference, "note")


def test_times_can_be_left_out(files, capsys):
    paths = files(report(), report(machine=5.0))
    assert run(["diff", *paths]) == 1
    assert run(["diff", *paths, "--no-times"]) == 0
    assert run(["diff", *paths, "--time-tolerance", "6"]) == 0
    assert "times: none compared" in capsys.readouterr().out


def test_results_that_were_kept_are_named():
    assert any("3 results" in note for note in words(compare_reports(report(), report() | {"kept": 3}), "note"))


def test_the_reports_of_these_tests_keep_to_the_schema():
    for data in (report(), report(3, busy=0.2, machine=2.0)):
        assert checked(data) is data


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "No such file or directory; wanted what `airlight report"),
        ("{", "is not valid JSON"),
        ("[]", "has no schema, wanted 'airlight-report/2'"),
        ('{"schema": "airlight-report/9"}', "has the schema 'airlight-report/9', wanted 'airlight-report/2'"),
        ('{"schema": "airlight-report/2", "scenes": []}', "'created' is missing"),
    ],
)
def test_what_is_no_report_is_refused(tmp_path, capsys, text, message):
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps(report()), encoding="utf-8")
    if text is not None:
        bad.write_text(text, encoding="utf-8")
    assert run(["diff", str(good), str(bad)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "bad.json" in error


def test_tolerances_that_are_none_are_refused(files, capsys):
    assert run(["diff", *files(report(), report()), "--time-tolerance", "-1"]) == 2
    assert "--time-tolerance: got -1" in capsys.readouterr().err


def test_reports_are_read_by_their_folder(files):
    folder, file = files(report(), report())
    assert read_report(folder) == read_report(file)


def claimed(verdict, measured, *, unit="", published=None, item="eq. 1"):
    """Return a report with one verdict on a paper."""
    row = {"paper": "biri", "item": item, "words": "words", "verdict": verdict, "published": published}
    row |= {"measured": measured, "low": measured, "high": measured, "unit": unit, "why": "so"}
    return report() | {"papers": [row]}


def test_verdicts_on_papers_are_compared():
    good, bad = claimed("reproduced", 1.0), claimed("not reproduced", 2.0)
    assert words(compare_reports(good, bad)) == ["biri, eq. 1: not reproduced, was reproduced"]
    assert words(compare_reports(bad, good), "better") == ["biri, eq. 1: reproduced, was not reproduced"]
    assert words(compare_reports(good, good)) == []
    gone = compare_reports(bad, claimed("impossible", None))
    assert words(gone, "note") == ["biri, eq. 1: impossible, was not reproduced"]
    slow = compare_reports(claimed("reproduced", 30.0, unit="frames/s"), claimed("differs", 20.0, unit="frames/s"))
    assert (words(slow), words(slow, "note")) == ([], ["biri, eq. 1: differs, was reproduced"])


def test_a_row_that_is_gone_and_a_published_figure_that_changed_are_worse():
    old, new = claimed("reproduced", 1.0), claimed("reproduced", 1.0, item="eq. 2")
    assert words(compare_reports(old, new)) == ["biri, eq. 1: the row is gone"]
    assert words(compare_reports(old, new, common=True)) == []
    other = claimed("reproduced", 1.0, published=4.0)
    assert words(compare_reports(old, other)) == ["biri, eq. 1: the published figure"]
    assert words(compare_reports(old, report())) == []  # a report of few scenes measures no claims


def test_reports_with_verdicts_keep_to_the_schema():
    checked(claimed("differs", 2.0, published=3))


def test_another_power_of_the_work_is_found():
    old, new = report(), report()
    assert not compare_reports(old, new | {"scaling": [growth_record()]}).findings  # earlier reports have none
    old["scaling"], new["scaling"] = [growth_record()], [growth_record(exponent=0.71)]
    found = compare_reports(checked(old), checked(new))
    assert words(found) == [
        f"hall shadow-planes (exact) the power of the triangles with which {time} grows"
        for time in ("frame", "light moved", "objects moved")
    ]
    assert [(finding.old, finding.new) for finding in found.worse] == [(0.47, 0.71)] * 3
    assert len(words(compare_reports(new, old), "better")) == 3
