# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from validation.configurations.methods import QUICK, Configuration
from validation.frames import scene_study as study
from validation.frames.benchmark import Measurement
from validation.frames.scene_study import EFFORTS, Effort, open_study, with_flips
from validation.scenes.registry import FOG_SCENES

TINY = Effort("tiny", (16, 12), (16, 12), (8, 6), {"volpath": 0.5}, {"volpath": 8}, 0.01)


def test_scenes_lit_by_lights_with_extent_are_compared_at_half_the_width(variant):
    emitters = {name: FOG_SCENES[name].build().values() for name in FOG_SCENES}
    wide = {name for name, parts in emitters.items() if any(isinstance(p, dict) and "emitter" in p for p in parts)}
    assert len(wide) == 4
    for effort in EFFORTS.values():
        sizes = {name: effort.of(name) for name in FOG_SCENES}
        width, height = effort.image
        assert {name for name, of in sizes.items() if of.image == (width // 2, height // 2)} == wide
        assert all(sizes[name] == effort for name in set(FOG_SCENES) - wide)
        assert {of.timed for of in sizes.values()} == {effort.timed}
        width, height = effort.checked
        for name in wide:
            narrow = sizes[name]
            assert narrow.checked == (width // 2, height // 2)
            paths = np.prod(narrow.checked) * narrow.samples["volpath"]
            assert paths == np.prod(effort.checked) * effort.samples["volpath"]


def test_flip_is_computed_where_it_is_asked_for_and_there_is_a_frame(monkeypatch):
    asked = []
    monkeypatch.setattr(study, "flip_hdr", lambda truth, test: asked.append((truth.mean(), test.mean())) or "flip")
    black = np.zeros((2, 3, 3))
    frame = SimpleNamespace(airlight=black + 2, surface=black + 1)
    measured = [
        Measurement(QUICK[0], frame, None, None, None),
        Measurement(QUICK[1], None, None, None, None, refused="no"),
        Measurement(Configuration("ray-march", None, (("steps", 3),)), frame, None, None, None),
    ]
    truth = SimpleNamespace(airlight=black + 5, surface=black)
    complete = with_flips(SimpleNamespace(effort=replace(TINY, flip="kinds"), truth=truth), measured, workers=2)
    assert [measurement.flip for measurement in complete] == ["flip", None, None]
    assert [measurement.configuration for measurement in complete] == [
        measurement.configuration for measurement in measured
    ]
    assert asked == [(5.0, 3.0)]


def test_frames_are_timed_at_their_own_size(variant):
    studied = open_study("open-fog", replace(TINY, timed=(32, 24)))
    assert (studied.scene.camera.width, studied.timed.camera.width, studied.probe.camera.width) == (16, 32, 64)
    assert studied.scene is studied.scene  # read once


@pytest.mark.slow
def test_without_patience_the_clock_decides_nothing(variant, own_cache, monkeypatch):
    """Two runs, one of them on a machine so busy that hours pass between two batches: the same samples."""
    from validation.estimates import agreement

    def checked():
        return study.check_truth(open_study("open-fog", replace(TINY, margins={"single-scatter": 0.01})))

    hours = iter(range(0, 10**9, 3600))
    quiet = checked()
    own_cache.rename(own_cache.with_name("other"))
    monkeypatch.setattr(agreement, "time", SimpleNamespace(monotonic=lambda: float(next(hours))))
    busy = checked()
    assert quiet
    assert busy == quiet
    impatient = study.check_truth(open_study("open-fog", replace(TINY, margins={"volpath": 1e-6}, patience=1.0)))
    assert not any(verdict.finished for verdict in impatient.values())
