# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the page of verdicts is what a run of `airlight fidelity` printed, of the rows that there are."""

import copy

import pytest

from analytic.errors import InputError
from reports.docs.fidelity import RECORD, ROOT, current_page, joined, page, read_record, redraw
from validation.fidelity.catalogue import ROWS, published_figures
from validation.fidelity.row import VERDICTS

EMPTY = "before\n<!-- verdicts: begin -->\nold\n<!-- verdicts: end -->\nafter\n"


def stale_rows(record):
    """Return in what the rows of a run differ from those that are measured now, a line each."""
    figures = {(figure["paper"], figure["item"]): figure["value"] for figure in published_figures(ROWS)}
    now = {(row.paper, row.item): (row.claim, row.unit, figures.get((row.paper, row.item))) for row in ROWS}
    then = {(row["paper"], row["item"]): (row["claim"], row["unit"], row["published"]) for row in record["fidelity"]}
    stale = [f"{paper}, {item}: not in the run" for paper, item in now if (paper, item) not in then]
    stale += [f"{paper}, {item}: no such row any more" for paper, item in then if (paper, item) not in now]
    return stale + [f"{key[0]}, {key[1]}: is not what it was" for key in now if key in then and now[key] != then[key]]


@pytest.fixture(scope="module")
def record():
    return read_record(ROOT / RECORD)


def test_the_page_is_made_of_its_run():
    """Run `python -m reports.docs.fidelity` if this fails."""
    assert (ROOT / "docs/fidelity.md").read_text(encoding="utf-8") == current_page()


@pytest.mark.claim("verdicts-are-of-a-run")
def test_the_run_has_the_rows_that_there_are(record):
    """Run `airlight fidelity --json > FILE` and `python -m reports.docs.fidelity FILE` if this fails."""
    assert stale_rows(record) == []


def test_verdicts_of_the_run_are_known_and_measured(record):
    for row in record["fidelity"]:
        assert row["verdict"] in VERDICTS
        assert row["why"]
        assert (row["measured"] is not None) or row["verdict"] == "impossible", row["item"]


def test_a_row_that_changed_is_stale(record):
    changed = copy.deepcopy(record)
    changed["fidelity"][0]["claim"] = "other words"
    gone = changed["fidelity"].pop()
    changed["fidelity"].append(gone | {"item": "eq. 99"})
    words = stale_rows(changed)
    assert any("is not what it was" in sentence for sentence in words)
    assert f"{gone['paper']}, {gone['item']}: not in the run" in words
    assert f"{gone['paper']}, eq. 99: no such row any more" in words


def row(**changes):
    known = {"paper": "biri", "item": "eq. 1", "claim": "words", "verdict": "refuted", "published": 3, "measured": 2.5}
    return known | {"unit": "m", "command": "airlight fidelity", "why": "so"} | changes


def run(*rows, measured="2026-11-22 20:00:00 +0000", processor="abacus"):
    environment = {"processor": processor, "threads": 2, "variant": "llvm_ad_rgb", "versions": {}}
    return {"measured": measured, "environment": environment, "fidelity": list(rows), "left_out": 0}


def test_the_page_shows_rows_by_paper():
    text = page(EMPTY, run(row(), row(item="eq. 2", verdict="reproduced"), row(paper="sun", measured=None)))
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "2 rows: 1 reproduced, 1 refuted." in text
    assert "| eq. 1 | words | refuted | 3 | 2.5 | m | airlight fidelity | so |" in text
    assert "## Sun" in text


def test_runs_of_one_paper_each_are_joined():
    first, second = run(row(), row(paper="sun")), run(row(measured=9.0), measured="2026-11-22 21:00:00 +0000")
    both = joined([first, second])
    assert [(row["paper"], row["measured"]) for row in both["fidelity"]] == [("biri", 9.0), ("sun", 2.5)]
    assert both["measured"] == first["measured"]
    with pytest.raises(InputError, match="different machines"):
        joined([first, run(row(), processor="slide rule")])


def test_another_file_is_refused(tmp_path):
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(InputError, match="wanted what `airlight fidelity --json` prints"):
        redraw(tmp_path, [tmp_path / "other.json"])
