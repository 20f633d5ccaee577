# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every equation, figure and table of the papers has a row, and every row takes its figure from what was run."""

import json
from collections import Counter

import pytest

from validation.fidelity import billeter, biri
from validation.fidelity import billeter_tables as billeter_tables_module
from validation.fidelity import biri_tables as biri_tables_module
from validation.fidelity.catalogue import EXPERIMENTS, PAPERS, ROWS, experiments_of, judged, published_figures
from validation.fidelity.row import Bound, judge
from validation.papers.billeter_tessellation import TABLE
from validation.papers.biri import PUBLISHED

KEYS = ["paper", "item", "claim", "verdict", "published", "measured", "unit", "command", "why"]


@pytest.mark.claim("a-row-for-every-claim")
def test_the_papers_have_their_rows():
    counts = Counter(row.paper for row in ROWS)
    assert counts["biri"] >= 45
    assert counts["billeter"] >= 30
    assert set(counts) == set(PAPERS)
    assert len({(row.paper, row.item) for row in ROWS}) == len(ROWS)
    assert {row.experiment for row in ROWS} == set(EXPERIMENTS)


def test_every_numbered_equation_figure_and_table_has_a_row():
    items = {paper: " ".join(row.item for row in ROWS if row.paper == paper) for paper in ("biri", "billeter")}
    wanted = {
        "biri": ["eq. 1", "eq. 2", "Table 1", "Table 2", *(f"Fig. {number}" for number in range(1, 8))],
        "billeter": ["eq. 1", "eq. 2", "eq. 3", "Table 1", *(f"Fig. {number}" for number in (1, 2, 3, 5, 6, 7, 8))],
    }
    assert {paper: [item for item in all_of if item not in items[paper]] for paper, all_of in wanted.items()} == {
        "biri": [],
        "billeter": [],
    }


def test_published_figures_are_those_that_the_tables_are_measured_against():
    figures = {(figure["paper"], figure["item"]): figure["value"] for figure in published_figures(ROWS)}
    for where, scene, fps, triangles in biri.RATES:
        (published,) = (row for row in PUBLISHED if row.scene == scene)
        assert (figures["biri", f"Table 2, {where}, FPS"], published.fps) == (fps, fps)
        assert figures["biri", f"Table 2, {where}, triangles"] == triangles
        if published.shares:
            shares = biri.SHARES[scene][1]
            assert published.shares == shares
    cells = sum(len(table.fps) * 2 + sum(len(values) for values in table.passes.values()) for table in TABLE)
    assert sum(item.startswith("Table 1") for paper, item in figures if paper == "billeter") == cells
    assert all(isinstance(figure["value"], (int, float)) for figure in published_figures(ROWS))


def timing(rate):
    return {"median_ms": 1000 / rate, "low_ms": 1000 / rate, "high_ms": 1000 / rate}


def biri_tables(speed, shares=(1.0, 2.0, 3.0, 4.0, 90.0)):
    """Return the tables of Biri, all rates `speed` times the published ones."""
    rows = []
    for published in PUBLISHED:
        for white in (1.0, 0.0):
            row = {"published": {"scene": published.scene}, "size": list(published.size), "kernel": "exact"}
            row |= {"white": white, "cone": 0, "tolerance": 0, "triangles": 7, "shares": list(shares)}
            row |= {"light_moved": timing(speed * published.fps), "error": {"relative_rmse": 0.5 / speed}}
            row |= {"frame_error": {"p50": 0.01}}
            rows.append(row)
    study = [
        {"relative_bias": -0.3, "relative_rmse": 0.2, "printed": 2.0, "polynomial": 0.4},
        {"relative_bias": 0.1, "relative_rmse": 0.5, "printed": 1.0, "polynomial": 0.6},
    ]
    return {"rows": rows, "constant_distance": study}


