# SPDX-License-Identifier: BSD-3-Clause
"""How good the kernels of papers are on many rays, isotropic: polynomials, the table of Sun 2005, the closed form."""

from typing import Any

from realtime.kernels.closed_form import closed_form
from validation.kernels.biri_misprints import COMPARED, PERCENTS, printed_against_derived

_COUNT = 1 << 13
_MEDIAN = PERCENTS.index(50)


def polynomials() -> dict[str, Any]:
    """Return the share of rays within 1 % and 10 % and the median error by region and kernel.

    The rays and regions are those of `validation.kernels.biri_misprints`.
    """
    accuracies: dict[str, Any] = {}
    for accuracy in printed_against_derived(_COUNT, kernels={**COMPARED, "closed-form": closed_form}):
        if accuracy.phase == "isotropic":
            accuracies.setdefault(accuracy.region, {})[accuracy.kernel] = {
                "within_1_percent": accuracy.within_1_percent,
                "within_10_percent": accuracy.within_10_percent,
                "median": accuracy.quantiles[_MEDIAN],
            }
    return accuracies
