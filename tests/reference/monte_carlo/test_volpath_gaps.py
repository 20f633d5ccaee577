# SPDX-License-Identifier: BSD-3-Clause
"""`volpath` refuses bodies of media of which Mitsuba's rays leap over a visible part, and gaps that
they leap over, and no others.
"""

from contextlib import nullcontext

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.monte_carlo.volpath_gaps import CannotTrace, check_gaps
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
        ("left", box((0, 0, 0), (5, 10, 1), turn), 1.0),
        ("right", box((5 + gap, 0, 0), (9, 10, 1), turn), 1.0),
    ]
    check(bodies, refused=gap < APART)


@pytest.mark.claim("volpath-gaps")
@pytest.mark.parametrize("gap", [0.0, CLOSE / 2, APART])
def test_spheres_and_a_ball_on_a_box(gap):
    check(
        [
            ("a", Sphere(np.zeros(3), 4.0), 1.0),
            ("b", Sphere(np.array([9.0 + gap, 0, 0]), 5.0), 1.0),
        ],
        refused=gap < APART,
    )
    bodies = [
        ("box", box((-9, -9, -1), (9, 9, 0)), 1.0),
        ("ball", Sphere(np.array([0, 0, 2.0 + gap]), 2.0), 1.0),
    ]
    check(bodies, refused=gap < APART)


def test_overlapping_bounding_boxes_alone_are_no_reason():
    # Two thin boxes across the corners of one square, 3 m apart.
    first, second = (box((x, -9, 0), (x + 1, 9, 1), 0.8) for x in (2, 6))
    check([("a", first, 1.0), ("b", second, 1.0)], refused=False)


#: Bounds, a mean free path [m], and whether half a percent of it or of the width is less than the
#: 0.9 mm about 9 m, or 0.09 mm about 0, that rays leap.
BODIES = [
    (box((0, 0, 0), (0.15, 9, 1), 0.4), 1.0, True),
    (box((0, 0, 0), (0.21, 9, 1), 0.4), 1.0, False),
    (box((0, 0, 0), (1, 9, 1), 0.4), 0.15, True),
    (box((0, 0, 0), (1, 9, 1), 0.4), 0.21, False),
    (Sphere(np.zeros(3), 0.008), 1.0, True),
    (Sphere(np.zeros(3), 0.01), 1.0, False),
]


@pytest.mark.claim("volpath-gaps")
@pytest.mark.parametrize(("bounds", "free", "refused"), BODIES)
def test_a_body_of_which_rays_leap_over_a_visible_part_is_refused(bounds, free, refused):
    """It would be too dim by this part of its light: 2.8 % in a slab of 1 cm at 2 m."""
    with (
        pytest.raises(CannotTrace, match=r"'film' is .* thick.*leap over")
        if refused
        else nullcontext()
    ):
        check_gaps([("film", bounds, 1 / free)])


def check(bodies, *, refused):
    """Expect a refusal that names both bodies, in either order, or none."""
    for pair in (bodies, bodies[::-1]):
        if not refused:
            check_gaps(pair)
            continue
        with pytest.raises(InputError, match=f"'{pair[0][0]}' and '{pair[1][0]}'.*leap"):
            check_gaps(pair)


@pytest.mark.claim("volpath-gaps")
def test_scenes_are_refused():
    """Order one of `cloud-slab` would lose 4 %: rays leap 1.1 m in mean free paths of 28 m."""
    for name, words in (
        ("step-cloud", "'thick-1' is 250 m thick, with a mean free path of 14 m"),
        ("cloud-slab", "with a mean free path of 28 m"),
    ):
        with pytest.raises(InputError, match=words):
            volpath_batch(read_reference(load_scene(name, (4, 3)).scene), 0, 1)
