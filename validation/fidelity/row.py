# SPDX-License-Identifier: BSD-3-Clause
"""One claim of a paper as data, and the rule that makes a verdict of the published and the measured figure.

A row names the experiment that measures it and a function that takes its figure from what the experiment gave. No
verdict is typed in: `judge` computes it, and one that says `impossible` carries a reason that was stated or measured.

reproduced  the measured figure agrees with the claim, by the rule of the row
refuted     it does not, and the claim is about mathematics or accuracy, which no machine changes
differs     it does not, and the claim depends on the machine or on the scene, which are not the paper's
impossible  the figure cannot be measured here, or the spread hides it
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Evidence = Mapping[str, Any]  # what an experiment gave, as JSON holds it

REPRODUCED, REFUTED, DIFFERS, IMPOSSIBLE = "reproduced", "refuted", "differs", "impossible"
_ROUNDING = 1e-6  # tolerances up to this are for rounding, and no rule names them [1]
VERDICTS = (REPRODUCED, REFUTED, DIFFERS, IMPOSSIBLE)


@dataclass(frozen=True)
class Spread:
    """A measured figure with the interval of its noise."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class NotMeasured:
    """Why there is no figure."""

    reason: str


Figure = float | Spread | NotMeasured


@dataclass(frozen=True)
class Equal:
    """The figure must agree with the published one within a relative tolerance."""

    tolerance: float  #: relative [1]
    reason: str
    otherwise: str = REFUTED

    def holds(self, published: float, measured: float) -> bool:
        """Return whether the figures agree."""
        return abs(measured - published) <= self.tolerance * abs(published)

    @property
    def words(self) -> str:
        """The rule, with a place for the published figure."""
        return "{:.4g}" + (f" within {100 * self.tolerance:g} %" if self.tolerance > _ROUNDING else "")


@dataclass(frozen=True)
class AtMost:
    """The figure must not exceed the published one."""

    reason: str
    otherwise: str = REFUTED

    def holds(self, published: float, measured: float) -> bool:
        """Return whether the figure keeps to the bound."""
        return measured <= published

    @property
    def words(self) -> str:
        """The rule, with a place for the published figure."""
        return "at most {:.4g}"


@dataclass(frozen=True)
class AtLeast:
    """The figure must reach the published one."""

    reason: str
    otherwise: str = REFUTED

    def holds(self, published: float, measured: float) -> bool:
        """Return whether the figure reaches the bound."""
        return measured >= published

    @property
    def words(self) -> str:
        """The rule, with a place for the published figure."""
        return "at least {:.4g}"


Rule = Equal | AtMost | AtLeast


@dataclass(frozen=True)
class Bound:
    """A number that we read out of words: what the paper prints is no figure."""

    value: float


@dataclass(frozen=True)
class Row:
    """One equation, figure, table cell or sentence of a paper."""

    paper: str  #: of `validation.fidelity.catalogue.PAPERS`
    item: str  #: where it stands: an equation, a figure, a table, a section
    claim: str  #: the paper's words, short
    published: float | Bound | None  #: the paper's figure, or the number that its words were taken to mean
    experiment: str  #: that measures it
    figure: Callable[[Evidence], Figure]  #: takes the measured figure from what the experiment gave
    rule: Rule | None  #: None where nothing can be measured: `figure` then says why
    unit: str = ""  #: of both figures; empty for a plain number
    command: str = ""  #: that prints the measured figure; empty for `airlight fidelity --paper PAPER`


def judge(row: Row, evidence: Evidence) -> dict[str, Any]:
    """Return a row with its verdict, ready for JSON.

    Parameters
    ----------
    row
        Of the catalogue.
    evidence
        What the experiment of the row gave.

    Returns
    -------
    dict
        `paper`, `item`, `claim`, `verdict`, `published`, `measured`, `unit`, `command` and `why`.
    """
    figure = row.figure(evidence)
    measured, verdict, why = None, IMPOSSIBLE, ""
    goal = row.published.value if isinstance(row.published, Bound) else row.published
    if isinstance(figure, NotMeasured):
        why = figure.reason
    else:
        assert row.rule is not None, row.item
        assert goal is not None, row.item
        value = figure.value if isinstance(figure, Spread) else float(figure)
        if math.isfinite(value):
            measured, (verdict, why) = value, _verdict(row.rule, goal, figure)
        else:
            why = "the measured figure is not finite"
    return {
        "paper": row.paper,
        "item": row.item,
        "claim": row.claim,
        "verdict": verdict,
        "published": None if isinstance(row.published, Bound) else row.published,
        "measured": measured,
        "unit": row.unit,
        "command": row.command or f"airlight fidelity --paper {row.paper}",
        "why": why,
    }


def _verdict(rule: Rule, published: float, figure: float | Spread) -> tuple[str, str]:
    """Return the verdict of a rule and its reason; where the ends of the spread disagree, nothing can be told."""
    ends = (figure.low, figure.value, figure.high) if isinstance(figure, Spread) else (figure,)
    verdicts = {rule.holds(published, end) for end in ends}
    if len(verdicts) == 2:
        low, high = ends[0], ends[-1]
        return IMPOSSIBLE, f"cannot be told apart: the measured figure lies between {low:.3g} and {high:.3g}"
    return (
        REPRODUCED if verdicts == {True} else rule.otherwise
    ), f"wanted {rule.words.format(published)}: {rule.reason}"
