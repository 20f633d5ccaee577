# SPDX-License-Identifier: BSD-3-Clause
"""Scattering angles at random, by the phase function, and the turn of a direction by them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HenyeyGreenstein:
    """Henyey and Greenstein's phase function; isotropic for g = 0.

    `g`: mean cosine, in (-1, 1).
    """

    g: float

    def cosines(self, uniform: Array) -> Array:
        """Return cosines of the scattering angle from numbers in [0, 1): the
        inverse of the distribution.
        """
        if abs(self.g) < 1e-6:
            return 1 - 2 * uniform
        g = self.g
        # 1 - c, which keeps its digits near forward: with s = (1 - g)/(1 - g + 2 g u), c =
        # (1 + g^2 - (1-g^2)^2/..)/2g
        root = (1 - g * g) / (1 - g + 2 * g * uniform)
        return np.clip((1 + g * g - root * root) / (2 * g), -1.0, 1.0)


class Tabulated:
    """A phase function linear in the angle between values.

    The distribution of the angle is summed exactly over cells that are finer than the table; within
    a cell, the cosine is uniform.

    `angles`: (A,), increasing from 0 to pi [rad]; `heights`: (A,), not negative, in any unit.
    """

    def __init__(self, angles: Array, heights: Array):
        parts = max(1, (1 << 17) // (angles.size - 1))  # about 2^17 cells of the whole table
        fraction = np.arange(parts) / parts
        fine = np.append(
            (angles[:-1, None] + np.diff(angles)[:, None] * fraction).reshape(-1), angles[-1]
        )
        height = np.interp(fine, angles, heights)
        self._cosines = np.cos(fine)
        # Cosines as 1 - 2 sin^2 keep the width of the cells near forward.
        width = 2 * (np.sin(fine[1:] / 2) ** 2 - np.sin(fine[:-1] / 2) ** 2)
        self._sums = np.concatenate([[0.0], np.cumsum((height[1:] + height[:-1]) / 2 * width)])
        self._sums /= self._sums[-1]

    def cosines(self, uniform: Array) -> Array:
        """Return cosines of the scattering angle from numbers in [0, 1)."""
        return np.interp(uniform, self._sums, self._cosines)


def turned(
    directions: tuple[Array, Array, Array], cosines: Array, azimuths: Array
) -> tuple[Array, Array, Array]:
    """Return directions that make an angle with the given ones, at an azimuth around them.

    The frame around a direction has no special case at the poles (Duff, Burgess, Christensen, Hery,
    Kensler, Liani and Villemin 2017, "Building an orthonormal basis, revisited").
    """
    x, y, z = directions
    sines = np.sqrt(np.maximum((1 - cosines) * (1 + cosines), 0.0))
    along, across = sines * np.cos(azimuths), sines * np.sin(azimuths)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    new_x = along * (1 + sign * x * x * a) + across * b + cosines * x
    new_y = along * (sign * b) + across * (sign + y * y * a) + cosines * y
    new_z = along * (-sign * x) - across * y + cosines * z
    # Rounding adds up over thousands of turns.
    length = np.sqrt(new_x * new_x + new_y * new_y + new_z * new_z)
    return new_x / length, new_y / length, new_z / length
