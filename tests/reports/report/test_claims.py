# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report holds the verdicts whose experiments its effort measures."""

from dataclasses import replace

from reports.report.claims import paper_parts
from validation.study.scene import EFFORTS


def test_a_larger_effort_measures_more_and_part_of_its_scenes_none(own_cache):
    efforts = [EFFORTS[name] for name in ("quick", "default", "full")]
    quick, default, full = ([part.title for part in paper_parts(each, each.scenes)] for each in efforts)
    assert quick == ["formulas", "stencil"]  # no image
    assert set(quick) < set(default) < set(full)
    assert paper_parts(efforts[1], ["open-fog"]) == []
    assert paper_parts(replace(efforts[0], scenes=()), ["my-scene.xml"]) == []
