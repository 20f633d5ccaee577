# SPDX-License-Identifier: BSD-3-Clause
"""A report from Python studies the scenes that it is asked for, and refuses what it cannot study before the work."""

import numpy as np
import pytest

import airlight
from reference.storage.exr import Image, write_exr
from reports.report.asked import scenes_of_images


def test_images_of_other_scenes_are_a_mistake(variant, tmp_path):
    write_exr(tmp_path / "open-fog.exr", Image({"total": np.ones((6, 8, 3))}))
    with pytest.raises(airlight.InputError, match="has no image of hall, only of open-fog"):
        airlight.report(tmp_path / "report", scenes=["hall"], images=tmp_path)
    names, shown = scenes_of_images(None, tmp_path, ["hall"])
    assert (names, list(shown)) == (["open-fog"], ["open-fog"])


def test_a_scene_that_cannot_be_read_is_refused_before_the_work(variant, tmp_path):
    (tmp_path / "bad.xml").write_text("<scene version='3.0.0'></scene>")
    with pytest.raises(airlight.InputError):
        airlight.report(tmp_path / "report", scenes=["open-fog", str(tmp_path / "bad.xml")])
    assert not list((tmp_path / "report").iterdir())
