# SPDX-License-Identifier: BSD-3-Clause
"""Smoke as a density grid: a plume that rises, widens, wanders and tears, from gradient noise.

At the fraction s of its height the plume has the radius r(s) and the middle m(s), which drifts
as smoke does in a room:

    rho = max(0, exp(-(d/r)^2) (1 + tear n(p)) - cut) (r(0)/r)^1.3 e(s),     d = |p - m(s)|,

divided by its largest value. The noise n is turned about the middle and is stretched along the
height. The plume thins out as it widens, and e(s) lets it end smoothly at its foot and below its
top. The density depends on the arguments alone.
"""

import numpy as np
from numpy.typing import NDArray

from airlight.validation.arrays import Array
from airlight.validation.scenes.hypertexture import grid_points, octaves, sigmoid


def smoke(
    low: Array,
    high: Array,
    voxels: tuple[int, int, int],
    *,
    radii: tuple[float, float],
    drift: float,
    seed: int,
) -> NDArray[np.float32]:
    """Return the density of a plume in a box, (z, y, x), 1 at most.

    `low`, `high`: corners of the box [m]; `voxels`: along x, y, z; `radii`: of the plume at its
    foot and top [m]; `drift`: how far its middle wanders [m]; `seed`: of the noise.
    """
    points = grid_points(low, high, voxels)
    # s of the module: 0 at the foot, 1 at the top.
    rise = (points[..., 2] - low[2]) / (high[2] - low[2])
    turn = 4.3 * rise
    # m(s): the middle drifts in a spiral with height.
    middle = 0.5 * (low + high)[:2] + drift * rise[..., None] * np.stack(
        [np.sin(turn + 0.7), np.cos(1.3 * turn)], -1
    )
    across = points[..., :2] - middle
    radius = radii[0] + (radii[1] - radii[0]) * rise**0.7
    # The noise is turned about the middle, most where the plume is dense, and stretched along z
    # (0.7): it looks carried up.
    swirl = 1.9 * np.exp(-np.sum(across**2, axis=-1) / radius**2) + turn
    turned = np.stack([np.cos(swirl), -np.sin(swirl), np.sin(swirl), np.cos(swirl)], -1).reshape(
        *swirl.shape, 2, 2
    )
    carried = np.concatenate(
        [np.einsum("...ij,...j->...i", turned, across), 0.7 * points[..., 2:]], axis=-1
    )
    noise = octaves(carried.reshape(-1, 3), 1.7 * radii[0] + 0.3 * radii[1], 4, seed).reshape(
        rise.shape
    )
    # The formula of the module with tear = 3.1 and cut = 0.13; the normalisation comes last.
    body = np.exp(-np.sum(across**2, axis=-1) / radius**2) * (1 + 3.1 * noise) - 0.13
    # Each level holds about as much, and both ends fade smoothly.
    thin = (radii[0] / radius) ** 1.3 * (1 - sigmoid(rise, 0.77, 1.0)) * sigmoid(rise, 0.0, 0.03)
    density = np.maximum(body, 0.0) * thin
    return (density / density.max()).astype(np.float32)
