# SPDX-License-Identifier: BSD-3-Clause
"""The numbers with which a fault, or two faults together, fit an image best.

The loss is Cauchy's, the mean of log(1 + (e/s)^2) over all values, with the relative errors e and a
scale s: outliers cannot decide. A single number is found by a bounded search on the line, since the
loss may have several minima there. Several numbers are found by steps of Gauss and Newton with
Cauchy's weights. The position of a light moves shadows: a pixel in a wrong shadow is off by all of
its light whatever a small step of the light does, so that the loss has no slope. The search for a
position begins along the axes, by strides as long as shadows are wide (Hooke and Jeeves 1961, J.
ACM 8, 212). The scale of the first search is the least usual error at any start. The scale of the
second search is the usual error that the first one leaves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from airlight.validation.arrays import Array, Bools
from airlight.validation.engine.fault import Fault, Number, Values
from airlight.validation.engine.prediction import Guess, Predictor

# Fraction of the loss that a step leaves which gains little, and fraction of the step of
# differences: a shorter move is none. Both end a search; more steps cost paths of light.
_LITTLE = 0.9
_SMALL = 0.02

#: Least scale of the errors of a search for some per cent: it does not tell errors below it apart.
COARSE = 1e-2


@dataclass(frozen=True)
class Explanation:
    """Faults with their best parameters, and what they leave."""

    faults: tuple[Fault, ...]
    values: tuple[Values, ...]
    guess: Guess
    errors: Array  #: relative, (pixels, 3)
    #: which values of the image are not dark, (pixels, 3): their errors say what the noise is
    lit: Bools
    error: float  #: mean of their sizes

    @property
    def parameters(self) -> int:
        """How many numbers were looked for."""
        return sum(len(fault.parameters) for fault in self.faults)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the faults."""
        return tuple(fault.name for fault in self.faults)


def explain(
    predictor: Predictor, faults: Sequence[Fault], near: Sequence[Values] = (), *, fine: bool = True
) -> Explanation:
    """Return the best explanation by some faults together.

    `faults`: in the order in which they change the guess; `near`: values to begin with; by default
    all starts of the faults are tried; `fine`: whether the values are found to all digits, or to
    some per cent, which is enough for a wrong fault.
    """
    # The first search looks at few pixels: paths of a fault that moves them are found again for
    # each value. A second one, if all digits are asked for, looks at all pixels.
    coarse = _coarse(predictor, faults)
    searches = [_Search(each, tuple(faults)) for each in (coarse, *[predictor] * fine)]
    given = [tuple(value for part in near for value in part)] if near else []
    starts = given or starts_of(coarse, faults)
    values = starts[0]
    if any(fault.parameters and not fault.solved for fault in faults):
        values = _best_values(searches, starts, fine=fine, is_near=bool(near))
    # The errors that they leave, in all pixels where those do not cost much.
    shown = coarse if predictor.many and not fine else predictor
    guess = guess_of(shown, faults, values)
    errors = shown.errors(guess)
    error = float(np.abs(errors).mean())
    parts = _parted(faults, values)
    return Explanation(tuple(faults), parts, guess, errors, shown.lit(guess), error)


def _best_values(
    searches: "Sequence[_Search]", starts: Sequence[Values], *, fine: bool, is_near: bool
) -> Values:
    """Return the best values that searches find one after the other, on more and more pixels.

    `is_near`: whether the starts are near the best values already.
    """
    search = searches[0]
    numbers = search.numbers
    # The starts by their loss, at the least scale of any of them.
    scale = min(search.scale(start, fine) for start in starts)
    starts = sorted(starts, key=lambda start: search.loss(start, scale))
    # One start is followed where paths move, which cost most. Elsewhere two are followed on a
    # line, and three by steps: the best one may lead to a lesser minimum. Half of the starts of
    # fog that thins with height lead to even fog.
    on_a_line = len(numbers) == 1
    moves = any(number.step for number in numbers)
    followed = 1 if moves else 2 if on_a_line else 3
    places = [inward(numbers, start) for start in starts[:followed]]
    if any(number.stride for number in numbers) and not is_near:
        places = [search.along_axes(place, scale) for place in places]
    # The second search begins where the first one ends, at the scale of the errors there. Where
    # paths move it is near the end already, and takes few steps.
    for turn, search in enumerate(searches):
        scale = scale if turn == 0 else search.scale(outward(numbers, places[0]), fine)
        follow = search.on_line if on_a_line else search.by_steps
        places = [follow(place, scale, fine, moves and turn > 0) for place in places]
    ends = [outward(numbers, place) for place in places]
    return min(ends, key=lambda values: search.loss(values, scale))


