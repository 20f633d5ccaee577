# SPDX-License-Identifier: BSD-3-Clause
"""Times stand under their own headings, what is not finite never wins; what tables decide
of references and growth.
"""

import re
from dataclasses import replace

import pytest

from airlight.reports.data.records import Method, Scene
from airlight.reports.tables.agreement import trust_table, verdict
from airlight.reports.tables.costs import cliffs, scaling_tables
from airlight.reports.tables.drawing import csv, html, latex, markdown, text
from airlight.reports.tables.methods import (
    COLUMNS,
    TIMES,
    fastest_table,
    headline,
    method_row,
    methods_table,
    times_words,
)
from airlight.reports.tables.table import Verdict
from airlight.validation.statistics.records import Agreement
from airlight.validation.timing import Scaling
from tests.helpers.reports import RUN, agreement, errors, growth_record, record_of, scene
from tests.helpers.reports import entry as made

MEDIANS = {name: 2.0 + place for place, name in enumerate(TIMES)}  # no two alike


def timing(median):
    return {"median_ms": median, "low_ms": 0.9 * median, "high_ms": 1.1 * median, "repetitions": 7}


def entry(label="a", *, rmse=0.01, frame=2.0, nonfinite=0, **more):
    times = {name: timing(median) for name, median in MEDIANS.items()} | {
        "frame": timing(frame),
        "run": RUN,
    }
    return record_of(
        made(label, times=times, error=errors(rmse, nonfinite=nonfinite)) | more, Method
    )


@pytest.mark.parametrize("name", TIMES)
def test_each_time_stands_under_its_own_heading(name):
    """The column "light moved" once held the time after objects moved, in one of the formats."""
    table = methods_table("t", [entry()], "label", *TIMES)
    median = f"{MEDIANS[name]:g}"
    lines = text(table).splitlines()
    heading = next(line for line in lines if "method" in line)
    # numbers end where headings end
    end = re.search(rf"  {re.escape(COLUMNS[name].title)}(?=  |$)", heading).end()
    assert next(line for line in lines if line.startswith(" a "))[:end].split()[-1] == median
    headings, _, cells = (
        [cell.strip() for cell in row.split("|")] for row in markdown(table).splitlines()[2:5]
    )
    assert cells[headings.index(COLUMNS[name].title)] == median
    place = 1 + TIMES.index(name)
    assert re.findall(r"<t[dh][^>]*>([\d.]+|a)", html(table).split("<tbody>")[1])[place] == median
    assert rf"$\num{{{MEDIANS[name]:.2f}}}" in latex([table]).splitlines()[-3].split(" & ")[place]
    keys, values = (line.split(",") for line in csv(table).splitlines())
    assert dict(zip(keys, values))[name] == median


def test_a_shader_has_its_device_beside_its_time_and_is_in_no_race_with_others():
    shader = entry("fog.glsl", frame=0.1, device="llvmpipe", kind="function", method="fog.glsl")
    table = methods_table("t", [entry(), shader])
    assert [column.key for column in table.columns][:3] == ["label", "frame", "device"]
    assert [row.values["device"] for row in table.rows] == [None, "llvmpipe"]
    assert "device" not in [column.key for column in methods_table("t", [entry()]).columns]
    assert fastest_of(entry("a", frame=9.0), shader)[1] == "a: 9 ms, 111 frames/s"


def fastest_of(*methods):
    """The cells of the table of the fastest methods for a scene."""
    (row,) = fastest_table([replace(record_of(scene("fog", []), Scene), methods=methods)]).rows
    return tuple(row.values.values())


def test_methods_whose_quartiles_overlap_share_the_first_place():
    first, slower = entry("a (exact)", method="a", frame=9.0), entry("b", method="b", frame=10.0)
    twice, late = entry("a (map)", method="a", frame=9.2), entry("c", method="c", frame=12.0)
    assert fastest_of(late, slower, twice, first)[1] == "a (exact) and b: 9 ms, 111 frames/s"
    assert fastest_of(late, first)[1] == "a (exact): 9 ms, 111 frames/s"


def test_the_headline_says_which_methods_reach_the_smallest_error():
    def words(*methods):
        return headline(replace(record_of(scene("fog", []), Scene), methods=methods))

    near, exact = entry("b", rmse=0.004, method="b"), entry("a (k)", rmse=1e-4, method="a")
    far, shader = entry("c", rmse=0.2, method="c", frame=3.0), entry("d", device="llvmpipe")
    assert (
        words(far, near, exact) == "In fog, a is the only method of 3 within 0.1 %: 2 ms a frame."
    )
    assert words(near) == "In fog, b is within 1 %: 2 ms a frame."
    other = entry("e", rmse=0.001, method="e", frame=8.0)
    assert (
        words(other, near, exact)
        == "In fog, 2 of 3 methods are within 0.1 %; the fastest: a (k): 2 ms, 500 frames/s."
    )
    assert (
        words(far, shader)
        == "In fog, no method of 1 is within 1 %; the nearest is c: 20 %, 3 ms a frame."
    )
    assert words(shader) == ""


