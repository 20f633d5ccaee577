# SPDX-License-Identifier: BSD-3-Clause
"""The heights of an adaptive tessellation at every corner of the texels, from its triangles."""

from typing import Any

import numpy as np

from realtime.methods.light_volumes.published.tessellation import (
    RING,
    _first_corner,
    _ring_offset,
    configuration,
    quads,
)


def tessellated_heights(height, divided: list[Any]):
    """Return the heights of the tessellation at every corner of the texels, to compare with `height`."""
    size = 2 ** len(divided)
    flat = np.array(height, dtype=float).ravel()
    result = flat.copy()
    for level, numbers, sides in quads(divided):
        if level == len(divided):
            continue  # texels keep their heights
        for sides_now in np.unique(sides):
            chosen = numbers[sides == sides_now]
            first, step = _first_corner(chosen, level, size)
            ring = first[:, None] + [_ring_offset(k, step, size) for k in range(8)]
            weights, offsets = _weights(configuration(int(sides_now)), step, size)
            # As many quads at a time as have about a million corners.
            batch = max(1, 2**20 // len(offsets))
            for start in range(0, len(chosen), batch):
                some = slice(start, start + batch)
                result[first[some, None] + offsets] = flat[ring[some]] @ weights.T
    return result.reshape(height.shape)


def _weights(fan, step: int, size: int):
    """Return the weights of the ring at all corners of the texels of a quad, and their numbers from its first."""
    row, column = (part.ravel() for part in np.mgrid[: step + 1, : step + 1])
    point = np.stack([column * 2 / step, row * 2 / step, np.ones(len(row))])
    weights = np.zeros((len(row), 8))
    for triangle in fan:
        corners = np.array([(*RING[k], 1) for k in triangle], dtype=float).T
        barycentric = np.linalg.solve(corners, point).T
        inside = np.all(barycentric > -1e-9, axis=1)
        weights[inside] = 0
        weights[np.ix_(inside, triangle)] = barycentric[inside]
    return weights, row * (size + 1) + column
