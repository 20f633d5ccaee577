# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the camera and of the grid of pixels."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.comparison.whole_image import TURNS
from validation.diagnosis.hypothesis import Hypothesis, Parameter
from validation.diagnosis.prediction import Guess, Predictor

Array = NDArray[np.float64]


def _undone(undo: Callable[[Array], Array]) -> Any:
    return lambda predictor, guess, p: replace(guess, undo=undo)


def _shift(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    # A pixel that shows what lies to the right of it shows an image that moved to the left.
    offset = (-round(p[0], 3), -round(p[1], 3))
    return replace(guess, scenery=replace(guess.scenery, offset=offset))


def _corners(predictor: Predictor, guess: Guess) -> tuple[float, ...]:
    """Return the best of no shift and half a pixel each way: at sharp edges slopes of one do not lead to others."""

    def error(shift: tuple[float, ...]) -> float:
        return float(np.abs(predictor.errors(_shift(predictor, guess, shift))).mean())

    return min(((0.0, 0.0), *product((-0.5, 0.5), repeat=2)), key=error)


def _other_axis(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    """Return the guess with the angle of view along the other axis: pixels grow with the ratio of the sides."""
    height, width = predictor.shape
    return replace(guess, scenery=replace(guess.scenery, zoom=width / height))


def _zoom(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, scenery=replace(guess.scenery, zoom=float(f"{p[0]:.5g}")))


def _vignette(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, vignette=p[0])


def _wide(predictor: Predictor) -> bool:
    return predictor.shape[0] != predictor.shape[1]


def _square(predictor: Predictor) -> bool:
    return not _wide(predictor)


CAMERA = (
    *(Hypothesis("flip", "camera", f"the image is {words}", _undone(turn)) for words, turn in TURNS.items()),
    Hypothesis(
        "flip",
        "camera",
        "rows and columns are interchanged",
        _undone(lambda image: image.transpose(1, 0, 2)),
        applies=_square,
    ),
    Hypothesis(
        "fov-axis",
        "camera",
        "the field of view is that of the other axis",
        _other_axis,
        applies=_wide,
    ),
    Hypothesis(
        "fov",
        "camera",
        "the image shows {0:.4g} times the width that it should",
        _zoom,
        (Parameter("factor", 0.2, 5.0, (0.9, 1.1), logarithmic=True, step=0.01),),
        costly=1,
    ),
    Hypothesis(
        "shift",
        "camera",
        "the image is {0:.3g} pixels too far right and {1:.3g} too far down",
        _shift,
        (
            Parameter("right", -3.0, 3.0, (0.0,), step=0.1, unit="pixels"),
            Parameter("down", -3.0, 3.0, (0.0,), step=0.1, unit="pixels"),
        ),
        begin=_corners,
    ),
    Hypothesis(
        "vignette",
        "camera",
        "the image falls off to its corners: a vignette, cos^{0:.3g} of the angle from the camera's axis",
        _vignette,
        (Parameter("power", 0.0, 100.0, (4.0, 1.0, 12.0)),),
    ),
)
