# SPDX-License-Identifier: BSD-3-Clause
"""The parameters with which hypotheses fit an image best, one alone or two together.

The measure is the mean of log(1 + (e/s)^2) over all values, e the relative errors and s a scale: pixels that disagree
cannot decide (`validation.fit.least_squares`). One parameter is looked for on the line, several by Nelder and Mead's
simplex, both by SciPy. The scale begins at what the unchanged scene leaves and ends at what the search leaves.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from validation.diagnosis.hypothesis import Hypothesis, Parameter
from validation.diagnosis.prediction import Guess, Predictor

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

EVALUATIONS = 15  #: for each number of a search that need not be fine
_LEAST_SCALE, _LEAST_COARSE = 1e-4, 1e-2  # where most pixels do not know a parameter, those that do are no outliers
_TURNS = 5  # steps of Gauss and Newton at most: each costs new paths for every number
_COARSE = 0.02  # on a line, of a logarithm or in units of the parameter: enough to tell hypotheses apart
_BEGUN = 2  # of the best starts: the best one may lead to a lesser minimum
_LITTLE = 0.9  # share of the loss that a step leaves which gains little
_SIMPLEX = 0.1  # first step, of a logarithm or in units of the parameter


@dataclass(frozen=True)
class Explanation:
    """Hypotheses with their best parameters, and what they leave."""

    hypotheses: tuple[Hypothesis, ...]
    values: tuple[tuple[float, ...], ...]
    guess: Guess
    errors: Array  #: relative, (pixels, 3)
    lit: Bools  #: which values of the image are not dark, (pixels, 3): their errors say what the noise is
    error: float  #: mean of their sizes

    @property
    def parameters(self) -> int:
        """How many numbers were looked for."""
        return sum(len(hypothesis.parameters) for hypothesis in self.hypotheses)

    @property
    def words(self) -> str:
        """Sentences of all hypotheses."""
        return "; ".join(
            hypothesis.words.format(*values) for hypothesis, values in zip(self.hypotheses, self.values, strict=True)
        )


def explain(
    predictor: Predictor,
    hypotheses: Sequence[Hypothesis],
    near: Sequence[tuple[float, ...]] = (),
    *,
    fine: bool = True,
) -> Explanation:
    """Return the best explanation by some hypotheses together.

    Parameters
    ----------
    hypotheses
        In the order in which they change the guess.
    near
        Values to begin with; by default all starts of the hypotheses are tried.
    fine
        Whether the values are looked for to all digits, or to some per cent, which a hypothesis that is wrong needs.
    """
    parameters = [parameter for hypothesis in hypotheses for parameter in hypothesis.parameters]
    known: dict[tuple[float, ...], Array] = {}

    def errors(numbers: Sequence[float]) -> Array:
        values = tuple(numbers)
        if values not in known:
            known[values] = predictor.errors(_guess(predictor, hypotheses, values))
        return known[values]

    def scale_at(numbers: Sequence[float]) -> float:
        values = tuple(numbers)
        left = errors(values)[predictor.lit(_guess(predictor, hypotheses, values))]
        return max(usual_size(left), _LEAST_SCALE if fine else _LEAST_COARSE)

    starts = [tuple(value for part in near for value in part)] if near else _starts(predictor, hypotheses)
    scale = min(scale_at(start) for start in starts)
    starts = sorted(starts, key=lambda start: _loss(errors(start), scale))
    ends = [_inward(parameters, start) for start in starts[: _BEGUN if _on_a_line(parameters) else 1]]
    for _ in range((2 if fine else 1) if parameters else 0):
        scale = scale_at(_outward(parameters, ends[0]))
        ends = [_improved(errors, parameters, inner, scale, fine=fine) for inner in ends]
    inner = min(ends, key=lambda end: _loss(errors(_outward(parameters, end)), scale))
    values = _outward(parameters, inner)
    left = errors(values)
    guess = _guess(predictor, hypotheses, values)
    error = float(np.abs(left).mean())
    return Explanation(tuple(hypotheses), _parted(hypotheses, values), guess, left, predictor.lit(guess), error)


def _on_a_line(parameters: Sequence[Parameter]) -> bool:
    """Return whether a search is quick, and can begin more than once: between starts there may be several minima."""
    return len(parameters) == 1 and not parameters[0].step


def begin(predictor: Predictor, hypotheses: Sequence[Hypothesis]) -> tuple[float, tuple[tuple[float, ...], ...]]:
    """Return the least mean error at the starts of some hypotheses together, and the values there."""
    starts = _starts(predictor, hypotheses)
    left = [float(np.abs(predictor.errors(_guess(predictor, hypotheses, start))).mean()) for start in starts]
    return min(left), _parted(hypotheses, starts[int(np.argmin(left))])


def _improved(
    errors_of: Callable[[Sequence[float]], Array],
    parameters: Sequence[Parameter],
    inner: Array,
    scale: float,
    *,
    fine: bool,
) -> Array:
    def errors(place: Array) -> Array:
        return errors_of(_outward(parameters, place))

    def loss(place: Array) -> float:
        return _loss(errors(place), scale)

    low, high = _inward(parameters, [p.low for p in parameters]), _inward(parameters, [p.high for p in parameters])
    if any(parameter.step for parameter in parameters):
        steps = np.array([parameter.step or 1e-4 for parameter in parameters])
        return _by_differences(errors, loss, inner, scale, (steps, low, high), fine=fine)
    if len(parameters) == 1:
        bounds = _between(parameters[0], float(inner[0]), float(low[0]), float(high[0]))
        solved = minimize_scalar(
            lambda value: loss(np.array([value])), bounds=bounds, options={"xatol": 1e-7 if fine else _COARSE}
        )
        return np.array([solved.x]) if solved.fun <= loss(inner) else inner
    simplex = np.concatenate([inner[None], inner + _SIMPLEX * np.eye(len(inner))])
    most = (60 if fine else EVALUATIONS) * len(inner)
    options = {"initial_simplex": np.clip(simplex, low, high), "maxfev": most, "xatol": 1e-5, "fatol": 1e-9}
    inner = np.clip(inner, low, high)
    solved = minimize(loss, inner, method="Nelder-Mead", bounds=list(zip(low, high, strict=True)), options=options)
    return np.asarray(solved.x)


def _between(parameter: Parameter, inner: float, low: float, high: float) -> tuple[float, float]:
    """Return the ends of a search on the line: a start's are the starts beside it, others have some room."""
    step = 0.7 if parameter.logarithmic else max(0.3 * abs(inner), 0.1)
    ends = inner - step, inner + step
    if not parameter.logarithmic and inner in parameter.starts:
        below, above = ([start for start in parameter.starts if sign * (start - inner) > 0] for sign in (-1, 1))
        ends = max(below, default=low), min(above, default=high if math.isfinite(high) else ends[1])
    return max(low, ends[0]), min(high, ends[1])


