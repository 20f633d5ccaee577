# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the camera and the grid of pixels, of brightness, and of the values:
encodings, curves, channels.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.engine.curves import (
    PRIMARIES,
    TONE_CURVES,
    from_srgb,
    gamma,
    srgb_in_8_bits,
    to_pq,
    to_srgb,
)
from airlight.validation.engine.fault import (
    Change,
    Fault,
    Number,
    Values,
    changed_values,
    scenery_number,
    top,
    undone,
)
from airlight.validation.engine.prediction import Guess, Predictor


def shifted(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return an image that lies some pixels too far right, and down."""
    # A pixel that shows what lies to the right of it shows an image that moved to the left.
    offset = (-round(p[0], 3), -round(p[1], 3))
    return replace(guess, scenery=replace(guess.scenery, offset=offset))


def best_corner(change: Change) -> Callable[[Predictor, Guess], Sequence[Values]]:
    """Return the best of no shift and half a pixel each way: at sharp edges slopes of
    one do not lead to others.
    """

    def begin(predictor: Predictor, guess: Guess) -> Sequence[Values]:
        def error(shift: Values) -> float:
            return float(np.abs(predictor.errors(change(predictor, guess, shift))).mean())

        # Without a shift, or half a pixel in both directions.
        return [min(((0.0, 0.0), *product((-0.5, 0.5), repeat=2)), key=error)]

    return begin


SHIFT = tuple(Number(-3.0, 3.0, step=0.1) for _ in range(2))  # begun by `best_corner`


def _other_axis(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return the guess with the angle of view along the other axis: pixels grow
    with the ratio of the sides.
    """
    height, width = predictor.shape
    return replace(guess, scenery=replace(guess.scenery, zoom=width / height))


def _vignette(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    attenuated = predictor.cosines[:, None] ** p[0]
    return replace(guess, values=(*guess.values, lambda radiance: radiance * attenuated))


#: Names of the turns of an image, and their inverses: each is its own.
TURNS: tuple[tuple[str, Callable[[Array], Array]], ...] = (
    ("upside down (flip it vertically)", lambda image: image[::-1]),
    (
        "mirrored left to right (a left-handed camera or an axis of the scene)",
        lambda image: image[:, ::-1],
    ),
    ("turned by 180 degrees", lambda image: image[::-1, ::-1]),
)

CAMERA = (
    *(Fault("flip", f"the image is {words}", undone(turn), undo=turn) for words, turn in TURNS),
    Fault(
        "flip",
        "rows and columns are interchanged",
        undone(lambda image: image.transpose(1, 0, 2)),
        needs=("square",),
    ),
    Fault(
        "fov-axis",
        "the field of view is that of the other axis",
        _other_axis,
        needs=("oblong",),
    ),
    Fault(
        "fov",
        "the image shows {0:.4g} times the width that it should",
        scenery_number("zoom", 5),
        (Number(0.2, 5.0, (0.9, 1.1), scale="log", step=0.01),),
        costly=1,
    ),
    Fault(
        "shift",
        "the image is {0:.3g} pixels too far right and {1:.3g} too far down",
        shifted,
        SHIFT,
        begin=best_corner(shifted),
    ),
    Fault(
        "vignette",
        "the image falls off to its corners: a vignette, cos^{0:.3g} of the angle from the "
        "camera's axis",
        _vignette,
        (Number(0.0, 100.0, (4.0, 1.0, 12.0)),),
    ),
)


# Brightness, and the values: encodings, tone curves, limits, channels.


def _exposed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    red, green, blue = (value * p[0] for value in guess.fog.exposure)
    return replace(guess, fog=replace(guess.fog, exposure=(red, green, blue)))


def _ratio(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    """Return the usual ratio of image and guess, and up to four stops more or less: a curve
    after the exposure may hide it.
    """
    # Dark values have no ratio of use; the median is one that few pixels do not decide.
    predicted, image = predictor.predicted(guess), predictor.shown(guess)
    lit = (predicted > 0.01 * predicted.mean()) & (image > 0)
    usual = float(np.median(image[lit] / predicted[lit])) if lit.any() else 1.0
    return [(usual * 2.0**stops,) for stops in (0, 1, -1, 2, -2, 3, -3, 4, -4)]


def _clamp(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    most = top(predictor)
    return replace(guess, values=(*guess.values, lambda radiance: np.minimum(radiance, most)))


def _darkest(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    """Return the excess of the darker half of the image over the guess."""
    # A level above 0, since it is looked for by its logarithm.
    predicted, image = predictor.predicted(guess), predictor.shown(guess)
    excess = (image - predicted)[predicted <= np.median(predicted)]
    return [(max(float(np.median(excess)), 1e-6 * float(np.abs(image).mean()), 1e-30),)]


def _swapped(order: tuple[int, ...]) -> Fault:
    words = f"the image is in the channel order {', '.join('RGB'[channel] for channel in order)}"
    undo = (lambda image: image[..., order]) if order == (2, 1, 0) else None  # which undoes itself
    return Fault(
        "channels",
        words,
        changed_values(lambda radiance: radiance[..., order]),
        needs=("colours",),
        undo=undo,
    )


BRIGHTNESS = Fault(
    "factor",
    "the image is {0:.4g} times as bright as it should be",
    _exposed,
    (Number(1e-9, 1e9, scale="log"),),
    begin=_ratio,
    factor=True,
)

VALUES = (
    Fault(
        "transfer",
        "the image is encoded by the sRGB curve (write linear values)",
        changed_values(to_srgb),
        undo=from_srgb,
    ),
    Fault(
        "transfer",
        "the values are decoded from sRGB, though they are linear: leave them as they are",
        changed_values(from_srgb),
        undo=to_srgb,
    ),
    Fault(
        "transfer",
        "the values were written in 8 bits by the sRGB curve",
        changed_values(srgb_in_8_bits),
    ),
    Fault(
        "transfer",
        "the values are encoded by a gamma of {0:.3g}: write linear ones",
        changed_values(gamma),
        (Number(0.2, 5.0, (0.4545, 1.8, 2.2, 2.4), scale="log"),),
    ),
    Fault(
        "transfer",
        "the values are encoded by the PQ curve of SMPTE ST 2084, 1 as {0:.4g} cd/m^2: write "
        "linear ones",
        changed_values(to_pq),
        (Number(1e-3, 1e6, (100.0, 10_000.0), scale="log"),),
    ),
    Fault(
        "clamp", "the values are cut off at the largest one: write floats", _clamp, needs=("stop",)
    ),
    *(
        Fault("tone-map", f"the values went through {words}", changed_values(curve))
        for words, curve in TONE_CURVES.items()
    ),
    Fault(
        "black-level",
        "every value has {0:.3g} added: a black level, a veil or light from elsewhere",
        changed_values(lambda radiance, level: radiance + level),
        (Number(1e-30, 1e30, scale="log"),),
        begin=_darkest,
    ),
    *(
        Fault(
            "primaries",
            f"the colours have the primaries of {name}: convert them to those of sRGB",
            changed_values(lambda radiance, matrix=matrix: radiance @ matrix.T),
            needs=("colours",),
        )
        for name, matrix in PRIMARIES.items()
    ),
    *(_swapped(order) for order in permutations(range(3)) if order != (0, 1, 2)),
)
