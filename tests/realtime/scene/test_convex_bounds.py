# SPDX-License-Identifier: BSD-3-Clause
"""Convex bounds of shapes whose planes, volume and mean distance are known."""

import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.convex_bounds import Bounds, holds, mean_distance, mesh_bounds
from validation.scenes.meshes import box, icosphere, placed, rotation

TURN = rotation((0.3, 1.0, 0.2), 27.3)


def bounds(mesh, name="solid"):
    vertices, faces = mesh
    return mesh_bounds(name, vertices.astype(np.float32).astype(np.float64), faces)


def sphere_bounds(centre, radius):
    return Bounds("sphere", np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3, 3)), np.array(centre), radius)


def test_what_the_half_spaces_hold_is_what_the_box_holds():
    half_spaces = bounds(placed(box((1.3, 0.7, 2.1)), (3.1, -2.3, 0.9), TURN))
    points = np.random.default_rng(5).uniform(-2, 2, (200, 3)) + np.array([3.1, -2.3, 0.9])
    own = (points - (3.1, -2.3, 0.9)) @ TURN
    expected = np.all(np.abs(own) < (0.65, 0.35, 1.05), axis=1)
    assert [holds(half_spaces, point) for point in points] == expected.tolist()
    assert 0 < expected.sum() < len(points)


@pytest.mark.claim("media-refused")
@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (lambda: (box((1.0, 1.1, 1.2))[0], box((1.0, 1.1, 1.2))[1][:, ::-1]), "inside out, at edge"),
        (lambda: (box((1.0, 1.1, 1.2))[0], box((1.0, 1.1, 1.2))[1][1:]), "not a closed surface: edge"),
        (lambda: (box((1.0, 1.1, 1.2))[0] * (1, 1, 0), box((1.0, 1.1, 1.2))[1]), "has no volume|not a closed"),
    ],
)
def test_refusals_name_the_shape_and_the_flaw(mesh, message):
    with pytest.raises(InputError, match=message):
        bounds(mesh())


def test_mean_distance_of_a_sphere_is_six_fifths_of_its_radius():
    assert mean_distance(sphere_bounds((1.0, 2.0, 3.0), 0.83)) == pytest.approx(1.2 * 0.83)
    # 1280 facets lie within 0.5 % of the sphere, the sum over random pairs within 0.2 % (one standard error).
    assert mean_distance(bounds(icosphere(3))) == pytest.approx(1.2, rel=0.01)