def billeter_tables(speed):
    """Return the figures and the table of Billeter, all rates `speed` times the published ones."""
    figures = []
    for where, method, values, fps in (
        *(
            (f"Fig. 6{letter}", "light-volumes", {"evaluation": "mesh"}, fps)
            for letter, fps in zip("abc", (230, 165, 25))
        ),
        ("Fig. 7a", "ray-march", {"sum": "transitions"}, 25),
        ("Fig. 7b", "ray-march", {"sum": "transitions"}, 10),
        ("Fig. 7c", "light-volumes", {"evaluation": "mesh"}, 96),
        ("Fig. 7c", "light-volumes", {"evaluation": "walk", "walls": "slanted"}, 192),
        ("peer", "min-max", {}, 48),
    ):
        error = {"relative_rmse": 1.0 if method == "ray-march" else 0.1}
        figures.append(
            {
                "entry": {"where": where, "method": method, "parameters": [[*pair] for pair in values.items()]},
                "light_moved": timing(speed * fps),
                "missing": None,
                "error": error,
            }
        )
    table = []
    for view in TABLE:
        for texels, rates in view.fps.items():
            for evaluation, rate in zip(("static", "adaptive"), rates):
                passes = {name: value / speed for name, value in view.passes.get((texels, evaluation), {}).items()}
                row = {"scene": view.scene, "map": texels, "evaluation": evaluation, "passes": passes, "missing": None}
                table.append(row | {"light_moved": timing(speed * rate)})
    return {"figures": figures, "table": table}


EVIDENCE = {"biri tables": biri_tables, "billeter tables": billeter_tables}


@pytest.mark.parametrize(
    "row", [row for row in ROWS if row.experiment in EVIDENCE], ids=lambda row: f"{row.paper}: {row.item}"
)
def test_rows_of_tables_follow_what_was_measured(row):
    fast, slow = (judge(row, EVIDENCE[row.experiment](speed)) for speed in (2.0, 0.5))
    assert list(fast) == KEYS
    assert json.dumps(fast, allow_nan=False)
    if row.unit in ("frames/s", "ms") and row.rule is not None:
        assert (fast["verdict"], slow["verdict"]) == ("reproduced", "differs")
    if row.unit == "frames/s" and isinstance(row.published, (int, float)) and "ours" not in row.item and row.rule:
        assert fast["measured"] == pytest.approx(2 * row.published)


def test_a_table_that_was_not_measured_is_no_verdict_but_a_reason():
    for row in ROWS:
        if row.experiment == "biri tables" and row.rule is not None:
            verdict = judge(row, {"rows": [], "constant_distance": []})
            assert verdict["verdict"] == "impossible"
            assert "not measured" in verdict["why"]
    missing = billeter_tables(1.0)
    for row in (*missing["figures"], *missing["table"]):
        row |= {"light_moved": None, "missing": "a frame takes 99 s"}
    for row in ROWS:
        if row.experiment == "billeter tables":
            verdict = judge(row, missing)
            assert (verdict["verdict"], verdict["why"]) == ("impossible", "not measured: a frame takes 99 s"), row.item


def test_shares_that_the_spread_hides_are_not_told_apart():
    evidence = biri_tables(1.0, shares=(10.0, 20.0, None, 30.0, None))
    rows = {row.item: judge(row, evidence) for row in ROWS if row.experiment == "biri tables"}
    assert "cannot be told apart" in rows["Table 1, Fig. 7 left, stage 3"]["why"]
    assert rows["Table 1, Fig. 7 left, stage 3"]["verdict"] == "impossible"
    assert rows["Table 1, Fig. 7 left, stage 1"]["measured"] == 10.0
    assert rows["6, main cost, Fig. 7 left"]["verdict"] == "impossible"
    known = {row.item: judge(row, biri_tables(1.0)) for row in ROWS if row.experiment == "biri tables"}
    assert known["6, main cost, Fig. 7 left"]["verdict"] == "reproduced"
    other = {
        row.item: judge(row, biri_tables(1.0, (40.0, 1, 1, 1, 30.0)))
        for row in ROWS
        if row.paper == "biri" and row.experiment == "biri tables"
    }
    assert (other["6, main cost, Fig. 7 left"]["measured"], other["6, main cost, Fig. 7 left"]["verdict"]) == (
        2,
        "differs",
    )


