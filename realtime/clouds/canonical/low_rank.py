# SPDX-License-Identifier: BSD-3-Clause
"""Fields over places and directions as sums of products.

A field q of the place p = (t, d, mu_L) and of the direction v = (mu, phi) is close to a sum of few products,

    q(p, v) = sum_k a_k(p) g_k(v),

coefficients of the place times shapes of the direction: places have little to tell each other apart by, and each tells
it in all directions at once. Tables of three and of two coordinates take the place of one of five, so that both can be
fine. The best g_k are the first eigenvectors of the mean of q(v) q(v') over places (Eckart and Young 1936): that of the
weighted square error, for weights of places and of directions. They are orthonormal, which makes a_k = <q, g_k>.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def direction_shapes(fields: Array, places: Array, directions: Array, rank: int) -> Array:
    """Return the shapes that fields at some places have most of.

    `fields`: (P, V), at P places in V directions; `places`, `directions`: (P,) and (V,), weights, not negative; those
    of directions positive; `rank`: K, how many shapes. Returns `ndarray`: (K, V), with sum_v directions_v g_k g_l =
    delta_kl.
    """
    roots = np.sqrt(directions)
    weighted = fields * roots * np.sqrt(places / places.max())[:, None]
    _, vectors = np.linalg.eigh(weighted.T @ weighted)
    return np.ascontiguousarray((vectors[:, ::-1][:, :rank] / roots[:, None]).T)


def coefficients(fields: Array, directions: Array, shapes: Array) -> Array:
    """Return a_k of fields, (P, K); parameters as above."""
    return (fields * directions) @ shapes.T
