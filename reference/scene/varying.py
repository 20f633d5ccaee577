# SPDX-License-Identifier: BSD-3-Clause
"""A medium around the camera whose extinction differs from place to place: what all such media have."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from analytic.phase import PhaseFunction

NO_EXTINCTION = (
    "the medium has an extinction that differs from place to place, and this asks for one number; wanted a medium of "
    "type 'homogeneous'"
)


@dataclass(frozen=True, kw_only=True)
class VaryingMedium:
    """A medium of one albedo and one phase function, whose density is its class's own."""

    albedo: NDArray[np.float64]  #: RGB
    phase: PhaseFunction
    largest: NDArray[np.float64]  #: a bound of the extinction, RGB [1/m]
    plugin: Any  #: Mitsuba's medium

    @property
    def sigma_t(self) -> NDArray[np.float64]:
        """Refuse: code that asks for one extinction would take the medium for a homogeneous one."""
        raise InputError(NO_EXTINCTION)