def best_of_starts(
    predictor: Predictor, faults: Sequence[Fault]
) -> tuple[float, tuple[Values, ...]]:
    """Return the least mean error at the starts of some faults together, and the values there."""
    predictor = _coarse(predictor, faults) if predictor.many else predictor
    starts = starts_of(predictor, faults)
    errors = [
        float(np.abs(predictor.errors(guess_of(predictor, faults, start))).mean())
        for start in starts
    ]
    return min(errors), _parted(faults, starts[int(np.argmin(errors))])


def best_shape(predictor: Predictor, fault: Fault) -> Values:
    """Return the start of a fault with the least error but for a factor on the image."""
    shown = predictor.shown(predictor.unchanged)

    def error(start: Values) -> float:
        predicted = predictor.predicted(fault.change(predictor, predictor.unchanged, start))
        lit = (predicted > 0.01 * predicted.mean()) & (shown > 0)
        factor = float(np.median(shown[lit] / predicted[lit])) if lit.any() else 1.0
        return float(np.abs(predictor.relative(factor * predicted, shown)).mean())

    return min(starts_of(predictor, (fault,)), key=error)


def _coarse(predictor: Predictor, faults: Sequence[Fault]) -> Predictor:
    """Return a predictor with fewer pixels, by what the paths of faults cost."""
    if any(fault.stage == "extent" for fault in faults) and not predictor.many:
        return predictor.fewest
    moves = any(fault.moves for fault in faults)
    return predictor.coarse if moves else predictor.quick


def guess_of(
    predictor: Predictor,
    faults: Sequence[Fault],
    values: Values,
    *,
    at: Values | None = None,
    guess: Guess | None = None,
) -> Guess:
    """Return the guess for some faults with these values.

    `at`: values for which paths are found, and held for others by the faults that can do with that;
    `guess`: what the faults change; the scene as it is, in its equation, by default.
    """
    # Faults change the guess in turn, each with its own part of the values.
    guess = guess or predictor.unchanged
    olds = _parted(faults, values if at is None else at)
    for fault, part, old in zip(faults, _parted(faults, values), olds, strict=True):
        if at is None or fault.held is None:
            guess = fault.change(predictor, guess, part)
        else:
            guess = fault.held(predictor, guess, part, old)
    return guess


def inward(numbers: Sequence[Number], values: Sequence[float]) -> Array:
    """Return the places on the whole line where values are looked for, (n,)."""
    return np.array([number.inward(value) for number, value in zip(numbers, values, strict=True)])


def outward(numbers: Sequence[Number], place: Sequence[float] | Array) -> Values:
    """Return the values that places on the whole line stand for."""
    return tuple(number.outward(each) for number, each in zip(numbers, place, strict=True))


def usual_size(errors: Array) -> float:
    """Return the standard deviation of normal errors with this median size."""
    return 1.4826 * float(np.median(np.abs(errors))) if errors.size else 0.0


