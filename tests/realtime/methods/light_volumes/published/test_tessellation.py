# SPDX-License-Identifier: BSD-3-Clause
"""The adaptive tessellation has no gaps, and errs by a small multiple of its threshold."""

from collections import Counter

import numpy as np
import pytest

from realtime.methods.light_volumes.published.tessellation import divide, edges, quads, triangles
from tests.helpers.tessellated_heights import tessellated_heights


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
