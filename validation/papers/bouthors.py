# SPDX-License-Identifier: BSD-3-Clause
"""Sections 2, 3 and 5 of Bouthors, Neyret, Max, Bruneton, Crassin 2008 again, on a slab: what the slab alone decides.

* Fig. 3, right: the share of sets of orders in reflectance and transmittance, by thickness.
* Fig. 3, left: sets of orders seen at a depth of 100 m in a slab of 1000 m with the sun at 75 degrees: how far the
  radiance of each changes with the azimuth.
* Section 2 and the appendix: the reflectance of a slab with the extinction as printed, with half the density for a peak
  of 44 %, and with Henyey and Greenstein's function, over that of the droplets.

Clouds are of droplets with r_e = 6 um, gamma = 2, 4e8 in a cubic metre, at 0.55 um; lengths in metres become optical
by their extinction, lowered by the share that is cut out of the peak where the phase function is the modified one.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from analytic.droplets import Modified, optics
from realtime.clouds.canonical.directional_moments import DirectionalMoments
from realtime.clouds.canonical.sets import SETS, set_name
from realtime.clouds.slab_orders.droplets import droplet_phase
from realtime.clouds.slab_orders.moments import SlabOrders, order_sets
from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase, SlabPhase

Progress = Callable[[float, str], None]

THICKNESSES = (50.0, 100.0, 300.0, 1000.0)  #: [m]
SUNS = (0.0, 75.0)  #: [degrees]
FIGURE_3 = (1000.0, 100.0, 75.0)  #: thickness [m], depth [m] and sun [degrees] of the left part
_PRINTED_G = 0.99
_DROPLETS = (6.0, 2.0, 0.55)
_STREAMS, _NODES = 48, 6  #: which give reflectances to 1e-4


def slab_study(*, progress: Progress | None = None) -> dict[str, Any]:
    """Measure what a slab decides.

    Parameters
    ----------
    progress
        Called with (share done, what).

    Returns
    -------
    dict
        `shares`: rows with `thickness` [m], `sun` [degrees], `reflectance`, `transmittance`, and the shares of the
        orders from 1 to 30 and from 31 on in both; `azimuth` by set: the largest radiance over the azimuths over the
        least, in the direction where that is largest; `reflectance`: by thickness [m] with the sun at 0, that of the
        droplets, and over it that with `printed` extinction, with the `modified` function and the density lowered by
        what is cut, by `half`, and with Henyey and Greenstein's function of the `matched` and of the `printed_g` mean
        cosine.
    """
    tell = progress or (lambda share, what: None)
    green = optics()
    cut = Modified(green).removed
    full, modified = (droplet_phase(*_DROPLETS, modified=cut_off) for cut_off in (False, True))
    lowered = (1 - cut) * green.extinction
    shares = []
    for number, (thickness, sun) in enumerate((t, s) for t in THICKNESSES for s in SUNS):
        tell(0.4 * number / (len(THICKNESSES) * len(SUNS)), f"{thickness:g} m")
        shares.append({"thickness": thickness, "sun": sun, **_shares(thickness * lowered, sun, modified)})
    tell(0.4, "by azimuth")
    azimuth = _by_azimuth(lowered, modified)
    reflectance = {}
    for number, thickness in enumerate((50.0, 300.0, 1000.0)):
        tell(0.6 + 0.13 * number, f"reflectance at {thickness:g} m")
        tau = thickness * green.extinction
        whole = _reflectance(tau, full)
        reflectance[f"{thickness:g}"] = {
            "droplets": whole,
            "printed": _reflectance(thickness * green.printed_extinction, full) / whole,
            "modified": _reflectance((1 - cut) * tau, modified) / whole,
            "half": _reflectance(0.5 * tau, modified) / whole,
            "matched": _reflectance(tau, HenyeyGreensteinPhase(green.g)) / whole,
            "printed_g": _reflectance(tau, HenyeyGreensteinPhase(_PRINTED_G)) / whole,
        }
    return {"shares": shares, "azimuth": azimuth, "reflectance": reflectance}


def _reflectance(tau: float, phase: SlabPhase) -> float:
    _, total = order_sets(_slab(tau, 1.0, phase), [(1, math.inf)])
    return float(total.up[0, 0])


def _slab(tau: float, mu0: float, phase: SlabPhase) -> SlabOrders:
    return SlabOrders(tau, mu0, phase, 1.0, streams=_STREAMS, nodes=_NODES)


def _shares(tau: float, sun: float, phase: SlabPhase) -> dict[str, float]:
    mu0 = math.cos(math.radians(sun))
    (few, many), total = order_sets(_slab(tau, mu0, phase), [(1, 30), (31, math.inf)])
    reflected, transmitted = total.up[0, 0], total.down[0, -1]
    return {
        "reflectance": float(reflected) / mu0,
        "transmittance": float(transmitted) / mu0 + math.exp(-tau / mu0),
        "reflected_1_30": float(few.up[0, 0] / reflected),
        "reflected_31_inf": float(many.up[0, 0] / reflected),
        "transmitted_1_30": float(few.down[0, -1] / transmitted),
        "transmitted_31_inf": float(many.down[0, -1] / transmitted),
    }


def _by_azimuth(lowered: float, phase: SlabPhase) -> dict[str, float]:
    """Return by set how far radiance changes with the azimuth, at the point of Fig. 3."""
    thickness, depth, sun = FIGURE_3
    mu = np.array([-0.9, -0.6, -0.3, 0.3, 0.6, 0.9])
    modes = DirectionalMoments(phase, 1.0, mu)(thickness * lowered, [math.cos(math.radians(sun))], [depth * lowered])[
        :, :, 0, 0, 0
    ]
    phi = np.linspace(0, np.pi, 37)
    m = np.arange(modes.shape[1])[:, None]
    radiance = np.einsum("smv,mp->svp", modes, np.cos(m * phi) * np.where(m > 0, 2.0, 1.0))
    ratios = radiance.max(-1) / np.maximum(radiance.min(-1), 1e-300)
    return {set_name(number): float(ratios[number].max()) for number in range(len(SETS))}
