# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the signs of the triangles of a closed mesh that a ray crosses add up to how often it surrounds the eye."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from realtime.methods.light_volumes.published.mesh import VolumeMesh
from realtime.methods.light_volumes.published.raster import signed_crossings
from tests.helpers.volumes import light_pyramid, make_camera, simple_camera, tetrahedron


def winding_number(mesh: VolumeMesh, point) -> int | None:
    """Return how often a mesh surrounds a point, by its solid angle (Van Oosterom, Strackee 1983); None if it is on it.

    Next to a triangle that a point is on (rounding apart), half of all directions end; there `top` is 0.
    """
    corner = mesh.vertices[:, :3] - mesh.vertices[:, 3:] * np.asarray(point)
    length = np.linalg.norm(corner, axis=1)
    if np.min(length) < 1e-9:
        return None
    a, b, c = np.moveaxis((corner / length[:, None])[mesh.triangles], 1, 0)
    top = np.sum(a * np.cross(b, c), axis=1)
    bottom = 1 + np.sum(a * b, axis=1) + np.sum(b * c, axis=1) + np.sum(c * a, axis=1)
    if np.any((np.abs(top) < 1e-9) & (bottom < 1e-9)):
        return None
    turns = 2 * np.arctan2(top, bottom).sum() / (4 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-6)
    return round(turns)


def check_signs(mesh: VolumeMesh, camera) -> None:
    inside = winding_number(mesh, np.array(camera.origin).ravel())
    if inside is None:
        return
    sums = np.zeros(camera.width * camera.height)
    for batch in signed_crossings(mesh, camera):
        assert np.all(np.array(batch.distance) >= 0)  # and so no NaN
        np.add.at(sums, np.array(batch.pixel), np.array(batch.sign))
    assert np.all(sums == inside)


coordinates = st.floats(-3, 3, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates)
whole = st.integers(-4, 4)


@pytest.mark.claim("signs-add-up", tolerance="none: whole numbers")
@settings(max_examples=60, deadline=None)
@given(corners=st.lists(st.tuples(whole, whole, whole), min_size=4, max_size=4))
def test_signs_add_up_where_edges_pass_through_pixel_centres(variant, corners):
    """Corners at whole coordinates before a camera at 0: every edge and plane meets centres, or passes the camera."""
    corners = np.array(corners, dtype=float)
    assume(abs(np.linalg.det(corners[1:] - corners[0])) > 0.5)
    check_signs(tetrahedron(corners), simple_camera())


@pytest.mark.claim("signs-add-up", tolerance="none: whole numbers")
@settings(max_examples=60, deadline=None)
@given(
    inverse=st.lists(st.sampled_from((0.0, 0.05, 0.2, 0.21, 0.5, 4.0)), min_size=36, max_size=36),
    eye=points,
    aim=points,
)
def test_signs_add_up_for_light_volumes(variant, inverse, eye, aim):
    """With vertices at infinity and behind the camera, the camera in the light, in shadow, or beside."""
    assume(np.linalg.norm(np.subtract(eye, aim)) >= 1e-3)
    check_signs(light_pyramid(np.reshape(inverse, (6, 6))), make_camera(eye, aim, fov=100.0))
