# SPDX-License-Identifier: BSD-3-Clause
"""Kernels on certified cases: the airlight integral of every row of a file."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.cases import Cases
from analytic.errors import InputError
from reference.storage.files import write_text
from validation.kernels.errors import relative_error
from validation.kernels.values import evaluate_rows
from validation.study.configuration import find_kernel

Array = NDArray[np.float64]

#: Largest number of a case in a precision: its square must be one too [m, 1/m].
LARGEST = {"single": 1e18, "double": 1e150}


def integrate_cases(cases: Cases, kernel: str, precision: str) -> Array:
    """Return J of every case by a kernel, (cases,) [1/m], in 'single' or 'double' precision.

    Where cases have rays, foot and height are computed from them in the precision. A number that it cannot square and
    an unknown kernel are refused.
    """
    function = find_kernel(kernel)
    for name in ("foot", "height", "x0", "x1", "sigma_t"):
        values = getattr(cases, name)
        large = (np.abs(values) > LARGEST.get(precision, np.inf)) & np.isfinite(values)
        if large.any():
            row = int(np.argmax(large))
            raise InputError(
                f"{_place(cases, row)}: {name} is {values[row]:g}; wanted at most {LARGEST[precision]:g} in "
                f"{precision} precision: use other units"
            )
    results = np.empty(len(cases.x0))
    for name in dict.fromkeys(cases.phase):
        rows = np.flatnonzero(np.asarray(cases.phase) == name)
        results[rows] = evaluate_rows(cases, rows, function, precision)
    return results


def check_results(cases: Cases, results: Array, kernel: str) -> None:
    """Refuse results, (n,) [1/m], of a kernel that are not finite, by the first row."""
    wrong = ~np.isfinite(results)
    if wrong.any():
        row = int(np.argmax(wrong))
        hint = f"{kernel} is not valid there: use another kernel"
        if cases.height[row] < 1e-30 and cases.x0[row] <= cases.foot[row] <= cases.x1[row]:
            hint = "the light lies on the segment, and J, which grows like 1/height, is infinite: give a larger height"
        raise InputError(
            f"{_place(cases, row)}: the result is {results[row]:g}, and {int(wrong.sum())} of {len(results)} rows are "
            f"not finite; {hint}"
        )


def _place(cases: Cases, row: int) -> str:
    return f"line {row + 2}" if cases.rows else f"row {row}"


def summary(cases: Cases, results: Array) -> dict[str, Any]:
    """Return quantiles of the relative error of results, (n,) [1/m], where the cases have values."""
    quantiles: dict[str, Any] = {"rows": len(results), "compared": 0, "nonfinite": int(np.sum(~np.isfinite(results)))}
    if cases.value is None:
        return quantiles
    error = relative_error(results, cases.value, "single")
    finite = np.isfinite(error)
    if not finite.any():
        return quantiles
    p50, p99, largest = np.percentile(error[finite], [50, 99, 100])
    worst = int(np.flatnonzero(finite)[np.argmax(error[finite])])
    # Row 1 of the file is its header.
    return quantiles | {"compared": int(finite.sum()), "p50": p50, "p99": p99, "max": largest, "worst_row": worst + 2}


def write_results(cases: Cases, results: Array, target: Path) -> None:
    """Write the rows of a file with their results [1/m] in a column `result`, whole or not at all."""
    kept = [k for k, name in enumerate(cases.header) if name != "result"]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([*(cases.header[k] for k in kept), "result"])
    for row, result in zip(cases.rows, results):
        writer.writerow([*(row[k] for k in kept), repr(float(result))])
    write_text(target, buffer.getvalue())
