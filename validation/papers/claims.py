# SPDX-License-Identifier: BSD-3-Clause
"""The claims of papers as data, and the rule that makes a verdict of what a paper
says and what was measured.

`claims.toml` has every claim: where it stands, its words, the experiment and the figure that
measure it, and which way the paper says that the figure lies. Nobody types a verdict in:

reproduced      the figure lies where the paper says
not reproduced  it does not, and the claim is about mathematics or accuracy, which no machine changes
differs         it does not, and the figure depends on the machine or on a scene of our own
impossible      the figure cannot be measured here, or its interval reaches into both answers: the words say which
                interval that is, a 95 % interval or the quartiles of repeated times

A row without a direction is a number beside ours and has no verdict: rates of graphics cards
of 2004 to 2016 are such.
"""

import importlib
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, reduce
from pathlib import Path
from typing import Any, NamedTuple

from airlight.validation.statistics.estimate import Answer

VERDICTS = REPRODUCED, NOT_REPRODUCED, DIFFERS, IMPOSSIBLE = (
    "reproduced",
    "not reproduced",
    "differs",
    "impossible",
)
EFFORTS = ("quick", "default", "full", "paper")
DIRECTIONS = ("at most", "at least", "equal", "unequal", "within")

QUARTILES, INTERVAL = "quartiles", "95 % interval"


class Figure(NamedTuple):
    """A measured number with the ends of an interval."""

    value: float
    low: float
    high: float
    #: what the ends are: `QUARTILES` of repetitions, `INTERVAL`; empty for a number without chance
    interval: str = ""

    def over(self, other: "Figure") -> "Figure":
        """Return the quotient of two positive numbers; its ends are the widest that it can have.

        Where the divisor may be 0 nothing is known of it: all three are NaN.
        """
        if not other.low > 0:
            return Figure(math.nan, math.nan, math.nan)
        names = dict.fromkeys(name for name in (self.interval, other.interval) if name)
        return Figure(
            self.value / other.value,
            self.low / other.high,
            self.high / other.low,
            " over ".join(names),
        )


#: A result of an experiment: a number, a number with an interval, or words that say why it could
#: not be measured.
Result = float | Figure | str
Figures = Mapping[str, Result]  #: results by name


def quartiles(values: Sequence[float]) -> Figure:
    """Return a median with the quartiles, in this order."""
    median, low, high = values
    return Figure(median, low, high, QUARTILES)


@dataclass(frozen=True)
class Claim:
    """One equation, figure, table cell or sentence of a paper."""

    paper: str  #: a name of `papers()`
    item: str  #: where it stands
    words: str  #: what the paper says, and what is measured for it
    experiment: str = ""  #: that measures it; none where nothing can be measured: `why` says so
    figure: str = ""  #: name of the number that the experiment gives, or 'a / b'
    direction: str = ""  #: of `DIRECTIONS`; none for a number without a verdict
    published: float | None = None  #: the number that the paper prints
    #: the number that its words are read as; two for 'within'
    limit: float | Sequence[float] | None = None
    tolerance: float = 0.0  #: of 'equal' and 'unequal', relative; absolute where the number is 0
    unit: str = ""
    why: str = ""  #: why the words are read so, or why nothing can be measured
    ours: bool = False  #: the figure depends on the machine or on a scene of our own
    #: of `VERDICTS`, once it is judged; None for a number without a direction
    verdict: str | None = None
    #: the figure, None before and where there is none, with the ends of its interval
    measured: float | None = None
    low: float | None = None
    high: float | None = None
    interval: str = ""  #: what these ends are, as of `Figure`

    @property
    def goal(self) -> float:
        """The number of the claim, printed or read out of its words; of a range its middle."""
        number = self.published if self.limit is None else self.limit
        assert number is not None, f"{self.paper}, {self.item} has no number"
        return sum(number) / len(number) if isinstance(number, Sequence) else float(number)

    @property
    def bounds(self) -> tuple[float, float]:
        """The range in which the figure lies, or, of 'unequal', does not."""
        if isinstance(self.limit, Sequence):
            return self.limit[0], self.limit[1]
        away = self.tolerance * (abs(self.goal) or 1.0)
        low = -math.inf if self.direction == "at most" else self.goal - away
        return low, math.inf if self.direction == "at least" else self.goal + away

    def holds(self, low: float, high: float) -> Answer:
        """Return whether a number between two ends lies where the paper says;
        unknown where some of them do.
        """
        least, most = self.bounds
        # An interval that lies whole on one side gives an answer; one that straddles a limit gives
        # none.
        inside, outside = least <= low and high <= most, high < least or low > most
        if not (inside or outside):
            return Answer.UNKNOWN
        return Answer.YES if inside != (self.direction == "unequal") else Answer.NO

    @property
    def rule(self) -> str:
        """The rule in words."""
        if isinstance(self.limit, Sequence):
            return f"within {self.limit[0]:g} and {self.limit[1]:g}"
        words = f"{'' if self.direction == 'equal' else self.direction + ' '}{self.goal:.4g}"
        return words + (f" to {100 * self.tolerance:g} %" if self.tolerance > 1e-6 else "")


