# SPDX-License-Identifier: BSD-3-Clause
"""Values of a kernel on tables of cases, with the airlight integral of every row of a file."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypedDict, Unpack

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import aligned_array, array_types
from airlight.realtime.rays import RayGeometry, ray_geometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import named_phase
from airlight.reference.storage.files import write_text
from airlight.validation.arrays import Array, Index
from airlight.validation.kernels.case_files import Cases
from airlight.validation.study.configuration import find_kernel

#: A kernel: a function of the ray's geometry, its ends, the medium and the light that returns J.
Kernel = Callable[[RayGeometry, "mi.Float", "mi.Float", Homogeneous, Light], "mi.Float"]

#: Largest number of a case in a precision: its square must be one too [m, 1/m].
LARGEST = {"single": 1e18, "double": 1e150}
#: The phase function of cases called 'tabulated': float32 numbers whose mean over
#: the sphere is exactly 1.
TABLE = (0.5, 0.25, 0.25, 0.5, 0.5, 0.75, 1.0, 2.0, 5.0)

#: Below these a precision has no normal numbers: such values are compared in absolute terms.
TINY = {"single": 1e-37, "double": 1e-300}


class RowOptions(TypedDict, total=False):
    """The options of `evaluate_rows`."""

    table: ArrayLike
    intensity: float


def evaluate_cases(
    cases: Cases, function: Kernel, precision: str, **options: Unpack[RowOptions]
) -> Array:
    """Return J of every case, (cases,) [1/m], as `evaluate_rows` does.

    Raises InputError for a phase function that the kernel refuses.
    """
    results, refused = evaluate_accepted(cases, function, precision, **options)
    for reason in refused.values():
        raise reason
    return results


def evaluate_accepted(
    cases: Cases, function: Kernel, precision: str, **options: Unpack[RowOptions]
) -> tuple[Array, dict[str, Exception]]:
    """Return J of every case, (cases,) [1/m], and the errors of a kernel by the phase functions
    that it refuses, where J is NaN.
    """
    names, results = np.asarray(cases.phase), np.full(len(cases.phase), np.nan)
    refused: dict[str, Exception] = {}
    # Kernels evaluate one phase function at a time; J stays NaN where one is refused.
    for name in dict.fromkeys(cases.phase):
        rows = np.flatnonzero(names == name)
        try:
            results[rows] = evaluate_rows(cases, rows, function, precision, **options)
        except InputError as reason:
            refused[name] = reason
    return results, refused


def evaluate_rows(
    cases: Cases,
    rows: Index,
    function: Kernel,
    precision: str,
    *,
    table: ArrayLike = TABLE,
    intensity: float = 1.0,
) -> Array:
    """Return J of cases that share a phase function, (rows,) [1/m].

    Where cases have rays, foot and height are computed from them in the precision, 'single' or
    'double'. The `table` has the values of the phase function 'tabulated', of mean 1; the light has
    an `intensity` [W/sr].
    """
    types = array_types(precision)
    name = cases.phase[rows[0]]
    column = partial(aligned_array, types.scalar)
    phase = named_phase(
        name,
        g=column(cases.g[rows]) if name == "hg" else None,
        values=column(np.asarray(table)) if name == "tabulated" else None,
        Float=types.scalar,
    )
    medium = Homogeneous((column(cases.sigma_t[rows]),), types.color(1), phase)
    # Without rays the light stands at the origin: the kernel asks for foot and height alone.
    if cases.light is None or cases.origin is None or cases.direction is None:
        light = Light(types.vector(0), types.color(intensity))
        geometry = RayGeometry(column(cases.foot[rows]), column(cases.height[rows]), None, None)
    else:
        light = Light(types.vector(cases.light[rows].T), types.color(intensity))
        # Directions stay in double precision until foot and height are computed.
        direction = mi.Vector3d(cases.direction[rows].T)
        geometry = ray_geometry(types.vector(cases.origin[rows].T), direction, light)
    x0, x1 = column(cases.x0[rows]), column(cases.x1[rows])
    return np.array(function(geometry, x0, x1, medium, light), dtype=np.float64)


def relative_error(
    results: Array, expected: Array, precision: str, allowance: Array | float = 0.0
) -> Array:
    """Return |results - expected| / |expected| [1] beyond an allowance [1/m], NaN
    where either is not finite.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        # Deviations that underflow explains are no errors; below the smallest normal number errors are absolute.
        error = np.maximum(np.abs(results - expected) - allowance, 0.0) / np.maximum(
            np.abs(expected), TINY[precision]
        )
    return np.where(np.isfinite(results) & np.isfinite(expected), error, np.nan)


