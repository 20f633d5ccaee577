# SPDX-License-Identifier: BSD-3-Clause
"""The adaptive tessellation has no gaps, and errs by a small multiple of its threshold."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from realtime.methods.light_volumes.published.tessellation import (
    RING,
    _first_corner,
    _ring_offset,
    configuration,
    divide,
    edges,
    quads,
    triangles,
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


def directed_edges(corners):
    return Counter(
        (int(a), int(b)) for triangle in corners for a, b in zip(triangle, np.roll(triangle, -1), strict=True)
    )


def areas(points, corners):
    """Twice the signed areas."""
    a, b, c = (points[corners[:, k]] for k in range(3))
    (p, q), (r, s) = (b - a).T, (c - a).T
    return p * s - q * r


def grid_points(numbers, size: int):
    return np.stack([numbers % (size + 1), numbers // (size + 1)], axis=-1)


def random_edges(rng, *, faces: int, levels: int, share: float):
    return [rng.random((faces, 2**level, 2**level)) < share for level in range(levels)]


@pytest.mark.claim("no-t-junctions")
def test_meshes_of_random_divisions_have_no_gaps():
    rng = np.random.default_rng(4)
    configurations = set()
    size = 32
    for share in (0.02, 0.1, 0.3):
        divided = divide(random_edges(rng, faces=1, levels=5, share=share))
        for _, _, sides in quads(divided):
            configurations |= set(sides.tolist())
        corners = triangles(divided)
        points = grid_points(np.arange((size + 1) ** 2), size)
        area = areas(points, corners)
        assert np.all(area > 0)
        assert area.sum() == 2 * size**2
        seen = directed_edges(corners)
        assert set(seen.values()) == {1}
        for a, b in seen:
            on_border = np.any((points[a] == points[b]) & ((points[a] == 0) | (points[a] == size)))
            assert ((b, a) in seen) != on_border
    assert configurations == set(range(16))


@pytest.mark.claim("no-t-junctions")
def test_divided_sides_differ_by_one_level():
    """Seen through the depth of the quad at every texel, not through the flags."""
    rng = np.random.default_rng(7)
    edge = random_edges(rng, faces=1, levels=6, share=0.01)
    divided = divide(edge)
    depth = np.zeros((64, 64), int)
    for flags in divided:
        depth += np.kron(flags[0], np.ones((64 // flags.shape[1],) * 2, int))
    assert abs(np.diff(depth, axis=0)).max() == 1
    assert abs(np.diff(depth, axis=1)).max() == 1
    assert depth.min() < 5  # something was left to be coarse
    for level, flags in enumerate(edge):
        fine = depth.reshape(2**level, 64 >> level, 2**level, 64 >> level).min(axis=(1, 3))
        assert np.all(fine[flags[0]] > level)


def height_of(function, size: int):
    u = np.linspace(-1, 1, size + 1)
    return function(u[None, None, :], u[None, :, None]) + np.zeros((1, size + 1, size + 1))


@pytest.mark.claim("tessellation-threshold")
def test_errors_stay_a_small_multiple_of_the_threshold():
    def bumps(u, v):
        return 1 + 0.4 * np.sin(5 * u + 3 * v) * np.cos(7 * v) + (u * u + v * v < 0.3) * 0.5

    height = height_of(bumps, 128)
    counts = []
    for threshold in (1e-3, 1e-2, 1e-1):
        divided = divide(edges(height, threshold))
        error = abs(tessellated_heights(height, divided) / height - 1).max()
        # The errors of a corner and of those it was interpolated from add up; on a smooth surface they fall by 4 from
        # level to level, which makes 4/3, and a diagonal sees the derivatives along both sides.
        assert threshold / 8 < error < 4 * threshold
        counts.append(len(triangles(divided)))
    assert counts[0] > 2 * counts[1] > 4 * counts[2]
