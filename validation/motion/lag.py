# SPDX-License-Identifier: BSD-3-Clause
"""The filter in time that makes the frames of a method from the references of these frames.

**One lag.** With r_n the reference of frame n, t_n the frame, and m the mean of the references,

    t_n = c m + g y_n,    y_n = a y_(n-1) + (1 - a) r_(n-d),    y = r where a history begins

has an offset c, a gain g, a persistence a and a whole delay d. Light in a frame has the mean age
d + a/(1 - a): the lag. The error after a step falls as exp(-n/tau), tau = -1/ln a. All frames are
fitted at once: the regression of a frame on the one before is wrong where noise comes after the
history. Offset and gain are fitted too: without them a bias looks like a lag.

**Which lag there is, if any.** The impulse response is the best t_n = c m + sum of h_k r_(n-k), k
from 0 to 15, h >= 0. `described` is the improvement of a lag over no filter, as a fraction of the
improvement of the impulse response.

**Which delay.** A delay is whole, so it has no standard error: leaving out a block moves it by
nothing or by a whole frame. The record says by how much the second-best delay is worse: with S the
sum of squares that a delay leaves with its best persistence, `delay_margin` is 1 - S_best/S_second,
with its error from blocks.
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
    #: by how much of its sum of squares the second-best delay is worse, see the module
    delay_margin: Estimate = UNKNOWN
    #: fraction of what an impulse response explains; None where the lag may be zero
    described: float | None = None
    response: tuple[Estimate, ...] = ()  #: of a flash, by frame after it
    lag: Estimate = UNKNOWN  #: mean age of the light that is shown [frames]
    #: frames after which 1/e of a step is missing; unknown where nothing persists
    time_constant: Estimate = UNKNOWN

    @property
    def filter(self) -> tuple[float, float, float, int]:
        """Offset, gain, persistence and delay; a number that is not known is taken as in
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
    """Yield the references through a filter, frame by frame: y_n of the module."""
    light = np.zeros(())
    for n in range(frames):
        # A delay reaches neither before the history began nor, if it is negative, past the end.
        late = reference(min(max(n - delay, start[n]), frames - 1))
        light = late if n == start[n] else persistence * light + (1 - persistence) * late
        yield light


def fit_lag(cells: Cells) -> Lag:
    """Return the filter that makes the frames from their references, with errors from
    blocks that are left out.
    """
    # The delay is whole: each is tried with the persistence that suits it best, on some of the
    # values. `residuals`: the sum of squares that remains, (delays, groups of blocks).
    few = _few(cells)
    if not np.any(few.weight):
        return Lag()
    tried = [_best_persistence(few, delay) for delay in DELAYS]
    residuals = np.array(
        [
            _residual(few, persistence, delay)
            for persistence, delay in zip(tried, DELAYS, strict=True)
        ]
    )
    best, second = (int(place) for place in np.argsort(residuals.sum(axis=1))[:2])
    delay = DELAYS[best]

    # Persistence, offset and gain are fitted to all values at that delay.
    fitted = _polished(cells, tried[best], delay)
    sums = _sums(cells, fitted, delay)
    offset, gain, persistence = _jackknife(sums, fitted)
    # Where the references do not change, no filter shows: neither its persistence nor its delay.
    if persistence.value is None:
        return Lag(offset, gain)
    response, described = _impulse_response(cells, _cost(sums.sum(axis=0)))
    filtered = delay != 0 or persistence.within(0.0, SURE) is Answer.NO

    # The lag is the mean age d + a/(1 - a); the derivative by a is 1/(1 - a)^2.
    history = persistence.value / (1 - persistence.value)
    return Lag(
        offset,
        gain,
        persistence,
        delay,
        _margin(residuals[best], residuals[second]),
        described if filtered else None,
        response,
        Estimate(delay + history, _times(persistence.error, 1 / (1 - persistence.value) ** 2)),
        _time_constant(persistence),
    )


