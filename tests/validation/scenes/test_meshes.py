# SPDX-License-Identifier: BSD-3-Clause
"""Solids and parts of scenes are closed and face outwards, their volumes are known; the
noise of `cumulus-detail`.
"""

import tomllib

import numpy as np
import pytest

from airlight.validation.scenes.hypertexture import NOISE_BOUND, gradient_noise, octaves
from airlight.validation.scenes.meshes import (
    arch,
    box,
    gem,
    icosphere,
    lathe,
    prism,
    star,
    tetrahedron,
    torus,
)
from airlight.validation.scenes.registry import FILES, mesh_of
from tests.helpers.meshes import is_closed, volume

TABLES = tomllib.loads(FILES[0].read_text())
PEN, COLUMN = (
    TABLES["two-pens"]["kinds"]["pen"] | {"height": 1.83},
    TABLES["colonnade"]["kinds"]["column"],
)
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
    assert volume(*tetrahedron(0.7)) == pytest.approx(
        (0.7 * np.sqrt(8 / 3)) ** 3 / (6 * np.sqrt(2))
    )
    # A star of 2 n corners is 2 n triangles of area inner outer sin(pi / n) / 2.
    assert volume(*prism(star(0.3, 0.7, 5), 0.4)) == pytest.approx(
        10 * 0.5 * 0.3 * 0.7 * np.sin(np.pi / 5) * 0.4
    )
    steps = 11
    ring = 0.5 * steps * np.sin(np.pi / steps) * (1.3**2 - 0.9**2)
    assert volume(*arch((0.9, 1.3), 0.4, steps)) == pytest.approx(ring * 0.4)
    # Pappus, with both circles as polygons, in the limit: the corners of the polygons
    # leave out less than 1e-3.
    assert volume(*torus(0.9, 0.3, (300, 200))) == pytest.approx(
        2 * np.pi**2 * 0.9 * 0.3**2, rel=1e-3
    )
    assert volume(*icosphere(5)) == pytest.approx(4 * np.pi / 3, rel=2e-3)


RANDOM = np.random.default_rng(71)


@pytest.mark.claim("noise-of-hypertexture", tolerance="1e-9 of a cell, times a slope of at most 4")
def test_noise_has_no_step_between_cells_and_is_nought_at_their_corners():
    corners = np.array(np.meshgrid(*[np.arange(-3, 3)] * 3)).reshape(3, -1).T.astype(float)
    np.testing.assert_array_equal(gradient_noise(corners, 5), 0)
    faces = RANDOM.uniform(-7, 7, (3000, 3))
    faces[:, 1] = np.round(faces[:, 1])
    step = np.array([0.0, 1e-9, 0.0])
    np.testing.assert_allclose(
        gradient_noise(faces - step, 5), gradient_noise(faces + step, 5), atol=8e-9
    )


@pytest.mark.claim("noise-of-hypertexture", tolerance="none: a bound")
def test_noise_is_bounded_and_of_mean_nought():
    points = RANDOM.uniform(-40, 40, (200_000, 3))
    noise = gradient_noise(points, 11)
    assert 0.5 < np.abs(noise).max() < NOISE_BOUND
    assert abs(noise.mean()) < 5 * noise.std() / np.sqrt(len(noise))
    assert np.abs(octaves(points, 37.0, 4, 11)).max() < 1


@pytest.mark.claim(
    "noise-of-hypertexture", tolerance="none: equal numbers; 1e-12 of a number that is pinned"
)
def test_noise_depends_on_place_and_seed_alone():
    points = RANDOM.uniform(-90, 90, (500, 3))
    noise = octaves(points, 13.0, 3, 7)
    np.testing.assert_array_equal(noise[::-7], octaves(points[::-7], 13.0, 3, 7))
    assert np.abs(noise - octaves(points, 13.0, 3, 8)).max() > 0.1
    # A number of the hash that no version of NumPy may change.
    assert gradient_noise(np.array([[0.31, -1.73, 2.57]]), 7)[0] == pytest.approx(
        0.18701449451543795, abs=1e-12
    )
