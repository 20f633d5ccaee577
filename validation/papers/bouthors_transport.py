# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 8 of Bouthors, Neyret, Max, Bruneton, Crassin 2008 again: what light leaves a point of a slab, by direction.

The paper plots T against the zenith angle of the view, in the plane of the sun, with the sun at 25 degrees: simulated
in blue, its fitted functions in red. For which slabs it does not say; here are a thin and a thick one, both faces, and
a depth of 100 m. Four ways to T stand side by side: the computation with more streams than the tables had, photons in
bins of directions, the tables that frames look up, and the paper's 22 functions, fitted to the tables.
"""

import math
from collections.abc import Callable
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from analytic.droplets import Modified, optics
from realtime.clouds.canonical.directional_moments import DirectionalMoments
from realtime.clouds.canonical.fit import fit_on_device, fitted_functions
from realtime.clouds.canonical.look_up import LookUp, on_device
from realtime.clouds.canonical.sets import SETS, set_name
from realtime.clouds.canonical.tables import canonical_tables
from realtime.numerics.array_types import ArrayTypes, array_types
from reference.monte_carlo.slab_walk.directions import DirectionEstimate, direction_estimate
from reference.monte_carlo.slab_walk.walk import Slab
from validation.slab.phases import PhasePair, phase_pair

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

SUN = 25.0  #: [degrees]
#: Thickness and depths [m].
PANELS: tuple[tuple[float, tuple[float, ...]], ...] = ((100.0, (0.0, 100.0)), (1000.0, (0.0, 100.0, 1000.0)))
_PHASE = "mie-modified"
_BINS, _WIDTH = 36, math.radians(20.0)  #: bins of the zenith angle; half their width in azimuth
_PHOTONS = 400_000
_STREAMS, _MODES, _NODES, _NEGLIGIBLE = 48, 47, 5, 1e-5
_WAYS = ("exact", "table", "fit", "photons", "photons_se")
_DIM = 1e-6  #: of the light of all sets, below which a set is not compared
_RARE = 1e-2  #: ... and not with photons, whose rare ones have errors of no use


def transport_study(*, photons: int = _PHOTONS, progress: Progress | None = None) -> dict[str, Any]:
    """Measure T by direction.

    Parameters
    ----------
    photons
        Of each thickness.
    progress
        Called with (share done, what).

    Returns
    -------
    dict
        `transport`: `sun` [degrees], `angles`, zenith angles of the view [degrees], and `curves`, each with `thickness`
        and `depth` [m], `orders`, by angle `exact`, `table`, `fit`, `photons` and `photons_se` [1/sr], and what they
        differ by: `table_p95`, `fit_p50` and `fit_p95` relative, `photons_z`, the root of the mean square of what
        photons differ by over their standard error, the computation averaged over their bins.
    """
    tell = progress or (lambda share, what: None)
    pair, types = phase_pair(_PHASE), array_types("single")
    tables = canonical_tables(pair.deterministic, 1.0, progress=lambda share, what: tell(0.5 * share, what))
    look_up = on_device(tables, types)
    tell(0.5, "22 functions")
    fit = fit_on_device(fitted_functions(pair.deterministic, 1.0, tables, look_up, types), types)
    lowered = (1 - Modified(optics()).removed) * optics().extinction
    edges = np.linspace(0, np.pi, _BINS + 1)
    angles = (edges[1:] + edges[:-1]) / 2
    curves = []
    for number, (thickness, depths) in enumerate(PANELS):
        tell(0.6 + 0.4 * number / len(PANELS), f"{thickness:g} m")
        t, at = thickness * lowered, [depth * lowered for depth in depths]
        exact, in_bins = _computed(pair, t, at, angles, edges)
        walked = _walked(pair, t, at, edges, photons)
        light = exact.sum(0)
        for place, depth in enumerate(depths):
            for orders in range(len(SETS)):
                by_table, by_fit = (_looked_up(each, types, orders, t, at[place], angles) for each in (look_up, fit))
                # Bins of mu go upwards, and angles from the zenith down.
                mean, error = (each[orders, place, ::-1, 0] for each in (walked.radiance, walked.radiance_error))
                numbers = exact[orders, place], by_table, by_fit, mean, error
                share = numbers[0] / np.maximum(light[place], 1e-300)
                curves.append(
                    {"thickness": thickness, "depth": depth, "orders": set_name(orders)}
                    | {name: [float(value) for value in each] for name, each in zip(_WAYS, numbers, strict=True)}
                    | _differences(share, *numbers, in_bins[orders, place])
                )
    return {"transport": {"sun": SUN, "angles": list(map(float, np.degrees(angles))), "curves": curves}}


def _computed(pair: PhasePair, t: float, depths: list[float], angles: Array, edges: Array) -> tuple[Array, Array]:
    """Return T at angles in the plane of the sun, and its means over bins, (sets, depths, angles) each."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    cosines = np.cos(edges)
    middles, halves = (cosines[1:] + cosines[:-1]) / 2, (cosines[1:] - cosines[:-1]) / 2
    within = (middles[:, None] + halves[:, None] * nodes).ravel()
    mu = np.concatenate([np.cos(angles), within])
    slabs = DirectionalMoments(
        pair.deterministic, 1.0, mu, streams=_STREAMS, modes=_MODES, nodes=_NODES, negligible=_NEGLIGIBLE, single=False
    )
    modes = slabs(t, [math.cos(math.radians(SUN))], depths)[:, :, 0, 0]
    m = np.arange(modes.shape[1])
    twice = np.where(m > 0, 2.0, 1.0)
    phi = _WIDTH * (nodes + 1) / 2
    over_phi = (np.cos(m[:, None] * phi) * weights).sum(-1) / 2 * twice
    plane = np.einsum("smdv,m->sdv", modes[..., : angles.size], twice)
    means = np.einsum("smdv,m->sdv", modes[..., angles.size :], over_phi)
    means = (means.reshape(*means.shape[:2], angles.size, 3) * weights).sum(-1) / 2
    return plane, means


