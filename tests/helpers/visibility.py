# SPDX-License-Identifier: BSD-3-Clause
"""Shadow rays of Mitsuba, to hold lit intervals against."""

import numpy as np
from numpy.typing import NDArray

from reference.visibility.lit_intervals import _shadow_rays, _visible
from reference.visibility.random_checks import Visible

Array = NDArray[np.float64]


def visibility_test(scene, position: Array, rays: tuple[Array, Array, Array]) -> Visible:
    """Return a function (ray numbers, angles) -> whether the light at `position` reaches those points.

    The shadow rays start at the light, where nothing is close, and stop twenty float32 roundings before the point: a
    point on a surface must not be blocked by that surface.
    """
    return _visible(scene, _shadow_rays(position, rays))
