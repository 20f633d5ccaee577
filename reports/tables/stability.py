# SPDX-License-Identifier: BSD-3-Clause
"""Where kernels break, in the manner of Boost's accuracy reports: Max = 3.2ε (Mean = 0.4ε).

The data are those that `airlight stability --json` prints.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from reports.tables.table import Column, Row, Table, number, table
from reports.tables.terminal import print_table

Entry = Mapping[str, Any]

_EPSILON = {"single": 2.0**-23, "double": 2.0**-52}


def print_stability(kernels: Sequence[Entry], *, certified: bool) -> None:
    """Print the tables of every kernel.

    Parameters
    ----------
    kernels
        An entry for each, as in JSON.
    certified
        Whether the files of certified values were there.
    """
    print("Relative errors; ε is 1.2e-7 in float32 and 2.2e-16 in float64, median and 99 % are of float32.")
    if not certified:
        print(
            "The certified values are not installed (they are in tests/data of a clone): only generated rays are used."
        )
    for kernel in kernels:
        claim = ", claims to be exact" if kernel["exact"] else ""
        print(f"\n=== {kernel['kernel']}{claim} ===")
        for phase, words in kernel["refused"].items():
            print(f"refuses {phase}: {words}")
        for one in kernel["sets"]:
            print_table(set_table(one))
            _print_worst(one)
        print_table(gamma_table(kernel["gamma"]))
        print_table(law_table(kernel["laws"]))
        for words in kernel["broken"]:
            print(f"BROKEN: {kernel['kernel']}, {words}")


def print_plane_stability(cases: Iterable[Entry], broken: Iterable[str]) -> None:
    """Print what was found of shadow planes, and what of it breaks the bar of the default."""
    print()
    print_table(plane_table(cases))
    print(
        "segments: J of each lit segment (the default); gamma: differences of Gamma a segment; planes: Gamma plane by\n"
        "plane as published, float32 against float64 (its negative pixels are the artefact of Fig. 4)"
    )
    for words in broken:
        print(f"BROKEN: shadow planes, {words}")


def summary_table(kernels: Iterable[Entry]) -> Table:
    """Return a row for each kernel and each set of rays, all of these together."""
    columns = (
        Column("kernel", "kernel", words=True),
        Column("set", "rays", words=True),
        Column("rays", "measured"),
        Column("refused", "refused"),
        Column("median", "float32 median", digits=2),
        Column("p99", "99 %", digits=2),
        Column("max", "largest", digits=2),
        Column("odd", "not finite or negative", alarm=True),
        Column("double", "float64 largest", digits=2),
    )
    rows = []
    for kernel in kernels:
        for one in kernel["sets"]:
            single, double = one["single"]["all"], one["double"]["all"]
            odd = single["nan"] + single["infinite"] + single["negative"]
            errors = (single["median"], single["p99"], single["max"])
            rows.append((kernel["kernel"], one["name"], single["rays"], single["refused"], *errors, odd, double["max"]))
    return table("Stability of the kernels", columns, rows, explanation="All rays of each set together.")


def set_table(one: Entry) -> Table:
    """Return the errors of a kernel on one set of rays, by group."""
    columns = (
        Column("group", "rays", words=True),
        Column("count", "count"),
        Column("refused", "refused"),
        Column("single", "float32", words=True),
        Column("median", "median"),
        Column("p99", "99 %"),
        Column("single_odd", "NaN/Inf/<0"),
        Column("double", "float64", words=True),
        Column("double_odd", "NaN/Inf/<0"),
        Column("precisions", "32 vs 64"),
    )
    rows = []
    for group, single in one["single"].items():
        double = one["double"][group]
        first = (group, single["rays"], single["refused"] or "", boost(single, "single"))
        quantiles = (single["median"], single["p99"], _odd(single))
        both = one["single_against_double"][group]["max"]
        rows.append((*first, *quantiles, boost(double, "double"), _odd(double), both))
    return table(one["name"], columns, rows)


def boost(errors: Entry, precision: str) -> str:
    """Return 'Max = 3.2ε (Mean = 0.4ε)', a dash where nothing was compared."""
    if errors["max"] is None or errors["mean"] is None:
        return "-"
    epsilon = _EPSILON[precision]
    return f"Max = {number(errors['max'] / epsilon)}ε (Mean = {number(errors['mean'] / epsilon)}ε)"


def _odd(errors: Entry) -> str:
    counts = (errors["nan"], errors["infinite"], errors["negative"])
    return "/".join(map(str, counts)) if any(counts) else ""


def _print_worst(one: Entry) -> None:
    """Print the worst rays as a file that `airlight integrate` reads."""
    worst = [line for line in (one["single"]["all"]["worst"], one["double"]["all"]["worst"]) if line is not None]
    if worst:
        print("\n".join(["worst rays, float32 then float64:", one["columns"], *worst]))


def gamma_table(by_precision: Mapping[str, Entry]) -> Table:
    """Return what is lost to cancellation where J is a difference of two Gammas."""
    columns = (
        Column("precision", "slivers", words=True),
        Column("direct", "J(x0, x1)", words=True),
        Column("difference", "J(0, x1) - J(0, x0)", words=True),
        Column("median", "median"),
        Column("negative", "negative", alarm=True),
        Column("rounding", "in ε (J(0, x0) + J(0, x1))", words=True),
    )
    rows = [
        (
            precision,
            boost(one["direct"], precision),
            boost(one["difference"], precision),
            one["difference"]["median"],
            one["difference"]["negative"],
            f"Max = {number(one['max_rounding'])} (Median = {number(one['median_rounding'])})",
        )
        for precision, one in by_precision.items()
    ]
    return table("cancellation: thin lit slivers far from the light", columns, rows)


def law_table(laws: Iterable[Entry]) -> Table:
    """Return how far a kernel is off laws that hold exactly."""
    columns = (
        Column("law", "law", words=True),
        Column("rays", "rays"),
        Column("single", "float32"),
        Column("double", "float64"),
    )
    rows = [(law["name"], law["rows"], law["single"], law["double"]) for law in laws]
    return table("exact laws: largest relative deviation", columns, rows)


def plane_table(cases: Iterable[Entry]) -> Table:
    """Return the errors of shadow planes in hard cases."""
    columns = (
        Column("case", "shadow planes", words=True),
        Column("sum", "sum", words=True),
        Column("precision", "precision", words=True),
        Column("median", "median"),
        Column("p99", "99 %"),
        Column("max", "max"),
        Column("beyond", "beyond 1e-4"),
        Column("negative", "negative", alarm=True),
        Column("nonfinite", "NaN/Inf", alarm=True),
    )
    keys = [column.key for column in columns]
    rows = [Row({key: one[key] for key in keys}) for one in cases]
    return table("cancellation between shadow planes: errors relative to each pixel's true value", columns, rows)