def _walked(pair: PhasePair, t: float, depths: list[float], edges: Array, photons: int) -> DirectionEstimate:
    slab = Slab(t, math.cos(math.radians(SUN)), 1.0, pair.sampled(), depths)
    sides = np.array([0.0, _WIDTH, np.pi])
    return direction_estimate(slab, SETS, mu_edges=np.cos(edges)[::-1], phi_edges=sides, photons=photons, seed=8)


def _looked_up(look_up: LookUp, types: ArrayTypes, orders: int, t: float, d: float, angles: Array) -> Array:
    numbers = np.broadcast_arrays(t, d, np.cos(angles), 1.0, 0.0, math.cos(math.radians(SUN)))
    T, *_ = look_up(orders, *(types.scalar(np.array(each)) for each in numbers))
    dr.eval(T)
    return np.array(T, dtype=np.float64)


def _differences(
    share: Array, exact: Array, table: Array, fit: Array, photons: Array, error: Array, in_bins: Array
) -> dict[str, float | None]:
    """Return how far the ways to T are apart; None where a set holds too little of the light of all."""
    seen, counted = share > _DIM, (share > _RARE) & (error > 0)
    by_table, by_fit = (np.abs(each[seen] / exact[seen] - 1) for each in (table, fit))
    z = (photons[counted] - in_bins[counted]) / error[counted]
    return {
        "table_p95": _percentile(by_table, 95),
        "fit_p50": _percentile(by_fit, 50),
        "fit_p95": _percentile(by_fit, 95),
        "photons_z": float(np.sqrt(np.mean(z**2))) if z.size else None,
    }


def _percentile(errors: Array, share: float) -> float | None:
    return float(np.percentile(errors, share)) if errors.size else None
