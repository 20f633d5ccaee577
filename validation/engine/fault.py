# SPDX-License-Identifier: BSD-3-Clause
"""Changes of a guess of an image, the numbers that are looked for in them, and the features
that they need of a scene.

A fault changes a guess, which another fault may have changed before: two faults of different kinds
are applied in turn. A fault has any number of parameters, each with a range and values to begin
with. A diagnosis looks for faults, most of them relative to the scene; a fit looks for faults that
set a number (`validation.fit.unknowns`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.engine.prediction import Guess, Layers, Predictor
from airlight.validation.engine.seen import stopped
from airlight.validation.fog_model.radiance import Fog

Values = tuple[float, ...]
Change = Callable[[Predictor, Guess, Values], Guess]

_NAMED = {
    "pi": math.pi,
    "2 pi": 2 * math.pi,
    "4 pi": 4 * math.pi,
    "pi^2": math.pi**2,
    "4 pi^2": 4 * math.pi**2,
    "683, lumens a watt": 683.0,
    "12.92, the slope of the sRGB curve at black": 12.92,
}


#: How a number is looked for on the whole line: to there, and back.
SCALES: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "plain": (float, float),
    "log": (math.log, lambda place: float(np.exp(place))),  # a step is a relative change
    "tanh": (math.atanh, math.tanh),
}


@dataclass(frozen=True)
class Number:
    """A number of a guess that is looked for."""

    low: float
    high: float
    starts: tuple[float, ...] = (1.0,)
    scale: str = "plain"  #: one of `SCALES`
    #: The step of differences, for what moves paths: each guess costs new ones, and few
    #: must do; 0: it does not.
    step: float = 0.0
    #: of the first search along the axes, for what moves shadows; 0: there is none
    stride: float = 0.0

    def inward(self, value: float) -> float:
        """Return the place on the whole line where a value is looked for."""
        return SCALES[self.scale][0](value)

    def outward(self, place: float) -> float:
        """Return the value that a place on the whole line stands for."""
        return SCALES[self.scale][1](float(place))


@dataclass(frozen=True)
class Fault:
    """A fault."""

    name: str
    words: str  #: a sentence with {0}, {1}, .. for the parameters
    change: Change
    parameters: tuple[Number, ...] = ()
    begin: Callable[[Predictor, Guess], Sequence[Values]] | None = (
        None  #: values to begin with, by what the image shows
    )
    solved: bool = False  #: whether the values to begin with are the best already
    #: The change with the paths of light held where they are for other values: enough for slopes.
    held: Callable[[Predictor, Guess, Values, Values], Guess] | None = None
    costly: int = 0  #: 1: tried where nothing of 0 explains the image; 2: where no pair does either
    single: bool = False  #: whether it is not tried together with another one
    needs: tuple[str, ...] = ()  #: the `traits` that the scene and its image must have for it
    #: the image without it, (height, width, 3) -> the same
    undo: Callable[[Array], Array] | None = None
    factor: bool = False  #: whether its number is a factor that may have a name
    kind: str = ""  #: of the table that it is in: one of `validation.engine.faults.KINDS`

    def sentence(self, values: Values) -> str:
        """Return the words for an image with the fault."""
        return self.words.format(*values) + (factor_name(values[0]) if self.factor else "")


def factor_name(times: float) -> str:
    """Return the name of a factor in brackets, such as 4 pi, or nothing."""
    for word, value in _NAMED.items():
        # A factor has a name if it agrees to 1 %.
        for name, constant in ((word, value), (f"1/({word})", 1 / value)):
            if abs(times / constant - 1) < 0.01:
                return f" ({name})"
    return ""


def changed_fog(change: Callable[..., Fog]) -> Change:
    """Return a change of the fog, by a function of it and the values."""
    return lambda predictor, guess, p: replace(guess, fog=change(guess.fog, *p))


def with_law(**given: Any) -> Change:
    """Return a change of fields of the fog."""
    return changed_fog(lambda fog: replace(fog, **given))


def with_scenery(**given: Any) -> Change:
    """Return a change of fields of the scenery."""
    return lambda predictor, guess, p: replace(guess, scenery=replace(guess.scenery, **given))


def scenery_number(name: str, digits: int = 4) -> Change:
    """Return a change of a number of the scenery, with few digits: sceneries that differ
    by less share their paths.
    """
    return lambda predictor, guess, p: with_scenery(**{name: short(p[0], digits)})(
        predictor, guess, p
    )


def of_fog_alone(change: Change) -> Change:
    """Return a change of the scenery that surfaces do not see."""

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        return replace(change(predictor, guess, p), surfaces=guess.surfaces or guess.scenery)

    return changed


def of_surfaces_alone(change: Change) -> Change:
    """Return a change of the scenery that the fog does not see."""

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        return replace(guess, surfaces=change(predictor, guess, p).scenery)

    return changed


def changed_layers(make: Callable[[Predictor, Guess, Values], Layers]) -> Change:
    """Return a change of airlight and surfaces before they are added."""
    return lambda predictor, guess, p: replace(
        guess, layers=(*guess.layers, make(predictor, guess, p))
    )


def changed_values(change: Callable[..., Array]) -> Change:
    """Return a change of the values, by a function of them and the numbers of the fault."""
    return lambda predictor, guess, p: replace(
        guess,
        values=(*guess.values, lambda radiance: change(radiance, *p) if p else change(radiance)),
    )


def undone(undo: Callable[[Array], Array]) -> Change:
    """Return the change by a fault of the grid of pixels, given the inverse of the fault."""
    return lambda predictor, guess, p: replace(guess, undo=undo)


def short(value: float, digits: int = 4) -> float:
    """Return a number with few digits."""
    return float(f"{value:.{digits}g}")


def traits(predictor: Predictor) -> dict[str, bool]:
    """Return whether a scene and its image have what faults need, by the words of `Fault.needs`."""
    reference, fog, holds, values = (
        predictor.reference,
        predictor.fog,
        predictor.seen.holds,
        predictor.seen.values,
    )
    # `optics` are the pairs of extinction and albedo of all channels of all media.
    spots, right = [light for light in reference.lights if light.axis is not None], Guess(fog)
    shapes, lobes = bool(reference.occluders.shapes()), any(isinstance(g, float) for g in fog.phase)
    optics = [
        pair
        for media in zip(fog.sigma_t, fog.albedo, strict=True)
        for pair in zip(*media, strict=True)
    ]
    return {
        "shapes": shapes,
        "lamps": bool(reference.lights),  # point and spot lights
        "point lights": len(spots) < len(reference.lights),
        "spots": bool(spots),
        "soft spots": any(0 < light.beam < light.cutoff for light in spots),
        "no bounds": not reference.media,
        "height fog": fog.height is not None,
        "even fog": fog.height is None,
        "clamped layers": fog.height is not None and fog.height.clamped,
        "rising layers": fog.height is not None and not fog.height.clamped,
        "fog": holds != "surface",  # in the image
        "all light": holds == "total",
        "both": holds == "total" and shapes,  # fog and surfaces in one layer
        "absorption": any(s > 0 and a < 1 - 1e-6 for s, a in optics),
        "lobes": lobes and holds != "surface",  # of Henyey and Greenstein
        "g": lobes and holds != "surface" and any(fog.phase),  # other than 0
        "isotropy": not lobes
        and any(medium.phase.is_constant for medium in (reference.medium, *reference.media)),
        "square": predictor.shape[0] == predictor.shape[1],
        "oblong": predictor.shape[0] != predictor.shape[1],
        "colours": bool(
            np.ptp(np.nan_to_num(values), axis=1).max() > 1e-6 * np.nanmax(np.abs(values))
        ),
        "stop": bool(stopped(values).any()),  # of many values
        # More light than there should be: higher orders take none away.
        "more light": float(np.median(predictor.shown(right) - predictor.predicted(right))) > 0,
    }


def top(predictor: Predictor) -> float:
    """Return the largest value of the image."""
    values = predictor.seen.values
    return float(values[np.isfinite(values)].max())
