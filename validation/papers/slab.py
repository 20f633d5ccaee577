# SPDX-License-Identifier: BSD-3-Clause
"""Sections 2, 3 and 5 of Bouthors, Neyret, Max, Bruneton, Crassin 2008 again, on a slab:
what the slab alone decides.

Clouds are of droplets with r_e = 6 um, gamma = 2, 4e8 in a cubic metre, at 0.55 um; lengths in
metres become optical by their extinction, lowered by what is cut out of the peak where the phase
function is the modified one. For Fig. 8, light by direction, three ways to T stand side by side:
the computation with more streams than the grid had, the grid that frames look up, and the paper's
functions, fitted to the grid (`fitted_transport.py`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import drjit as dr
import numpy as np

from airlight.analytic.droplets import Modified, optics
from airlight.realtime.clouds.canonical.coordinates import SETS, set_name
from airlight.realtime.clouds.canonical.directional_moments import DirectionalMoments
from airlight.realtime.clouds.canonical.transport_grid import (
    Transport,
    canonical_transport,
    on_device,
)
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase, SlabPhase
from airlight.realtime.numerics.array_types import ArrayTypes, array_types
from airlight.validation.arrays import Array
from airlight.validation.papers.claims import Figures
from airlight.validation.papers.fitted_transport import fit_radiance
from airlight.validation.slab.moments import DOWN, UP, SlabOrders, order_sets
from airlight.validation.slab.phases import droplet_phase, phase_pair

THICKNESSES = (50.0, 100.0, 300.0, 1000.0)  #: [m]

#: Phase functions that are compared with the droplets, by thickness [m].
_REFLECTANCES: Mapping[float, tuple[str, ...]] = {
    50.0: ("printed", "modified", "half", "printed g"),
    300.0: ("printed", "matched g"),
    1000.0: ("printed",),
}

_STREAMS, _NODES = 48, 6  # which give reflectances to 1e-4


SUN = 25.0  #: of Fig. 8 [degrees]
#: Thickness and depths of Fig. 8 [m].
PANELS: tuple[tuple[float, tuple[float, ...]], ...] = (
    (100.0, (0.0, 100.0)),
    (1000.0, (0.0, 100.0, 1000.0)),
)


def slab_figures() -> Figures:
    """Return reflectances over those of the droplets, fractions of orders [%] and how
    radiance changes by azimuth.
    """
    green = optics()
    # The modified phase function has lost a part of its peak; light in it goes straight on, so the
    # extinction is lowered by the same part.
    cut = float(Modified(green).removed)
    droplets = (6.0, 2.0, 0.55)  # r_e [um], gamma, wavelength [um]
    full, modified = (droplet_phase(*droplets, modified=cut_off) for cut_off in (False, True))
    lowered = (1 - cut) * green.extinction
    figures = {f"azimuth, {name}": ratio for name, ratio in _by_azimuth(lowered, modified).items()}
    for thickness, asked in _REFLECTANCES.items():
        tau = thickness * green.extinction
        # Optical thickness and phase function of what is compared with the droplets in full.
        slabs: dict[str, tuple[float, SlabPhase]] = {
            "printed": (thickness * green.printed_extinction, full),
            "modified": ((1 - cut) * tau, modified),
            "half": (0.5 * tau, modified),
            "matched g": (tau, HenyeyGreensteinPhase(green.g)),
            "printed g": (tau, HenyeyGreensteinPhase(0.99)),
        }
        whole = _reflectance(tau, full)
        figures |= {
            f"{thickness:g} m, {name}": _reflectance(*slabs[name]) / whole for name in asked
        }
    fractions = {
        (t, sun): _fractions(t * lowered, sun, modified) for t in THICKNESSES for sun in (0.0, 75.0)
    }
    # Fraction of orders 1 to 30 in the reflected light with the sun overhead; the rest, of higher
    # orders, is the isotropic part.
    overhead = [fractions[t, 0.0][0] for t in THICKNESSES]
    return figures | {
        # Orders appear from a fraction of 1 % on.
        "isotropic from": crossing(THICKNESSES, [100 - each for each in overhead], 1.0),
        "transmitted, 1000 m": fractions[1000.0, 0.0][1],
        "reflected, least": min(reflected for reflected, _ in fractions.values()),
    }


def crossing(places: tuple[float, ...], values: list[float], level: float) -> float:
    """Return where rising values reach a level, by a power law between the two places around it."""
    after = next(number for number, value in enumerate(values) if value >= level)
    (x0, x1), (y0, y1) = (
        np.log(places[after - 1 : after + 1]),
        np.log(values[after - 1 : after + 1]),
    )
    return float(np.exp(x0 + (math.log(level) - y0) / (y1 - y0) * (x1 - x0)))


def _reflectance(tau: float, phase: SlabPhase) -> float:
    _, total = order_sets(_slab(tau, 1.0, phase), [(1, math.inf)])
    return float(total[UP, 0, 0])


def _slab(tau: float, mu0: float, phase: SlabPhase) -> SlabOrders:
    return SlabOrders(tau, mu0, phase, 1.0, streams=_STREAMS, nodes=_NODES)


def _fractions(tau: float, sun: float, phase: SlabPhase) -> tuple[float, float]:
    """Return the fraction of orders 1 to 30 in the light that is reflected, and
    transmitted after scattering [%].
    """
    # At the upper face for reflected light, at the lower face for transmitted light.
    (few, _), total = order_sets(
        _slab(tau, math.cos(math.radians(sun)), phase), [(1, 30), (31, math.inf)]
    )
    return 100 * float(few[UP, 0, 0] / total[UP, 0, 0]), 100 * float(
        few[DOWN, 0, -1] / total[DOWN, 0, -1]
    )


def _by_azimuth(lowered: float, phase: SlabPhase) -> dict[str, float]:
    """Return by set how far radiance changes with the azimuth, at the point of Fig.
    3, where it changes most.
    """
    # thickness [m], depth [m] and sun [degrees] of the left part of Fig. 3
    thickness, depth, sun = 1000.0, 100.0, 75.0
    slab = DirectionalMoments(phase, 1.0, np.array([-0.9, -0.6, -0.3, 0.3, 0.6, 0.9]))
    modes = slab(thickness * lowered, [math.cos(math.radians(sun))], [depth * lowered])[
        :, :, 0, 0, 0
    ]
    phi = np.linspace(0, np.pi, 37)
    m = np.arange(modes.shape[1])[:, None]
    # A Fourier series in the azimuth: modes above 0 count twice, since the series runs over +-m.
    radiance = np.einsum("smv,mp->svp", modes, np.cos(m * phi) * np.where(m > 0, 2.0, 1.0))
    ratios = radiance.max(-1) / np.maximum(radiance.min(-1), 1e-300)
    return {set_name(number): float(ratios[number].max()) for number in range(len(SETS))}


def transport_figures() -> Figures:
    """Return the median error of the paper's functions over directions, the median of these over
    the curves [%].
    """
    medians = []
    for curve in transport_curves():
        # Directions dimmer than a millionth of the light of all sets are not compared: their
        # relative errors would count as much as all others.
        shown = curve.exact > 1e-6 * curve.whole
        if shown.any():
            medians.append(np.median(np.abs(curve.fit[shown] / curve.exact[shown] - 1)))
    return {"fit, median": 100 * float(np.median(medians))}


@dataclass(frozen=True, kw_only=True)
class TransportCurve:
    """T of Fig. 8 of some orders by the zenith angle of the view, in the
    plane of the sun [1/sr].
    """

    thickness: float  #: [m]
    depth: float  #: [m]
    orders: str
    angle: Array  #: [degrees]
    exact: Array
    grid: Array
    fit: Array
    whole: Array  #: of all sets of orders


def transport_curves() -> list[TransportCurve]:
    """Return T of Fig. 8 by direction."""
    pair, types = phase_pair("mie-modified"), array_types("single")
    grid = on_device(canonical_transport(pair.deterministic, 1.0), types)
    fit = fit_radiance(grid, types)
    lowered = (1 - Modified(optics()).removed) * optics().extinction
    count = 36  # zenith angles of the view
    angles = (np.arange(count) + 0.5) * np.pi / count
    # The exact curve: more streams and modes than the grid that frames look up.
    slab = DirectionalMoments(
        pair.deterministic,
        1.0,
        np.cos(angles),
        streams=48,
        modes=47,
        nodes=5,
        negligible=1e-5,
        single=False,
    )
    curves = []
    for thickness, depths in PANELS:
        t, at = thickness * lowered, [depth * lowered for depth in depths]
        modes = slab(t, [math.cos(math.radians(SUN))], at)[:, :, 0, 0]
        # In the plane of the sun all cosines of the Fourier series are 1; modes above 0 count
        # twice.
        twice = np.where(np.arange(modes.shape[1]) > 0, 2.0, 1.0)
        exact = np.einsum("smdv,m->sdv", modes, twice)
        for place, depth in enumerate(at):
            for orders in range(len(SETS)):
                curves.append(
                    TransportCurve(
                        thickness=thickness,
                        depth=depths[place],
                        orders=set_name(orders),
                        angle=np.degrees(angles),
                        exact=exact[orders, place],
                        grid=_looked_up(grid, types, orders, t, depth, angles),
                        fit=fit[orders](t, depth, np.cos(angles), math.cos(math.radians(SUN))),
                        whole=exact[:, place].sum(0),
                    )
                )
    return curves


def _looked_up(
    look_up: Transport, types: ArrayTypes, orders: int, t: float, d: float, angles: Array
) -> Array:
    # Thickness, depth, direction (cosine, and cosine and sine of the azimuth 0) and sun.
    numbers = np.broadcast_arrays(t, d, np.cos(angles), 1.0, 0.0, math.cos(math.radians(SUN)))
    T, *_ = look_up(orders, *(types.scalar(np.array(each)) for each in numbers))
    dr.eval(T)
    return np.array(T, dtype=np.float64)
