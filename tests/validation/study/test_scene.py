# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a study compares with a reference is cached for that reference alone."""

from dataclasses import replace

import pytest

import airlight.validation.study.scene_rows as rows_module
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.run import cell_row
from airlight.validation.study.scene import open_scene
from airlight.validation.study.scene_rows import TimesInputs, cell_inputs, scene_times
from airlight.validation.study.study import Cell, standard_study
from airlight.validation.study.turns import CellTimes


@pytest.mark.claim("report-kept")
def test_rows_hang_on_the_number_of_light_samples_of_their_reference(variant):
    """Rows that were compared with 16 samples stood beside a reference of
    1024 and its smaller error.
    """
    usual = standard_study("quick").at((8, 6))
    studies = [
        open_scene("penumbra-plane", replace(usual, points=points), {}) for points in (4, 16, None)
    ]
    assert len({study.reference_inputs.key for study in studies}) == 3
    assert len({cell_inputs(study, study.configurations[0]).key for study in studies}) == 3


@pytest.mark.claim("report-kept")
def test_times_are_kept_only_with_those_of_a_method_that_is_tried_again(monkeypatch, own_cache):
    """A user's method failed once; it was rendered in the next report, and never had times."""
    asked = []

    def timed(study, rows, apart):
        asked.append([row.status for row in rows])
        return [CellTimes(prepare_ms=1.0 if row.status == "done" else None) for row in rows]

    monkeypatch.setattr(rows_module, "_scene_times", timed)
    cell = Cell("open-fog", (8, 6), (), Configuration("own.py:fog"))
    inputs = TimesInputs((cell,), ((),), {})
    for status in ("refused", "done", "done"):
        kept = scene_times(None, inputs, [cell_row(cell, status=status)], None)
    assert asked == [["refused"], ["done"]]
    assert kept.value[0].prepare_ms == 1.0
