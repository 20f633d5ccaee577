# SPDX-License-Identifier: BSD-3-Clause
"""What an estimator is compared with: the quadrature image, for volpath that of its shorter shadow ray."""

import numpy as np
import pytest

from reference.scene.shadow_epsilon import measure_shadow_epsilon
from validation.estimates.agreement import estimator_truth
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import load_scene


@pytest.mark.claim("corrected-for-the-epsilon")
def test_volpath_should_find_a_little_more_light(variant):
    """exp(-sigma_t r (1 - epsilon)) over exp(-sigma_t r): at most 1 + 2 epsilon where sigma_t r is below 2."""
    scene = load_scene("open-fog", (16, 12)).scene
    plain, mask = estimator_truth(scene, "single-scatter")
    shortened, same = estimator_truth(scene, "volpath")
    assert mask.shape == (12, 16)
    np.testing.assert_array_equal(mask, same)
    np.testing.assert_array_equal(plain, truth_image(scene).airlight[mask])
    lit = plain > 0
    assert lit.all(axis=1).any()
    more = shortened[lit] / plain[lit] - 1
    assert more.min() > 0
    assert more.max() < 2 * measure_shadow_epsilon()
