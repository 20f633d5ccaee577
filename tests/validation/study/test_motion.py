# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a method that keeps history lags by it, and one that does not is exact in every frame."""

import numpy as np
import pytest

from analytic.errors import InputError
from validation.scenes.loading import load_scene
from validation.study.configuration import Configuration, named_configurations
from validation.study.motion import method_motion

USUAL = named_configurations("motion")


@pytest.mark.claim("history-lag", tolerance="0.01 frames: float32 beside the light")
def test_a_history_lags_by_its_weight_and_planes_do_not(variant):
    loaded = load_scene("open-fog", (32, 24))
    before = np.array(loaded.scene.emitters()[0].world_transform().matrix)
    averaged = Configuration("unshadowed+history", "exact", (("alpha", 0.1),))
    rows = method_motion(loaded.scene, loaded.animation, [USUAL[0], averaged], frames=16, turn=240)
    planes, late = (row.measures for row in rows)
    assert planes.relative_rmse.value < 1e-5  # float32 beside the light
    assert abs(planes.lag.lag.value) < 1e-4
    assert late.lag.lag.value == pytest.approx(9, abs=0.01)
    assert late.lag.persistence.above(4)
    assert late.flicker_beside_lag.value < late.flicker.value
    np.testing.assert_array_equal(np.array(loaded.scene.emitters()[0].world_transform().matrix), before)


def test_a_noisy_march_with_history_is_measured_in_several_runs(variant):
    loaded = load_scene("open-fog", (32, 24))
    (row,) = method_motion(loaded.scene, loaded.animation, [USUAL[3]], frames=16, turn=240, runs=3)
    # Of 0.1 for the newest frame 9 frames are expected; errors are those of three runs, Student's 2 degrees.
    lag, bias = row.measures.lag.lag, row.measures.bias
    assert abs(lag.value - 9) < 0.5 + 10 * lag.error
    assert 0 < bias.error < row.measures.relative_rmse.value


def test_what_does_not_move_is_refused(variant):
    loaded = load_scene("penumbra-plane", (16, 12))
    with pytest.raises(InputError, match="area lights"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1])
    with pytest.raises(InputError, match="wanted at least 10 for a step"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1], stimulus="step", frames=9)
