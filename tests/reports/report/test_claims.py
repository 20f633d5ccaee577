# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report holds the verdicts whose experiments its effort measures."""

from dataclasses import replace

from reports.report.claims import paper_parts, paper_rows
from validation.frames.result_cache import CachedResult
from validation.frames.scene_study import EFFORTS
from validation.papers.claims import claims


def test_a_larger_effort_measures_more_and_part_of_its_scenes_none(own_cache):
    efforts = [EFFORTS[name] for name in ("quick", "default", "full")]
    quick, default, full = ([part.title for part in paper_parts(each, each.scenes)] for each in efforts)
    assert quick == ["formulas", "stencil"]  # no image
    assert set(quick) < set(default) < set(full)
    assert paper_parts(efforts[1], ["open-fog"]) == []
    assert paper_parts(replace(efforts[0], scenes=()), ["my-scene.xml"]) == []


def test_rows_follow_the_results_of_a_run():
    data = {"experiment": "stencil", "figures": {"stage 5": 0.2, "section 5.1.5": 1.0}}
    rows = paper_rows({"papers": [CachedResult(data, {}, "2026-11-22 20:00:00 +0000", 1.0, False)]})
    expected = [each.item for each in claims() if each.experiment in ("stencil", "")]
    assert [row["item"] for row in rows] == expected
    assert paper_rows({}) == []
