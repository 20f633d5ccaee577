# SPDX-License-Identifier: BSD-3-Clause
"""Smoke as a density grid: a plume that rises, widens, wanders and tears, from gradient noise.

At the fraction s of its height the plume has the radius r(s) and the middle m(s), which drifts
as smoke does in a room:

    rho = max(0, exp(-(d/r)^2) + tear n(p) - cut)/(1 + tear - cut),     d = |p - m(s)|,

with noise n that is carried up and is turned about the middle. It thins out as 1/r^2, so that each
level holds as much, and ends smoothly below its top. The numbers depend on nothing but the
arguments.
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
    rise = (points[..., 2] - low[2]) / (high[2] - low[2])
    turn = 4.3 * rise
    middle = 0.5 * (low + high)[:2] + drift * rise[..., None] * np.stack(
        [np.sin(turn + 0.7), np.cos(1.3 * turn)], -1
    )
    across = points[..., :2] - middle
    radius = radii[0] + (radii[1] - radii[0]) * rise**0.7
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
    body = np.exp(-np.sum(across**2, axis=-1) / radius**2) * (1 + 3.1 * noise) - 0.13
    thin = (radii[0] / radius) ** 1.3 * (1 - sigmoid(rise, 0.77, 1.0)) * sigmoid(rise, 0.0, 0.03)
    density = np.maximum(body, 0.0) * thin
    return (density / density.max()).astype(np.float32)