def _margin(best: Array, second: Array) -> Estimate:
    """Return `delay_margin` from the residuals of the best and the second-best delay, (groups,)
    each: one less their ratio.
    """
    # A group in which both residuals are zero, such as a dark one, is no sample.
    groups = np.stack([best, second])
    groups = groups[:, groups.any(axis=0)]
    total = groups.sum(axis=1, keepdims=True)
    left_out = total - groups
    # The ratio needs a residual of the second-best delay, also without any one group; sums of
    # products that cancel may be below zero.
    if total.min() < 0 or total[1, 0] <= 0 or left_out[1].min(initial=np.inf) <= 0:
        return UNKNOWN
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
    # Few values may count, as beside a lamp: the choice is made among those that do. 20 000 values
    # choose the delay.
    counted = np.flatnonzero(cells.weight.any(axis=0))
    chosen = np.sort(np.random.default_rng(0).permutation(counted)[:20_000])
    reference, test, weight = (
        each.reshape(frames, 1, -1, 1)[:, :, chosen]
        for each in (cells.reference, cells.test, cells.weight)
    )
    weight[max(frames + min(DELAYS), 1) :] = 0.0
    return Cells(reference, test, weight, cells.mean, cells.start)


def _best_persistence(cells: Cells, delay: int) -> float:
    """Return the persistence that leaves the smallest sum of squares at a delay."""

    def residual(persistence: float) -> float:
        # Blocks matter for errors alone: here all values are one group.
        flat = (each.reshape(4, -1) for each in _columns(cells, persistence, delay))
        return _cost(np.asarray(sum(each @ each.T for each in flat)))

    # The residual may have several minima: the search goes on between the neighbours of the best
    # start. Starts are denser towards 1, where the lag a/(1 - a) grows fast.
    starts = (-0.3, 0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98)
    ends = (_LEAST, *starts, _MOST)
    best = int(np.argmin([residual(each) for each in starts]))
    bounds = ends[best], ends[best + 2]
    return float(minimize_scalar(residual, bounds=bounds, method="bounded").x)


def _columns(cells: Cells, persistence: float, delay: int) -> Iterator[Array]:
    """Yield of each frame the columns m, y, dy/da and t, each times the root of its weight."""
    light_before: Array = np.zeros(())
    slope: Array = np.zeros(())
    lights = filtered_frames(
        cells.reference.__getitem__, len(cells.test), cells.start, persistence, delay
    )
    for n, light in enumerate(lights):
        # From y_n = a y_(n-1) + (1 - a) r the derivative is y'_n = a y'_(n-1) + y_(n-1) - r, and
        # y_(n-1) - r is (y_(n-1) - y_n)/(1 - a).
        begins = n == cells.start[n]
        slope = (
            np.zeros_like(light)
            if begins
            else persistence * slope + (light_before - light) / (1 - persistence)
        )
        light_before = light
        # A frame that does not count still moves the filter on.
        if cells.weight[n].any():
            values = np.stack([np.full_like(light, cells.mean), light, slope, cells.test[n]])
            yield values * np.sqrt(cells.weight[n])


def _counted(cells: Cells) -> list[int]:
    return [n for n, weight in enumerate(cells.weight) if weight.any()]