class _Search:
    """The errors of guesses, by the values of all numbers."""

    def __init__(self, predictor: Predictor, faults: tuple[Fault, ...]) -> None:
        self.predictor, self.faults = predictor, faults
        self.numbers = tuple(number for fault in faults for number in fault.parameters)
        self.cached: dict[Values, Array] = {}  # errors by values

    def errors(self, values: Values) -> Array:
        if values not in self.cached:
            self.cached[values] = self.predictor.errors(
                guess_of(self.predictor, self.faults, values)
            )
        return self.cached[values]

    def loss(self, values: Values, scale: float) -> float:
        return float(np.mean(np.log1p((self.errors(values) / scale) ** 2)))

    def loss_at(self, place: Array, scale: float) -> float:
        return self.loss(outward(self.numbers, place), scale)

    def scale(self, values: Values, fine: bool) -> float:
        # Where a parameter changes only a few pixels, most are right and the usual error is tiny: a
        # least scale keeps the few from being outliers.
        errors = self.errors(values)[
            self.predictor.lit(guess_of(self.predictor, self.faults, values))
        ]
        return max(usual_size(errors), 1e-4 if fine else COARSE)

    def on_line(self, place: Array, scale: float, fine: bool, near: bool = False) -> Array:
        """Return the best place of one parameter; `near`: a search on few pixels has found it
        except for a few steps of differences.
        """
        (parameter,) = self.numbers
        low, high = (parameter.inward(end) for end in (parameter.low, parameter.high))

        def loss(value: float) -> float:
            return self.loss_at(np.array([value]), scale)

        place = np.clip(place, low, high)  # an image that is nearly black may begin beyond an end
        ends = _between(parameter, float(place[0]), low, high)
        # Few paths are off by three steps of differences at most.
        if near:
            ends = (
                max(ends[0], place[0] - 3 * parameter.step),
                min(ends[1], place[0] + 3 * parameter.step),
            )
        # 2 % of a logarithm, or of the unit of the parameter, is enough to tell faults apart.
        enough = (_SMALL * parameter.step or 1e-7) if fine else 0.02
        solved = minimize_scalar(loss, bounds=ends, method="bounded", options={"xatol": enough})
        return np.array([solved.x]) if solved.fun <= loss(float(place[0])) else place

    def along_axes(self, place: Array, scale: float) -> Array:
        """Return the end of steps along the axes, halved where none of them gains; of two
        sizes if these gain little.

        Where they have gained, diagonals are tried too: a shadow stays where a light
        moves towards what casts it.
        """
        # `strides` are as long as shadows are wide; moves are along the axes and the diagonals of
        # pairs of axes.
        longest = strides = np.array([parameter.stride for parameter in self.numbers])
        least = begun = self.loss_at(place, scale)
        axes = np.eye(len(place))
        diagonals = [
            a + sign * b for n, a in enumerate(axes) for b in axes[n + 1 :] for sign in (1, -1)
        ]
        for _ in range(10):
            before = least
            # At 2 % of the loss shadows lie nearly where they should: slopes find the rest.
            if least < 0.02 * begun:
                break
            # Diagonals follow the axes once a tenth of the loss is gone.
            for moves in (axes, diagonals) if least < _LITTLE * begun else (axes,):
                for move in strides * moves:
                    for trial in (place + move, place - move):
                        reached = self.loss_at(trial, scale)
                        if reached < least:
                            place, least = trial, reached
                            break
                if least < _LITTLE * before:
                    break
            else:
                # A round that gains less than a tenth is repeated with half the stride. If steps of
                # two sizes leave half of the loss, this fault is not what makes it.
                strides = 0.5 * strides
                if least > 0.5 * begun and np.all(strides < 0.5 * longest):
                    break
        return place

    def by_steps(self, place: Array, scale: float, fine: bool, near: bool = False) -> Array:
        """Return the end of a few steps of Gauss and Newton with Cauchy's weights, halved
        while they make it worse.
        """
        low, high = (
            inward(self.numbers, [getattr(p, end) for p in self.numbers]) for end in ("low", "high")
        )
        # Differences of 1e-4, of a logarithm or in units of the parameter, where no paths move.
        steps = np.array([parameter.step or 1e-4 for parameter in self.numbers])
        least = self.loss_at(place, scale)
        for _ in range(3 if near else 8 if fine else 4):
            # The step that is best for errors linear in the parameters. The weights are those of
            # Cauchy's loss: an error of the scale counts half.
            errors = self.errors(outward(self.numbers, place)).ravel()
            slopes = self._slopes(place, errors, steps)
            weights = 1 / (1 + (errors / scale) ** 2)
            move = -np.linalg.lstsq(
                slopes * np.sqrt(weights)[:, None], errors * np.sqrt(weights), rcond=1e-10
            )[0]
            # Halves of the step, until one is better; if none is, the search is at its end.
            for _ in range(4 if fine else 2):
                trial = np.clip(place + move, low, high)
                reached = self.loss_at(trial, scale)
                if reached < least:
                    break
                move = 0.5 * move
            else:
                return place
            small = np.all(np.abs(trial - place) < _SMALL * steps) or (
                not fine and reached > _LITTLE * least
            )
            place, least = trial, reached
            if small:
                break
            # Differences of faults that move paths become shorter as the search comes nearer.
            steps = np.where([p.step > 0 for p in self.numbers], 0.6 * steps, steps)
        return place

    def _slopes(self, place: Array, errors: Array, steps: Array) -> Array:
        """Return the derivatives of `errors` at a place, (values, parameters), by differences."""
        at = outward(self.numbers, place)
        columns = []
        for step, axis in zip(steps, np.eye(len(place)), strict=True):
            values = outward(self.numbers, place + step * axis)
            columns.append((self._held_errors(values, at).ravel() - errors) / step)
        return np.stack(columns, axis=1)

    def _held_errors(self, values: Values, at: Values) -> Array:
        """Return the errors with paths held where they are, for faults that can do with that."""
        if not any(fault.held for fault in self.faults):
            return self.errors(values)
        return self.predictor.errors(guess_of(self.predictor, self.faults, values, at=at))


