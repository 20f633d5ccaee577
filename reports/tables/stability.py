# SPDX-License-Identifier: BSD-3-Clause
"""The tables of `airlight stability`, in the manner of Boost's accuracy reports: Max = 3.2ε (Mean = 0.4ε)."""

from typing import TYPE_CHECKING

from reports.tables.terminal import number, print_table
from validation.kernels.errors import EPSILON, Errors

if TYPE_CHECKING:
    from validation.frames.plane_stability import PlaneStability
    from validation.kernels.stability import KernelStability, SetStability

_HEADERS = ("rays", "count", "refused", "float32", "median", "99 %", "NaN/Inf/<0", "float64", "NaN/Inf/<0", "32 vs 64")


def print_stability(found: "list[KernelStability]", *, certified: bool) -> None:
    """Print what `validation.kernels.stability.stability` found.

    Parameters
    ----------
    found
        One entry for each kernel.
    certified
        Whether the files of certified values were there.
    """
    print("Relative errors; ε is 1.2e-7 in float32 and 2.2e-16 in float64, median and 99 % are of float32.")
    if not certified:
        print(
            "The certified values are not installed (they are in tests/data of a clone): only generated rays are used."
        )
    for kernel in found:
        claim = ", claims to be exact" if kernel.exact else ""
        print(f"\n=== {kernel.kernel}{claim} ===")
        for phase, words in kernel.refused.items():
            print(f"refuses {phase}: {words}")
        for one in kernel.sets:
            print_table(_HEADERS, [_row(one, group) for group in one.single], one.name)
            _print_worst(one)
        _print_gamma(kernel)
        _print_laws(kernel)
        for words in kernel.broken:
            print(f"BROKEN: {kernel.kernel}, {words}")


def print_plane_stability(found: "list[PlaneStability]", broken: list[str]) -> None:
    """Print what `validation.frames.plane_stability.plane_stability` found, and what of it breaks the bar of the
    default.
    """
    headers = ("shadow planes", "sum", "precision", "median", "99 %", "max", "beyond 1e-4", "negative", "NaN/Inf")
    rows = [
        (
            one.case,
            one.sum,
            one.precision,
            number(one.median),
            number(one.p99),
            number(one.max),
            *(str(count) if count else "" for count in (one.beyond, one.negative, one.nonfinite)),
        )
        for one in found
    ]
    print()
    print_table(headers, rows, "cancellation between shadow planes: errors relative to each pixel's true value")
    print(
        "segments: J of each lit segment (the default); gamma: differences of Gamma a segment; planes: Gamma plane by"
    )
    print("plane as published, float32 against float64 (its negative pixels are the artefact of Fig. 4)")
    for words in broken:
        print(f"BROKEN: shadow planes, {words}")


def boost(errors: Errors, precision: str) -> str:
    """Return 'Max = 3.2ε (Mean = 0.4ε)', a dash where nothing was compared."""
    if errors.max is None or errors.mean is None:
        return "-"
    epsilon = EPSILON[precision]
    return f"Max = {number(errors.max / epsilon)}ε (Mean = {number(errors.mean / epsilon)}ε)"


def _row(one: "SetStability", group: str) -> tuple[str, ...]:
    single, double = one.single[group], one.double[group]
    return (
        group,
        str(single.rays),
        str(single.refused) if single.refused else "",
        boost(single, "single"),
        number(single.median),
        number(single.p99),
        _counts(single),
        boost(double, "double"),
        _counts(double),
        number(one.single_against_double[group].max),
    )


def _counts(errors: Errors) -> str:
    counts = (errors.nan, errors.infinite, errors.negative)
    return "/".join(map(str, counts)) if any(counts) else ""


def _print_worst(one: "SetStability") -> None:
    """Print the worst rays as a file that `airlight integrate` reads."""
    single, double = one.single["all"].worst, one.double["all"].worst
    if single is None and double is None:
        return
    print(f"worst rays, float32 then float64:\n{one.columns}")
    for line in (single, double):
        if line is not None:
            print(line)


def _print_gamma(kernel: "KernelStability") -> None:
    headers = ("slivers", "J(x0, x1)", "J(0, x1) - J(0, x0)", "median", "negative", "in ε (J(0, x0) + J(0, x1))")
    rows = [
        (
            precision,
            boost(one.direct, precision),
            boost(one.difference, precision),
            number(one.difference.median),
            str(one.difference.negative),
            f"Max = {number(one.max_rounding)} (Median = {number(one.median_rounding)})",
        )
        for precision, one in kernel.gamma.items()
    ]
    print_table(headers, rows, "cancellation: thin lit slivers far from the light")


def _print_laws(kernel: "KernelStability") -> None:
    rows = [(law.name, str(law.rows), number(law.single), number(law.double)) for law in kernel.laws]
    print_table(("law", "rays", "float32", "float64"), rows, "exact laws: largest relative deviation")
