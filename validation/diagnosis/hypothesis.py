# SPDX-License-Identifier: BSD-3-Clause
"""What may be wrong with an image: a name, the kind of fault, and the guesses that it allows.

A hypothesis changes a guess, which may be that of another one: two faults of different kinds are one after the other.
It has no parameter, or some, each with a range and values to begin with.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from validation.diagnosis.prediction import Guess, Predictor

KINDS = ("brightness", "medium", "light", "camera", "values")


@dataclass(frozen=True)
class Parameter:
    """A number of a hypothesis."""

    name: str
    low: float
    high: float
    starts: tuple[float, ...]
    logarithmic: bool = False  #: whether it is looked for by its logarithm
    step: float = (
        0.0  #: of differences, for what moves paths: each guess costs new ones, and few must do; 0: it does not
    )
    unit: str = ""


Begin = Callable[[Predictor, Guess], tuple[float, ...]]
Change = Callable[[Predictor, Guess, tuple[float, ...]], Guess]


@dataclass(frozen=True)
class Hypothesis:
    """A fault."""

    name: str
    kind: str  #: of `KINDS`
    words: str  #: a sentence with {0}, {1}, .. for the parameters
    change: Change
    parameters: tuple[Parameter, ...] = field(default=())
    begin: Begin | None = None  #: values to begin with, by what the image shows, in the place of the starts
    costly: int = 0  #: 1: tried where nothing of 0 explains the image; 2: where no pair does either
    applies: Callable[[Predictor], bool] = field(default=lambda predictor: True)
