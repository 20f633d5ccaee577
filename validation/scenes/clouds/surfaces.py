# SPDX-License-Identifier: BSD-3-Clause
"""Surfaces of clouds as closed triangle meshes: around a centre, and between two heights.

Both have one radius or one height a direction or place, so that they cross themselves nowhere.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mesh = tuple[Array, NDArray[np.int64]]  #: vertices (v, 3) [m] and faces (f, 3), counter-clockwise as seen from outside

_STEPS = 160  #: of the search along a direction


def star_shaped(function: Callable[[Array], Array], centre: Array, reach: float, sphere: Mesh) -> Mesh:
    """Return the outermost surface around a centre where a function changes its sign, by one radius a direction.

    Parameters
    ----------
    function
        Takes points, (n, 3) [m], and returns values, (n,), negative at the centre and positive at the `reach`.
    centre, reach
        A point (3,) and a radius that nothing exceeds [m].
    sphere
        The directions, unit vectors, and the triangles between them.
    """
    directions, faces = sphere
    radius = np.full(len(directions), reach)
    outside = np.ones(len(directions), dtype=bool)
    step = reach / _STEPS
    previous = function(centre + reach * directions)
    for number in range(_STEPS - 1, -1, -1):
        value = function(centre + number * step * directions)
        enters = outside & (value < 0)
        share = value[enters] / (value[enters] - previous[enters])
        radius[enters] = (number + share) * step
        outside &= ~enters
        previous = value
    return centre + radius[:, None] * directions, faces


def between_heights(x: Array, y: Array, bottom: Array, top: Array) -> Mesh:
    """Return the closed surface around what lies between two heights over a rectangle, upright at its border.

    Parameters
    ----------
    x, y
        Ascending, (n,) and (m,) [m].
    bottom, top
        Heights, (n, m) each [m]; the top is above the bottom everywhere.

    Returns
    -------
    mesh
        4 (n - 1) (m - 1) + 4 (n + m - 2) triangles, counter-clockwise as seen from outside.
    """
    n, m = len(x), len(y)
    plane = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    sheets = [np.concatenate([plane, height[..., None]], axis=-1).reshape(-1, 3) for height in (bottom, top)]
    i, j = (index.reshape(-1) for index in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij"))
    a, b, c, d = i * m + j, (i + 1) * m + j, (i + 1) * m + j + 1, i * m + j + 1
    above = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    # Counter-clockwise as seen from above.
    border = np.concatenate(
        [np.arange(n) * m, (n - 1) * m + np.arange(1, m), np.arange(n - 2, -1, -1) * m + m - 1, np.arange(m - 2, 0, -1)]
    )
    following, size = np.roll(border, -1), n * m
    sides = [
        np.stack([border, following, following + size], axis=1),
        np.stack([border, following + size, border + size], axis=1),
    ]
    return np.concatenate(sheets), np.concatenate([above[:, ::-1], above + size, *sides])
