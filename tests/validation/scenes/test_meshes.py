# SPDX-License-Identifier: BSD-3-Clause
"""Solids and parts of scenes are closed and face outwards, their volumes are known, and the bent tubes do not fold."""

import tomllib

import numpy as np
import pytest

from tests.helpers.meshes import is_closed, volume
from validation.scenes.meshes import arch, bent, box, gem, icosphere, lathe, prism, star, tetrahedron, torus
from validation.scenes.registry import FILES, mesh_of

TABLES = tomllib.loads(FILES[0].read_text())
PEN, COLUMN = TABLES["two-pens"]["kinds"]["pen"] | {"height": 1.83}, TABLES["colonnade"]["kinds"]["column"]
SOLIDS = {
    # name: mesh, triangles, Euler's number
    "box": (box((0.7, 1.3, 0.9)), 12, 2),
    "tetrahedron": (tetrahedron(0.7), 4, 2),
    "icosphere": (icosphere(2), 320, 2),
    "gem": (gem(13, 5), 130, 2),
    "prism": (prism(star(0.3, 0.7, 5), 0.4), 40, 2),
    "arch": (arch((0.9, 1.3), 0.4, 11), 96, 2),
    "torus": (torus(0.9, 0.3, (20, 9)), 360, 0),
    "cylinder": (lathe([0.3, 0.4], [0.1, 1.7], 7), 28, 2),
    "column": (mesh_of(COLUMN, {}), 2 * 72 * 32, 2),
    "pen": (mesh_of(PEN, {}), 17_088, 2),
    "sphere": (mesh_of(TABLES["sphere-spot"]["shapes"][0], {}), 2 * 32 * 17, 2),
    "knot": (mesh_of(TABLES["tangle"]["shapes"][0]["parts"][0], {}), 2 * 1249 * 11, 0),
}


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


def test_tangle_is_bent_without_folding_space():
    """Two points move against each other by less than they are apart: the waves' Lipschitz bounds add to below 1."""
    waves = TABLES["tangle"]["shapes"][0]["waves"]
    assert sum(np.linalg.norm(displacement) * np.linalg.norm(wave) for displacement, wave, _ in waves) < 1
    points = np.random.default_rng(20100621).uniform(-1.7, 1.7, (4000, 3))
    step = 1e-5
    either = [[bent(points + sign * step * axis, waves) for sign in (1, -1)] for axis in np.eye(3)]
    columns = [(ahead - behind) / (2 * step) for ahead, behind in either]
    determinants = np.linalg.det(np.stack(columns, axis=2))
    assert determinants.min() > 0
    assert determinants.max() / determinants.min() > 2  # and yet it is bent
