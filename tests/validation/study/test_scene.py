# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a study compares with a reference is cached for that reference alone."""

from dataclasses import replace

import pytest

from airlight.validation.study.scene import open_scene
from airlight.validation.study.study import standard_study


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
    assert len({study.inputs(study.configurations[0]).key for study in studies}) == 3
