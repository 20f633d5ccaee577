# SPDX-License-Identifier: BSD-3-Clause
"""Surfaces of clouds by formulas, as closed triangle meshes: around a centre,
and between two heights.

Both have one radius or one height a direction or place, so that they cross themselves nowhere.
"""

from collections.abc import Callable

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.scenes.meshes import Mesh, icosphere

_BASE = 713.0  # height of the base of the cumulus [m]


def cumulus() -> Mesh:
    """Return lobes heaped on a flat base, with bumps: 5120 triangles."""
    return star_shaped(
        _cumulus_distance, np.array([29.0, -13.0, _BASE + 113.0]), 1013.0, icosphere(4)
    )


def _cumulus_distance(points: Array) -> Array:
    """Return about the signed distance [m] from the cumulus, at points, (n, 3) [m]."""
    count = 31
    number = np.arange(count)
    # A sunflower: with the golden angle 2.39996 and radii as the square root of the number, the
    # lobes cover the disk evenly.
    fraction = np.sqrt((number + 0.37) / count)
    angle = 2.39996 * number + 0.71
    # Golden-ratio multiples modulo 1 are spread evenly and follow no order of the radius: heights
    # look irregular, and no random numbers are needed.
    rank = (0.618034 * number + 0.29) % 1.0
    tower = 1 - fraction**2.3
    centres = np.stack(
        [
            31.0 + 527.0 * fraction * np.cos(angle),
            -7.0 + 391.0 * fraction * np.sin(angle),
            _BASE + 53.0 + (83.0 + 337.0 * rank) * tower,
        ],
        axis=1,
    )
    radii = 89.0 + 83.0 * (1 - fraction) + 47.0 * ((0.754878 * number + 0.13) % 1.0)
    union = lobes(centres, radii, 13.7)(points) + 11.3 - 39.0 * bumps(points, 47.0)
    # Positive below the base: the maximum with it cuts the lobes off there, with gentle waves.
    base = (
        _BASE
        + 9.7 * np.sin(points[:, 0] / 131.0 + 0.9) * np.sin(points[:, 1] / 113.0)
        - points[:, 2]
    )
    return np.maximum(union, base)


def stratocumulus() -> Mesh:
    """Return a layer of 5.4 km by 3.8 km, cells and bumps on top and nearly flat
    below: 129 596 triangles.
    """
    base, halves = 611.0, (2713.0, 1879.0)  # height of the base, half the sides [m]
    x, y = (np.linspace(-half, half, count) for half, count in zip(halves, (216, 150), strict=True))
    plane = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((216, 150))], axis=-1).reshape(
        -1, 3
    )
    # 0 at the border, 1 from 431 m inwards, smooth at both ends (3 r^2 - 2 r^3): top and bottom
    # meet in a thin upright rim.
    rim = np.minimum(*((half - np.abs(plane[:, axis])) / 431.0 for axis, half in enumerate(halves)))
    rim = np.clip(rim, 0.0, 1.0)
    full = rim * rim * (3 - 2 * rim)
    cells, hills = bumps(plane, 173.0), bumps(plane + np.array([371.0, 59.0, 0.0]), 61.0)
    top = base + 37.0 + full * (113.0 + 197.0 * cells + 53.0 * hills * cells)
    bottom = base - full * 29.0 * bumps(plane + np.array([97.0, 1013.0, 0.0]), 137.0)
    return between_heights(x, y, bottom.reshape(216, 150), top.reshape(216, 150))


def two_lobes() -> Mesh:
    """Return two balls side by side, both around the point from which the triangles
    are drawn: 5120 triangles.
    """
    centres = np.array([[-251.0, 3.0, 967.0], [257.0, -5.0, 971.0], [7.0, 11.0, 853.0]])
    union = lobes(centres, np.array([269.0, 271.0, 149.0]), 17.3)
    return star_shaped(union, np.array([3.0, 2.0, 893.0]), 811.0, icosphere(4))


