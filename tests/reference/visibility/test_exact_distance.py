# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the distance to a visible triangle or sphere is exact to float64, whatever rays were cast in float32."""

import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature.surface import surface_hits
from reference.scene.read import read_reference
from reference.scene.shapes import read_shapes
from reference.visibility.exact_distance import exact_distance
from tests.helpers.scenes import tiny_scene


def test_distance_to_a_plane_is_exact(variant):
    reference = read_reference(mi.load_dict(tiny_scene(ball=None)))
    hits = surface_hits(reference)
    distance = exact_distance(reference, hits.interaction, hits.distance)
    met = np.isfinite(hits.distance)
    assert met.sum() > 50
    assert distance[met] == pytest.approx((-reference.origin[2] / reference.direction[:, 2])[met], rel=1e-14)
    assert np.isinf(distance[~met]).all()


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
def test_distance_to_a_sphere_is_exact(variant, inside):
    """The points lie on the sphere in float64, and they are those that were cast."""
    sphere = {"type": "sphere", "center": [0.1, -3.9, 1.2], "radius": 1.9} if inside else tiny_scene()["ball"]
    reference = read_reference(mi.load_dict(tiny_scene(ball=sphere, floor=None)))
    hits = surface_hits(reference)
    distance = exact_distance(reference, hits.interaction, hits.distance)
    met = np.isfinite(hits.distance)
    assert met.all() if inside else 5 < met.sum() < 100
    shapes = read_shapes(reference.occluders)
    point = reference.origin + distance[met, None] * reference.direction[met]
    assert np.linalg.norm(point - shapes.centre, axis=1) == pytest.approx(shapes.radius.item(), rel=1e-14)
    assert distance[met] == pytest.approx(hits.distance[met], rel=1e-5)
    assert np.isinf(distance[~met]).all()
