# SPDX-License-Identifier: BSD-3-Clause
"""Rays of interpolated images are counted as they are needed, and cells lie where the light's place says."""

from dataclasses import replace

import numpy as np
import pytest

from analytic.errors import InputError

SIZE = 64  # of the image of twice the size


def image(airlight, *, size=SIZE, distance=None, epipole=(20.0, 30.0)):
    """An image of which each channel is a function of column and row, with the light's place in it or beside it."""
    from realtime.scene.camera import read_camera
    from realtime.scene.read_scene import read_scene
    from validation.frames.interpolation_study import Image
    from validation.scenes.loading import load_scene

    row, column = np.mgrid[0:size, 0:size].astype(float)
    values = np.stack([airlight(column, row)] * 3, axis=-1)
    scene = read_scene(load_scene("sphere-spot", (size, size)).scene)
    camera, light = read_camera(scene.camera), scene.lights[0]
    left, up = (0.5 * (size - 1) - place for place in epipole)
    place = camera.origin + 5 * (camera.forward + left * camera.left + up * camera.up)
    light = replace(light, position=type(light.position)(*place.tolist()))
    distances = np.ones((size, size)) if distance is None else distance(column, row)
    return Image(values, distances, scene.camera, light)


def study(shown, tolerance, *lines):
    from validation.frames.interpolation_study import study_interpolation

    return study_interpolation(shown, [tolerance], lines)


@pytest.mark.parametrize("epipole", [(20.0, 30.0), (-40.0, 31.5), (300.0, -80.0), (63.0, 63.0)])
def test_a_plane_is_interpolated_exactly(variant, epipole):
    tiles, lines = study(image(lambda x, y: 2 + 0.002 * x + 0.001 * y, epipole=epipole), 0.01, (256, 64))
    side = SIZE // 2
    assert tiles.relative_rmse < 1e-14
    assert tiles.corners == 1 / 16
    # The last tiles of rows and columns have no corners beyond them; their first pixels are corners.
    assert tiles.computed == (1 - (1 - 4 / side) ** 2) - 15 / side**2
    assert lines.computed < 0.1  # where lines do not reach the image
    assert lines.relative_rmse < 1e-4  # two lines and a sample of each are no parallelogram, but nearly one
    assert lines.rays == lines.corners + lines.computed


def test_beams_are_sparse_along_lines(variant):
    """Airlight that depends on the direction from the epipole alone: few samples on many lines do."""
    x0, y0 = -500.0, 250.0

    def beams(x, y):
        return 2 + np.sin(100 * np.arctan2(y - y0, x - x0))

    tiles, few, many = study(image(beams, size=512, epipole=(x0, y0)), 0.1, (64, 8), (1024, 8))
    assert few.computed > 0.9  # too few lines for these beams
    assert many.rays < 0.3 * tiles.rays


def test_edges_of_surfaces_are_not_interpolated(variant):
    def step(x, y):
        return np.where(x < 31, 1.0, 2.0)

    tiles, lines = study(image(lambda x, y: np.ones_like(x), distance=step), 0.01, (256, 64))
    flat, _ = study(image(lambda x, y: np.ones_like(x)), 0.01, (256, 64))
    assert tiles.computed > flat.computed
    assert lines.relative_rmse < 1e-15
    assert tiles.relative_rmse < 1e-15


def test_a_scene_with_two_lights_is_refused(variant):
    from realtime.scene.read_scene import read_scene
    from validation.configurations.methods import Configuration
    from validation.frames.interpolation_study import rendered
    from validation.scaling.ladders import with_copies
    from validation.scenes.loading import load_scene

    scene = with_copies(read_scene(load_scene("sphere-spot", (16, 12)).scene), 2)
    with pytest.raises(InputError, match=r"2 light\(s\), wanted just one, and without extent"):
        rendered(scene, Configuration("unshadowed", "exact"))