def integrate_cases(cases: Cases, kernel: str, precision: str) -> Array:
    """Return J of every case by a kernel, (cases,) [1/m], in 'single' or 'double' precision.

    Where cases have rays, foot and height are computed from them in the precision. A number that it
    cannot square and an unknown kernel are refused.
    """
    function = find_kernel(kernel)
    for name in ("foot", "height", "x0", "x1", "sigma_t"):
        values = getattr(cases, name)
        # A number whose square overflows gives infinity or NaN, with a message about the kernel and
        # not about the unit.
        large = (np.abs(values) > LARGEST.get(precision, np.inf)) & np.isfinite(values)
        if large.any():
            row = int(np.argmax(large))
            raise InputError(
                f"{cases.place(row)}: {name} is {values[row]:g}; expected at most "
                f"{LARGEST[precision]:g} in "
                f"{precision} precision: use other units"
            )
    return evaluate_cases(cases, function, precision)


def check_results(cases: Cases, results: Array, kernel: str) -> None:
    """Refuse results, (n,) [1/m], of a kernel that are not finite, by the first row."""
    wrong = ~np.isfinite(results)
    if wrong.any():
        row = int(np.argmax(wrong))
        hint = f"{kernel} is not valid there: use another kernel"
        # The usual cause: the light lies on the segment itself, where J is infinite.
        if cases.height[row] < 1e-30 and cases.x0[row] <= cases.foot[row] <= cases.x1[row]:
            hint = "the light lies on the segment, and J, which grows like 1/height, is infinite: give a larger height"
        raise InputError(
            f"{cases.place(row)}: the result is {results[row]:g}, and {int(wrong.sum())} of "
            f"{len(results)} rows are "
            f"not finite; {hint}"
        )


def summary(cases: Cases, results: Array, precision: str = "single") -> dict[str, float]:
    """Return quantiles of the relative error of results, (n,) [1/m], of a kernel
    in a precision, where the cases have values.
    """
    quantiles: dict[str, float] = {
        "rows": len(results),
        "compared": 0,
        "nonfinite": int(np.sum(~np.isfinite(results))),
    }
    if cases.value is None:
        return quantiles
    error = relative_error(results, cases.value, precision)
    finite = np.isfinite(error)
    if not finite.any():
        return quantiles
    p50, p99, largest = np.percentile(error[finite], [50, 99, 100])
    # Counted among the finite errors, then as a row of the whole table, then as a line of the file.
    worst = int(np.flatnonzero(finite)[np.argmax(error[finite])])
    worst = cases.lines[worst] if cases.lines else worst
    return quantiles | {
        "compared": int(finite.sum()),
        "p50": p50,
        "p99": p99,
        "max": largest,
        "worst_row": worst,
    }


def write_results(cases: Cases, results: Array, target: Path) -> None:
    """Write the rows of a file with their results [1/m] in a column
    `result`, whole or not at all.
    """
    # A file with results of an earlier run gets new ones in their place.
    columns = [k for k, name in enumerate(cases.header) if name != "result"]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([*(cases.header[k] for k in columns), "result"])
    for row, result in zip(cases.rows, results):
        writer.writerow([*(row[k] for k in columns), repr(float(result))])
    write_text(target, buffer.getvalue())