def test_adaptive_tessellation_pays_from_the_smallest_map_on():
    (row,) = (row for row in ROWS if row.item == "6, adaptive tessellation, Sponza")
    assert judge(row, billeter_tables(1.0))["measured"] == 4096  # as published
    evidence = billeter_tables(1.0)
    billeter.view(evidence, "colonnade", 2048, "adaptive")["light_moved"] = timing(99)
    assert (judge(row, evidence)["measured"], judge(row, evidence)["verdict"]) == (2048, "differs")
    billeter.view(evidence, "colonnade", 4096, "adaptive")["light_moved"] = timing(1)
    assert judge(row, evidence)["verdict"] == "impossible"


def test_rows_without_an_experiment_of_the_run_are_left_out():
    rows = [row for row in ROWS if row.paper == "biri"]
    assert {row["item"] for row in judged(rows, {"nothing": {}})} == {
        row.item for row in rows if row.experiment == "nothing"
    }
    assert experiments_of(rows)[0] == "nothing"
    assert judged(rows, {}) == []


def test_the_papers_that_contradict_themselves():
    rows = {row.item: judge(row, {}) for row in ROWS if row.experiment == "nothing"}
    assert (rows["6, two pens"]["verdict"], rows["6, two pens"]["measured"]) == ("refuted", 23)
    assert (rows["7, 25 frames/s"]["verdict"], rows["7, 25 frames/s"]["measured"]) == ("refuted", 23)
    assert rows["Table 1, sums"]["verdict"] == "reproduced"
    assert rows["Fig. 8a, FPS"]["verdict"] == rows["Fig. 8c, FPS"]["verdict"] == "reproduced"


def test_the_opposite_figure_has_the_opposite_verdict():
    """No row has a verdict that its figure cannot change."""
    for row in ROWS:
        if row.rule is None:
            continue
        goal = row.published.value if isinstance(row.published, Bound) else row.published
        holds = {row.rule.holds(goal, value) for value in (goal, goal - 1e9, goal + 1e9)}
        assert holds == {True, False}, row.item


def test_the_constant_distance_is_judged_by_its_study():
    rows = {
        row.item: judge(row, biri_tables(1.0))
        for row in ROWS
        if row.item.startswith("4.2, ") and row.experiment == "biri tables"
    }
    measured = {item: row["measured"] for item, row in rows.items() if row["measured"] is not None}
    assert measured["4.2, constant R"] == 0.3
    assert measured["4.2, bounded media"] == pytest.approx((10 + 2) / 2)
    assert measured["4.2, coefficients"] == pytest.approx((2 + 1.2) / 2)
    assert measured["4.2, coefficients, largest"] == pytest.approx(2.0)


def test_the_tables_of_billeter_are_measured_as_far_as_rows_ask_for_them(variant, monkeypatch):
    monkeypatch.setattr(billeter_tables_module, "MAPS", (16, 32))
    evidence = billeter_tables_module.billeter_tables(size=(16, 12))
    rows = {row.item: judge(row, evidence) for row in ROWS if row.experiment == "billeter tables"}
    measured = [item for item, row in rows.items() if row["measured"] is not None]
    assert [
        item for item in rows if item.startswith(("Fig.", "abstract", "6, map", "6, peers")) and item not in measured
    ] == []
    assert [(row["scene"], row["map"], row["evaluation"]) for row in evidence["table"]] == [
        (scene, texels, evaluation)
        for scene in ("colonnade", "tangle")
        for texels in (16, 32)
        for evaluation in ("static", "adaptive")
    ]
    assert all(row["light_moved"]["median_ms"] > 0 for row in evidence["table"])


def test_the_tables_of_biri_are_measured_as_far_as_rows_ask_for_them(variant, monkeypatch):
    monkeypatch.setattr(biri_tables_module, "constant_distance_study", lambda: ())
    monkeypatch.setattr(biri_tables_module, "_SECONDS", 0.0)
    evidence = biri_tables_module.biri_tables(scale=0.04)
    assert [(row["published"]["scene"], row["white"] > 0) for row in evidence["rows"]] == [
        (published.scene, as_published) for published in PUBLISHED for as_published in (False, True)
    ]
    assert biri.table_row(evidence, "clutter", (32, 24))["kernel"] == "taylor"
    assert biri.table_row(evidence, "clutter", (32, 24), ours=True)["kernel"] == "exact"
    assert biri.table_row(evidence, "clutter") is None
