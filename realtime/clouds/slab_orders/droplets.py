# SPDX-License-Identifier: BSD-3-Clause
"""Water droplets as the phase function of a slab, in full or without the forward peak."""

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.slab_orders.phases import AnglePhase
from realtime.droplets.series import droplet_series
from realtime.droplets.table import CUT

Array = NDArray[np.float64]


def droplet_phase(radius: float, gamma: float, wavelength: float, *, modified: bool) -> AnglePhase:
    """Return the phase function of droplets.

    Parameters
    ----------
    radius, gamma, wavelength
        See `realtime.droplets.series.droplet_series`.
    modified
        Whether the peak below `CUT` is cut to zero: then lengths are those of the medium whose density is lowered by
        the share of the peak.
    """
    series = droplet_series(radius, gamma, wavelength)
    edge = np.deg2rad(CUT)

    def cut(angles: Array) -> Array:
        return np.where(angles < edge, 0.0, series.values(angles))

    if modified:
        return AnglePhase(cut, np.array([0.0, edge, np.pi]))
    return AnglePhase(series.values, np.array([0.0, np.pi]))
