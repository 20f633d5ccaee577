# SPDX-License-Identifier: BSD-3-Clause
"""What the misprints of Biri 2006 cost: the annex as printed against the derived polynomial, ray by ray.

Both polynomials of degree 4, and the certified kernel beside them, run on the same wide set of rays (see
`validation.kernels.rays.wide_rays`) in float64, so that rounding plays no part, for each of the paper's four phase
functions. The paper does not claim its polynomial everywhere, so the shares are also given in two regions of the set:

moderate        what scenes are made of: optical depth 0.01 to 5 at the distance of the light, angle to the light 1 to
                179 degrees, length 0.05 to 10 distances
near-foot       both ends within one radian of the foot of the perpendicular, as seen from the light, where a polynomial
                in that angle should be good
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from analytic.cases import Cases
from realtime.kernels.exact import exact
from realtime.kernels.taylor import PRINTED_PHASES, taylor
from validation.kernels.rays import wide_rays
from validation.kernels.values import Kernel, evaluate_cases

Array = NDArray[np.float64]

#: The kernels compared, by the names that tables and figures give them.
COMPARED: Mapping[str, Kernel] = MappingProxyType(
    {"taylor-printed": partial(taylor, printed=True), "taylor": taylor, "exact": exact}
)

_NEAR_FOOT = 1.0  # [rad]


@dataclass(frozen=True)
class Accuracy:
    """How far a kernel is from the truth on a set of rays."""

    phase: str
    kernel: str
    region: str  #: 'all', 'moderate' or 'near-foot', see the module
    rays: int
    within_1_percent: float  #: share of the rays [1]
    within_10_percent: float  #: share of the rays [1]


def printed_against_derived(count: int = 100_000, *, kernels: Mapping[str, Kernel] = COMPARED) -> list[Accuracy]:
    """Return the accuracy for each of the paper's phase functions, each region and each kernel, in this order.

    Of each phase function there are `count` rays, at most 2^20; a power of two keeps them balanced.
    """
    accuracies = []
    for phase in PRINTED_PHASES:
        cases = wide_rays(count, phase)
        regions = {"all": np.ones(count, dtype=bool), "moderate": _moderate(cases), "near-foot": _near_foot(cases)}
        errors = {name: relative_errors(cases, function) for name, function in kernels.items()}
        for region, chosen in regions.items():
            accuracies += [_accuracy(phase, name, region, error[chosen]) for name, error in errors.items()]
    return accuracies


def relative_errors(cases: Cases, function: Kernel) -> Array:
    """Return |value / J - 1| of every case [1], (n,), in float64; inf where the value is not finite."""
    assert cases.value is not None
    values = evaluate_cases(cases, function, "double").J
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.abs(values / cases.value - 1)
    return np.where(np.isfinite(error), error, np.inf)


def _moderate(cases: Cases) -> NDArray[np.bool_]:
    distance = np.hypot(cases.foot, cases.height)  # and optical depth: the extinction of the set is 1
    length = cases.x1 / distance
    fine = (distance >= 0.01) & (distance <= 5) & (length >= 0.05) & (length <= 10)
    return fine & (cases.height >= distance * np.sin(np.radians(1)))


def _near_foot(cases: Cases) -> NDArray[np.bool_]:
    ends = [np.abs(np.arctan2(x - cases.foot, cases.height)) for x in (cases.x0, cases.x1)]
    return np.maximum(*ends) <= _NEAR_FOOT


def _accuracy(phase: str, kernel: str, region: str, error: Array) -> Accuracy:
    within_1, within_10 = (float(np.mean(error <= bound)) if len(error) else float("nan") for bound in (0.01, 0.1))
    return Accuracy(phase, kernel, region, len(error), within_1, within_10)
