# SPDX-License-Identifier: BSD-3-Clause
"""Water droplets as the phase function of a slab, in full or without the forward peak, and the fit to them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from realtime.clouds.slab_orders.phases import AnglePhase, HenyeyGreensteinPhase, SlabPhase
from realtime.droplets.series import droplet_series
from realtime.droplets.table import CUT
from realtime.scene.phase import HgDraine

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


@dataclass(frozen=True)
class HgDrainePhase(SlabPhase):
    """The function of Jendersie and d'Eon 2023, see `realtime.scene.phase.HgDraine`.

    Parameters
    ----------
    diameter
        Of the droplets, 5 to 50 [um].
    """

    diameter: float

    def moments(self, count: int) -> Array:
        """Return the moments; those of c^2 f follow from c P_l = ((l + 1) P_{l+1} + l P_{l-1})/(2 l + 1), twice."""
        fit = HgDraine(self.diameter)
        (share, narrow), (_, wide) = fit.lobes
        constant, square = fit.rise
        lobe = HenyeyGreensteinPhase(wide).moments(count + 2)
        return share * HenyeyGreensteinPhase(narrow).moments(count) + (
            constant * lobe[:count] + square * _times_cosine(_times_cosine(lobe))
        )

    def values(self, cosines: ArrayLike) -> Array:
        """Return the values."""
        fit = HgDraine(self.diameter)
        (share, narrow), (_, wide) = fit.lobes
        constant, square = fit.rise
        rise = constant + square * np.asarray(cosines, dtype=np.float64) ** 2
        return share * HenyeyGreensteinPhase(narrow).values(cosines) + rise * HenyeyGreensteinPhase(wide).values(
            cosines
        )


def _times_cosine(moments: Array) -> Array:
    """Return the moments of c f from those of f, one less."""
    degree = np.arange(moments.size - 1)
    below = np.concatenate([[0.0], moments[:-2]])
    return ((degree + 1) * moments[1:] + degree * below) / (2 * degree + 1)
