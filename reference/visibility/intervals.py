# SPDX-License-Identifier: BSD-3-Clause
"""The lit parts of camera rays, as both routes to them return them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Doubt = tuple[Index, Array, Array]


@dataclass(frozen=True)
class RandomChecks:
    """How often fresh random shadow rays contradicted lit intervals."""

    checked: int = 0  #: shadow rays cast
    disagreements: int = 0  #: of these, how many contradicted the intervals further from an edge than rounding
    refined: int = 0  #: disagreements that were settled: by a new bracket, or by testing every shape in float64
    left: int = 0  #: disagreements that were not
    missed: float = 0.0  #: share of the first round's shadow rays that contradicted the intervals

    @staticmethod
    def of_all(parts: "Sequence[RandomChecks]") -> "RandomChecks":
        """Add up the checks of several lights or chunks of rays; of the shares the worst counts."""
        return RandomChecks(
            sum(part.checked for part in parts),
            sum(part.disagreements for part in parts),
            sum(part.refined for part in parts),
            sum(part.left for part in parts),
            max((part.missed for part in parts), default=0.0),
        )


@dataclass(frozen=True)
class LitIntervals:
    """The lit parts of rays: one entry per interval, sorted by ray and angle."""

    ray: Index  #: number of the ray
    low: Array  #: angle at the light where the interval begins [rad]
    high: Array  #: where it ends [rad]
    transitions: int  #: edges between light and shadow
    edge: float = 2e-6  #: relative uncertainty of the distance of an edge; the default is that of a float32 shadow ray
    random_checks: RandomChecks = field(default_factory=RandomChecks)
    doubt: Doubt | None = None  #: what was left in doubt: rays, angles, widths [rad]


def joined_doubt(*parts: Doubt | None) -> Doubt | None:
    """Join lists of doubtful angles; None stands for an empty list."""
    known = [part for part in parts if part is not None]
    if not known:
        return None
    ray, angle, width = (np.concatenate(column) for column in zip(*known, strict=True))
    return ray, angle, width


def intersected(first: LitIntervals, second: LitIntervals, ends: tuple[Array, Array]) -> LitIntervals:
    """Return what is lit in both; the edges are as uncertain as the worse of the two, and doubt and checks add up.

    Parameters
    ----------
    first, second
        The intervals; those of one ray neither overlap nor touch.
    ends
        Angles at the light between which the rays are looked at, (rays,) each [rad].
    """
    count = len(first.ray), len(second.ray)
    ray = np.concatenate([first.ray, first.ray, second.ray, second.ray])
    angle = np.concatenate([first.low, first.high, second.low, second.high])
    step = np.repeat([1, -1, 1, -1], [count[0], count[0], count[1], count[1]])
    order = np.lexsort((step, angle, ray))  # what closes comes before what opens at the same angle
    ray, angle = ray[order], angle[order]
    both = np.flatnonzero(np.cumsum(step[order]) == 2)
    ray, low, high = ray[both], angle[both], angle[both + 1]
    transitions = int(np.sum(low > ends[0][ray]) + np.sum(high < ends[1][ray]))
    random_checks = RandomChecks.of_all([first.random_checks, second.random_checks])
    return LitIntervals(
        ray,
        low,
        high,
        transitions,
        max(first.edge, second.edge),
        random_checks,
        joined_doubt(first.doubt, second.doubt),
    )
