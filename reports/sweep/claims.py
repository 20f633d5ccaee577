# SPDX-License-Identifier: BSD-3-Clause
"""Claims: in what fraction of the scenes a configuration keeps an error, with its interval.

A scene counts as within an error if its image was made, all its pixels are finite, and the relative RMSE is at most
the error. A refusal is no try: refused scenes are counted apart, and so are scenes that have no reference. A cell that
failed, hung or died is a try that missed.

Where the target and the error differ by less than the error of the reference nothing is decided. Such a scene is within
at the upper end of the interval and not at the lower one: the interval holds the fraction whatever an exact reference
would have said.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reports.sweep.samples import FAULTS, UNTOLD, Sample
from validation.statistics.samples import LEVEL, binomial_interval

TARGETS = (0.1, 0.01, 0.001)  #: relative RMSE of claims, as fractions


@dataclass(frozen=True)
class Claim:
    """A fraction of scenes and its interval."""

    label: str  #: of the configuration
    target: float  #: relative RMSE [1]
    tries: int  #: scenes that count
    within: int  #: of these, within the error for sure
    undecided: int  #: of these, with an error nearer to the target than the reference is exact
    refused: int  #: scenes beside these
    untold: int  #: further scenes that have no reference
    low: float
    high: float
    level: float = LEVEL

    @property
    def fraction(self) -> float | None:
        """Of the scenes that are within the error for sure; None of no scene."""
        return self.within / self.tries if self.tries else None

    @property
    def fraction_words(self) -> str:
        """The fraction with its interval, and what is not in it, in words."""
        words = f"in {percent(self.fraction or 0.0, self.tries)} % of {scenes_words(self.tries)}, "
        words += f"{percent(self.low, self.tries)} to {percent(self.high, self.tries)} %"
        if self.undecided:
            words += f"; the reference is not exact enough to tell in {scenes_words(self.undecided)}"
        words += f"; {self.refused} more refused" if self.refused else ""
        return words + (f"; no reference of {self.untold} more" if self.untold else "")

    @property
    def text(self) -> str:
        """The claim as a sentence."""
        within = f"within {written(self.target)} {self.fraction_words}" if self.tries else "no scene was tried"
        return f"{self.label}: {within}."


def claim(sample: Sample, target: float, level: float = LEVEL) -> Claim:
    """Return in what fraction of the scenes a relative RMSE is at most the target; `level` is of this claim [1]."""
    measured = sample.measured
    finite = measured & (sample.nonfinite == 0)
    surely = finite & (sample.errors + sample.reference_errors <= target)
    possibly = finite & (sample.errors - sample.reference_errors <= target)
    tries = int(measured.sum()) + sample.count(*FAULTS)
    within, at_most = int(surely.sum()), int(possibly.sum())
    return Claim(
        label=sample.label,
        target=target,
        tries=tries,
        within=within,
        undecided=at_most - within,
        refused=sample.count("refused"),
        untold=sample.count(UNTOLD),
        low=binomial_interval(within, tries, level)[0],
        high=binomial_interval(at_most, tries, level)[1],
        level=level,
    )


def claims(made: Sequence[Sample], targets: Sequence[float] = TARGETS) -> list[Claim]:
    """Return the claims of every configuration, one for each error."""
    return [claim(sample, target) for sample in made for target in targets]


def best_claims(made: Sequence[Claim], target: float) -> list[Claim]:
    """Return the claims on an error that promise most, by the lower ends of their intervals, with equals."""
    tried = [each for each in made if each.target == target and each.within]
    most = max((each.low for each in tried), default=0.0)
    return [each for each in tried if each.low == most]


def scenes_words(count: int) -> str:
    """Return how many scenes, in words."""
    return "one scene" if count == 1 else f"{count} scenes"


def percent(fraction: float, trials: int) -> str:
    """Return a fraction in per cent, to the digits that so many trials tell apart, never rounded up to all or none."""
    places = max(0, int(np.ceil(np.log10(max(trials, 1)))) - 2)
    text = f"{100 * fraction:.{places}f}"
    if fraction < 1 and float(text) == 100:
        text = f"{100 - 10.0**-places:.{places}f}"
    if fraction > 0 and float(text) == 0:
        text = f"{10.0**-places:.{places}f}"
    return text


def written(target: float) -> str:
    """Return an error as claims name it: 1e-3, or 0.05 where it is no power of ten."""
    exponent = np.log10(target)
    return f"1e{exponent:.0f}" if np.isclose(exponent, np.round(exponent), atol=1e-9) else f"{target:g}"
