# SPDX-License-Identifier: BSD-3-Clause
"""The triangles that stand for a black light are as large as it, closed where it is, and turned outwards."""

import numpy as np
import pytest

from realtime.area_lights.shape import occluder_triangles, occluder_vertices
from tests.helpers.meshes import directed_edges, volume
from tests.realtime.area_lights.test_points import AXES, MIDDLE, lamp


@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_flat_occluders_have_the_area_and_face_of_their_light(kind):
    light = lamp(kind)
    vertices, faces = occluder_vertices(light), occluder_triangles(light)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = 0.5 * np.cross(b - a, c - a).sum(axis=0)
    np.testing.assert_allclose(area, light.area * AXES[2], atol=1e-12)


def test_a_sphere_is_closed_and_nearly_as_large():
    light = lamp("sphere")
    vertices, faces = occluder_vertices(light), occluder_triangles(light)
    edges = directed_edges(faces)
    assert set(edges.values()) == {1}
    assert {(b, a) for a, b in edges} == set(edges)
    assert volume(vertices - MIDDLE, faces) == pytest.approx(4 / 3 * np.pi * light.radius**3, rel=5e-3)
