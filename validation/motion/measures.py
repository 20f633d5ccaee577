# SPDX-License-Identifier: BSD-3-Clause
"""Every measure of a sequence of frames against the reference of each frame.

With r_n the reference of frame n, t_n the frame, e = t - r, and m the mean of r
over all values that count:

- relative RMSE: the root mean square of e, over m;
- relative bias: the mean of e over m. Its error is that of the mean of a series of frames that may
  depend on those before them (`validation.statistics.samples.mean_of_series`); fewer than eight
  frames tell none;
- flicker: the root mean square of e_n - e_(n-1), over m: it leaves out the change of the reference.
  Flicker beside the lag: the same for t - c m - g y, the part that no lag explains
  (`validation.motion.lag`);
- ghost: light that left a place in the last twelve frames is w = max(r_(n-12) .. r_n) - r_n; the
  fraction G of it that is still there is a coefficient of e = c m + b r + G w. By age k, w is
  max(r_(n-k) - r_n, 0);
- pop: the largest root mean square of e_n - e_(n-1) of a frame, over the median of all frames.

Pairs of frames across the beginning of a history do not count. A sequence that does not begin with
one has frames that only start the filter. Values that are not finite are counted, and left out:
there the frame is taken for its reference.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from airlight.validation.arrays import Array, Bools
from airlight.validation.motion.blocks import products, regression, relative_root
from airlight.validation.motion.lag import CELL, DARK, Cells, Lag, filtered_frames, fit_lag
from airlight.validation.statistics.comparison import block_sums
from airlight.validation.statistics.estimate import UNKNOWN, Estimate
from airlight.validation.statistics.samples import mean_of_runs, mean_of_series

_Record = TypeVar("_Record", "Measures", Lag)

AGES = 12  #: of light that left [frames]
STARTING = 16  #: first frames of a history that began before them: they only start the filter


@dataclass(frozen=True)
class Sequence:
    """Frames, references and which pixels count, by number from zero; histories
    begin at the frames `resets`.
    """

    frames: int
    frame: Callable[[int], Array]  #: (height, width, 3)
    reference: Callable[[int], Array]  #: (height, width, 3), finite
    selected: Callable[[int], Bools]  #: (height, width)
    resets: tuple[int, ...] = (0,)

    @cached_property
    def start(self) -> tuple[int, ...]:
        """The frame with which the history of each frame begins."""
        return tuple(max(r for r in (0, *self.resets) if r <= n) for n in range(self.frames))

    def counts(self, n: int) -> bool:
        """Return whether a frame counts, or only starts the filter."""
        # A sequence without a reset at its first frame has an earlier history, which nobody knows.
        return self.start[n] in self.resets or n >= STARTING

    def pair_counts(self, n: int) -> bool:
        """Return whether the change from the frame before counts."""
        return n > 0 and n != self.start[n] and self.counts(n) and self.counts(n - 1)


@dataclass(frozen=True)
class Measures:
    """The measures of a sequence; relative values are relative to the mean of the references."""

    values: int  #: in all frames, that count
    nonfinite: int  #: values of frames that are NaN or infinite
    mean: float  #: of the references [W/(m^2 sr)]
    relative_rmse: Estimate
    bias: Estimate
    flicker: Estimate  #: per frame
    flicker_beside_lag: Estimate  #: per frame
    reference_change: float  #: root mean square change of the references [per frame]
    lag: Lag
    ghost: Estimate
    ghost_by_age: tuple[Estimate, ...]  #: from one frame on
    pop: float | None  #: ratio to the median; None where that is 0
    pop_frame: int | None  #: None where the error never changes
    rmse_by_frame: tuple[float, ...]
    change_by_frame: tuple[float, ...]  #: of the reference
    #: frames that are the one before, bit by bit, though the reference moved
    repeated: tuple[int, ...]


def measure(sequence: Sequence) -> Measures | None:
    """Return all measures of a sequence, which is read twice; None where
    nothing counts, or all is dark.
    """
    first = _first_pass(sequence)
    if not first.mean > 0:
        return None
    lag = fit_lag(first.cells(sequence))
    return _second_pass(sequence, first, lag)


def mean_measures(runs: list[Measures]) -> Measures:
    """Return the means over runs of what has an error, with errors from their spread.

    Runs that measure the same to the last digit are one run, of one seed. A number that one run
    does not tell is unknown of their mean, and so is a delay in which runs differ. Values that
    are not finite are counted over all runs; every other field is taken from the first run.
    """
    runs = [run for number, run in enumerate(runs) if run not in runs[:number]]
    if len(runs) == 1:
        return runs[0]
    lags = [each.lag for each in runs]
    lag = _means(lags)
    if len({each.delay for each in lags}) > 1:
        lag = replace(lag, delay=None, delay_margin=UNKNOWN)
    return replace(_means(runs), lag=lag, nonfinite=sum(each.nonfinite for each in runs))


def _means(records: list[_Record]) -> _Record:
    means: dict[str, Any] = {}
    for each in fields(records[0]):
        several = [getattr(record, each.name) for record in records]
        if isinstance(several[0], Estimate):
            values = [estimate.value for estimate in several]
            means[each.name] = UNKNOWN if None in values else mean_of_runs(values)
    return replace(records[0], **means)


class _FirstPass:
    """Sums of errors, and cells for the fit of a lag."""

    def __init__(self, shape: tuple[int, ...], frames: int) -> None:
        rows, columns = (-(-side // CELL) for side in shape)
        self.reference, self.test = np.zeros((2, frames, rows, columns, 3))
        self.fraction = np.zeros((frames, rows, columns, 1))
        self.sums: Array = np.zeros(())
        self.brightness = np.zeros((*shape, 3))
        self.frame_sums: list[Array] = []
        self.repeated: list[int] = []
        self.nonfinite = 0

    @property
    def mean(self) -> float:
        total = self.sums.sum(axis=0) if self.sums.ndim else np.zeros((5, 5))
        return float(total[0, 2] / total[0, 0]) if total[0, 0] > 0 else 0.0

    def cells(self, sequence: Sequence) -> Cells:
        weight = self.fraction / (self.reference.mean(axis=0) + DARK * self.mean) ** 2
        return Cells(self.reference, self.test, weight, self.mean, sequence.start)


def _first_pass(sequence: Sequence) -> _FirstPass:
    sums: _FirstPass | None = None
    error = reference = frame = np.zeros(())
    for n in range(sequence.frames):
        error_before, reference_before, frame_before = error, reference, frame
        reference, frame = sequence.reference(n), sequence.frame(n)
        if sums is None:
            sums = _FirstPass(sequence.selected(n).shape, sequence.frames)
        # A value that is not finite is counted, and taken for the reference: no sum holds NaN.
        selected = sequence.selected(n)[..., None] & np.ones(3, dtype=bool)
        finite = np.isfinite(frame)
        sums.nonfinite += int((selected & ~finite).sum())
        frame = np.where(finite, frame, reference)
        selected &= finite
        error = frame - reference
        # The fit of a lag needs every frame, since the filter runs through all of them; the
        # measures only need the frames that count.
        sums.brightness += reference / sequence.frames
        sums.reference[n], sums.test[n] = _cell_means(reference), _cell_means(frame)
        if not sequence.counts(n):
            continue
        sums.fraction[n] = _cell_means(selected.astype(np.float64)).mean(axis=2, keepdims=True)
        # `pair`: 1 where the change from the frame before counts. No pair crosses the beginning of
        # a history.
        pair = np.where(selected, float(sequence.pair_counts(n)), 0.0)
        change = (error - error_before) * pair if n else np.zeros_like(error)
        moved = (reference - reference_before) * pair if n else np.zeros_like(error)
        # Columns 0 to 5: every mean square and every ratio is made of their products.
        one = selected.astype(np.float64)
        by_group = products(np.stack([one, error * one, reference * one, pair, change, moved]))
        sums.sums = sums.sums + by_group
        sums.frame_sums.append(by_group.sum(axis=0))
        if n and sequence.pair_counts(n) and moved.any() and np.array_equal(frame, frame_before):
            sums.repeated.append(n)
    assert sums is not None
    return sums


def _second_pass(sequence: Sequence, first: _FirstPass, lag: Lag) -> Measures:
    """Return all measures; flicker beside the lag and ghosts, which need the mean in time and the
    lag, are summed here.
    """
    mean = first.mean
    # As in the fit of a lag, squares count with 1/(r + 0.1 m)^2: few bright pixels do not rule.
    scale = 1 / (first.brightness + DARK * mean)
    # The references through the filter that fits: y_n of `validation.motion.lag`.
    offset, gain, persistence, delay = lag.filter
    filtered = filtered_frames(
        sequence.reference, sequence.frames, sequence.start, min(max(persistence, 0.0), 1.0), delay
    )
    window: deque[Array] = deque(maxlen=AGES + 1)  # references of this history, this frame last
    residual: Array = np.zeros(())
    ghosts: Array = np.zeros(())
    beside: Array = np.zeros(())
    for n, light in enumerate(filtered):
        if n == sequence.start[n]:
            window.clear()
        reference, frame = sequence.reference(n), sequence.frame(n)
        # Ghosts are summed in float32, which takes half of the memory and time.
        window.append(reference.astype(np.float32))
        frame = np.where(np.isfinite(frame), frame, reference)
        # t - c m - g y: no lag explains its change from frame to frame.
        residual_before, residual = residual, frame - offset * mean - gain * light
        if not sequence.counts(n):
            continue
        one = np.where(sequence.selected(n)[..., None], 1.0, 0.0) + np.zeros(3)
        if sequence.pair_counts(n):
            change = (residual - residual_before) * one
            beside = beside + products(np.stack([one, change, reference * one]))
        # The columns m, r, w, w by age 1 to `AGES`, and e. A history that is shorter than an age
        # has its first reference there.
        here, count = window[-1], len(window)
        columns = np.empty((AGES + 4, *here.shape), np.float32)
        columns[0], columns[1], columns[-1] = mean, here, frame - reference
        for age in range(1, AGES + 1):
            columns[2 + age] = np.maximum(window[max(count - 1 - age, 0)] - here, 0)
        columns[2] = columns[3:-1].max(axis=0)
        columns *= one * scale
        ghosts = ghosts + products(columns).astype(np.float64)
    # Products of the columns 1, e, r, pair, e_n - e_(n-1) and r_n - r_(n-1) of the first pass:
    # [4, 4] over [3, 3], for one, is the mean square change of the error over pairs of frames.
    total = first.sums.sum(axis=0)
    by_frame = np.array(first.frame_sums)
    pairs = by_frame[:, 3, 3] > 0
    jumps = np.sqrt(by_frame[pairs, 4, 4] / by_frame[pairs, 3, 3])
    # `by_frame` has rows of the frames that count alone: `counted` has their numbers.
    counted = [n for n in range(sequence.frames) if sequence.counts(n)]
    places = np.flatnonzero(pairs)
    rmse = np.sqrt(by_frame[:, 1, 1] / np.maximum(by_frame[:, 0, 0], 1)) / mean
    moved = np.sqrt(by_frame[:, 5, 5] / np.maximum(by_frame[:, 3, 3], 1)) / mean
    median = float(np.median(jumps)) if len(jumps) else 0.0
    return Measures(
        values=int(total[0, 0]),
        nonfinite=first.nonfinite,
        mean=mean,
        relative_rmse=relative_root(first.sums, 1, to=2),
        bias=_bias(by_frame),
        flicker=relative_root(first.sums, 4, to=2, values=3),
        flicker_beside_lag=relative_root(beside, 1, to=2) if beside.ndim else UNKNOWN,
        reference_change=float(np.sqrt(total[5, 5] / max(total[3, 3], 1)) / mean),
        lag=lag,
        ghost=regression(ghosts[:, [0, 1, 2, -1]][:, :, [0, 1, 2, -1]])[2],
        ghost_by_age=tuple(
            regression(ghosts[:, [0, 1, 2 + age, -1]][:, :, [0, 1, 2 + age, -1]])[2]
            for age in range(1, AGES + 1)
        ),
        pop=float(jumps.max() / median) if median > 0 else None,
        pop_frame=counted[places[int(np.argmax(jumps))]] if jumps.any() else None,
        rmse_by_frame=tuple(rmse.tolist()),
        change_by_frame=tuple(moved.tolist()),
        repeated=tuple(first.repeated),
    )


def _cell_means(values: Array) -> Array:
    """Return means over cells of pixels, those at the ends smaller."""
    return block_sums(values, CELL) / block_sums(np.ones((*values.shape[:2], 1)), CELL)


def _bias(by_frame: Array) -> Estimate:
    """Return the mean error over the mean reference, with the error of the mean of the frames."""
    light = by_frame[:, 0, 2]
    lit = light > 0
    series = mean_of_series(by_frame[lit, 0, 1] / light[lit])
    return Estimate(float(by_frame[:, 0, 1].sum() / light.sum()), series.error)
