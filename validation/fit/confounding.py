# SPDX-License-Identifier: BSD-3-Clause
"""Which parameters an image does not tell apart.

Where a combination of steps changes no pixel, the derivatives are linearly dependent: albedo
against intensity in the airlight, always; exposure against the intensity of the only light. The
columns of the derivatives are divided by their lengths. Their singular vectors with a singular
value below a millionth of the largest are such combinations. As many of the parameters in them stay
free as the image determines; later ones in the list are held, and free ones stand for products with
the ones that are held.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.fit.unknowns import Unknown

# singular value over the largest: rounding of float64 sums is 1e-12, real
# dependence on anything 1e-4
_ZERO = 1e-6
# component of a unit vector, or power of a parameter, below which a parameter takes no part
_INVOLVED = 1e-3


@dataclass(frozen=True)
class Group:
    """Parameters that one image does not tell apart."""

    members: tuple[int, ...]  #: numbers of the parameters
    held: tuple[int, ...]  #: which of them are held
    #: By free parameter, the powers of held parameters whose product with it the image determines.
    powers: Mapping[int, Mapping[int, float]]


def confounded_groups(derivatives: Array) -> tuple[Group, ...]:
    """Return the groups of parameters that are not told apart.

    `derivatives`: weighted derivatives of all values by all parameters, (n, parameters).
    """
    # Columns of the length 1, so that the units of parameters do not count. The column of a
    # parameter that does nothing is rounding, 1e-12 of the longest one or less: it becomes 0.
    length = np.linalg.norm(derivatives, axis=0)
    count = len(length)
    silent = length <= 1e-12 * max(float(length.max()), 1e-300)
    columns = derivatives / np.where(silent, 1.0, length)
    columns[:, silent] = 0.0
    # R of a QR decomposition has the singular values and right singular vectors of the columns, in
    # a row for each parameter instead of one for each value.
    _, values, rows = np.linalg.svd(np.linalg.qr(columns, mode="r"))
    null = rows[values <= _ZERO * max(float(values.max()), 1e-300)].T
    if not null.size:
        return ()
    # null null^T projects onto the combinations that change nothing. Its entries do not depend on
    # the choice of singular vectors, and link parameters of one combination.
    linked = np.abs(null @ null.T) > _INVOLVED
    groups, ungrouped = [], [number for number in range(count) if linked[number].any()]
    while ungrouped:
        # The parameters that are linked with the first one, directly or through others.
        members = {ungrouped[0]}
        while more := {int(j) for i in members for j in np.flatnonzero(linked[i])} - members:
            members |= more
        ungrouped = [number for number in ungrouped if number not in members]
        groups.append(_group(columns, length, null, sorted(members)))
    return tuple(groups)


def _group(columns: Array, length: Array, null: Array, members: Sequence[int]) -> Group:
    # A parameter stays free if its column is independent of the columns of those that are free
    # already: the order of the list decides.
    free: list[int] = []
    for number in members:
        trial = columns[:, [*free, number]]
        values = np.linalg.svd(trial, compute_uv=False)
        if values[-1] > _ZERO * max(float(values[0]), 1e-300):
            free.append(number)
    held = [number for number in members if number not in free]
    # A step of the null space N changes log p_k + sum_h a_kh log p_h by N_k + sum_h a_kh
    # N_h, which must be nothing. N is one of the scaled columns: steps of the parameters themselves
    # are divided by the lengths.
    steps = null / np.where(length > 0, length, 1.0)[:, None]
    powers = -steps[free] @ np.linalg.pinv(steps[held])
    by_free = {
        number: {
            h: float(power) for h, power in zip(held, row, strict=True) if abs(power) > _INVOLVED
        }
        for number, row in zip(free, powers, strict=True)
    }
    return Group(tuple(members), tuple(held), by_free)


@dataclass(frozen=True)
class Confounded:
    """Parameters that the image does not tell apart."""

    parameters: tuple[str, ...]
    held: tuple[str, ...]  #: which of them were held at the value to begin with
    #: The products of powers of them that the image determines, such as 'albedo * intensity', each
    #: with the ends of its interval; the high end is None where the image sets none.
    products: Mapping[str, tuple[float, float, float | None]]
    way_out: str

    @property
    def lines(self) -> list[str]:
        """The lines that `airlight compare --fit` prints of them."""
        names = ", ".join(self.parameters)
        alone = len(self.parameters) == 1
        lines = [
            f"This image says nothing of {names}."
            if alone
            else f"This image does not tell apart: {names}."
        ]
        for name, (value, low, high) in self.products.items():
            ends = f"{low:.6g} or more" if high is None else f"{low:.6g} to {high:.6g}"
            lines.append(f"Known is {name} = {value:.6g} ({ends}).")
        return [*lines, f"Way out: {self.way_out}."]


def confounded(
    group: Group, unknowns: Sequence[Unknown], inner: Array, lengths: Array, holds: str
) -> Confounded:
    """Return the products that an image tells of a group, from the numbers on the whole
    line and their intervals.
    """
    names = {number: unknowns[number].name for number in group.members}
    products: dict[str, tuple[float, float, float | None]] = {}
    for free, powers in group.powers.items():
        # Only parameters that are looked for by their logarithms have products: the image
        # determines the sum of the logarithms, and the interval of the free parameter is its own.
        if all(unknowns[number].number.scale == "log" for number in (free, *powers)):
            words = [
                names[free],
                *(_power(names[number], power) for number, power in powers.items()),
            ]
            middle = inner[free] + sum(power * inner[number] for number, power in powers.items())
            low, high = (float(np.exp(middle + float(length))) for length in lengths[free])
            products[" * ".join(words)] = (
                math.exp(middle),
                low,
                high if math.isfinite(high) else None,
            )
    held = tuple(names[number] for number in group.held)
    return Confounded(tuple(names.values()), held, products, _way_out(group, unknowns, holds))


def _power(name: str, power: float) -> str:
    return name if abs(power - 1) < 1e-3 else f"{name}^{power:.3g}"


def _way_out(group: Group, unknowns: Sequence[Unknown], holds: str) -> str:
    kinds = {unknowns[number].kind for number in group.members}
    if len(group.held) == len(group.members):
        return "these do nothing in the pixels of this image: fit a layer in which they show"
    if "albedo" in kinds and holds == "airlight":
        return (
            "the airlight holds only their product: leave all but one out of the fit, or fit a "
            "layer with lit "
            "surfaces, which the albedo does not change, such as --layer total"
        )
    return "leave all but one out of the fit; what is left out keeps the value of the scene"
