# SPDX-License-Identifier: BSD-3-Clause
"""How far batches of Monte Carlo are from an image of the quadrature."""

import numpy as np


def biases(reference, image, batches):
    """Relative biases of airlight and surface, pixels near the lamp left out, and half
    of their 95 % intervals.
    """
    away = (image.light_angle > 0.12)[..., None]
    found = []
    for number, layer in enumerate((image.airlight, image.surface)):
        means = np.array(
            [np.sum(each.mean[number].reshape(layer.shape) * away) for each in batches]
        )
        ratio = means / np.sum(layer * away)
        # Student, 39 degrees
        found.append((ratio.mean() - 1, 2.02 * ratio.std(ddof=1) / np.sqrt(len(ratio))))
    return found
