# SPDX-License-Identifier: BSD-3-Clause
"""Relative errors of kernels on rays with a known J: quantiles, what is not finite or negative, the worst ray."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.cases import Cases
from validation.kernels.rays import case_row
from validation.kernels.underflow import underflow_allowance
from validation.kernels.values import Values

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

#: Distance from 1 to the next number: the unit of Boost's reports.
EPSILON = {"single": 2.0**-23, "double": 2.0**-52}
#: Below these a precision has no normal numbers: such values are compared in absolute terms.
TINY = {"single": 1e-37, "double": 1e-300}


@dataclass(frozen=True)
class Errors:
    """Relative errors of one group of rays [1]; the quantiles are of the finite ones, None where there is none."""

    rays: int  #: that the kernel did not refuse
    refused: int  #: rays that it refused
    median: float | None
    p99: float | None  #: 99 % quantile
    max: float | None
    mean: float | None
    nan: int  #: rays with a NaN
    infinite: int  #: rays with an infinity where the truth is finite
    negative: int  #: rays with a negative value
    worst: str | None  #: the ray with the largest error, or the first that is not finite, as a line of CSV


def groups(cases: Cases) -> dict[str, Rows]:
    """Return which rows belong to 'all', to each tag and to each phase function (as 'phase NAME')."""
    groups = {"all": np.ones(len(cases.phase), dtype=bool)}
    if cases.tag is not None:
        tags = np.asarray(cases.tag)
        groups |= {tag: tags == tag for tag in sorted(set(cases.tag))}
    phases = np.asarray(cases.phase)
    return groups | {f"phase {name}": phases == name for name in sorted(set(cases.phase))}


def relative_error(results: Array, expected: Array, precision: str, allowance: Array | float = 0.0) -> Array:
    """Return |results - expected| / |expected| [1] beyond an allowance, NaN where either is not finite.

    Parameters
    ----------
    results, expected
        J [1/m], (n,) each.
    precision
        'single' or 'double', of the results.
    allowance
        What each may be off without an error, `validation.kernels.underflow.underflow_allowance`, (n,) [1/m].
    """
    with np.errstate(invalid="ignore", over="ignore"):
        error = np.maximum(np.abs(results - expected) - allowance, 0.0) / np.maximum(np.abs(expected), TINY[precision])
    return np.where(np.isfinite(results) & np.isfinite(expected), error, np.nan)


def errors_by_group(
    cases: Cases, values: Values, precision: str, rows: Mapping[str, Rows], *, expected: Array | None = None
) -> dict[str, Errors]:
    """Return the relative errors [1] of each group of rows.

    Parameters
    ----------
    cases
        With `value`, the truth, unless `expected` is given.
    values
        What the kernel gave.
    precision
        'single' or 'double', of the values.
    rows
        The groups, see `groups`.
    expected
        What to compare with instead of the truth, (cases,) [1/m].

    Raises
    ------
    ValueError
        If the cases have no `value` and nothing is expected.
    """
    expected = cases.value if expected is None else expected
    if expected is None:
        raise ValueError("cases: got cases without `value`, wanted the true J of each")
    error = relative_error(values.J, expected, precision, underflow_allowance(cases, precision))
    return {name: _errors(cases, values, error, np.isfinite(expected), group) for name, group in rows.items()}


def _errors(cases: Cases, values: Values, error: Array, known: Rows, group: Rows) -> Errors:
    tried = group & values.accepted
    J, finite = values.J[tried], np.isfinite(error) & tried
    bad = tried & known & ~np.isfinite(values.J)
    median = p99 = largest = mean = worst = None
    if finite.any():
        median, p99, largest = (float(q) for q in np.percentile(error[finite], [50, 99, 100]))
        mean = float(error[finite].mean())
        worst = int(np.argmax(np.where(finite, error, -1.0)))
    if bad.any():
        worst = int(np.argmax(bad))
    return Errors(
        rays=int(tried.sum()),
        refused=int((group & ~values.accepted).sum()),
        median=median,
        p99=p99,
        max=largest,
        mean=mean,
        nan=int(np.isnan(J).sum()),
        infinite=int((np.isinf(values.J) & known & tried).sum()),
        negative=int((J < 0).sum()),
        worst=None if worst is None else case_row(cases, worst),
    )
