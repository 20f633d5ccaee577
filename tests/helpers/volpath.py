# SPDX-License-Identifier: BSD-3-Clause
"""What Mitsuba's path tracer says of a reference, for the tests that ask it."""

import numpy as np

from reference.monte_carlo.batches import merged
from reference.monte_carlo.volpath.integrator import volpath_batch
from reference.quadrature.image import quadrature_image
from reference.scene.shadow_epsilon import measure_shadow_epsilon


def assert_volpath_agrees(reference, *, batches, least_precision):
    """Trace batches of 256 samples a pixel: the pooled bias of each layer and channel is within four standard errors.

    The standard errors are below `least_precision`, relative; the shadow-ray epsilon is corrected.
    """
    expected = quadrature_image(reference, shadow_scale=1 - measure_shadow_epsilon())
    traced = volpath_batch(reference, 100, 256)
    for seed in range(101, 100 + batches):
        traced = merged(traced, volpath_batch(reference, seed, 256))
    for number, image in enumerate((expected.airlight, expected.surface)):
        for channel in range(3):
            total = image[..., channel].sum()
            if total == 0:
                assert not traced.mean[number].any()
                continue
            bias = traced.mean[number][:, channel].sum() / total - 1
            error = np.sqrt(np.sum(traced.standard_error[number][:, channel] ** 2)) / total
            assert error < least_precision
            assert abs(bias) < 4 * error
