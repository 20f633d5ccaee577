# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a study compares with a reference is kept for that reference alone."""

from dataclasses import replace
from pathlib import Path

import pytest

from validation.engine.images import EngineImage
from validation.study.scene import measured, measured_image, open_scene
from validation.study.study import standard_study

MACHINE = {"host": "a"}


def study_of(points):
    study = replace(standard_study("quick").at((8, 6)), points=points)
    return open_scene("penumbra-plane", study, MACHINE)


@pytest.mark.claim("report-kept")
def test_rows_and_images_hang_on_the_number_of_light_samples_of_their_reference(variant):
    """Rows that were compared with 16 samples stood beside a reference of 1024 and its smaller error."""
    studies = [study_of(points) for points in (4, 16, None)]
    assert len({study.reference_key for study in studies}) == 3
    assert len({measured.key(*study.given(study.configurations[0])) for study in studies}) == 3
    shown = EngineImage("penumbra-plane", "a", Path("a.exr"))
    assert len({measured_image.key(*study.given_image(shown, "0", None)) for study in studies}) == 3
