# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the camera rays as arrays are those of the reference, and of Mitsuba's own camera."""

import mitsuba as mi
import numpy as np
import pytest

import airlight
from tests.helpers.height_fog import SUN
from tests.helpers.scenes import scene_xml

SIZE = (17, 12)


@pytest.mark.parametrize("name", ["three-media", "windows"])
def test_camera_rays_are_those_of_mitsuba_and_end_where_the_reference_ends(variant, name):
    found = airlight.rays(name, SIZE)
    sensor = airlight.load_scene(name, SIZE).scene.sensors()[0]
    row, column = np.divmod(np.arange(SIZE[0] * SIZE[1]), SIZE[0])
    position = mi.Point2f((column + 0.5) / SIZE[0], (row + 0.5) / SIZE[1])
    theirs = sensor.sample_ray(0.0, 0.5, position, mi.Point2f(0.5))[0]
    direction = np.array(theirs.d).T.reshape(found.direction.shape)
    # Mitsuba's rays are float32 and begin at the near plane
    np.testing.assert_allclose(found.direction, direction, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found.direction, axis=2), 1, rtol=1e-14)
    beside = np.array(theirs.o).T - found.origin
    along = np.sum(beside * found.direction.reshape(-1, 3), axis=1)[:, None]
    np.testing.assert_allclose(beside, along * found.direction.reshape(-1, 3), atol=1e-5)
    # the depth of the file is float32
    depth = airlight.reference(name, size=SIZE).image.depth
    np.testing.assert_array_equal(np.isfinite(found.distance), np.isfinite(depth))
    np.testing.assert_allclose(found.distance, depth, rtol=2e-6)


def test_a_sun_that_only_the_model_of_a_scene_lets_through_is_in_no_ray_s_way(variant, tmp_path):
    """The reference took the scene, and its rays were refused by physics."""
    (tmp_path / "sun.xml").write_text(scene_xml(SUN, size=SIZE))
    found = airlight.rays(airlight.load_scene(tmp_path / "sun.xml", model="light-path=off"))
    (tmp_path / "lamp.xml").write_text(scene_xml(size=SIZE))
    lamp = airlight.rays(tmp_path / "lamp.xml")
    np.testing.assert_array_equal(found.direction, lamp.direction)
    np.testing.assert_array_equal(found.distance, lamp.distance)
    with pytest.raises(airlight.InputError, match="nothing of it arrives"):
        airlight.rays(tmp_path / "sun.xml")


def test_a_scene_without_a_quadrature_has_no_such_rays(variant):
    with pytest.raises(airlight.InputError, match="cloud"):
        airlight.rays("cumulus", SIZE)
