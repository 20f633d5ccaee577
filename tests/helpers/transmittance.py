# SPDX-License-Identifier: BSD-3-Clause
r"""Estimators of the transmittance T = exp(-tau) of a ray, and how wrong
they are in a density grid.

All look the extinction up at random places of a ray of the length l; a march of n steps does so at
one random fraction of every step, which gives the unbiased estimate X = (l/n) sum sigma_t of tau.

- **naive**: exp(-X). The exponential is convex, so by Jensen's inequality it is too bright: to
  second order by T v/2, with the variance v of X, which falls as 1/n^2 where the extinction is
  smooth.
- **ratio tracking** (Novak, Selle, Jarosz 2014): the product of 1 - sigma_t/m over the points of a
  Poisson process of the density m >= sigma_t, here the largest extinction of the grid. E = exp(-int
  sigma_t): unbiased.
- **unbiased ray marching** (Kettunen, d'Eon, Pantaleoni, Novak 2021): with N + 1
  marches X_i, and any pivot X_j,

      T = exp(-X_j) sum_k (X_j - tau)^k/k!,     (X_j - tau)^k = E[m_k of X_j - X_i, i != j],

  with the elementary symmetric means m_k, cut at a random order N by roulette: order 0 in nine of
  ten cases, else 2 at least, and from there on k with the probability 2/k (their aggressive
  Bhanot-Kennedy roulette); term k is divided by the probability to get there. The mean over all
  pivots is taken. Without their affine control variate.
- **jackknife** (Peters 2025): exp(-(X_1 + X_2)/2) cos((X_1 - X_2)/2). For normal X it is the
  unbiased estimate of least variance: E exp(-mean) = T exp(v/4), and the cosine, independent of the
  mean, is exp(-v/4) on average.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from airlight.reference.quadrature.fields import field_of
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import GridMedium
from airlight.validation.arrays import Array, Index

# fractions of a ray, any shape -> optical depth of the whole ray if all were as there
Look = Callable[[Array], Array]

_ORDER_0, _SURE, _RATE = 0.9, 2, 2.0  # of the roulette
_RAYS, _TIMES = 48, 1024


@dataclass(frozen=True, kw_only=True)
class TransmittanceError:
    """How wrong an estimator is along rays, relative to the mean transmittance of these."""

    estimator: str
    steps: int  #: of a march, or how many times the majorant's optical depth
    look_ups: float  #: of a ray, on the average
    bias: float
    bias_error: float  #: standard error of the bias
    jensen: float | None = None  #: brightening by the variance of a march; None for others
    spread: float  #: root of the mean variance of one estimate


def marches(look: Look, random: np.random.Generator, times: int, steps: int) -> Array:
    """Return estimates of an optical depth, (times,), by marches that look up
    one fraction of all steps.
    """
    return look((np.arange(steps) + random.random((times, 1))) / steps).mean(axis=1)


def naive(depth: Array) -> Array:
    """Return exp(-X) of marches, (times, 1)."""
    return np.exp(-depth[:, 0])


def jackknife(depth: Array) -> Array:
    """Return the estimate from pairs of marches, (times, 2)."""
    return np.exp(-depth.mean(axis=1)) * np.cos(0.5 * (depth[:, 0] - depth[:, 1]))


def orders(random: np.random.Generator, times: int) -> Index:
    """Return random orders of the power series."""
    chosen = np.where(random.random(times) < _ORDER_0, 0, _SURE)
    going = np.flatnonzero(chosen)
    while len(going):
        going = going[random.random(len(going)) < _RATE / (chosen[going] + 1)]
        chosen[going] += 1
    return chosen


def power_series(depth: Array) -> Array:
    """Return the estimates from as many marches as the order of the series and
    one, (times, order + 1).
    """
    order = depth.shape[1] - 1
    total = np.zeros(len(depth))
    for pivot in range(order + 1):
        away = depth[:, [pivot]] - np.delete(depth, pivot, axis=1)
        symmetric = [np.ones(len(depth))] + [np.zeros(len(depth))] * order
        for place in range(order):
            for k in range(place + 1, 0, -1):
                symmetric[k] = symmetric[k] + symmetric[k - 1] * away[:, place]
        term, likely, series = 1.0, 1.0, symmetric[0]
        for k in range(1, order + 1):
            likely *= 1 - _ORDER_0 if k == 1 else 1.0 if k <= _SURE else _RATE / k
            term *= (order - k + 1) / k * k  # k! times how many products m_k is the mean of
            series = series + symmetric[k] / (term * likely)
        total += np.exp(-depth[:, pivot]) * series
    return np.asarray(total / (order + 1))


def ratio_tracking(
    look: Look, random: np.random.Generator, times: int, majorant: float
) -> tuple[Array, float]:
    """Return estimates, (times,), and look-ups each, with a majorant of the optical depth."""
    count = random.poisson(majorant, times)
    most = int(count.max(initial=1))
    kept = 1 - look(random.random((times, most))) / majorant
    return np.where(np.arange(most) < count[:, None], kept, 1.0).prod(axis=1), float(count.mean())


def transmittance_errors(
    reference: ReferenceScene, steps: Sequence[int]
) -> list[TransmittanceError]:
    """Return how wrong the estimators are along rays through the grid of a scene, a
    row for each and its steps.

    `steps`: of the marches. Rays go between random places in the box; each has 1024
    estimates by each estimator.
    """
    medium = reference.medium
    assert isinstance(medium, GridMedium)
    random = np.random.default_rng(1)
    begin, end = medium.low + random.random((2, _RAYS, 3)) * (medium.high - medium.low)
    length = np.linalg.norm(end - begin, axis=1)
    depth = field_of(reference).optical_depth(
        begin, (end - begin) / length[:, None], np.zeros(_RAYS), length
    )[:, 0]
    exact = np.exp(-depth)
    found: dict[tuple[str, int], list[tuple[float, float, float, float]]] = {}

    def keep(name: str, count: int, values: Array, look_ups: float, variance: float = 0.0) -> None:
        found.setdefault((name, count), []).append(
            (look_ups, float(values.mean()), float(values.var()), variance)
        )

    for ray in range(_RAYS):

        def look(fraction: Array, ray: int = ray) -> Array:
            places = begin[ray] + fraction[..., None] * (end - begin)[ray]
            return length[ray] * medium.extinction(places.reshape(-1, 3)).reshape(fraction.shape)

        for count in steps:
            one = marches(look, random, _TIMES, count)
            keep("naive", count, naive(one[:, None]), count, float(one.var()))
            keep(
                "jackknife",
                count,
                jackknife(np.stack([one, marches(look, random, _TIMES, count)], 1)),
                2 * count,
            )
            chosen = orders(random, _TIMES)
            values = np.empty(_TIMES)
            for order in np.unique(chosen):
                rows = np.flatnonzero(chosen == order)
                each = [marches(look, random, len(rows), count) for _ in range(order + 1)]
                values[rows] = power_series(np.stack(each, axis=1))
            keep("unbiased-ray-marching", count, values, count * (1 + float(chosen.mean())))
        majorant = length[ray] * float(medium.largest[0])
        for times in (1, 4):
            keep("ratio-tracking", times, *ratio_tracking(look, random, _TIMES, times * majorant))
    return [
        _over_rays(name, count, np.array(rays), exact)
        for (name, count), rays in sorted(found.items())
    ]


def _over_rays(name: str, count: int, rays: Array, exact: Array) -> TransmittanceError:
    look_ups, mean, variance, depth_variance = rays.T
    scale = exact.mean()
    return TransmittanceError(
        estimator=name,
        steps=count,
        look_ups=float(look_ups.mean()),
        bias=float((mean - exact).mean() / scale),
        bias_error=float(np.sqrt(variance.sum() / _TIMES) / _RAYS / scale),
        jensen=float((0.5 * exact * depth_variance).mean() / scale) if name == "naive" else None,
        spread=float(np.sqrt(variance.mean()) / scale),
    )
