# SPDX-License-Identifier: BSD-3-Clause
"""The phase function of a scene as the computation of slabs needs it."""

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.slab_orders.phases import AnglePhase
from realtime.droplets.table import CUT
from realtime.numerics.array_types import ArrayTypes
from realtime.scene.phase import Phase

Array = NDArray[np.float64]


def slab_phase(phase: Phase, types: ArrayTypes, *, modified: bool = False) -> AnglePhase:
    """Return the phase function of a scene by its values.

    `phase`: of a medium of the scene; `types`: of its numbers; `modified`: whether the peak below `CUT` is cut to zero:
    then lengths are those of the medium whose density is lowered by `share_of_peak`.
    """
    edge = np.deg2rad(CUT)

    def heights(angles: Array) -> Array:
        values = _values(phase, types, angles)
        return np.where(angles < edge, 0.0, values) if modified else values

    return AnglePhase(heights, np.array([0.0, edge, np.pi]))


def share_of_peak(phase: Phase, types: ArrayTypes) -> float:
    """Return the share of the light [1] that a phase function scatters by less than `CUT`."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    edge = np.deg2rad(CUT)
    angles = edge * (nodes + 1) / 2
    return float(weights @ (_values(phase, types, angles) * np.sin(angles)) * edge / 4)


def _values(phase: Phase, types: ArrayTypes, angles: Array) -> Array:
    down, up = (types.scalar(function(angles / 2) ** 2) for function in (np.sin, np.cos))
    return np.array(phase.evaluate_half(down, up), dtype=np.float64)
