# SPDX-License-Identifier: BSD-3-Clause
"""Where kernels break, in the manner of Boost's accuracy reports: Max = 3.2ε (Mean = 0.4ε).

The data are those that `airlight stability --json` prints.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from reports.tables.table import Table, number, numbers, table, words
from reports.tables.terminal import print_table

Entry = Mapping[str, Any]

_EPSILON = {"single": 2.0**-23, "double": 2.0**-52}
_ALARM = {"alarm": True}


def print_stability(kernels: Sequence[Entry]) -> None:
    """Print the tables of every kernel.

    Parameters
    ----------
    kernels
        An entry for each, as in JSON.
    """
    print("Relative errors; ε is 1.2e-7 in float32 and 2.2e-16 in float64, median and 99 % are of float32.")
    for kernel in kernels:
        claim = ", claims to be exact" if kernel["exact"] else ""
        print(f"\n=== {kernel['kernel']}{claim} ===")
        for phase, reason in kernel["refused"].items():
            print(f"refuses {phase}: {reason}")
        for rays in kernel["sets"]:
            print_table(set_table(rays))
            _print_worst(rays)
        print_table(gamma_table(kernel["gamma"]))
        for reason in kernel["broken"]:
            print(f"BROKEN: {kernel['kernel']}, {reason}")


def summary_table(kernels: Iterable[Entry]) -> Table:
    """Return a row for each kernel and each set of rays, all of these together."""
    columns = (
        *words("kernel", set="rays"),
        *numbers(rays="measured", refused=""),
        *numbers(median="float32 median", p99="99 %", max="largest", how={"digits": 2}),
        *numbers(odd="not finite or negative", how=_ALARM),
        *numbers(double="float64 largest", how={"digits": 2}),
    )

    def row(kernel: Entry, rays: Entry) -> Entry:
        single = rays["single"]["all"]
        odd = single["nan"] + single["infinite"] + single["negative"]
        largest = rays["double"]["all"]["max"]
        return {**single, "kernel": kernel["kernel"], "set": rays["name"], "odd": odd, "double": largest}

    rows = (row(kernel, rays) for kernel in kernels for rays in kernel["sets"])
    return table("Stability of the kernels", columns, rows, explanation="All rays of each set together.")


def set_table(rays: Entry) -> Table:
    """Return the errors of a kernel on one set of rays, by group."""
    columns = (
        *words(group="rays"),
        *numbers(rays="count", refused=""),
        *words(single="float32"),
        *numbers("median", p99="99 %", odd="NaN/Inf/<0"),
        *words(double="float64"),
        *numbers(double_odd="NaN/Inf/<0", both="32 vs 64"),
    )

    def rows() -> Iterator[Entry]:
        for group, single in rays["single"].items():
            double, both = rays["double"][group], rays["single_against_double"][group]["max"]
            written = {"single": in_epsilons(single, "single"), "double": in_epsilons(double, "double")}
            odd = {"odd": _odd(single), "double_odd": _odd(double)}
            yield {**single, **written, **odd, "group": group, "refused": single["refused"] or "", "both": both}

    return table(rays["name"], columns, rows())


def in_epsilons(errors: Entry, precision: str) -> str:
    """Return 'Max = 3.2ε (Mean = 0.4ε)', a dash where nothing was compared."""
    if errors["max"] is None or errors["mean"] is None:
        return "-"
    epsilon = _EPSILON[precision]
    return f"Max = {number(errors['max'] / epsilon)}ε (Mean = {number(errors['mean'] / epsilon)}ε)"


def _odd(errors: Entry) -> str:
    counts = (errors["nan"], errors["infinite"], errors["negative"])
    return "/".join(map(str, counts)) if any(counts) else ""


def _print_worst(rays: Entry) -> None:
    """Print the worst rays as a file that `airlight integrate` reads."""
    worst = [line for line in (rays["single"]["all"]["worst"], rays["double"]["all"]["worst"]) if line is not None]
    if worst:
        print("\n".join(["worst rays, float32 then float64:", rays["columns"], *worst]))


def gamma_table(by_precision: Mapping[str, Entry]) -> Table:
    """Return what is lost to cancellation where J is a difference of two Gammas."""
    columns = (
        *words(precision="slivers", direct="J(x0, x1)", difference="J(0, x1) - J(0, x0)"),
        *numbers("median"),
        *numbers("negative", how=_ALARM),
        *words(rounding="in ε (J(0, x0) + J(0, x1))"),
    )
    rows = [
        {
            **study["difference"],
            "precision": precision,
            "direct": in_epsilons(study["direct"], precision),
            "difference": in_epsilons(study["difference"], precision),
            "rounding": f"Max = {number(study['max_rounding'])} (Median = {number(study['median_rounding'])})",
        }
        for precision, study in by_precision.items()
    ]
    return table("cancellation: thin lit slivers far from the light", columns, rows)
