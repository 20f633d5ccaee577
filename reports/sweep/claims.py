# SPDX-License-Identifier: BSD-3-Clause
"""Claims: in what fraction of the scenes a configuration keeps an error, and which property
of a scene goes with it.

A scene counts as within an error if its image was made, all its pixels are finite, and the relative
RMSE is at most the error. A refusal is no try: refused scenes are counted apart, and so are scenes
that have no reference, and those that were left out for their time. A cell that failed, hung or
died is a try that missed. Where the target and the error differ by less than the error of the
reference nothing is decided. Such a scene is within at the upper end of the interval and not at the
lower one: the interval holds the fraction whatever an exact reference would have said.

Properties are correlated with errors by ranks, as neither has a natural scale. A property that
correlates with an error need not cause it. Properties correlate with one another too (more lights,
more triangles): among several that say nearly the same, the one with the strongest correlation is
named. All intervals of correlations hold together with the level (Bonferroni): each has the level
1 - (1 - level)/m of m correlations. With hundreds of these, some would be away from zero by chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from airlight.reports.sweep.samples import FAULTS, UNTOLD, Sample, Sweep
from airlight.validation.properties.properties import PROPERTIES
from airlight.validation.statistics.samples import LEVEL, binomial_interval, rank_correlation

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
    left_out: int  #: further scenes of which a frame would take too long
    fraction: float | None  #: of the scenes that are within the error for sure; None without scenes
    low: float
    high: float
    level: float = LEVEL
    text: str = ""  #: the claim as a sentence

    @property
    def fraction_words(self) -> str:
        """The fraction with its interval, and what is not in it, in words."""
        words = "in none, as no scene counts"
        if self.fraction is not None:
            words = f"in {percent(self.fraction, self.tries)} % of {scenes_words(self.tries)}, "
            words += f"{percent(self.low, self.tries)} to {percent(self.high, self.tries)} %"
        if self.undecided:
            words += (
                f"; the reference is not exact enough to tell in {scenes_words(self.undecided)}"
            )
        words += f"; {self.refused} more refused" if self.refused else ""
        words += f"; {self.left_out} more left out for their time" if self.left_out else ""
        return words + (f"; no reference of {self.untold} more" if self.untold else "")


def claim(sample: Sample, target: float, level: float = LEVEL) -> Claim:
    """Return in what fraction of the scenes a relative RMSE is at most the target;
    `level` is of this claim [1].
    """
    # A scene counts as within if it is so at both ends of the reference's error, as undecided if
    # only at one.
    measured = sample.measured
    finite = measured & (sample.nonfinite == 0)
    surely, possibly = finite & (sample.most <= target), finite & (sample.least <= target)
    # Faults are tries that missed; refusals and scenes without a reference are none.
    tries = int(measured.sum()) + sample.count(*FAULTS)
    within, at_most = int(surely.sum()), int(possibly.sum())
    # The interval of the fraction holds whatever an exact reference would say of the undecided
    # scenes: its lower end counts none of them, its upper end all.
    made = Claim(
        label=sample.label,
        target=target,
        tries=tries,
        within=within,
        undecided=at_most - within,
        refused=sample.count("refused"),
        untold=sample.count(UNTOLD),
        left_out=sample.count("left out"),
        fraction=within / tries if tries else None,
        low=binomial_interval(within, tries, level)[0],
        high=binomial_interval(at_most, tries, level)[1],
        level=level,
    )
    words = f"within {written(target)} {made.fraction_words}" if tries else "no scene was tried"
    return replace(made, text=f"{sample.label}: {words}.")


def claims(made: Sequence[Sample]) -> list[Claim]:
    """Return the claims of every configuration, one for each error."""
    return [claim(sample, target) for sample in made for target in TARGETS]


def best_claims(made: Sequence[Claim], target: float) -> list[Claim]:
    """Return the claims on an error that promise most, by the lower ends of
    their intervals, with equals.
    """
    # The lower end of the interval, not the fraction: three of three scenes promise less than
    # ninety of a hundred.
    tried = [each for each in made if each.target == target and each.within]
    most = max((each.low for each in tried), default=0.0)
    return [each for each in tried if each.low == most]


def scenes_words(count: int) -> str:
    """Return how many scenes, in words."""
    return "one scene" if count == 1 else f"{count} scenes"


def percent(fraction: float, trials: int) -> str:
    """Return a fraction in per cent, to the digits that so many trials tell apart, never
    rounded up to all or none.
    """
    # A hundred trials tell whole per cents apart, a thousand tenths.
    places = max(0, int(np.ceil(np.log10(max(trials, 1)))) - 2)
    text = f"{100 * fraction:.{places}f}"
    # "100 %" would claim that no scene missed, "0 %" that none was within.
    if fraction < 1 and float(text) == 100:
        text = f"{100 - 10.0**-places:.{places}f}"
    if fraction > 0 and float(text) == 0:
        text = f"{10.0**-places:.{places}f}"
    return text


def written(target: float) -> str:
    """Return an error as claims name it: 1e-3, or 0.05 where it is no power of ten."""
    exponent = np.log10(target)
    return (
        f"1e{exponent:.0f}"
        if np.isclose(exponent, np.round(exponent), atol=1e-9)
        else f"{target:g}"
    )


SAME = 0.8  #: rank correlation of two properties from which on they say nearly the same
NAMED = 3  #: properties that are named of a configuration at most
LEAST = 10  #: scenes below which no correlation is stated


@dataclass(frozen=True)
class Correlation:
    """Correlation of a property with the error of a configuration, over scenes."""

    label: str  #: of the configuration
    property: str
    scenes: int
    r: float  #: Spearman's rank correlation
    low: float
    high: float


def correlations(sweep: Sweep, made: Sequence[Sample]) -> list[Correlation]:
    """Return the correlation of every property that varies with the
    error of every configuration.
    """
    pairs = []
    for sample in made:
        # Scenes with an error and a property; a constant has no rank correlation.
        usable = sample.measured & ~np.isnan(sample.errors)
        for name in sweep.properties:
            values = sweep.property(name)[list(sample.rows)]
            both = usable & np.isfinite(values)
            x, y = values[both], sample.errors[both]
            if len(x) >= LEAST and np.ptp(x) > 0 and len(np.unique(y)) > 1:
                pairs.append((sample, name, x, y))
    # Bonferroni: all intervals hold together with the level.
    each = 1 - (1 - LEVEL) / max(len(pairs), 1)
    return [
        Correlation(sample.label, name, len(x), *rank_correlation(x, y, each))
        for sample, name, x, y in pairs
    ]


def sure(found: Correlation) -> bool:
    """Return whether the interval of a correlation leaves zero out."""
    return found.low > 0 or found.high < 0


def strongest(found: Sequence[Correlation], sweep: Sweep, sample: Sample) -> list[Correlation]:
    """Return the properties that go with the error of a configuration most, without any
    that say nearly the same.

    `found` comes from `correlations`.
    """
    # From the strongest down; a property that says nearly the same as one already named is passed
    # over.
    candidates = [each for each in found if each.label == sample.label and sure(each)]
    chosen: list[Correlation] = []
    for each in sorted(candidates, key=lambda each: (-abs(each.r), each.property)):
        if len(chosen) < NAMED and all(
            not _same(sweep, sample, each.property, other.property) for other in chosen
        ):
            chosen.append(each)
    return chosen


def _same(sweep: Sweep, sample: Sample, first: str, second: str) -> bool:
    x, y = (sweep.property(name)[list(sample.rows)] for name in (first, second))
    both = np.isfinite(x) & np.isfinite(y)
    return abs(rank_correlation(x[both], y[both])[0]) > SAME


def property_words(name: str) -> str:
    """Return a property in words; of one that has none here its name without underscores."""
    return PROPERTIES.get(name) or name.replace("_", " ")
