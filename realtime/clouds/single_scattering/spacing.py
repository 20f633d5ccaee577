# SPDX-License-Identifier: BSD-3-Clause
r"""Nodes along a ray, exponentially spaced in optical depth.

N steps of a ray of the depth T in clouds end at

    tau_k = -s log(1 - (k/N) (1 - exp(-T/s))),        k = 1 .. N,        tau_N = T:

equal shares of the integral of exp(-tau/s). With s = 1 each step takes as much of the ray's own extinction; light that
is extinguished less on its way in than on the way out needs nodes further in, so that s is larger.
"""

import drjit as dr

SPREAD = 2.0  #: s
_LEAST = 1e-30  # of the logarithm's argument: the last node is the end of the ray


def node_share(total, steps: int):
    """Return (1 - exp(-T/s))/N of rays of the depth `total` in so many `steps`."""
    return (1 - dr.exp(-total / SPREAD)) / steps


def node_depth(number, steps: int, share):
    """Return tau_k of a `number` k [1], of `steps` N with their `share`; infinite from the last one on."""
    depth = -SPREAD * dr.log(dr.maximum(1 - type(share)(number) * share, _LEAST))
    return dr.select(number >= steps, dr.inf, depth)
