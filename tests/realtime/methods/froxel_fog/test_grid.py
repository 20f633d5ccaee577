# SPDX-License-Identifier: BSD-3-Clause
"""The grid: places and points are inverse to one another, and values between froxels are linear."""

import numpy as np
import pytest

from tests.helpers.scenes import tiny_scene


def grid(near=0.7, far=9.3, size=(7, 5, 6)):
    import mitsuba as mi

    from realtime.methods.froxel_fog.grid import Grid
    from realtime.scene.read_scene import read_scene

    camera = read_scene(mi.load_dict(tiny_scene()), "double").camera
    return Grid(*size, camera, mi.Float64(far), None if near is None else mi.Float64(near))


@pytest.mark.parametrize("near", [0.7, None])
def test_depths_and_shares_are_inverse_and_begin_at_the_camera(variant, near):
    import drjit as dr
    import mitsuba as mi

    froxels = grid(near)
    s = dr.linspace(mi.Float64, 0, 1, 17)
    depth = froxels.depth(s)
    np.testing.assert_allclose(froxels.share(depth), s, atol=1e-14)
    assert np.array(depth)[0] == 0
    assert np.array(depth)[-1] == pytest.approx(9.3, rel=1e-14)


def test_values_between_froxels_are_linear_and_constant_beside_the_grid(variant):
    import mitsuba as mi

    from realtime.methods.froxel_fog.grid import trilinear
    from realtime.numerics.array_types import packed

    k, j, i = (
        axis.ravel().astype(float) for axis in np.meshgrid(np.arange(4), np.arange(3), np.arange(5), indexing="ij")
    )
    values = 1.3 + 0.7 * i - 0.4 * j + 2.1 * k
    volume = packed(mi.Vector4d(mi.Float64(values), mi.Float64(2 * values), mi.Float64(i), 0))
    random = np.random.default_rng(3)
    place = [random.uniform(-1, count, 200) for count in (5, 3, 4)]
    x, y, z = (np.clip(axis, 0, count - 1) for axis, count in zip(place, (5, 3, 4), strict=True))
    between = trilinear(volume, (5, 3, 4), tuple(mi.Float64(axis) for axis in place))
    np.testing.assert_allclose(between[0], 1.3 + 0.7 * x - 0.4 * y + 2.1 * z, rtol=1e-13)
    np.testing.assert_allclose(between[1], 2 * np.array(between[0]), rtol=1e-13)
    np.testing.assert_allclose(between[2], x, atol=1e-13)
    assert not np.isnan(
        np.array(trilinear(volume, (5, 3, 4), (mi.Float64(np.inf), mi.Float64(-np.inf), mi.Float64(0))))
    ).any()
