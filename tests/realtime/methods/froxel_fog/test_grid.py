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


def test_the_exponential_distribution_becomes_linear(variant):
    import drjit as dr
    import mitsuba as mi

    s = dr.linspace(mi.Float64, 0, 1, 17)
    np.testing.assert_allclose(grid(1e5).depth(s), grid(None).depth(s), rtol=1e-4)


def test_slices_behind_near_grow_with_their_depth(variant):
    import drjit as dr
    import mitsuba as mi

    depth = np.array(grid(0.01).depth(dr.linspace(mi.Float64, 0, 1, 65)))
    growth = np.diff(depth)[30:] / depth[31:]
    np.testing.assert_allclose(growth, growth.mean(), rtol=0.05)


def test_points_of_columns_have_their_places(variant):
    import drjit as dr
    import mitsuba as mi

    froxels = grid()
    column = dr.arange(mi.UInt32, froxels.columns)
    u, v, depth = froxels.place(froxels.camera.origin + 3.7 * froxels.column_ray(column, (0.2, -0.3)))
    row, across = np.divmod(np.arange(35), 7)
    np.testing.assert_allclose(u, (across + 0.7) / 7, rtol=1e-5)
    np.testing.assert_allclose(v, (row + 0.2) / 5, rtol=1e-5)
    np.testing.assert_allclose(depth, 3.7, rtol=1e-5)


def test_columns_as_fine_as_pixels_are_the_camera_rays(variant):
    import drjit as dr
    import mitsuba as mi

    from realtime.scene.camera import ray_directions

    froxels = grid(size=(16, 12, 2))
    column = dr.arange(mi.UInt32, 16 * 12)
    ray = froxels.column_ray(column)
    np.testing.assert_allclose(ray / dr.norm(ray), ray_directions(froxels.camera, column)[0], atol=1e-14)


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