def _by_differences(
    errors: Callable[[Array], Array],
    loss: Callable[[Array], float],
    inner: Array,
    scale: float,
    steps_and_ends: tuple[Array, Array, Array],
    *,
    fine: bool,
) -> Array:
    """Return the end of a few steps of Gauss and Newton with Cauchy's weights, halved while they make it worse.

    Each loss costs new paths: a search that need not be fine ends where a step gains little.
    """
    steps, low, high = steps_and_ends
    least = loss(inner)
    for _ in range(_TURNS):
        steps = 0.6 * steps
        left = errors(inner).ravel()
        slopes = np.stack(
            [(errors(inner + step * axis).ravel() - left) / step for step, axis in zip(steps, np.eye(len(inner)))],
            axis=1,
        )
        weights = 1 / (1 + (left / scale) ** 2)
        move = -np.linalg.lstsq(slopes * np.sqrt(weights)[:, None], left * np.sqrt(weights), rcond=1e-10)[0]
        for _ in range(4 if fine else 2):
            trial = np.clip(inner + move, low, high)
            reached = loss(trial)
            if reached < least:
                break
            move = 0.5 * move
        else:
            return inner
        small = np.all(np.abs(trial - inner) < 0.02 * steps) or (not fine and reached > _LITTLE * least)
        inner, least = trial, reached
        if small:
            break
    return inner


def _guess(predictor: Predictor, hypotheses: Sequence[Hypothesis], values: Sequence[float]) -> Guess:
    guess = Guess(predictor.fog)
    for hypothesis, part in zip(hypotheses, _parted(hypotheses, values), strict=True):
        guess = hypothesis.change(predictor, guess, part)
    return guess


def _parted(hypotheses: Sequence[Hypothesis], values: Sequence[float]) -> tuple[tuple[float, ...], ...]:
    parts, start = [], 0
    for hypothesis in hypotheses:
        end = start + len(hypothesis.parameters)
        parts.append(tuple(float(value) for value in values[start:end]))
        start = end
    return tuple(parts)


def _starts(predictor: Predictor, hypotheses: Sequence[Hypothesis]) -> list[tuple[float, ...]]:
    """Return values to begin with, those of each hypothesis chosen after what those before it change."""
    starts: list[tuple[float, ...]] = [()]
    for number, hypothesis in enumerate(hypotheses):
        starts = [
            (*start, *more)
            for start in starts
            for more in _own_starts(predictor, hypothesis, _guess(predictor, hypotheses[:number], start))
        ]
    return starts


def _own_starts(predictor: Predictor, hypothesis: Hypothesis, guess: Guess) -> list[tuple[float, ...]]:
    if hypothesis.begin is not None:
        return [hypothesis.begin(predictor, guess)]
    if len(hypothesis.parameters) == 1:
        return [(start,) for start in hypothesis.parameters[0].starts]
    return [tuple(parameter.starts[0] for parameter in hypothesis.parameters)]


def _inward(parameters: Sequence[Parameter], values: Sequence[float]) -> Array:
    return np.array(
        [
            math.log(value) if parameter.logarithmic else value
            for parameter, value in zip(parameters, values, strict=True)
        ]
    )


def _outward(parameters: Sequence[Parameter], inner: Sequence[float] | Array) -> tuple[float, ...]:
    return tuple(
        math.exp(value) if parameter.logarithmic else float(value)
        for parameter, value in zip(parameters, inner, strict=True)
    )


def _loss(errors: Array, scale: float) -> float:
    return float(np.mean(np.log1p((errors / scale) ** 2)))


def usual_size(errors: Array) -> float:
    """Return the standard deviation of normal errors with this median size."""
    return 1.4826 * float(np.median(np.abs(errors))) if errors.size else 0.0
