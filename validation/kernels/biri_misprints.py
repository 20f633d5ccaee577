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

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from types import MappingProxyType
from typing import Any

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


def printed_against_derived(
    count: int = 100_000, *, kernels: Mapping[str, Kernel] = COMPARED
) -> Iterator[dict[str, Any]]:
    """Yield for each of the paper's phase functions, region and kernel which fraction of rays is how accurate.

    Of each phase function there are `count` rays, at most 2^20; a power of two keeps them balanced. A row has `phase`,
    `region`, `kernel`, how many `rays`, and of these the fractions `within_1_percent` and `within_10_percent`.
    """
    for phase in PRINTED_PHASES:
        cases = wide_rays(count, phase)
        regions = {"all": np.ones(count, dtype=bool), "moderate": _moderate(cases), "near-foot": _near_foot(cases)}
        errors = {name: relative_errors(cases, function) for name, function in kernels.items()}
        for (region, chosen), (name, error) in product(regions.items(), errors.items()):
            of = error[chosen]
            within = {f"within_{percent}_percent": _within(of, percent / 100) for percent in (1, 10)}
            yield {"phase": phase, "region": region, "kernel": name, "rays": len(of), **within}


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


def _within(error: Array, bound: float) -> float:
    return float(np.mean(error <= bound)) if len(error) else float("nan")
