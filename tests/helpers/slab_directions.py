# SPDX-License-Identifier: BSD-3-Clause
"""Radiance of a slab in bins of directions by sets of orders, with where its light entered, by photons.

The walk is that of `reference.monte_carlo.slab_walk.walk`. Every flight counts at every plane before it with its
probability to reach it, over |mu|, in the bin of its direction: the mean radiance of the bin follows with its solid
angle. Nothing changes under y -> -y, so that bins hold both signs of the azimuth, and the displacement along y counts
with the sign of the direction's.
"""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.slab_walk.walk import Slab, flights

Array = NDArray[np.float64]

_BATCH, _FEWEST = 25_000, 64  #: photons of a batch at most; batches at least, so that errors are known to 9 %


@dataclass(frozen=True)
class DirectionEstimate:
    """Means over bins, and their standard errors, (sets, depths, mu bins, phi bins) each.

    Parameters
    ----------
    radiance
        For unit flux across the beam [1/sr].
    x, y, square
        Mean displacement from the entry along the sun's horizontal direction and across, and mean of x^2 + y^2.
    """

    radiance: Array
    radiance_error: Array
    x: Array
    x_error: Array
    y: Array
    y_error: Array
    square: Array
    square_error: Array


def direction_estimate(
    slab: Slab,
    sets: Sequence[tuple[int, float]],
    *,
    mu_edges: Array,
    phi_edges: Array,
    photons: int,
    seed: int = 0,
    workers: int = 2,
) -> DirectionEstimate:
    """Estimate radiance in bins by a walk of photons.

    Parameters
    ----------
    slab
        The slab; its depths are where radiance is counted.
    sets
        First and last order of each set.
    mu_edges, phi_edges
        Increasing edges of bins: mu, positive upwards, and the azimuth from 0, along the sun's light, to pi.
    photons
        How many at least, in equal batches.
    seed
        The same seed gives the same numbers, whatever the number of workers.
    workers
        Threads.
    """
    batches = max(_FEWEST, math.ceil(photons / _BATCH))
    size = math.ceil(photons / batches)
    seeds = np.random.SeedSequence(seed).spawn(batches)

    def batch(number: int) -> Array:
        return _walk(slab, sets, mu_edges, phi_edges, size, np.random.default_rng(seeds[number]))

    with ThreadPoolExecutor(workers) as pool:
        sums = np.stack(list(pool.map(batch, range(batches))))
    # Both signs of the azimuth
    angles = 2 * np.diff(mu_edges)[:, None] * np.diff(phi_edges)
    values = sums / angles * slab.mu0
    mean = values.mean(0)
    safe = np.where(mean[0] > 0, mean[0], 1.0)

    def error(residuals: Array) -> Array:
        return np.asarray(np.sqrt((residuals**2).sum(0) / (batches * (batches - 1))))

    ratios = [mean[field] / safe for field in (1, 2, 3)]
    errors = [error((values[:, field] - ratio * values[:, 0]) / safe) for field, ratio in zip((1, 2, 3), ratios)]
    (x, y, square), (x_error, y_error, square_error) = ratios, errors
    return DirectionEstimate(mean[0], error(values[:, 0] - mean[0]), x, x_error, y, y_error, square, square_error)


def _walk(
    slab: Slab,
    sets: Sequence[tuple[int, float]],
    mu_edges: Array,
    phi_edges: Array,
    photons: int,
    random: np.random.Generator,
) -> Array:
    """Return sums over a batch over its number of photons, (4, sets, depths, mu bins, phi bins)."""
    shape = (mu_edges.size - 1, phi_edges.size - 1)
    sums = np.zeros((4, len(sets), len(slab.depths), *shape))
    for order, (weight, (x, y, z), (u, v, w)) in enumerate(flights(slab, photons, random)):
        rows = [number for number, (first, last) in enumerate(sets) if first <= order <= last]
        if rows:
            places = _bins(-w, mu_edges) * shape[1] + _bins(np.arctan2(np.abs(v), u), phi_edges)
            for plane, depth in enumerate(slab.depths):
                before = np.where(w > 0, z < depth, z > depth)
                length = (depth - z[before]) / w[before]
                weights = weight * np.exp(-length) / np.abs(w[before])
                at_x, at_y = x[before] + u[before] * length, y[before] + v[before] * length
                moments = (1.0, at_x, at_y * np.sign(v[before]), at_x**2 + at_y**2)
                for field, moment in enumerate(moments):
                    counts = np.bincount(places[before], weights * moment, shape[0] * shape[1]).reshape(shape)
                    for row in rows:
                        sums[field, row, plane] += counts
    return sums / photons


def _bins(values: Array, edges: Array) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
