# SPDX-License-Identifier: BSD-3-Clause
"""How the light of lamps falls with the distance r from them [m].

A falloff is a factor on the light of a point light, I/r^2: r^2 f(r) of a distance law f, and the
window w of a range. Those of a `Model` are records: equal ones share what was computed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from airlight.reference.scene.model import Law, Range
from airlight.validation.arrays import Array

#: factor on the light of a point light by the distance from it [m]
Falloff = Callable[[Array], Array]


def softened(r: Array, size: float) -> Array:
    """Return the factor of light that falls as 1/(r^2 + size)."""
    return r**2 / (r**2 + size)


def of_a_disk(r: Array, radius: float) -> Array:
    """Return the light of a disk at a point that it faces, as a fraction of
    the light of a point light.
    """
    return 2 * r**2 / (r**2 + radius**2 + r * np.sqrt(r**2 + radius**2))


def clamped(r: Array, radius: float, power: float = 2.0) -> Array:
    """Return the factor of light that falls as a power of the distance, and is even within a
    radius.
    """
    return r**2 * np.maximum(r, radius) ** -power


#: Windows by the distance over the range, up to 1; beyond they are 0.
WINDOWS: Mapping[str, Callable[[Array], Array]] = {
    "quartic": lambda s: (1 - s**4) ** 2,
    "fourth": lambda s: 1 - s**4,
    "square": lambda s: (1 - s**2) ** 2,
    "linear": lambda s: 1 - s,
    "cut": lambda s: (s < 1).astype(float),
}


@dataclass(frozen=True)
class LawFactor:
    """r^2 f(r) of a distance law."""

    law: Law

    def __call__(self, r: Array) -> Array:
        """Return the factor at distances."""
        law = self.law
        if law.kind == "softened":
            return law.scale * softened(r, law.length**2)
        if law.kind == "sphere":
            return of_a_disk(r, law.length)
        return clamped(r, law.length, law.power)


@dataclass(frozen=True)
class Window:
    """The window of a range."""

    range: Range

    def __call__(self, r: Array) -> Array:
        """Return the factor at distances."""
        return WINDOWS[self.range.kind](np.minimum(r / self.range.end, 1.0))
