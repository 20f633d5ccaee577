# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the fog against the surfaces: factors, opacity, ambient light, a shift, a lag."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.engine.fault import (
    Change,
    Fault,
    Number,
    Values,
    changed_layers,
    of_fog_alone,
    of_surfaces_alone,
    scenery_number,
)
from airlight.validation.engine.image_faults import SHIFT, best_corner, shifted
from airlight.validation.engine.light_faults import PLACE, at_position, position_held
from airlight.validation.engine.prediction import Guess, Layers, Predictor


def scaled(entry: str, lights: Sequence[int] | None = None) -> Change:
    """Return a function that gives some lights, or all, a factor in a tuple of the fog."""

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        old = getattr(guess.fog, entry)
        new = tuple(
            value * p[0] if lights is None or n in lights else value for n, value in enumerate(old)
        )
        given: dict[str, Any] = {entry: new}
        return replace(guess, fog=replace(guess.fog, **given))

    return changed


def _times(change: Change) -> Callable[[Predictor, Guess], Sequence[Values]]:
    """Return a function that finds the start of a factor on a part of the light: with it the part
    explains most of what the image has beyond the rest of the light.
    """

    def begin(predictor: Predictor, guess: Guess) -> Sequence[Values]:
        # The image is the rest plus the factor times the part, both of which are guesses with the
        # factors 1 and 0. Bright pixels of the part say most of its factor: they are its weights.
        whole, rest = (
            predictor.predicted(change(predictor, guess, (value,))) for value in (1.0, 0.0)
        )
        part, residual = whole - rest, predictor.shown(guess) - rest
        lit = part > 0.01 * max(float(part.mean()), 1e-300)
        if not lit.any():
            return [(1.0,)]
        return [(max(_weighted_median(residual[lit] / part[lit], part[lit]), 1e-9),)]

    return begin


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][min(int(np.searchsorted(total, 0.5 * total[-1])), len(order) - 1)])


def factor_fault(name: str, words: str, change: Change, needs: tuple[str, ...] = ()) -> Fault:
    """Return a fault that multiplies a part of the light."""
    one = (Number(1e-9, 1e9, scale="log"),)
    return Fault(
        name, words, change, one, begin=_times(change), needs=needs, factor=True, kind="layers"
    )


def _opacity(change: Callable[[Array, Array, Array], tuple[Array, Array]]) -> Change:
    """Return the change of airlight and surfaces by the transmittance of the fog."""

    def make(predictor: Predictor, guess: Guess, p: Values) -> Layers:
        transmittance = predictor.transmittance(guess)
        return lambda airlight, surface: change(airlight, surface, transmittance)

    return changed_layers(make)


def _ambient(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    # Ambient light shows in the fog by its opacity.
    opacity = 1 - predictor.transmittance(guess)
    return replace(
        guess,
        layers=(
            *guess.layers,
            lambda airlight, surface: (airlight + np.array(p) * opacity, surface),
        ),
    )


def _ambient_colour(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    # In each channel the excess of the image over the guess is the ambient light times the opacity:
    # the median of their ratios, with the opacity as weights, is the solution already.
    opacity = np.maximum(1 - predictor.transmittance(guess), 1e-6)
    excess = predictor.shown(guess) - predictor.predicted(guess)
    return [
        tuple(
            max(_weighted_median(e / o, o), 0.0) for e, o in zip(excess.T, opacity.T, strict=True)
        )
    ]


def _fog_held(predictor: Predictor, guess: Guess, p: Values, at: Values) -> Guess:
    return replace(position_held(predictor, guess, p, at), surfaces=guess.surfaces or guess.scenery)


FOG_AND_SURFACES = (
    factor_fault(
        "fog-factor",
        "the fog is {0:.4g} times as bright as it should be, surfaces are right",
        scaled("airlight"),
        ("both",),
    ),
    factor_fault(
        "surface-factor",
        "surfaces are {0:.4g} times as bright as they should be, the fog is right",
        scaled("surface"),
        ("both",),
    ),
    *(
        Fault("opacity", words, _opacity(change), needs=needs)
        for words, needs, change in (
            (
                "the fog is multiplied by its opacity once more: it was blended as a colour, or "
                "premultiplied twice",
                ("fog",),
                lambda airlight, surface, left: (airlight * (1 - left), surface),
            ),
            (
                "the fog is divided by its opacity: it was not premultiplied, and is taken as if "
                "it were",
                ("fog",),
                lambda airlight, surface, left: (airlight / np.maximum(1 - left, 1e-6), surface),
            ),
            (
                "the fog is multiplied by the transmittance of the whole ray: it is attenuated "
                "once more",
                ("both",),
                lambda airlight, surface, left: (airlight * left, surface),
            ),
            (
                "surfaces are attenuated on the way to the camera twice",
                ("shapes",),
                lambda airlight, surface, left: (airlight, surface * left),
            ),
            (
                "fog and surfaces are mixed by the fog's opacity: both are attenuated once more",
                ("both",),
                lambda airlight, surface, left: (airlight * (1 - left), surface * left),
            ),
        )
    ),
    Fault(
        "ambient",
        "ambient light with the colour ({0:.3g}, {1:.3g}, {2:.3g}) W/(m^2 sr) is in the fog",
        _ambient,
        tuple(Number(0.0, 1e30) for _ in range(3)),
        begin=_ambient_colour,
        solved=True,
        single=True,
        needs=("fog",),
    ),
    Fault(
        "fog-shift",
        "the fog lies {0:.3g} pixels too far right and {1:.3g} too far down, against the surfaces",
        of_fog_alone(shifted),
        SHIFT,
        begin=best_corner(of_fog_alone(shifted)),
        costly=1,
        single=True,
        needs=("both",),
    ),
    Fault(
        "fog-shift",
        "the fog shows {0:.4g} times the width that surfaces do",
        of_fog_alone(scenery_number("zoom", 5)),
        (Number(0.2, 5.0, (0.95, 1.05), scale="log", step=0.01),),
        costly=1,
        single=True,
        needs=("both",),
    ),
    *(
        Fault(
            "light-lag",
            f"the first light is off by ({{0:.3g}}, {{1:.3g}}, {{2:.3g}}) m for {words}: one of "
            "them lags",
            alone(at_position),
            PLACE,
            held=held,
            costly=1,
            single=True,
            needs=("both", "lamps"),
        )
        for words, alone, held in (
            ("the fog, not for surfaces", of_fog_alone, _fog_held),
            ("surfaces, not for the fog", of_surfaces_alone, None),
        )
    ),
)
