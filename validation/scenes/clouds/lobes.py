# SPDX-License-Identifier: BSD-3-Clause
"""Lobes with bumps as functions of points, for `surfaces.star_shaped`."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def lobes(centres: Array, radii: Array, blend: float) -> Callable[[Array], Array]:
    """Return about the signed distance [m] from a union of spheres whose seams are filled.

    With d_i the distance from sphere i the value is -blend log(sum exp(-d_i/blend)).

    Parameters
    ----------
    centres, radii
        Of the spheres, (k, 3) and (k,) [m].
    blend
        Width of the seams [m].
    """

    def distance(points: Array) -> Array:
        total = np.zeros(len(points))
        for centre, radius in zip(centres, radii, strict=True):
            total += np.exp(np.minimum((radius - np.linalg.norm(points - centre, axis=1)) / blend, 600.0))
        return -blend * np.log(np.maximum(total, 1e-300))

    return distance


def bumps(points: Array, size: float) -> Array:
    """Return billows over points, (n, 3) [m]: round bumps of about a `size` [m] with sharp valleys, 0 to 1."""
    turned = points @ _TURN.T / size
    waves = np.sin(turned + 1.7 * np.sin(0.61 * turned[:, [1, 2, 0]] + (0.37, 1.91, 4.13)))
    return np.sqrt(np.abs(waves).prod(axis=1) ** (2 / 3) + 1e-3)


# Away from the axes, which nothing else may favour either.
_TURN = np.linalg.qr(np.array([[0.71, -0.53, 0.29], [0.37, 0.83, -0.41], [-0.19, 0.47, 0.91]]))[0]
