# SPDX-License-Identifier: BSD-3-Clause
"""Several rays a pixel: their points fill it, the mean converges to that over its area, one ray is the centre."""

import numpy as np
import pytest

from realtime.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.frame.samples import pixel_offsets, render_samples
from realtime.scene.camera import ray_directions, read_camera, shifted_camera
from realtime.scene.read_scene import read_scene
from validation.configurations.methods import configuration, prepared
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import load_scene


def test_points_fill_the_pixel():
    assert list(pixel_offsets(1)) == [(0.0, 0.0)]
    for samples in (3, 16, 25):
        points = np.array(list(pixel_offsets(samples)))
        assert np.abs(points).max() < 0.5
        np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-12)
    quarters = np.floor(4 * (np.array(list(pixel_offsets(16))) + 0.5)).astype(int)
    assert len({tuple(cell) for cell in quarters}) == 16  # one point in each of 4 x 4 parts of the pixel
    with pytest.raises(InputError, match="samples: got 0"):
        list(pixel_offsets(0))


def test_shifted_camera_looks_beside_the_centres(variant):
    """Half a pixel to the right of the centre of one pixel is half a pixel to the left of the next."""
    import mitsuba as mi

    camera = read_scene(load_scene("sphere-spot", (8, 6)).scene, "double").camera
    here, next_one = mi.UInt32(19), mi.UInt32(20)
    right, _ = ray_directions(shifted_camera(camera, 0.5, 0), here)
    left, _ = ray_directions(shifted_camera(camera, -0.5, 0), next_one)
    np.testing.assert_allclose(np.array(right), np.array(left), atol=1e-12)
    below, _ = ray_directions(shifted_camera(camera, 0, 1), here)
    lower, _ = ray_directions(camera, mi.UInt32(19 + 8))
    np.testing.assert_allclose(np.array(below), np.array(lower), atol=1e-12)
    host = read_camera(camera)
    assert np.dot(np.array(below).ravel(), host.up) < np.dot(np.array(ray_directions(camera, here)[0]).ravel(), host.up)


@pytest.mark.parametrize("method", ["shadow-planes", "froxel-fog"])
def test_one_ray_is_the_frame_itself(variant, method):
    renderer = prepared(read_scene(load_scene("sphere-spot", (16, 12)).scene), configuration(method))
    np.testing.assert_array_equal(render_samples(renderer, 1).airlight, render_frame(renderer).airlight)


@pytest.mark.claim("anti-aliased")
def test_the_mean_converges_to_that_over_the_pixels(variant):
    """16 rays err a quarter as much as the centre alone, by the quadrature of the means over pixels."""
    loaded = load_scene("sphere-spot", (16, 12))
    truth = truth_image(loaded.scene, pixel="area").airlight
    renderer = prepared(read_scene(loaded.scene), configuration("shadow-planes"))
    shares = []

    def error(samples):
        frame = render_samples(renderer, samples, shares.append)
        return np.sqrt(np.mean((frame.airlight - truth) ** 2)) / truth.mean()

    assert error(16) < error(1) / 4
    assert shares == [number / 16 for number in range(1, 17)]
