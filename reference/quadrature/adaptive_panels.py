# SPDX-License-Identifier: BSD-3-Clause
"""Panels of the smooth pieces of rays, halved until the sum of each ray meets a tolerance (see `analytic.panels`)."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.unbounded import sums_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

RTOL = 1e-9  #: relative tolerance of the sum of a ray and a light
_HALVINGS = 40


@dataclass(frozen=True)
class Panels:
    """Panels and what the two rules gave for them.

    The integrals are albedo sigma_t J [1/m^2] of a point light, in the logarithmic variable w [1], and albedo sigma_t
    int exp(-tau) dx [1] of a directional light, in the distance x [m].
    """

    piece: Index  #: the piece that each panel is a part of, (m,)
    start: Array  #: in the variable of the integral, (m,)
    width: Array  #: in the same variable, (m,)
    value: Array  #: the integral by Kronrod's rule, (m, 3)
    error: Array  #: by how much Gauss's rule differs from it, (m, 3)
    noise: Array  #: rounding error of the value, (m, 3)

    def __getitem__(self, rows) -> "Panels":
        return Panels(*(getattr(self, f.name)[rows] for f in fields(self)))


def first_panels(start: Array, width: Array, widest: float) -> tuple[Index, Array, Array]:
    """Cut pieces into equal panels no wider than `widest`.

    Parameters
    ----------
    start, width
        Where the pieces begin and how wide they are, (pieces,), in the variable of the integral: w [1] or x [m], see
        `Panels`.
    widest
        In the same unit, above 0.

    Returns
    -------
    piece, start, width
        Of every panel: the number of its piece, where it begins, and how wide it is, (panels,) each.
    """
    count = np.maximum(np.ceil(width / widest), 1).astype(np.int64)
    piece = np.repeat(np.arange(len(count)), count)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    part = (width / count)[piece]
    return piece, start[piece] + number * part, part


def sum_panels(
    first: tuple[Index, Array, Array],
    evaluate: Callable[[Index, Array, Array], Panels],
    owner: Index,
    count: int,
    rtol: float = RTOL,
) -> tuple[Array, Array]:
    """Halve panels until all rays meet the tolerance, or only rounding is left, and add up those of each ray.

    Parameters
    ----------
    first
        From `first_panels`.
    evaluate
        (pieces, starts, widths) -> panels.
    owner
        The ray of each piece, from 0 on.
    count
        Number of rays.
    rtol
        Relative tolerance of the sum of each ray [1].

    Returns
    -------
    value, error
        The integral of each ray and a bound of its error, (count, 3) each, in the unit of the panels' values, [1/m^2]
        or [1].
    """
    panels = evaluate(*first)
    for _ in range(_HALVINGS):
        ray = owner[panels.piece]
        allowed = rtol * sums_of(ray, panels.value, count)
        missed = sums_of(ray, panels.error, count) > allowed
        share = allowed / np.maximum(np.bincount(ray, minlength=count), 1)[:, None]
        halve = np.any(missed[ray] & (panels.error > share[ray]) & (panels.error > panels.noise), axis=1)
        if not halve.any():
            break
        half = 0.5 * panels.width[halve]
        start = np.concatenate([panels.start[halve], panels.start[halve] + half])
        halves = evaluate(np.tile(panels.piece[halve], 2), start, np.tile(half, 2))
        kept = panels[~halve]
        panels = Panels(*(np.concatenate([getattr(p, f.name) for p in (kept, halves)]) for f in fields(Panels)))
    ray = owner[panels.piece]
    return sums_of(ray, panels.value, count), sums_of(ray, panels.error + panels.noise, count)
