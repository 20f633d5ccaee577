# SPDX-License-Identifier: BSD-3-Clause
"""Gauss-Legendre nodes as Python numbers: constants in the kernels that Dr.Jit records."""

from functools import lru_cache

import numpy as np


@lru_cache
def unit_nodes(count: int) -> tuple[tuple[float, float], ...]:
    """Return the nodes and weights of the Gauss-Legendre rule on [0, 1]; the weights add up to 1."""
    xi, weight = np.polynomial.legendre.leggauss(count)
    return tuple((float(0.5 + 0.5 * x), float(0.5 * w)) for x, w in zip(xi, weight))
