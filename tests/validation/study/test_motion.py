# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a method that keeps history lags by it, and one that does not is exact in every frame."""

import numpy as np
import pytest

from analytic.errors import InputError
from validation.scenes.loading import load_scene
from validation.study.motion import USUAL, method_motion


def test_froxels_with_history_lag_and_planes_do_not(variant):
    loaded = load_scene("open-fog", (32, 24))
    before = np.array(loaded.scene.emitters()[0].world_transform().matrix)
    rows = method_motion(loaded.scene, loaded.animation, [USUAL[0], USUAL[2]], frames=16, turn=240)
    planes, froxels = rows
    assert planes["relative_rmse"] < 1e-5  # float32 beside the light
    assert abs(planes["lag"]) < 1e-4
    # Of a history of 0.9, 0.9/(1 - 0.9) = 9 frames are expected; froxels blur, which a lag does not describe.
    assert froxels["lag"] == pytest.approx(9, rel=0.3)
    assert froxels["persistence"] > 4 * froxels["persistence_se"]
    assert froxels["flicker_beside_lag"] < froxels["flicker"]
    np.testing.assert_array_equal(np.array(loaded.scene.emitters()[0].world_transform().matrix), before)


def test_what_does_not_move_is_refused(variant):
    loaded = load_scene("penumbra-plane", (16, 12))
    with pytest.raises(InputError, match="lights with extent"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1])
    with pytest.raises(InputError, match="wanted at least 10 for a step"):
        method_motion(loaded.scene, loaded.animation, USUAL[:1], stimulus="step", frames=9)