def star_shaped(
    function: Callable[[Array], Array], centre: Array, reach: float, sphere: Mesh
) -> Mesh:
    """Return the outermost surface around a centre, (3,), where a function changes its sign,
    by one radius a direction.

    The function takes points, (n, 3) [m], and is negative at the centre and positive at the radius
    `reach` [m]. The sphere gives the directions, unit vectors, and the triangles between them.
    """
    directions, faces = sphere
    # Search inwards from the reach: the first change of sign is the outermost surface.
    radius = np.full(len(directions), reach)
    outside = np.ones(len(directions), dtype=bool)
    steps = 160  # of the search along a direction
    step = reach / steps
    previous = function(centre + reach * directions)
    for number in range(steps - 1, -1, -1):
        value = function(centre + number * step * directions)
        enters = outside & (value < 0)
        # Linear between the value at this radius (below 0) and the value one step farther out
        # (above 0).
        fraction = value[enters] / (value[enters] - previous[enters])
        radius[enters] = (number + fraction) * step
        outside &= ~enters
        previous = value
    return centre + radius[:, None] * directions, faces


def between_heights(x: Array, y: Array, bottom: Array, top: Array) -> Mesh:
    """Return the closed surface between two heights, (n, m) [m], over a
    rectangle, upright at its border.

    The lines x, (n,), and y, (m,) [m], ascend, and the top is above the bottom everywhere. The
    surface has 4 (n - 1) (m - 1) + 4 (n + m - 2) triangles.
    """
    n, m = len(x), len(y)
    plane = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    # Two sheets of the same n m points, the bottom first; `size` is the offset from one to the
    # other.
    sheets = [
        np.concatenate([plane, height[..., None]], axis=-1).reshape(-1, 3)
        for height in (bottom, top)
    ]
    i, j = (
        index.reshape(-1)
        for index in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    )
    a, b, c, d = i * m + j, (i + 1) * m + j, (i + 1) * m + j + 1, i * m + j + 1
    above = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    # Counter-clockwise as seen from above.
    border = np.concatenate(
        [
            np.arange(n) * m,
            (n - 1) * m + np.arange(1, m),
            np.arange(n - 2, -1, -1) * m + m - 1,
            np.arange(m - 2, 0, -1),
        ]
    )
    following, size = np.roll(border, -1), n * m
    # Each edge of the border makes two triangles of the upright wall. The bottom's faces are
    # reversed so that they face downwards.
    sides = [
        np.stack([border, following, following + size], axis=1),
        np.stack([border, following + size, border + size], axis=1),
    ]
    return np.concatenate(sheets), np.concatenate([above[:, ::-1], above + size, *sides])


def lobes(centres: Array, radii: Array, blend: float) -> Callable[[Array], Array]:
    """Return about the signed distance [m] from a union of spheres, centres
    (k, 3) and radii (k,) [m].

    With d_i the distance from sphere i it is -blend log(sum exp(-d_i/blend)): seams as wide
    as `blend` [m] are filled.
    """

    def distance(points: Array) -> Array:
        total = np.zeros(len(points))
        for centre, radius in zip(centres, radii, strict=True):
            total += np.exp(
                # exp(600) is finite in double precision: deep inside a lobe the sum must not
                # overflow.
                np.minimum((radius - np.linalg.norm(points - centre, axis=1)) / blend, 600.0)
            )
        return -blend * np.log(np.maximum(total, 1e-300))

    return distance


def bumps(points: Array, size: float) -> Array:
    """Return billows over points, (n, 3) [m]: round bumps of about a `size` [m]
    with sharp valleys, 0 to 1.
    """
    turned = points @ _TURN.T / size
    # Sines of bent coordinates along three directions of no symmetry; their absolute values have
    # valleys with sharp edges. The small constant rounds these edges by a little.
    waves = np.sin(turned + 1.7 * np.sin(0.61 * turned[:, [1, 2, 0]] + (0.37, 1.91, 4.13)))
    return np.sqrt(np.abs(waves).prod(axis=1) ** (2 / 3) + 1e-3)


# Away from the axes, which nothing else may favour either.
_TURN = np.linalg.qr(np.array([[0.71, -0.53, 0.29], [0.37, 0.83, -0.41], [-0.19, 0.47, 0.91]]))[0]