@pytest.mark.claim("times-of-one-run")
def test_a_table_says_of_which_runs_its_times_are():
    later = RUN | {"started": "2026-11-22 07:00:00 +0000", "steady": False, "between": 1.7}
    ours, engine = entry("a"), entry("engine", kind="image", times={"frame": timing(0.1)})
    other = entry("b", times={"frame": timing(3.0), "run": later})
    assert times_words(
        [ours, entry("c")]
    ) == f"Times: measured in turns in one run of 5 rounds, {RUN['started']}; " + (
        "the machine stayed as it was (the anchor, camera rays alone: medians within a factor of "
        "1.01 over the run, "
        "quartiles of 1.02 in a round)."
    )
    mixed = times_words([ours, other, engine])
    assert f"Times of a: measured in turns in one run of 5 rounds, {RUN['started']};" in mixed
    assert (
        "Times of b: measured in turns in one run of 5 rounds, 2026-11-22 07:00:00 +0000; the "
        "machine CHANGED" in mixed
    )
    assert mixed.endswith("is of another run, on another machine or by other rules.")
    unknown = entry("d", times={"frame": timing(3.0), "run": RUN | {"steady": None}})
    assert (
        times_words([unknown])
        == f"Times: measured in turns in one run of 5 rounds, {RUN['started']}."
    )
    assert method_row(engine).remarks[-1] == "timed elsewhere"
    assert "timed elsewhere" not in method_row(ours).remarks


@pytest.mark.claim("claims-follow")
def test_the_fastest_method_within_each_error_has_a_cell():
    fast, good, slow = (
        entry("fast", rmse=0.02, frame=1.0),
        entry("good", rmse=0.004),
        entry("slow", rmse=1e-4, frame=8),
    )
    assert fastest_of(fast, good, slow) == (
        "fog",
        "good: 2 ms, 500 frames/s",
        "slow: 8 ms, 125 frames/s",
    )
    assert fastest_of(fast, good) == ("fog", "good: 2 ms, 500 frames/s", "none")
    assert fastest_of() == ("fog", "none", "none")


@pytest.mark.claim("claims-follow")
@pytest.mark.parametrize(
    "never",
    [
        entry("no error", rmse=None, frame=0.1),  # a black reference has no relative error
        entry("refused", reason="no series", times=None, error=None),
        # its RMSE leaves out the very pixels that are wrong
        entry("not finite", rmse=1e-5, frame=0.1, nonfinite=3),
        entry("image", kind="image", rmse=1e-5, times=None),
        # of another run than the others
        entry("engine", kind="image", rmse=1e-5, times={"frame": timing(0.1)}),
    ],
    ids=lambda never: never.label,
)
def test_what_has_no_finite_error_or_no_time_is_never_the_fastest(never):
    assert fastest_of(never, entry("best", rmse=0.0009)) == (
        "fog",
        *["best: 2 ms, 500 frames/s"] * 2,
    )


@pytest.mark.parametrize(
    ("equivalent", "interval", "finished", "good"),
    [
        (True, [-0.001, 0.003], True, True),
        (False, [-0.001, 0.03], True, False),
        (False, [-0.001, 0.03], False, None),  # not decided in time
        (False, [0.006, 0.03], False, False),  # outside as a whole
        (False, [None, None], True, False),
        (False, [None, None], False, None),  # stopped before there was an interval
    ],
)
def test_a_reference_is_confirmed_refused_or_not_decided(equivalent, interval, finished, good):
    compared = agreement(equivalent, margin=0.005, finished=finished, relative_bias_ci=interval)
    assert verdict(record_of(compared, Agreement)) is good


def test_an_estimator_that_did_not_check_a_scene_has_no_cells_there():
    checks = {
        "volpath airlight": agreement(),
        "volpath surface": agreement(layer="surface", detectable=0.01),
    }
    alone = {"single-scatter airlight": agreement(estimator="single-scatter", margin=0.05)}
    both, one = (
        record_of(scene("b", [], agreement=each), Scene) for each in (checks | alone, checks)
    )
    rows = [row.values for row in trust_table([both, one]).rows]
    assert rows[0]["single-scatter agrees"] == Verdict(True, "±5 %")
    assert "single-scatter" not in rows[1]
    assert rows[1]["volpath agrees"] == Verdict(True, "±1 %")
    line = markdown(trust_table([both, one])).splitlines()[5]
    assert line.endswith("| 0..+0.1 % | yes, ±1 % | - | - |")


def test_jumps_are_found():
    calm, jump = (record_of(growth_record(cliff=cliff), Scaling) for cliff in (False, True))
    assert len(cliffs([jump, calm])) == 1
    costs, exponents = scaling_tables(
        [record_of(growth_record(works=(), refused="method x: no"), Scaling)]
    )
    assert costs.rows[0].reason == "refused: method x: no"
    assert exponents.rows == ()