def _sums(cells: Cells, persistence: float, delay: int) -> Array:
    # A cell is one element here: a block of `BLOCK` pixels has BLOCK // CELL of them on a side.
    return np.asarray(
        sum(products(each, BLOCK // CELL) for each in _columns(cells, persistence, delay))
    )


def _linear(total: Array) -> Array:
    """Return offset and gain of the filter whose columns have these products."""
    return np.asarray(np.linalg.lstsq(total[:2, :2], total[:2, 3], rcond=None)[0])


def _cost(total: Array) -> float:
    # The sum of squares that remains after the best offset and gain: |t|^2 - t . fit.
    return float(total[3, 3] - total[:2, 3] @ _linear(total))


def _residual(cells: Cells, persistence: float, delay: int) -> Array:
    """Return the sum of squares that a filter leaves in each group."""
    sums = _sums(cells, persistence, delay)
    # With offset and gain of all groups, t - c m - g y has these coefficients in the columns m, y,
    # dy/da and t.
    residual = np.array([*-_linear(sums.sum(axis=0)), 0.0, 1.0])
    return np.asarray(np.einsum("i,gij,j->g", residual, sums, residual))


def _polished(cells: Cells, persistence: float, delay: int) -> float:
    """Return the persistence of all values from that of some, by steps of Gauss and Newton."""
    # Few steps are needed: the start is the minimum of a part of the values.
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
    # Without a slope dy/da nothing says how much persists: offset and gain alone are unknowns.
    moves = total[2, 2] > _MOVES * total[1, 1]
    unknowns = 3 if moves else 2
    fit = np.array([*linear, persistence])[:unknowns]
    # The derivatives of c m + g y(a) by c, g and a are m, y and g dy/da.
    scale = np.array([1.0, 1.0, linear[1]])[:unknowns]
    groups = held(sums)
    # At the minimum the gradients of all groups add up to zero. Without a group, the rest has the
    # negative of its gradient: a step by the rest's matrix leads to the minimum of the rest.
    gradient = scale * (groups[:, :unknowns, 3] - groups[:, :unknowns, :2] @ linear)
    matrix = (total - groups)[:, :unknowns, :unknowns] * np.outer(scale, scale)
    if all(told_apart(each) for each in matrix):
        left_out = fit - np.linalg.solve(matrix, gradient[..., None])[..., 0]
    else:
        left_out = fit[None]  # one group alone decides them: their errors are not known
    fitted = estimates(fit, left_out)
    return fitted[0], fitted[1], fitted[2] if moves else UNKNOWN


def _impulse_response(cells: Cells, residual: float) -> tuple[tuple[Estimate, ...], float | None]:
    """Return the response to a flash, and the fraction of it that a filter explains, which leaves
    the sum of squares `residual`.

    Light from before a history began counts as that of its first frame, and what is older
    than all taps as the last.
    """
    # The columns of the regression: m, the references of the last `TAPS` frames, and t.
    sums: Array = np.zeros(())
    for n in _counted(cells):
        ages = [cells.reference[max(n - age, cells.start[n])] for age in range(TAPS)]
        columns = np.stack([np.full_like(ages[0], cells.mean), *ages, cells.test[n]]) * np.sqrt(
            cells.weight[n]
        )
        sums = sums + products(columns, BLOCK // CELL)
    total = sums.sum(axis=0)
    response, least = _positive_response(total)
    # No filter at all is the response with the tap of age 0 alone: columns m, r_n and t.
    still = total[np.ix_([0, 1, -1], [0, 1, -1])]
    none = float(
        still[2, 2] - still[:2, 2] @ np.linalg.lstsq(still[:2, :2], still[:2, 2], rcond=None)[0]
    )
    # The fraction is undefined where no response is better than no filter, rounding apart.
    described = (
        min((none - residual) / (none - least), 1.0)
        if none - least > _MOVES * total[-1, -1]
        else None
    )
    without = np.array([_positive_response(total - each)[0] for each in held(sums)])
    return estimates(response, without), described


def _positive_response(total: Array) -> tuple[Array, float]:
    """Return the taps, none below zero, that fit best by the products of columns, and the
    sum of squares they leave.
    """
    # The products are a matrix P; a solver of least squares needs some R with R^T R = P, and
    # R^-T b. The eigenvectors give both. References that change little make P nearly singular:
    # eigenvalues are held above their rounding.
    values, vectors = np.linalg.eigh(total[:-1, :-1])
    root = np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    target = (vectors.T @ total[:-1, -1]) / root
    # The offset may have either sign, the taps may not.
    least = np.r_[-np.inf, np.zeros(TAPS)]
    fit = lsq_linear(root[:, None] * vectors.T, target, bounds=(least, np.inf)).x
    return fit[1:], float(total[-1, -1] - 2 * fit @ total[:-1, -1] + fit @ total[:-1, :-1] @ fit)
