# SPDX-License-Identifier: BSD-3-Clause
"""Estimates of the light of a slab by sets of orders, with standard errors from batches of photons."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.slab_walk.walk import Counts, Slab, walk

Array = NDArray[np.float64]

#: Photons of a batch: their arrays fit into the cache of a core.
BATCH = 25_000
_FEWEST = 5
_MOST_COARSE = 64  #: batches there are at least, so that standard errors are known to 9 %


@dataclass(frozen=True)
class Estimate:
    """A number and its standard error; both None where no photon gave one."""

    value: float | None
    error: float | None


@dataclass(frozen=True)
class ExitEstimate:
    """Light of some orders through a plane: its amount, and mean and rms displacement [mean free paths]."""

    value: Estimate
    mean: Estimate
    rms: Estimate


@dataclass(frozen=True)
class SetEstimate:
    """Light of one set of orders."""

    reflected: ExitEstimate
    transmitted: ExitEstimate
    fluence: tuple[ExitEstimate, ...]


@dataclass(frozen=True)
class SlabEstimate:
    """Light of a slab by photons.

    `photons`: how many; `sets`: one for each set of orders; `reflectance`, `transmittance`: of all orders, the light
    that was never scattered among them; `up`, `down`: diffuse flux at each depth for a flux of pi across the beam.
    """

    photons: int
    sets: tuple[SetEstimate, ...]
    reflectance: Estimate
    transmittance: Estimate
    up: tuple[Estimate, ...]
    down: tuple[Estimate, ...]


def slab_estimate(
    slab: Slab,
    sets: Sequence[tuple[int, float]],
    *,
    photons: int,
    seed: int = 0,
    workers: int = 2,
    progress: Callable[[float, str], None] | None = None,
) -> SlabEstimate:
    """Estimate the light of a slab by a walk of photons.

    `slab`: the slab; `sets`: first and last order of each set, the last `math.inf` for a set without end; order 0 is
    the beam; `photons`: at least two; they are walked in batches of at most `BATCH`, at least 64 if there are as many
    photons; `seed`: the same seed gives the same numbers, whatever the number of workers; `workers`: threads;
    `progress`: called with (share done, what).
    """
    batches = max(math.ceil(photons / BATCH), min(photons, _MOST_COARSE))
    sizes = [photons // batches + (number < photons % batches) for number in range(batches)]
    seeds = np.random.SeedSequence(seed).spawn(batches)
    ranges = [*sets, (0, math.inf), (1, math.inf)]

    def batch(number: int) -> tuple[Array, Array, Array, Array, Array]:
        counts = walk(slab, sizes[number], np.random.default_rng(seeds[number]))
        return _by_set(counts, ranges)

    done = []
    with ThreadPoolExecutor(workers) as pool:
        for number, sums in enumerate(pool.map(batch, range(batches))):
            done.append(sums)
            if progress is not None:
                progress((number + 1) / batches, f"{sum(sizes[: number + 1])} photons")
    # (batches, .., sets, 3)
    reflected, transmitted, up, down, fluence = (np.stack(each) for each in zip(*done, strict=True))
    fraction = np.array(sizes) / photons
    beam, pi = slab.mu0, math.pi
    return SlabEstimate(
        photons=photons,
        sets=tuple(
            SetEstimate(
                reflected=_exit(reflected[:, place], fraction),
                transmitted=_exit(transmitted[:, place], fraction),
                fluence=tuple(_exit(beam * fluence[:, depth, place], fraction) for depth in range(len(slab.depths))),
            )
            for place in range(len(sets))
        ),
        reflectance=_amount(reflected[:, -2, 0], fraction),
        transmittance=_amount(transmitted[:, -2, 0], fraction),
        up=tuple(_amount(pi * beam * up[:, depth, -1, 0], fraction) for depth in range(len(slab.depths))),
        down=tuple(_amount(pi * beam * down[:, depth, -1, 0], fraction) for depth in range(len(slab.depths))),
    )


def _by_set(counts: Counts, ranges: Sequence[tuple[int, float]]) -> tuple[Array, Array, Array, Array, Array]:
    """Return the sums of the orders of each range, (.., ranges, 3)."""

    def summed(values: Array) -> Array:
        parts = [values[..., first : int(last) + 1 if math.isfinite(last) else None].sum(-1) for first, last in ranges]
        return np.stack(parts, axis=-2)

    return (
        summed(counts.reflected),
        summed(counts.transmitted),
        summed(counts.up),
        summed(counts.down),
        summed(counts.fluence),
    )


def _amount(batches: Array, fraction: Array) -> Estimate:
    """Return the mean over batches, weighted with their fraction of the photons, and its standard error."""
    mean = float(fraction @ batches)
    return Estimate(mean, _standard_error(batches - mean, fraction))


def _standard_error(residuals: Array, fraction: Array) -> float | None:
    count = residuals.size
    return (
        math.sqrt(float((fraction * residuals) @ (fraction * residuals)) * count / (count - 1)) if count > 1 else None
    )


def _exit(batches: Array, fraction: Array) -> ExitEstimate:
    """Return amount, mean and rms of (batches, 3) moments; ratios by the delta method.

    The errors of ratios need light in several batches: below `_FEWEST` there is none to tell.
    """
    amount, first, second = fraction @ batches
    if amount <= 0.0:
        return ExitEstimate(_amount(batches[:, 0], fraction), Estimate(None, None), Estimate(None, None))
    mean, square = first / amount, second / amount
    rms = math.sqrt(square)
    if np.count_nonzero(batches[:, 0]) < _FEWEST:
        return ExitEstimate(_amount(batches[:, 0], fraction), Estimate(float(mean), None), Estimate(rms, None))
    mean_error = _standard_error((batches[:, 1] - mean * batches[:, 0]) / amount, fraction)
    square_error = _standard_error((batches[:, 2] - square * batches[:, 0]) / amount, fraction)
    return ExitEstimate(
        _amount(batches[:, 0], fraction),
        Estimate(float(mean), mean_error),
        Estimate(rms, square_error / (2 * rms) if square_error is not None and rms > 0 else square_error),
    )
