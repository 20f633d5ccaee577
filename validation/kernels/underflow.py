# SPDX-License-Identifier: BSD-3-Clause
r"""What a value may lose near the smallest numbers of a precision, and still be right.

Many processors, and all GPUs, put 0 for a product below the smallest normal number t (2^-126 in float32, 2^-1022 in
float64): they flush. Others round it with the few digits that are left. In either case a product is wrong by at most t,
beside its relative rounding. Where that happens is a matter of units and factors, so that a value far above t can hang
on it: a light 2e5 m away, 60 optical depths, J = 1.2e-33 1/m over 3e4 m is a sum of terms of 1e-38 1/m^2 each.

A rule with n nodes adds up terms w_k f_k, the shares w_k adding up to 1, over a length L:

    J = int f dx ~ L sum_k w_k f_k,        f = exp(-sigma_t (x + r)) p / r^2   [1/m^2].

* The exponential is wrong by at most t, so f by t p/r^2. Summed up that is t V, V the integral without extinction.
* A product w_k f_k is smaller than its factors, so it is the one that is flushed: by at most t, and J by n t L.
* J itself is wrong by at most t.

So a value is right, on every processor, where

    |J - J_true| <= bar J_true + a,        a = t (n L + V + 1),

with n = 8 nodes, those of the longest rule in x and of one panel, and upper bounds in the place of L and V:

* L ends 87/sigma_t behind the foot or the beginning, whichever is later: from there on f falls by e^-87 = t, and what
  is left is below t V. It ends at 2^63 m in any case: there p/r^2 itself is t.
* V = int p/r^2 dx is at most the largest p times L/r^2, r the least distance to the light, and times pi/h, all angles.

The allowance a is in the units of J, and it is small: relative to V it is 1e-38 for the exponential, and n r^2 1e-38
[1/m^2] for the terms, so that up to 30 optical depths and r = 1e6 m it is less than a millionth of J.
"""

import numpy as np
from numpy.typing import NDArray

from analytic.cases import Cases
from analytic.phase import PhaseFunction, phase_from_words
from validation.kernels.values import TABLE

Array = NDArray[np.float64]

_NODES = 8
_LARGEST_DEPTH = 87.0
_FARTHEST = 2.0**63  # [m]
_SMALLEST = {"single": 2.0**-126, "double": 2.0**-1022}


def underflow_allowance(cases: Cases, precision: str) -> Array:
    """Return how far each value may be off because a term of it is below the smallest normal number, (n,) [1/m].

    Parameters
    ----------
    cases
        The rays, with foot and height.
    precision
        'single' or 'double'.
    """
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        beginning = np.maximum(cases.foot, cases.x0)
        end = np.minimum(cases.x1, beginning + _LARGEST_DEPTH / cases.sigma_t)
        length = np.minimum(end - cases.x0, _FARTHEST)
        nearest = np.hypot(cases.height, np.clip(0.0, cases.x0 - cases.foot, cases.x1 - cases.foot))
        vacuum = _peaks(cases) * np.minimum(length / nearest**2, np.pi / cases.height)
    vacuum = np.nan_to_num(vacuum, nan=0.0)  # an empty segment at the light
    return _SMALLEST[precision] * (_NODES * length + vacuum + 1.0)


def _peaks(cases: Cases) -> Array:
    """Return the largest value of the phase function of each case, which all have forward or backward, (n,)."""
    kinds = list(zip(cases.phase, cases.g.tolist()))
    peaks = {kind: _peak(*kind) for kind in set(kinds)}
    return np.array([peaks[kind] for kind in kinds])


def _peak(name: str, g: float) -> float:
    phase = PhaseFunction(name, table=TABLE) if name == "tabulated" else phase_from_words(name, g=g)
    return float(np.max(phase(np.array([-1.0, 1.0]))))
