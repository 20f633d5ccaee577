# SPDX-License-Identifier: BSD-3-Clause
r"""Relative errors of kernels on rays with a known J: quantiles, values that are not finite or
negative, the worst ray.

A value may lose accuracy near the smallest numbers of a precision and still be right. Many
processors, and all GPUs, put 0 for a product below the smallest normal number t (2^-126 in float32,
2^-1022 in float64): they flush. Others round it with the few digits that are left. In either case a
product is wrong by at most t, besides its relative rounding. Units and factors decide where this
happens, so that a value far above t can depend on it: a light 2e5 m away, 60 optical depths, J =
1.2e-33 1/m over 3e4 m is a sum of terms of 1e-38 1/m^2 each.

A rule with n nodes adds up terms w_k f_k, the fractions w_k adding up to 1, over a length L:

    J = int f dx ~ L sum_k w_k f_k,        f = exp(-sigma_t (x + r)) p / r^2   [1/m^2].

* The exponential is wrong by at most t, so f by t p/r^2. Summed up that is t V, V the
  integral without extinction.
* A product w_k f_k is smaller than its factors and is flushed first: it is wrong by at most t, and
  J by n t L.
* J itself is wrong by at most t.

A value is therefore right, on every processor, where

    |J - J_true| <= bar J_true + a,        a = t (n L + V + 1),

with n = 8 nodes, as many as the longest rule in x and one panel have, and upper bounds in the place
of L and V:

* L ends 87/sigma_t behind the foot or the beginning, whichever is later: from there on f falls by
  e^-87 = t, and the rest of the integral is below t V. It ends at 2^63 m in any case: there p/r^2
  itself is t.
* V = int p/r^2 dx is at most the largest p times L/r^2, r the least distance to the light,
  and times pi/h, all angles.

The allowance a is in the units of J, and it is small: relative to V it is 1e-38 for the
exponential, and n r^2 1e-38 [1/m^2] for the terms, so that up to 30 optical depths and r = 1e6 m it
is less than a millionth of J.
"""

from collections.abc import Collection, Mapping
from functools import cache

import numpy as np

from airlight.analytic.phase import phase_from_words
from airlight.validation.arrays import Array, Bools
from airlight.validation.kernels.case_files import Cases
from airlight.validation.kernels.cases import TABLE, relative_error
from airlight.validation.kernels.rays import case_row
from airlight.validation.kernels.records import KernelErrors


def groups(cases: Cases) -> dict[str, Bools]:
    """Return which rows belong to 'all', to each tag and to each phase
    function (as 'phase NAME').
    """
    groups = {"all": np.ones(len(cases.phase), dtype=bool)}
    if cases.tag is not None:
        tags = np.asarray(cases.tag)
        groups |= {tag: tags == tag for tag in sorted(set(cases.tag))}
    phases = np.asarray(cases.phase)
    return groups | {f"phase {name}": phases == name for name in sorted(set(cases.phase))}


def underflow_allowance(cases: Cases, precision: str) -> Array:
    """Return how far each value may be off because a term of it is below the smallest
    normal number, (n,) [1/m].
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        # The upper bound of L: the segment ends 87 optical depths behind the foot or the beginning,
        # and at 2^63 m at the latest.
        beginning = np.maximum(cases.foot, cases.x0)
        end = np.minimum(cases.x1, beginning + 87.0 / cases.sigma_t)
        length = np.minimum(end - cases.x0, 2.0**63)
        # r: the least distance between the light and the segment; the clip moves the foot to the
        # nearer end where it lies outside.
        nearest = np.hypot(cases.height, np.clip(0.0, cases.x0 - cases.foot, cases.x1 - cases.foot))
        peaks = np.array([_peak(*kind) for kind in zip(cases.phase, cases.g.tolist())])
        # The upper bound of V, the lesser of both.
        vacuum = peaks * np.minimum(length / nearest**2, np.pi / cases.height)
    vacuum = np.nan_to_num(vacuum, nan=0.0)  # an empty segment at the light
    # a = t (n L + V + 1), with t the smallest normal number and n = 8 nodes
    smallest = {"single": 2.0**-126, "double": 2.0**-1022}[precision]
    return np.asarray(smallest * (8 * length + vacuum + 1.0))


@cache
def _peak(name: str, g: float) -> float:
    """Return the largest value of a phase function, which all have forward or backward."""
    phase = phase_from_words(name, g=g, table=TABLE)
    return float(np.max(phase(np.array([-1.0, 1.0]))))


def errors_by_group(
    cases: Cases,
    values: Array,
    precision: str,
    rows: Mapping[str, Bools],
    refused: Collection[str] = (),
) -> dict[str, KernelErrors]:
    """Return the relative errors [1] of each group of rows, against the value of the cases.

    `values`: J by a kernel, (cases,) [1/m]; `refused`: the phase functions that it refuses.
    """
    assert cases.value is not None
    # One computation for all groups; each group then takes its rows.
    error = relative_error(values, cases.value, precision, underflow_allowance(cases, precision))
    accepted, has_value = ~np.isin(cases.phase, list(refused)), np.isfinite(cases.value)
    return {
        name: _errors(cases, values, error, has_value, group & accepted, group)
        for name, group in rows.items()
    }


def _errors(
    cases: Cases, values: Array, error: Array, has_value: Bools, tried: Bools, group: Bools
) -> KernelErrors:
    # Rows of refused phase functions count as refused, not as wrong; rows whose reference is not
    # finite have no error.
    J, finite = values[tried], np.isfinite(error) & tried
    bad = tried & has_value & ~np.isfinite(values)
    median = p99 = largest = mean = worst = None
    if finite.any():
        median, p99, largest = (float(q) for q in np.percentile(error[finite], [50, 99, 100]))
        mean = float(error[finite].mean())
        worst = int(np.argmax(np.where(finite, error, -1.0)))
    # A value that is not finite is worse than any error.
    if bad.any():
        worst = int(np.argmax(bad))
    return KernelErrors(
        rays=int(tried.sum()),
        refused=int((group & ~tried).sum()),
        median=median,
        p99=p99,
        max=largest,
        mean=mean,
        nan=int(np.isnan(J).sum()),
        infinite=int((np.isinf(values) & has_value & tried).sum()),
        negative=int((J < 0).sum()),
        worst=None if worst is None else case_row(cases, worst),
    )
