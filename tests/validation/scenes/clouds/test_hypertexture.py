# SPDX-License-Identifier: BSD-3-Clause
"""The density of `cumulus-detail`: noise that is continuous, bounded and always the same, and a distance field."""

import numpy as np
import pytest

from validation.scenes.clouds.hypertexture import (
    NOISE_BOUND,
    SAMPLING,
    distance_into,
    gradient_noise,
    grid_points,
    inside,
    octaves,
    sigmoid,
)
from validation.scenes.solids import icosphere, torus

RANDOM = np.random.default_rng(71)


@pytest.mark.claim("noise-of-hypertexture", tolerance="1e-9 of a cell, times a slope of at most 4")
def test_noise_has_no_step_between_cells_and_is_nought_at_their_corners():
    corners = np.array(np.meshgrid(*[np.arange(-3, 3)] * 3)).reshape(3, -1).T.astype(float)
    np.testing.assert_array_equal(gradient_noise(corners, 5), 0)
    faces = RANDOM.uniform(-7, 7, (3000, 3))
    faces[:, 1] = np.round(faces[:, 1])
    step = np.array([0.0, 1e-9, 0.0])
    np.testing.assert_allclose(gradient_noise(faces - step, 5), gradient_noise(faces + step, 5), atol=8e-9)


@pytest.mark.claim("noise-of-hypertexture", tolerance="none: a bound")
def test_noise_is_bounded_and_of_mean_nought():
    points = RANDOM.uniform(-40, 40, (200_000, 3))
    noise = gradient_noise(points, 11)
    assert 0.5 < np.abs(noise).max() < NOISE_BOUND
    assert abs(noise.mean()) < 5 * noise.std() / np.sqrt(len(noise))
    assert np.abs(octaves(points, 37.0, 4, 11)).max() < 1


@pytest.mark.claim("noise-of-hypertexture", tolerance="none: equal numbers; 1e-12 of a number that is pinned")
def test_noise_depends_on_place_and_seed_alone():
    points = RANDOM.uniform(-90, 90, (500, 3))
    noise = octaves(points, 13.0, 3, 7)
    np.testing.assert_array_equal(noise[::-7], octaves(points[::-7], 13.0, 3, 7))
    assert np.abs(noise - octaves(points, 13.0, 3, 8)).max() > 0.1
    # A number of the hash that no version of NumPy may change.
    assert gradient_noise(np.array([[0.31, -1.73, 2.57]]), 7)[0] == pytest.approx(0.18701449451543795, abs=1e-12)


def test_sigmoid_is_nought_and_one_outside_its_depths():
    depth = np.array([-9.0, 3.0, 4.0, 5.0, 99.0])
    np.testing.assert_allclose(sigmoid(depth, 3.0, 5.0), [0, 0, 0.5, 1, 1])


@pytest.mark.slow
def test_what_lies_within_a_mesh_and_how_deep():
    """A ball: the distance of a point from its surface is known. A ring: a line meets it four times."""
    ball = icosphere(4)
    vertices, faces = ball[0] * 97.0 + (13.0, -7.0, 5.0), ball[1]
    points = grid_points(vertices.min(axis=0) - 9, vertices.max(axis=0) + 9, (23, 29, 31))
    radius = np.linalg.norm(points - (13.0, -7.0, 5.0), axis=-1)
    within = inside((vertices, faces), points)
    sure = np.abs(radius - 97.0) > 0.4  # chords of the triangles
    np.testing.assert_array_equal(within[sure], radius[sure] < 97.0)
    deep = distance_into((vertices, faces), points[within])
    # sqrt(D^2 + s^2/3) - D of samples s apart, less what chords leave.
    over = np.sqrt((97.0 - radius[within]) ** 2 + SAMPLING**2 / 3) - (97.0 - radius[within])
    assert np.all(deep - (97.0 - radius[within]) < over + 0.1)
    assert np.all(deep - (97.0 - radius[within]) > -0.4)
    vertices, faces = torus(31.0, 11.0, (89, 43))
    points = grid_points(vertices.min(axis=0) - 3, vertices.max(axis=0) + 3, (37, 41, 19))

    hole = np.linalg.norm(points, axis=-1) < 31.0 - 11.0 - 2
    assert not inside((vertices, faces), points)[hole].any()
    assert inside((vertices, faces), points).sum() > 1000


@pytest.mark.slow
def test_cumulus_detail_is_empty_at_its_hull_and_full_within(variant):
    from scipy.ndimage import map_coordinates

    from validation.scenes.cumulus import cumulus_mesh
    from validation.scenes.cumulus_detail import VOXELS, density, grid_box

    rho = density()
    assert rho.shape == (VOXELS,) * 3
    assert (rho.min(), rho.max()) == (0, 1)
    vertices, faces = cumulus_mesh()
    low, high = grid_box()
    places = vertices[faces].mean(axis=1)
    at = ((places - low) / (high - low) * VOXELS - 0.5)[:, ::-1].T
    # The distance is linear over two voxels: a wisp may touch the hull.
    assert np.mean(map_coordinates(rho, at, order=1) > 0) < 0.01
    assert 0.1 < np.mean(rho == 1) < 0.2
