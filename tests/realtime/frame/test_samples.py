# SPDX-License-Identifier: BSD-3-Clause
"""Several rays a pixel: the mean converges to that over its area, and one ray is the centre."""

import numpy as np
import pytest

from realtime.frame.renderer import render_frame
from realtime.frame.samples import render_samples
from realtime.scene.read_scene import read_scene
from validation.estimates.quadrature import reference_image
from validation.scenes.loading import load_scene
from validation.study.configuration import configuration, prepared


@pytest.mark.parametrize("method", ["shadow-planes", "froxel-fog"])
def test_one_ray_is_the_frame_itself(variant, method):
    renderer = prepared(read_scene(load_scene("sphere-spot", (16, 12)).scene), configuration(method))
    np.testing.assert_array_equal(render_samples(renderer, 1).airlight, render_frame(renderer).airlight)


@pytest.mark.claim("anti-aliased")
def test_the_mean_converges_to_that_over_the_pixels(variant):
    """16 rays err a quarter as much as the centre alone, by the quadrature of the means over pixels."""
    loaded = load_scene("sphere-spot", (16, 12))
    reference = reference_image(loaded.scene, pixel="area").airlight
    renderer = prepared(read_scene(loaded.scene), configuration("shadow-planes"))
    shares = []

    def error(samples):
        frame = render_samples(renderer, samples, shares.append)
        return np.sqrt(np.mean((frame.airlight - reference) ** 2)) / reference.mean()

    assert error(16) < error(1) / 4
    assert shares == [number / 16 for number in range(1, 17)]