def _between(parameter: Number, inner: float, low: float, high: float) -> tuple[float, float]:
    """Return the ends of a search on the line about a place.

    The ends of a start are the starts beside it, unless the search is of a logarithm.
    """
    # Everywhere else the search has some room: a factor of two, or 30 % of the value.
    step = 0.7 if parameter.scale == "log" else max(0.3 * abs(inner), 0.1)
    ends = inner - step, inner + step
    if parameter.scale != "log" and inner in parameter.starts:
        below, above = (
            [start for start in parameter.starts if sign * (start - inner) > 0] for sign in (-1, 1)
        )
        ends = max(below, default=low), min(above, default=high if math.isfinite(high) else ends[1])
    return max(low, ends[0]), min(high, ends[1])


def _parted(faults: Sequence[Fault], values: Values) -> tuple[Values, ...]:
    """Return the values of each fault by itself."""
    parts, start = [], 0
    for fault in faults:
        end = start + len(fault.parameters)
        parts.append(tuple(float(value) for value in values[start:end]))
        start = end
    return tuple(parts)


def starts_of(predictor: Predictor, faults: Sequence[Fault]) -> list[Values]:
    """Return values to begin with: a fault chooses its own on the guess that the faults before it
    have changed.
    """
    starts: list[Values] = [()]
    for number, fault in enumerate(faults):
        before = faults[:number]
        starts = [
            (*start, *more) for start in starts for more in _starts(predictor, fault, before, start)
        ]
    return starts


def _starts(
    predictor: Predictor, fault: Fault, before: Sequence[Fault], values: Values
) -> Sequence[Values]:
    if fault.begin is not None:
        return fault.begin(predictor, guess_of(predictor, before, values))
    # One number is tried at each of its starts, several together at the first of each.
    if len(fault.parameters) == 1:
        return [(start,) for start in fault.parameters[0].starts]
    return [tuple(parameter.starts[0] for parameter in fault.parameters)]
