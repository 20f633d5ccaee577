# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report holds the verdicts whose experiments its effort measures."""

from dataclasses import replace

from reports.report.others import other_parts
from validation.study.study import STUDIES, standard_study


def papers(study):
    return [part.title for part in other_parts(study) if part.kind == "papers"]


def test_a_larger_effort_measures_more_and_part_of_its_scenes_none(own_cache):
    studies = [standard_study(name) for name in STUDIES]
    quick, default, full = map(papers, studies)
    assert quick == ["formulas", "stencil"]  # no image
    assert set(quick) < set(default) < set(full)
    assert papers(replace(studies[1], scenes=("open-fog",))) == []
    assert papers(replace(studies[0], name="mine")) == []
