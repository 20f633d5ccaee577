# SPDX-License-Identifier: BSD-3-Clause
"""Which filter in time makes the frames of a method from the references of these frames.

**One lag.** With r_n the reference of frame n, t_n the frame, and m the mean of the references,

    t_n = c m + g y_n,    y_n = a y_(n-1) + (1 - a) r_(n-d),    y = r where a history begins

has an offset c, a gain g, a persistence a and a whole delay d. Light in a frame has the mean age
d + a/(1 - a): the lag. The error after a step falls as exp(-n/tau), tau = -1/ln a. All frames are
fitted at once: the regression of a frame on the one before is wrong where noise comes after the
history. Offset and gain are fitted too: without them a bias looks like a lag.

**Which lag there is, if any.** The impulse response is the best t_n = c m + sum of h_k r_(n-k), k
from 0 to 15, h >= 0. `described` is the improvement of a lag over no filter, as a fraction of the
improvement of the impulse response.

**Which delay.** It is whole, so it has no standard error: leaving out a block moves it by nothing
or by a whole frame. The record tells by how much the second-best delay is worse, each with the
persistence that suits it best: `delay_margin` is the fraction of the sum of squares of the
second-best delay that the best one does not leave, with its error from blocks.

Squares count with 1/(r + 0.1 m)^2, r the mean of a value in time: otherwise a few bright pixels
rule. Filters in time commute with means over pixels, so means over cells of 4 x 4 pixels are
fitted.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, minimize_scalar

from airlight.validation.arrays import Array
from airlight.validation.motion.blocks import BLOCK, estimates, held, products, told_apart
from airlight.validation.statistics.estimate import UNKNOWN, Answer, Estimate

CELL = 4  #: side of a cell [pixels]
TAPS = 16  #: of the impulse response [frames]
DELAYS = range(-2, 5)  #: that are tried [frames]
DARK = 0.1  #: of the mean: what is darker counts no more than this
# persistence: below zero a filter that sharpens in time, which noise may look like
_LEAST, _MOST = -0.5, 0.9995
_MOVES = 1e-12  # relative square of a change, below which it is rounding
_SEARCHED = 20_000  # values that choose the delay
_STARTS = (-0.3, 0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98)
#: errors from which on a number of a sequence is not zero: by chance in less than one of 10 000
SURE = 4.0


@dataclass(frozen=True)
class Cells:
    """Frames and their references as means over cells, (frames, rows, columns, 3)."""

    reference: Array
    test: Array
    weight: Array  #: of the square of an error; zero where it does not count
    mean: float  #: of the references, over all values that count
    start: tuple[int, ...]  #: the frame with which the history of each frame begins


@dataclass(frozen=True)
class Lag:
    """The filter that fits best."""

    offset: Estimate = UNKNOWN
    gain: Estimate = UNKNOWN
    persistence: Estimate = UNKNOWN
    delay: int | None = None  #: whole [frames]
    #: fraction of what the second-best delay leaves that this one does not
    delay_margin: Estimate = UNKNOWN
    #: fraction of what an impulse response explains; None where the lag may be zero
    described: float | None = None
    response: tuple[Estimate, ...] = ()  #: of a flash, by frame after it
    lag: Estimate = UNKNOWN  #: mean age of the light that is shown [frames]
    #: frames after which 1/e of a step is missing; unknown where nothing persists
    time_constant: Estimate = UNKNOWN

    @property
    def filter(self) -> tuple[float, float, float, int]:
        """Offset, gain, persistence and delay; what is not known is that of
        frames without a filter.
        """
        without = ((self.offset, 0.0), (self.gain, 1.0), (self.persistence, 0.0))
        offset, gain, persistence = (
            usual if each.value is None else each.value for each, usual in without
        )
        return offset, gain, persistence, 0 if self.delay is None else self.delay


def filtered_frames(
    reference: Callable[[int], Array],
    frames: int,
    start: tuple[int, ...],
    persistence: float,
    delay: int,
) -> Iterator[Array]:
    """Yield the references through a filter, frame by frame."""
    shown = np.zeros(())
    for n in range(frames):
        late = reference(min(max(n - delay, start[n]), frames - 1))
        shown = late if n == start[n] else persistence * shown + (1 - persistence) * late
        yield shown


def fit_lag(cells: Cells) -> Lag:
    """Return the filter that makes the frames from their references, with errors from
    blocks that are left out.
    """
    few = _few(cells)
    if not np.any(few.weight):
        return Lag()
    tried = [_best_persistence(few, delay) for delay in DELAYS]
    left = np.array(
        [_left(few, persistence, delay) for persistence, delay in zip(tried, DELAYS, strict=True)]
    )
    best, second = (int(place) for place in np.argsort(left.sum(axis=1))[:2])
    delay = DELAYS[best]
    found_persistence = _polished(cells, tried[best], delay)
    sums = _sums(cells, found_persistence, delay)
    offset, gain, persistence = _jackknife(sums, found_persistence)
    if persistence.value is None:
        return Lag(offset, gain)
    response, described = _impulse_response(cells, _cost(sums.sum(axis=0)))
    filtered = delay != 0 or persistence.within(0.0, SURE) is Answer.NO
    kept = persistence.value / (1 - persistence.value)
    return Lag(
        offset,
        gain,
        persistence,
        delay,
        _margin(left[best], left[second]),
        described if filtered else None,
        response,
        Estimate(delay + kept, _times(persistence.error, 1 / (1 - persistence.value) ** 2)),
        _time_constant(persistence),
    )


def _margin(best: Array, second: Array) -> Estimate:
    """Return the fraction of the squares of the second-best delay that the best one does
    not leave, (groups,) each.
    """
    groups = np.stack([best, second])
    groups = groups[:, groups.any(axis=0)]
    total = groups.sum(axis=1, keepdims=True)
    left_out = total - groups
    if total.min() < 0 or total[1, 0] <= 0 or left_out[1].min(initial=np.inf) <= 0:
        return UNKNOWN  # nothing is left to compare, or in one group alone
    fraction, without = (1 - each[0] / each[1] for each in (total, left_out))
    return estimates(fraction, without[:, None])[0]


def _time_constant(persistence: Estimate) -> Estimate:
    a = persistence.value
    if a is None or not 1e-6 < a < 1 or persistence.exceeds(0.0) is not Answer.YES:
        return UNKNOWN
    rate = math.log(a)
    return Estimate(-1 / rate, _times(persistence.error, 1 / (a * rate**2)))


def _times(error: float | None, slope: float) -> float | None:
    return None if error is None else slope * error


def _few(cells: Cells) -> Cells:
    """Return some of the values of all frames that count, as a picture of one row,
    without the last frames.

    Delays below zero look ahead: all delays are judged by the same frames.
    """
    frames = len(cells.test)
    # few are beside a lamp: of values by chance perhaps none
    counted = np.flatnonzero(cells.weight.any(axis=0))
    chosen = np.sort(np.random.default_rng(0).permutation(counted)[:_SEARCHED])
    reference, test, weight = (
        each.reshape(frames, 1, -1, 1)[:, :, chosen]
        for each in (cells.reference, cells.test, cells.weight)
    )
    weight[max(frames + min(DELAYS), 1) :] = 0.0
    return Cells(reference, test, weight, cells.mean, cells.start)


def _best_persistence(cells: Cells, delay: int) -> float:
    """Return the persistence that leaves the smallest sum of squares at a delay."""

    def left(persistence: float) -> float:
        flat = (each.reshape(4, -1) for each in _columns(cells, persistence, delay))
        return _cost(np.asarray(sum(each @ each.T for each in flat)))

    ends = (_LEAST, *_STARTS, _MOST)
    best = int(np.argmin([left(each) for each in _STARTS]))
    return float(minimize_scalar(left, bounds=(ends[best], ends[best + 2]), method="bounded").x)


def _columns(cells: Cells, persistence: float, delay: int) -> Iterator[Array]:
    """Yield of each frame the columns m, y, dy/da and t, each times the root of its weight."""
    shown: Array = np.zeros(())
    slope: Array = np.zeros(())
    lights = filtered_frames(
        cells.reference.__getitem__, len(cells.test), cells.start, persistence, delay
    )
    for n, light in enumerate(lights):
        # From y_n = a y_(n-1) + (1 - a) r the derivative is y'_n = a y'_(n-1) + y_(n-1) - r.
        begins = n == cells.start[n]
        slope = (
            np.zeros_like(light)
            if begins
            else persistence * slope + (shown - light) / (1 - persistence)
        )
        shown = light
        if cells.weight[n].any():
            values = np.stack([np.full_like(light, cells.mean), light, slope, cells.test[n]])
            yield values * np.sqrt(cells.weight[n])


def _counted(cells: Cells) -> list[int]:
    return [n for n, weight in enumerate(cells.weight) if weight.any()]


def _sums(cells: Cells, persistence: float, delay: int) -> Array:
    return np.asarray(
        sum(products(each, BLOCK // CELL) for each in _columns(cells, persistence, delay))
    )


def _linear(total: Array) -> Array:
    """Return offset and gain of the filter whose columns have these products."""
    return np.asarray(np.linalg.lstsq(total[:2, :2], total[:2, 3], rcond=None)[0])


def _cost(total: Array) -> float:
    return float(total[3, 3] - total[:2, 3] @ _linear(total))


def _left(cells: Cells, persistence: float, delay: int) -> Array:
    """Return the sum of squares that a filter leaves in each group."""
    sums = _sums(cells, persistence, delay)
    residual = np.array([*-_linear(sums.sum(axis=0)), 0.0, 1.0])
    return np.asarray(np.einsum("i,gij,j->g", residual, sums, residual))


def _polished(cells: Cells, persistence: float, delay: int) -> float:
    """Return the persistence of all values from that of some, by steps of Gauss and Newton."""
    for _ in range(8):
        total = _sums(cells, persistence, delay).sum(axis=0)
        linear = _linear(total)
        gradient = linear[1] * (total[2, 3] - total[2, :2] @ linear)
        # The square of the slope that offset and gain cannot make up for.
        shared = np.linalg.lstsq(total[:2, :2], total[:2, 2], rcond=None)[0]
        square = linear[1] ** 2 * (total[2, 2] - total[:2, 2] @ shared)
        step = gradient / square if square > _MOVES * total[1, 1] else 0.0
        persistence = min(max(persistence + step, _LEAST), _MOST)
        if abs(step) < 1e-8:
            break
    return float(persistence)


def _jackknife(sums: Array, persistence: float) -> tuple[Estimate, Estimate, Estimate]:
    """Return offset, gain and persistence; without a group they are one step
    of Gauss and Newton away.
    """
    total = sums.sum(axis=0)
    linear = _linear(total)
    moves = total[2, 2] > _MOVES * total[1, 1]  # otherwise nothing says how much persists
    unknowns = 3 if moves else 2
    found = np.array([*linear, persistence])[:unknowns]
    scale = np.array([1.0, 1.0, linear[1]])[:unknowns]
    groups = held(sums)
    # by group; their sum is zero
    gradient = scale * (groups[:, :unknowns, 3] - groups[:, :unknowns, :2] @ linear)
    matrix = (total - groups)[:, :unknowns, :unknowns] * np.outer(scale, scale)
    if all(told_apart(each) for each in matrix):
        left_out = found - np.linalg.solve(matrix, gradient[..., None])[..., 0]
    else:
        left_out = found[None]  # one group alone tells them: their errors are not known
    told = estimates(found, left_out)
    return told[0], told[1], told[2] if moves else UNKNOWN


def _impulse_response(cells: Cells, left: float) -> tuple[tuple[Estimate, ...], float | None]:
    """Return the response to a flash, and the fraction that a filter with a given sum
    of squares explains of it.

    Light from before a history began counts as that of its first frame, and what is older
    than all taps as the last.
    """
    sums: Array = np.zeros(())
    for n in _counted(cells):
        ages = [cells.reference[max(n - age, cells.start[n])] for age in range(TAPS)]
        columns = np.stack([np.full_like(ages[0], cells.mean), *ages, cells.test[n]]) * np.sqrt(
            cells.weight[n]
        )
        sums = sums + products(columns, BLOCK // CELL)
    total = sums.sum(axis=0)
    found, least = _positive_response(total)
    still = total[np.ix_([0, 1, -1], [0, 1, -1])]
    none = float(
        still[2, 2] - still[:2, 2] @ np.linalg.lstsq(still[:2, :2], still[:2, 2], rcond=None)[0]
    )
    described = (
        min((none - left) / (none - least), 1.0) if none - least > _MOVES * total[-1, -1] else None
    )
    without = np.array([_positive_response(total - each)[0] for each in held(sums)])
    return estimates(found, without), described


def _positive_response(total: Array) -> tuple[Array, float]:
    """Return the taps, none below zero, that fit best by the products of columns, and the
    sum of squares they leave.
    """
    values, vectors = np.linalg.eigh(total[:-1, :-1])
    root = np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    wanted = (vectors.T @ total[:-1, -1]) / root
    least = np.r_[-np.inf, np.zeros(TAPS)]
    found = lsq_linear(root[:, None] * vectors.T, wanted, bounds=(least, np.inf)).x
    return found[1:], float(
        total[-1, -1] - 2 * found @ total[:-1, -1] + found @ total[:-1, :-1] @ found
    )