@dataclass(frozen=True)
class Experiment:
    """A function that measures the figures of some claims."""

    #: of a module beside this one, 'module:function'; called without arguments it gives the figures
    function: str
    seconds: float  #: that it takes on two threads, about
    #: the least of `EFFORTS` whose reports have it; 'paper': only the command
    effort: str = EFFORTS[-1]

    def run(self) -> dict[str, Result]:
        """Return the results by name."""
        name, function = self.function.split(":")
        module = importlib.import_module(f"airlight.validation.papers.{name}")
        figures: Figures = getattr(module, function)()
        return dict(figures)


@cache
def _data() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_name("claims.toml").read_text(encoding="utf-8"))


def papers() -> dict[str, str]:
    """Return the papers, by the name of the command line, in words."""
    return dict(_data()["papers"])


@cache
def experiments() -> dict[str, Experiment]:
    """Return the experiments by name."""
    return {name: Experiment(**given) for name, given in _data()["experiments"].items()}


@cache
def claims() -> tuple[Claim, ...]:
    """Return every claim, in the order of the file; a block with `rows` is as many
    claims that share its keys.
    """
    rows = []
    for block in _data()["claims"]:
        shared = {key: value for key, value in block.items() if key != "rows"}
        rows += [Claim(**(shared | row)) for row in block.get("rows", [{}])]
    return tuple(rows)


def taken(claim: Claim, figures: Figures) -> Figure | str:
    """Return the figure of a claim, or why there is none."""
    # The name of a figure may be 'a / b', a quotient of two results; a result may be text that says
    # why there is none, and a list where it is read from a file.
    parts = []
    for name in claim.figure.split(" / "):
        part = figures[name]
        if isinstance(part, str):
            return part
        parts.append(Figure(*part) if isinstance(part, Sequence) else Figure(part, part, part))
    figure = reduce(Figure.over, parts)
    if not all(map(math.isfinite, figure[:3])):
        return "the measured figure is not finite"
    # An error as large as the number itself can turn the ends round.
    if not figure.low <= figure.value <= figure.high:
        return "the measured figure has no interval that holds it"
    return Figure(float(figure.value), float(figure.low), float(figure.high), figure.interval)


def verdict(claim: Claim, figure: Figure) -> str:
    """Return the verdict on a claim: impossible where the interval reaches into both answers."""
    answer = claim.holds(figure.low, figure.high)
    if answer is Answer.UNKNOWN:
        return IMPOSSIBLE
    return REPRODUCED if answer is Answer.YES else DIFFERS if claim.ours else NOT_REPRODUCED


def judged(claim: Claim, figures: Figures) -> Claim:
    """Return a claim with what was measured; `why` says why there is no figure, or by
    which rule it is judged.
    """
    figure = taken(claim, figures) if claim.experiment else claim.why
    # Without a figure a claim with a direction is impossible to judge; a number without a direction
    # has no verdict anyway.
    if isinstance(figure, str):
        return replace(
            claim,
            verdict=IMPOSSIBLE if claim.direction or not claim.experiment else None,
            why=figure,
        )
    claim = replace(
        claim, measured=figure.value, low=figure.low, high=figure.high, interval=figure.interval
    )
    if not claim.direction:
        return claim
    judgement = verdict(claim, figure)
    if judgement == IMPOSSIBLE:
        interval = f"from {figure.low:.3g} to {figure.high:.3g}"
        ends = f"{figure.interval or 'the interval'} {interval}, both answers lie between"
        return replace(
            claim, verdict=judgement, why=f"cannot be told: {ends}; {claim.rule}: {claim.why}"
        )
    return replace(claim, verdict=judgement, why=f"{claim.rule}: {claim.why}")
