# SPDX-License-Identifier: BSD-3-Clause
"""Properties of a scene to the numbers of a regression: logarithms of what is positive, the rest as it is.

Cost and error are products of powers far more than sums, so their logarithms are nearly linear in logarithms. Where a
property may be 0, a small number is added that stands for 'next to none'.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError

Array = NDArray[np.float64]

#: By property of `validation.properties`, what is added before the logarithm; None: the number itself.
FEATURES: dict[str, float | None] = {
    "lights": 0.0,
    "areas": None,
    "directionals": None,
    "light_size": 1e-3,
    "light_nearest": 1e-3,
    "light_ray": 0.0,
    "lights_seen": 1.0,
    "optical_depth": 1e-4,
    "optical_depth_light": 1e-4,
    "forward": 0.0,
    "extinctions": None,
    "endless": None,
    "facets": 1.0,
    "inside": None,
    "triangles": 1.0,
    "components": 1.0,
    "silhouettes": 1.0,
    "surface_share": None,
    "depth_edges": 1e-3,
    "lit_share": 1e-2,
    "shadow_edges": 1e-2,
    "shadow_edges_across": 1e-3,
    "change_without_shadows": 1e-3,
    "shadows_seen": None,
    "change_with_points": 1e-5,
}


def features(properties: Mapping[str, float]) -> Array:
    """Return the numbers of a regression, (len(FEATURES),), in the order of `FEATURES`.

    Raises
    ------
    InputError
        For a property that is missing or not finite.
    """
    numbers = []
    for name, added in FEATURES.items():
        value = properties.get(name)
        if value is None or not math.isfinite(value):
            raise InputError(f"property {name}: got {value}, wanted a finite number; sweep again with this version")
        numbers.append(float(value) if added is None else math.log10(max(value + added, 1e-12)))
    return np.array(numbers)
