# SPDX-License-Identifier: BSD-3-Clause
"""Costs of kernels and of growing work: each number stands under its heading,
and what has none says why.
"""

import csv as comma_separated
import io

from airlight.reports.studies.growth import _draw_scaling
from airlight.reports.tables.costs import (
    cliffs,
    cost_table,
    kernel_tables,
    same_records,
    scaling_tables,
    stability_summary,
)
from airlight.reports.tables.drawing import csv, markdown, text
from airlight.validation.kernels.records import (
    ErrorLevel,
    KernelCost,
    KernelErrors,
    Rays,
    RayTime,
    Stability,
)
from airlight.validation.timing import Scaling
from tests.helpers.reports import growth_record, record_of


def cells(table):
    """The rows of a table by the keys of its columns, as CSV has them."""
    return list(comma_separated.DictReader(io.StringIO(csv(table))))


def cost(kernel, phase="isotropic", **changes):
    made = {"kernel": kernel, "family": kernel, "size": None, "phase": phase, "g": 0.7}
    times = {"device": RayTime(median=1.25, low=1.1, high=1.5, repetitions=9)}
    times |= {"wall": RayTime(median=2.5, low=2.4, high=2.75, repetitions=9)}
    return KernelCost(
        **made | times | {"rays": 4096, "median": 1e-7, "p99": 3e-6, "max": 4e-5} | changes
    )


def test_kernels_are_tabled_by_phase_function_with_the_cheapest_at_each_error():
    costs = [cost("exact"), cost("exact", "hg"), cost("taylor", "hg", refused="no series of hg")]
    levels = [
        ErrorLevel(phase="hg", statistic="max", level=1e-3, cheapest="exact", ns=1.25),
        ErrorLevel(phase="hg", statistic="max", level=1e-9, cheapest=None, ns=None),
        ErrorLevel(phase="isotropic", statistic="p99", level=1e-4, cheapest="taylor-7", ns=0.5),
    ]
    tables = list(kernel_tables(costs, levels))
    titles = [table.title for table in tables]
    assert titles == [
        "isotropic, float32, wide rays",
        "isotropic: speed against error, maximum error",
        "isotropic: speed against error, 99 % of the rays",
        "hg, g = 0.7, float32, wide rays",
        "hg: speed against error, maximum error",
        "hg: speed against error, 99 % of the rays",
    ]
    assert [row["kernel"] for row in cells(tables[3])] == ["exact", "taylor"]
    assert text(tables[3]).endswith("taylor: refused: no series of hg\n")
    assert [row["ns"] for row in cells(tables[4])] == ["1.25", ""]
    assert [row["cheapest"] for row in cells(tables[4])] == ["exact", "none"]
    assert [tables[place].rows for place in (1, 5)] == [(), ()]
    assert [row["cheapest"] for row in cells(tables[2])] == ["taylor-7"]


def test_a_kernel_has_its_time_with_quartiles_on_the_device_and_by_the_clock():
    (row,) = cells(cost_table("t", [cost("exact", nonfinite=3)]))
    assert [row[f"device{end}"] for end in ("", "_low", "_high")] == ["1.25", "1.1", "1.5"]
    assert [row[f"wall{end}"] for end in ("", "_low", "_high")] == ["2.5", "2.4", "2.75"]
    assert [row[key] for key in ("rays", "median", "p99", "max", "nonfinite")] == [
        "4096",
        "1e-07",
        "3e-06",
        "4e-05",
        "3",
    ]
    # Where the device does not tell, and nothing was timed, there is no number rather than 0.
    (row,) = cells(cost_table("t", [cost("exact", device=None, rays=0)]))
    assert (row["device"], row["wall"], row["rays"]) == ("", "2.5", "")
    assert "| `exact` | 1.25 | 1.1..1.5 |" in markdown(cost_table("t", [cost("exact")], code=True))


def errors(largest, **changes):
    counts = {"rays": 90, "refused": 10, "nan": 1, "infinite": 2, "negative": 4, "worst": None}
    return KernelErrors(
        **counts | {"median": 1e-8, "p99": 1e-6, "max": largest, "mean": 1e-7} | changes
    )


def test_the_robustness_of_a_kernel_has_a_row_for_each_set_of_rays():
    groups = {"all": errors(3e-5), "near": errors(7.0)}
    sets = [
        Rays(name=name, columns="", single=groups, double={"all": errors(2e-12)})
        for name in ("wide", "edge")
    ]
    table = stability_summary(
        [Stability(kernel="exact", exact=True, refused={}, sets=tuple(sets), broken=())]
    )
    rows = cells(table)
    assert [(row["kernel"], row["set"]) for row in rows] == [("exact", "wide"), ("exact", "edge")]
    wanted = {
        "rays": "90",
        "refused": "10",
        "median": "1e-08",
        "p99": "1e-06",
        "max": "3e-05",
        "double": "2e-12",
    }
    assert {name: rows[0][name] for name in wanted} == wanted
    assert rows[0]["odd"] == "7"  # not a number, infinite or negative


def growth(**changes):
    return record_of(growth_record(**changes), Scaling)


def test_growing_work_has_the_costs_of_each_step_and_how_they_grow():
    calm, jumps = growth(), growth(cliff=True, refused="prism: out of memory")
    costs, exponents = scaling_tables([jumps, calm])
    assert costs.title == "hall by triangles, 80 x 60"
    rows = cells(costs)
    assert [row["work"] for row in rows] == ["100", "400", "", "100", "400"]
    assert [row["frame"] for row in rows[:2]] == ["31", "124"]
    assert [row["light_moved_high"] for row in rows[:2]] == ["37.2", "148.8"]
    assert (rows[0]["rays"], rows[0]["memory"]) == ("31", "71.5")
    assert rows[2]["reason"] == "refused: prism: out of memory"
    assert exponents.title == "hall: how times grow"
    assert [row["cliff"] for row in cells(exponents)] == ["frame", "no"]
    row = cells(exponents)[0]
    assert (row["kind"], row["label"]) == ("triangles", "shadow-planes (exact)")
    assert [row[name] for name in ("frame", "frame_steepest", "objects_moved")] == [
        "0.47",
        "1.93",
        "0.47",
    ]


def test_a_jump_is_a_sentence_with_its_power_and_where_it_is():
    said = "hall, shadow-planes (exact): frame grows with the power 1.9 of the triangles up to 400"
    assert cliffs([growth(), growth(cliff=True)]) == [said]


def test_records_to_compare_are_of_one_method_scene_size_and_work():
    old, new = growth(exponent=0.5), growth(exponent=0.6)
    assert same_records([old, growth(size=(40, 30))], [growth(size=(20, 15)), new]) == [(old, new)]
    assert same_records([old], []) == []


def test_growth_in_two_scenes_has_a_panel_for_each():
    """A method that refused early does not cut the camera rays short."""
    refused = growth_record(works=(100.0,)) | {"label": "light-volumes (exact)"}
    records = [growth_record(), growth_record() | {"scene": "fence"}, refused]
    figure = _draw_scaling([record_of(each, Scaling) for each in records], "single")
    lines = {axes.get_title(): axes.lines for axes in figure.axes}
    assert {name: len(of) for name, of in lines.items()} == {"hall": 3, "fence": 2}
    assert list(lines["hall"][-1].get_xdata()) == [100.0, 400.0]
