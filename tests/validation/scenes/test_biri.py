# SPDX-License-Identifier: BSD-3-Clause
"""The scenes of Biri 2006's Table 2, the solids that they are made of, and the casters that other tests share."""

from functools import cache

import numpy as np
import pytest

from tests.helpers.meshes import is_closed, volume
from validation.scenes.clutter import SCENE as CLUTTER
from validation.scenes.hall import SCENE as HALL
from validation.scenes.solids import (
    arch,
    box,
    gem,
    icosphere,
    prism,
    star,
    tetrahedron,
    torus,
)
from validation.scenes.three_media import SCENE as THREE_MEDIA

RECORDS = {record.name: record for record in (THREE_MEDIA, CLUTTER, HALL)}
SOLIDS = {
    # name: mesh, triangles, Euler's number
    "box": (box((0.7, 1.3, 0.9)), 12, 2),
    "tetrahedron": (tetrahedron(0.7), 4, 2),
    "icosphere": (icosphere(2), 320, 2),
    "gem": (gem(13, 5), 130, 2),
    "prism": (prism(star(0.3, 0.7, 5), 0.4), 40, 2),
    "arch": (arch((0.9, 1.3), 0.4, 11), 96, 2),
    "torus": (torus(0.9, 0.3, (20, 9)), 360, 0),
}


@cache
def built(name):
    return RECORDS[name].build()


def meshes(name):
    """Return the meshes of a scene as Mitsuba has them, {name: (vertices, faces)}."""
    import mitsuba as mi

    result = {}
    for key, value in built(name).items():
        if isinstance(value, mi.Mesh):
            parameters = mi.traverse(value)
            vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
            result[key] = vertices, np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    return result


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_face_outwards(name):
    (vertices, faces), count, euler = SOLIDS[name]
    assert len(faces) == count
    assert is_closed(faces)
    assert len(vertices) - 3 * len(faces) // 2 + len(faces) == euler
    assert set(faces.reshape(-1)) == set(range(len(vertices)))
    assert volume(vertices - vertices.mean(axis=0), faces) > 0


def test_volumes_of_solids_by_their_formulas():
    assert volume(*box((0.7, 1.3, 0.9))) == pytest.approx(0.7 * 1.3 * 0.9)
    # Edge of the tetrahedron: R sqrt(8/3); volume: edge^3 / (6 sqrt 2).
    assert volume(*tetrahedron(0.7)) == pytest.approx((0.7 * np.sqrt(8 / 3)) ** 3 / (6 * np.sqrt(2)))
    # A star of 2 n corners is 2 n triangles of area inner outer sin(pi / n) / 2.
    assert volume(*prism(star(0.3, 0.7, 5), 0.4)) == pytest.approx(10 * 0.5 * 0.3 * 0.7 * np.sin(np.pi / 5) * 0.4)
    steps = 11
    ring = 0.5 * steps * np.sin(np.pi / steps) * (1.3**2 - 0.9**2)
    assert volume(*arch((0.9, 1.3), 0.4, steps)) == pytest.approx(ring * 0.4)
    # Pappus, with both circles as polygons, in the limit: the corners of the polygons leave out less than 1e-3.
    assert volume(*torus(0.9, 0.3, (300, 200))) == pytest.approx(2 * np.pi**2 * 0.9 * 0.3**2, rel=1e-3)
    assert volume(*icosphere(5)) == pytest.approx(4 * np.pi / 3, rel=2e-3)
