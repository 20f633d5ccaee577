# SPDX-License-Identifier: BSD-3-Clause
"""Errors of a look-up of the canonical transport at random points, by set of orders.

Thicknesses are uniform in their logarithm from 0.01 to 200; shares of the depth, cosines of directions and of suns
(from 0.02) and azimuths are uniform. `TOGETHER` points share a slab, a thickness and a sun, whose computation is what
takes time. It has more streams and modes than the one that tables are made of, and float64.

A set that holds less than `NEGLIGIBLE` of the light at a point is left out there, and counted.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical.coordinates import LOWEST_SUN, SETS, THICKEST, THINNEST, set_name
from realtime.clouds.canonical.directional_moments import DirectionalMoments
from realtime.clouds.canonical.transport_grid import Transport
from realtime.clouds.slab_orders.phases import SlabPhase
from realtime.numerics.array_types import ArrayTypes

Array = NDArray[np.float64]

TOGETHER = 16
NEGLIGIBLE = 1e-6
#: Streams of slabs thinner than so much.
_STREAMS = (0.3, 64), (10.0, 48), (np.inf, 40)
_MODES, _NODES = 47, 5
_WORKERS = 2


@dataclass(frozen=True)
class Points:
    """Points of slabs, (N,) each, and what the computation gives there, (sets, N) each.

    Lengths are in mean free paths; `T` is the radiance for unit irradiance across the beam [1/sr].
    """

    t: Array
    d: Array
    mu: Array
    phi: Array
    mu_l: Array
    T: Array
    c_x: Array
    c_y: Array
    sigma: Array


def random_points(phase: SlabPhase, albedo: float, count: int, *, seed: int = 0) -> Points:
    """Draw points and compute the transport there."""
    random = np.random.default_rng(seed)
    slabs = []
    for start in range(0, count, TOGETHER):
        size = min(TOGETHER, count - start)
        t, mu_l = np.exp(random.uniform(np.log(THINNEST), np.log(THICKEST))), random.uniform(LOWEST_SUN, 1)
        d, mu = np.sort(random.uniform(0, t, size)), random.uniform(-1, 1, size)
        slabs.append(np.stack([np.full(size, t), d, mu, random.uniform(0, 2 * np.pi, size), np.full(size, mu_l)]))
    with ThreadPoolExecutor(_WORKERS) as pool:
        values = list(pool.map(lambda each: transport_at(phase, albedo, *each), slabs))
    return Points(*np.concatenate(slabs, axis=-1), *np.concatenate(values, axis=-1))


def transport_at(
    phase: SlabPhase, albedo: float, t: Array, d: Array, mu: Array, phi: Array, mu_l: Array, *, streams: int = 0
) -> Array:
    """Return T, c_x, c_y and sigma by set at points of one slab, (4, sets, N); `streams` 0: as many as it needs."""
    thickness = float(np.max(t))
    streams = streams or next(count for below, count in _STREAMS if thickness < below)
    slabs = DirectionalMoments(
        phase,
        albedo,
        mu,
        streams=streams,
        modes=min(_MODES, 2 * streams - 1),
        nodes=_NODES,
        negligible=1e-5,
        single=False,
    )
    suns, of_point = np.unique(mu_l, return_inverse=True)
    place = np.arange(d.size)
    modes = slabs(thickness, suns, list(d))[:, :, :, of_point, place, place]
    m = np.arange(modes.shape[1])[:, None]
    cosines, sines = np.cos(m * phi), np.sin(m * phi)
    twice, once = np.where(m > 0, 2.0, 1.0), np.where(m > 0, 1.0, 0.5)
    T = (modes[:, :, 0] * cosines * twice).sum(1)
    x = ((modes[:, :, 1] + modes[:, :, 2]) * cosines * once).sum(1)
    y = ((modes[:, :, 1] - modes[:, :, 2]) * sines).sum(1)
    square = (modes[:, :, 3] * cosines * twice).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / T, y / T
        sigma = np.sqrt(np.maximum(square / T - x * x - y * y, 0.0) / 2)
    return np.stack([T, -x, -y, sigma])


def _looked_up(
    look_up: Transport, types: ArrayTypes, number: int, t: Array, d: Array, mu: Array, phi: Array, mu_l: Array
) -> Array:
    """Return T, c_x, c_y and sigma of one set, (4, N)."""
    given = [types.scalar(each) for each in (t, d, mu, np.cos(phi), np.sin(phi), mu_l)]
    results = look_up(number, *given)
    dr.eval(results)
    return np.stack([np.array(each, dtype=np.float64) for each in results])


def look_up_errors(look_up: Transport, types: ArrayTypes, points: Points) -> list[dict[str, Any]]:
    """Return errors by set: of T relative, of c over sigma, of sigma relative, each at 50 and 95 % of the points."""
    given = points.t, points.d, points.mu, points.phi, points.mu_l
    light = points.T.sum(0)
    rows = []
    for number in range(len(SETS)):
        T, c_x, c_y, sigma = _looked_up(look_up, types, number, *given)
        seen = (points.T[number] > NEGLIGIBLE * light) & (points.sigma[number] > 0)
        exact = points.sigma[number][seen]
        off = np.hypot(c_x - points.c_x[number], c_y - points.c_y[number])[seen] / exact
        rows.append(
            {
                "orders": set_name(number),
                "points": int(seen.sum()),
                "negligible": int((~seen).sum()),
                "T": _percentiles(T[seen] / points.T[number][seen] - 1),
                "c": _percentiles(off),
                "sigma": _percentiles(sigma[seen] / exact - 1),
            }
        )
    return rows


def _percentiles(errors: Array) -> dict[str, float | None]:
    if not errors.size:
        return {"p50": None, "p95": None}
    p50, p95 = np.percentile(np.abs(errors), [50, 95])
    return {"p50": float(p50), "p95": float(p95)}
