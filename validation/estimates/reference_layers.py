# SPDX-License-Identifier: BSD-3-Clause
"""The reference of an image of another renderer, and its standard error: the one place that says what its total holds.

A renderer shows the area lights that the camera sees: Mitsuba's integrators do unless `hide_emitters` is set, and so do
those of Blender for an emitting mesh. So `total` is airlight, lit surface and `emitted` together. It is without
`emitted` where a file has that as a layer beside it, as the files of `airlight reference` do, and for frames of our own
methods, which show no light. Where a renderer hides its lights (Blender's light objects by default, `hide_emitters`),
compare the layer `airlight`, or leave the lights out here.
"""

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.ray_values import TruthImage
from reference.storage.exr import TOTAL

Array = NDArray[np.float64]


def reference_layer(truth: TruthImage, layer: str, *, emitted: bool = True) -> Array:
    """Return 'airlight', 'surface' or 'total', (height, width, 3) [W/(m^2 sr)].

    `emitted` says whether area lights that the camera sees are part of the total.
    """
    if layer != TOTAL:
        return np.asarray(getattr(truth, layer))
    total = truth.airlight + truth.surface
    return total if truth.emitted is None or not emitted else total + truth.emitted


def reference_error(truth: TruthImage, layer: str) -> Array | None:
    """Return the standard error of a layer, (height, width, 3) [W/(m^2 sr)]; None without area lights, where it is 0.

    Airlight and surface have draws of their own, so that the variances of the total add up; what lights emit is exact.
    """
    if truth.airlight_se is None or truth.surface_se is None:
        return None
    if layer == TOTAL:
        return np.hypot(truth.airlight_se, truth.surface_se)
    return np.asarray(getattr(truth, f"{layer}_se"))
