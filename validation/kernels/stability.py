# SPDX-License-Identifier: BSD-3-Clause
"""Where kernels break: every kernel on certified values and on rays of every magnitude.

The certified values are the files of `validation.certified`.
"""

from collections.abc import Collection, Sequence

import numpy as np

from airlight.realtime.kernels.registry import KERNELS, Kernel
from airlight.validation.arrays import Array, Bools, Counted
from airlight.validation.certified.files import certified_data
from airlight.validation.kernels.case_files import Cases, read_cases
from airlight.validation.kernels.cases import evaluate_accepted
from airlight.validation.kernels.errors import errors_by_group, groups
from airlight.validation.kernels.rays import hard_rays
from airlight.validation.kernels.records import Rays, Stability
from airlight.validation.study.configuration import find_kernel

CERTIFIED = ("airlight_integral.csv", "airlight_integral_rays.csv")
GENERATED = "generated"
PRECISIONS = ("single", "double")
#: Limits that an exact kernel keeps: the maxima on every set of rays, the
#: quantiles on the certified ones.
#:
#: Tables, whose kinks no rule of fixed cost resolves, are left out, but not values that are NaN,
#: infinite or negative. The quantiles describe the certified cases; how many generated rays are
#: hard is a matter of taste. Products that a processor flushes to zero are no error:
#: `validation.kernels.errors` derives how much they can be.
BAR = {
    "single_max": 3e-5,  # in float32, for |g| <= 0.9
    "single_max_sharp": 1e-4,  # in float32, for |g| up to 0.95
    "single_p99": 3e-6,  # 99 % quantile in float32
    "single_median": 3e-7,  # median in float32
    "double_max": 1e-10,  # in float64
}


def stability(
    names: Sequence[str] | None = None, *, count: int = 100_000, progress: Counted | None = None
) -> list[Stability]:
    """Study kernels, all of the registry by default, on the certified rays and
    on so many generated ones.
    """
    chosen = [find_kernel(name) for name in names or KERNELS]  # refuse a wrong name before any work
    sets = {name: read_cases(certified_data(name)) for name in CERTIFIED} | {
        GENERATED: hard_rays(count)
    }
    results = []
    for number, kernel in enumerate(chosen):
        if progress is not None:
            progress(number, len(chosen), kernel.name)
        results.append(kernel_stability(kernel, sets))
    return results


def kernel_stability(kernel: Kernel, sets: dict[str, Cases]) -> Stability:
    """Study one kernel on sets of rays with known J, the generated ones among them."""
    broken: list[str] = []
    studied = []
    refused: dict[str, str] = {}
    for label, cases in sets.items():
        values: dict[str, Array] = {}
        for each in PRECISIONS:
            # Both precisions of every set: single precision is what frames use, double says whether
            # the formula itself is right.
            values[each], reasons = evaluate_accepted(cases, kernel, each)
            refused |= {phase: str(reason) for phase, reason in reasons.items()}
        rows = groups(cases)
        errors = {
            each: errors_by_group(cases, values[each], each, rows, refused) for each in PRECISIONS
        }
        studied.append(Rays(name=label, columns=",".join(cases.header), **errors))
        # Only kernels that claim to be exact have limits to break.
        if kernel.exact:
            broken += _broken(label, cases, values, refused)
    return Stability(
        kernel=kernel.name,
        exact=kernel.exact,
        refused=refused,
        sets=tuple(studied),
        broken=tuple(broken),
    )


def _broken(
    name: str, cases: Cases, values: dict[str, Array], refused: Collection[str] = ()
) -> list[str]:
    """Return the limits that a kernel that claims to be exact exceeds, in words."""
    # Tabulated phase functions have kinks, which no rule of fixed cost resolves.
    sharp, smooth = np.abs(cases.g) > 0.9, np.asarray(cases.phase) != "tabulated"
    rows: dict[str, Bools] = {
        "all": np.ones(len(sharp), dtype=bool),
        "smooth": smooth,
        "g up to 0.9": smooth & ~sharp,
        "g above 0.9": sharp,
    }
    single, double = (
        errors_by_group(cases, values[precision], precision, rows, refused)
        for precision in PRECISIONS
    )
    limits = [
        ("float32 maximum, |g| up to 0.9", single["g up to 0.9"], "max", BAR["single_max"]),
        ("float32 maximum, |g| above 0.9", single["g above 0.9"], "max", BAR["single_max_sharp"]),
        ("float64 maximum", double["smooth"], "max", BAR["double_max"]),
    ]
    # Quantiles depend on how many rays of a set are hard: only the certified sets, which stay as
    # they are, have limits for them.
    if name != GENERATED:
        limits += [
            ("float32 99 %", single["smooth"], "p99", BAR["single_p99"]),
            ("float32 median", single["smooth"], "median", BAR["single_median"]),
        ]
    faults = []
    for what, errors, quantile, limit in limits:
        value = getattr(errors, quantile)
        if value is not None and value > limit:
            at = f" at {errors.worst}" if quantile == "max" else ""
            faults.append(f"{name}: {what} {value:.3g} > {limit:g}{at}")
    # Values that are NaN, infinite or negative break the limits for every phase function.
    for precision, errors in (("float32", single["all"]), ("float64", double["all"])):
        counts = {"NaN": errors.nan, "infinite": errors.infinite, "negative": errors.negative}
        faults += [
            f"{name}: {precision}: {number} {what}" for what, number in counts.items() if number
        ]
    return faults
