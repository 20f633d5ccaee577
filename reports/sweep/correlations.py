# SPDX-License-Identifier: BSD-3-Clause
"""Which property of a scene goes with the error: rank correlations over scenes, the strongest of each configuration.

Ranks, as neither an error nor a property has a scale of its own: the correlation is the same in decades. What goes with
an error need not cause it. Properties go with one another too (more lights, more triangles): of several that say
nearly the same the one that goes with the error most is named.

All intervals hold together with the level (Bonferroni): each has the level 1 - (1 - level)/m of m correlations. With
hundreds of these, some would be away from zero by chance otherwise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reports.sweep.read import Numbers, Sweep
from reports.sweep.samples import Sample
from validation.properties.properties import PROPERTIES
from validation.statistics.samples import LEVEL, rank_correlation

SAME = 0.8  #: rank correlation of two properties from which on they say nearly the same
NAMED = 3  #: properties that are named of a configuration at most
LEAST = 10  #: scenes below which no correlation is stated


@dataclass(frozen=True)
class Correlation:
    """Of a property with the error of a configuration, over scenes."""

    label: str  #: of the configuration
    property: str
    scenes: int
    r: float  #: Spearman's rank correlation
    low: float
    high: float


def correlations(sweep: Sweep, made: Sequence[Sample], level: float = LEVEL) -> list[Correlation]:
    """Return the correlation of every property that varies with the error of every configuration.

    All intervals hold what they estimate with the probability `level` [1].
    """
    pairs = []
    for sample in made:
        usable = sample.measured & ~np.isnan(sample.errors)
        for name in sweep.properties:
            values = sweep.property(name)[list(sample.rows)]
            both = usable & np.isfinite(values)
            x, y = values[both], sample.errors[both]
            if len(x) >= LEAST and np.ptp(x) > 0 and len(np.unique(y)) > 1:
                pairs.append((sample, name, x, y))
    each = 1 - (1 - level) / max(len(pairs), 1)
    return [Correlation(sample.label, name, len(x), *rank_correlation(x, y, each)) for sample, name, x, y in pairs]


def sure(found: Correlation) -> bool:
    """Return whether the interval of a correlation leaves zero out."""
    return found.low > 0 or found.high < 0


def strongest(found: Sequence[Correlation], sweep: Sweep, sample: Sample, count: int = NAMED) -> list[Correlation]:
    """Return the properties that go with the error of a configuration most, without any that say nearly the same.

    `found` comes from `correlations`; there are `count` at most.
    """
    own = [each for each in found if each.label == sample.label and sure(each)]
    chosen: list[Correlation] = []
    for each in sorted(own, key=lambda each: (-abs(each.r), each.property)):
        if len(chosen) < count and all(not _same(sweep, sample, each.property, other.property) for other in chosen):
            chosen.append(each)
    return chosen


def _same(sweep: Sweep, sample: Sample, first: str, second: str) -> bool:
    x, y = (_of(sweep, sample, name) for name in (first, second))
    both = np.isfinite(x) & np.isfinite(y)
    return abs(rank_correlation(x[both], y[both])[0]) > SAME


def _of(sweep: Sweep, sample: Sample, name: str) -> Numbers:
    return sweep.property(name)[list(sample.rows)]


def property_words(name: str) -> str:
    """Return a property in words; of one that has none here its name without underscores."""
    return PROPERTIES.get(name) or name.replace("_", " ")
