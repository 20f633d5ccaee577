# SPDX-License-Identifier: BSD-3-Clause
"""The phase function scattered n times, P_s of the coordinates of the tables."""

import math

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical.sets import SETS
from realtime.clouds.slab_orders.phases import SlabPhase

Array = NDArray[np.float64]

ENTRIES = 1025  #: at even angles from 0 to pi
_DEGREES = 800
_LEAST = 1e-3  #: of the mean, below which nothing is divided by it


def repeated_scattering(phase: SlabPhase) -> Array:
    """Return P_s at even angles, (sets, ENTRIES).

    n scatterings of a beam without a boundary multiply Legendre moments: the mean over the orders of a set of
    sum (2 l + 1) chi_l^n P_l. The set without end counts as isotropic.
    """
    cosines = np.cos(np.linspace(0.0, np.pi, ENTRIES))
    moments = phase.moments(_DEGREES)
    series = []
    for first, last in SETS:
        if math.isfinite(last):
            powers = np.mean([moments**order for order in range(first, int(last) + 1)], axis=0)
        else:
            powers = np.eye(1, _DEGREES)[0]
        series.append((2 * np.arange(_DEGREES) + 1) * powers)
    before, now = np.zeros_like(cosines), np.ones_like(cosines)
    total = np.zeros((len(SETS), ENTRIES))
    for degree, strengths in enumerate(np.array(series).T):
        total += strengths[:, None] * now
        before, now = now, ((2 * degree + 1) * cosines * now - degree * before) / (degree + 1)
    return np.maximum(total, _LEAST)


def at_angle(table: Array, cosines: Array) -> Array:
    """Return values of one set at cosines, linear in the angle between entries."""
    return np.interp(np.arccos(np.clip(cosines, -1.0, 1.0)), np.linspace(0.0, np.pi, ENTRIES), table)
