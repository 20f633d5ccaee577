# SPDX-License-Identifier: BSD-3-Clause
"""`volpath` refuses bodies of media, and gaps, that Mitsuba's rays leap over, and no others."""

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.monte_carlo.volpath_gaps import check_gaps
from airlight.reference.scene.convex_bounds import Polyhedron, Sphere
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene

pytestmark = pytest.mark.usefixtures("variant")


def box(low, high, turn=0.0):
    """A box, turned about z [radians]."""
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    low, high = np.array(low, float), np.array(high, float)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    normal = np.concatenate([np.eye(3), -np.eye(3)]) @ matrix.T
    points = (low + corners * (high - low)) @ matrix.T
    offset = np.concatenate([high, -low])
    ends = [(a, b) for a in range(8) for b in range(8) if np.sum(corners[a] != corners[b]) == 1]
    return Polyhedron(normal, offset, points[ends])


CLOSE, APART = 1e-3, 2e-2  #: [m]; rays leap 0.9 to 1.3 mm about 10 m


@pytest.mark.claim("volpath-gaps")
@pytest.mark.parametrize("gap", [0.0, CLOSE / 2, APART])
@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_walls_that_face_each_other(gap, turn):
    bodies = [
        ("left", box((0, 0, 0), (5, 10, 1), turn)),
        ("right", box((5 + gap, 0, 0), (9, 10, 1), turn)),
    ]
    check(bodies, refused=gap < APART)


@pytest.mark.claim("volpath-gaps")
@pytest.mark.parametrize("gap", [0.0, CLOSE / 2, APART])
def test_spheres_and_a_ball_on_a_box(gap):
    check(
        [("a", Sphere(np.zeros(3), 4.0)), ("b", Sphere(np.array([9.0 + gap, 0, 0]), 5.0))],
        refused=gap < APART,
    )
    bodies = [
        ("box", box((-9, -9, -1), (9, 9, 0))),
        ("ball", Sphere(np.array([0, 0, 2.0 + gap]), 2.0)),
    ]
    check(bodies, refused=gap < APART)


def test_overlapping_bounding_boxes_alone_are_no_reason():
    # Two thin boxes across the corners of one square, 3 m apart.
    bodies = [("a", box((2, -9, 0), (3, 9, 1), 0.8)), ("b", box((6, -9, 0), (7, 9, 1), 0.8))]
    check(bodies, refused=False)


def test_a_body_that_rays_leap_over_is_refused():
    """Behind it they would never leave its fog."""
    thin, thick = (box((0, 0, 0), (width, 10, 1), 0.4) for width in (CLOSE / 2, APART))
    for body in (thin, Sphere(np.zeros(3), 4e-5)):
        with pytest.raises(InputError, match=r"'film' is .* thick, and Mitsuba's rays leap"):
            check_gaps([("film", body)])
    check_gaps([("film", thick)])


def check(bodies, *, refused):
    """Expect a refusal that names both bodies, in either order, or none."""
    for pair in (bodies, bodies[::-1]):
        if not refused:
            check_gaps(pair)
            continue
        with pytest.raises(InputError, match=f"'{pair[0][0]}' and '{pair[1][0]}'.*leap"):
            check_gaps(pair)


@pytest.mark.claim("volpath-gaps")
def test_a_row_of_boxes_is_refused_and_a_single_slab_is_not():
    with pytest.raises(InputError, match=r"'thin-1' and 'thick-1' are 0\.002 m apart"):
        volpath_batch(read_reference(load_scene("step-cloud", (4, 3)).scene), 0, 1)
    volpath_batch(read_reference(load_scene("cloud-slab", (4, 3)).scene), 0, 1)
