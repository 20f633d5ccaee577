# SPDX-License-Identifier: BSD-3-Clause
"""The lit parts of camera rays, as both routes to them return them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Certificate:
    """What fresh random shadow rays said of lit intervals."""

    checked: int = 0  #: shadow rays cast
    disagreements: int = 0  #: of these, how many contradicted the intervals further from an edge than rounding
    refined: int = 0  #: disagreements that were settled: by a new bracket, or by testing every triangle in float64
    left: int = 0  #: disagreements that were not
    missed: float = 0.0  #: share of the first round's shadow rays that contradicted the intervals

    @staticmethod
    def of_all(parts: "Sequence[Certificate]") -> "Certificate":
        """Add up what was said of several lights or chunks of rays; of the shares the worst counts."""
        return Certificate(
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
    certificate: Certificate = field(default_factory=Certificate)
    doubt: tuple[Index, Array, Array] | None = None  #: what was left in doubt: rays, angles, widths [rad]
