# SPDX-License-Identifier: BSD-3-Clause
"""Which parameters an image does not tell apart.

Where a combination of steps changes no pixel, the derivatives are linearly dependent: albedo against intensity in the
airlight, always; exposure against the intensity of the only light. Singular vectors of the derivatives, each column
divided by its length, say which: those with a singular value below a millionth of the largest. Of the parameters in
them all but as many as can be known are held, the later ones of the list, and the others mean products with them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ZERO = 1e-6  # singular value over the largest: rounding of float64 sums is 1e-12, real dependence on anything 1e-4
_SILENT = 1e-12  # length of a column over the longest: a parameter that does nothing
_INVOLVED = 1e-3


@dataclass(frozen=True)
class Group:
    """Parameters that one image does not tell apart."""

    members: tuple[int, ...]  #: numbers of the parameters
    held: tuple[int, ...]  #: which of them are held
    #: By parameter that is not held, the powers of those held whose product with it is known.
    powers: Mapping[int, Mapping[int, float]]


def confounded_groups(derivatives: Array) -> tuple[Group, ...]:
    """Return the groups of parameters that are not told apart.

    Parameters
    ----------
    derivatives
        Weighted derivatives of all values by all parameters, (n, parameters).
    """
    length = np.linalg.norm(derivatives, axis=0)
    count = len(length)
    silent = length <= _SILENT * max(float(length.max()), 1e-300)
    columns = derivatives / np.where(silent, 1.0, length)
    columns[:, silent] = 0.0
    _, values, rows = np.linalg.svd(np.linalg.qr(columns, mode="r"))
    null = rows[values <= _ZERO * max(float(values.max()), 1e-300)].T
    if not null.size:
        return ()
    linked = np.abs(null @ null.T) > _INVOLVED
    groups, left = [], [number for number in range(count) if linked[number].any()]
    while left:
        members = {left[0]}
        while more := {int(j) for i in members for j in np.flatnonzero(linked[i])} - members:
            members |= more
        left = [number for number in left if number not in members]
        groups.append(_group(columns, length, null, sorted(members)))
    return tuple(groups)


def _group(columns: Array, length: Array, null: Array, members: Sequence[int]) -> Group:
    kept: list[int] = []
    for number in members:
        trial = columns[:, [*kept, number]]
        values = np.linalg.svd(trial, compute_uv=False)
        if values[-1] > _ZERO * max(float(values[0]), 1e-300):
            kept.append(number)
    held = [number for number in members if number not in kept]
    # A step of the null space N changes log p_k + sum_h a_kh log p_h by N_k + sum_h a_kh N_h, which must be nothing.
    steps = null / np.where(length > 0, length, 1.0)[:, None]
    powers = -steps[kept] @ np.linalg.pinv(steps[held])
    known = {
        number: {h: float(power) for h, power in zip(held, row, strict=True) if abs(power) > _INVOLVED}
        for number, row in zip(kept, powers, strict=True)
    }
    return Group(tuple(members), tuple(held), known)
