# SPDX-License-Identifier: BSD-3-Clause
"""Gauss-Legendre nodes on pieces of rays, in w = asinh((x - foot)/height).

On a piece of a ray in one medium

    dx / r^2 = dw / (height cosh w),      r = height cosh w,

and everything in the integrand of the airlight has its singularities at |Im w| >= pi/2, whatever the phase function
(`realtime.kernels.exact` and `reference.quadrature.bounded` say why). With half a panel of the width 1.2 the ellipse
of regularity has rho = 1.31 + sqrt(1 + 1.31^2) = 2.96, so eight nodes err by about rho^-16 = 3e-8, and four nodes on a
panel of the width 0.6 (rho = 10.6) by 6e-9. The extinction adds exp(-sigma_t height e^w), entire in w; a panel over
which it falls by many orders is the only hard one, and what is left beyond it is small.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PANEL, _NODES = 2.4, 8
_SHORT, _FEW = 0.6, 4


def panel_nodes(
    start: Array, width: Array, *, most: float = _PANEL, short: float = _SHORT, orders: tuple[int, int] = (_NODES, _FEW)
) -> tuple[Index, Array, Array]:
    """Return nodes on intervals.

    Parameters
    ----------
    start, width
        Of the intervals, (n,), in any variable.
    short
        Widest interval that few nodes serve.
    orders
        How many nodes a panel has, and how many are few.

    Returns
    -------
    owner, place, weight
        Number of the interval, variable and weight of each node, (nodes,) each; sorted by interval.
    """
    few = width <= short
    owners, places, weights = [], [], []
    for chosen, order in ((np.flatnonzero(few), orders[1]), (np.flatnonzero(~few), orders[0])):
        panels = np.maximum(np.ceil(width[chosen] / most).astype(np.int64), 1)
        owner = np.repeat(chosen, panels)
        number = np.arange(len(owner)) - np.repeat(np.cumsum(panels) - panels, panels)
        size = width[owner] / np.repeat(panels, panels)
        node, weight = np.polynomial.legendre.leggauss(order)
        owners.append(np.repeat(owner, order))
        places.append((start[owner] + size * number)[:, None] + 0.5 * size[:, None] * (1 + node))
        weights.append(0.5 * size[:, None] * weight)
    owner = np.concatenate(owners)
    by_owner = np.argsort(owner, kind="stable")
    place, weight = (np.concatenate([part.ravel() for part in parts]) for parts in (places, weights))
    return owner[by_owner], place[by_owner], weight[by_owner]
