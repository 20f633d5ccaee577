# SPDX-License-Identifier: BSD-3-Clause
"""Changes of a guess of an image, and the numbers that are looked for in them.

A fault changes a guess, which another fault may have changed before: two faults of different kinds
are applied in turn. A fault has any number of parameters, each with a range and values to begin
with. A diagnosis looks for faults, most of them relative to the scene; a fit looks for faults that
set a number (`validation.fit.unknowns`).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.engine.prediction import Guess, Predictor

Values = tuple[float, ...]
Change = Callable[[Predictor, Guess, Values], Guess]
#: A change to values, with the paths that the guess has at other values.
Held = Callable[[Predictor, Guess, Values, Values], Guess]
#: Values to begin with, by the predictor of an image and the guess that a fault changes.
Begin = Callable[[Predictor, Guess], Sequence[Values]]

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
    #: the value of a plain number at the place 1: a length of the scene, where it is one
    unit: float = 1.0

    def inward(self, value: float) -> float:
        """Return the place on the whole line where a value is looked for."""
        return SCALES[self.scale][0](value / self.unit)

    def outward(self, place: float) -> float:
        """Return the value that a place on the whole line stands for."""
        return self.unit * SCALES[self.scale][1](float(place))


@dataclass(frozen=True)
class Fault:
    """A fault."""

    name: str
    words: str  #: a sentence with {0}, {1}, .. for the parameters
    change: Change
    parameters: tuple[Number, ...] = ()
    #: values to begin with, by what the image shows; None: the starts of the parameters
    begin: Begin | None = None
    solved: bool = False  #: whether the values to begin with are the best already
    #: The change with the paths of light held where they are for other values: enough for slopes.
    held: Held | None = None
    #: when the diagnosis tries it, one of `validation.engine.stages.STAGES`
    stage: str = "quick"
    single: bool = False  #: whether it is not tried together with another one
    needs: tuple[str, ...] = ()  #: the `traits` that the scene and its image must have for it
    #: the image without it, (height, width, 3) -> the same
    undo: Callable[[Array], Array] | None = None
    factor: bool = False  #: whether its number is a factor that may have a name
    #: the words of an engine's equation, see `validation.engine.equations`
    equation: str = ""
    #: of faults that leave the same, with as many numbers, the one of the lowest rank is named
    rank: int = 0
    tell: Callable[[Values], str] | None = None  #: the words by the numbers, where they are long
    kind: str = ""  #: of the table that it is in: one of `validation.engine.faults.KINDS`

    @property
    def moves(self) -> bool:
        """Whether each of its values has paths of its own."""
        return any(parameter.step for parameter in self.parameters)

    def sentence(self, values: Values) -> str:
        """Return the words for an image with the fault."""
        told = self.words.format(*values) if self.tell is None else self.tell(values)
        return told + (factor_name(values[0]) if self.factor else "")


def factor_name(times: float) -> str:
    """Return the name of a factor in brackets, such as 4 pi, or nothing."""
    for word, value in _NAMED.items():
        # A factor has a name if it agrees to 1 %.
        for name, constant in ((word, value), (f"1/({word})", 1 / value)):
            if abs(times / constant - 1) < 0.01:
                return f" ({name})"
    return ""
