# SPDX-License-Identifier: BSD-3-Clause
"""The airlight that a Monte Carlo estimator of a scene converges to, by quadrature.

For volpath that is the integral over the shadow ray that it traces, which ends a little before the light; see
`validation.estimates.agreement`.
"""

import numpy as np
from numpy.typing import NDArray

from reference.scene.read import read_truth
from reference.scene.shadow_epsilon import measure_shadow_epsilon
from validation.estimates.agreement import layer_masks
from validation.estimates.quadrature import truth_image


def estimator_truth(scene, estimator: str) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the airlight that an estimator of a Mitsuba scene converges to, and the pixels that can be compared.

    The airlight is that of these pixels, (pixels, 3) [W/(m^2 sr)]; their mask, (height, width), is that of
    `validation.estimates.agreement.layer_masks`.
    """
    epsilon = measure_shadow_epsilon() if estimator == "volpath" else 0.0
    truth = truth_image(scene, shadow_scale=1 - epsilon)
    mask = layer_masks(read_truth(scene), truth)["airlight"]
    return truth.airlight[mask], mask
