# SPDX-License-Identifier: BSD-3-Clause
"""Bounds of media that are no bodies beside one another: what is refused, with the name of
an edge, and what is not.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.closed_mesh import Bounds
from airlight.validation.scenes.bodies import _common_sphere, check_bodies
from airlight.validation.scenes.meshes import box, icosphere, joined, placed, torus
from tests.helpers.clouds import DROPLETS, SUN, TURN, cloud, loaded, ring

pytestmark = pytest.mark.usefixtures("variant")

FAR = (400.3, 20.1, -30.7)
# in the middle of the tube of the ring
WITHIN = np.array([3.71, -0.13, 2.03]) + 101.37 * TURN[:, 0]

CORNERS = ring()[0][ring()[1][5]]  # of a facet, through which a small sphere dips without an edge
BESIDE, FACET_NORMAL = (
    CORNERS.mean(axis=0),
    np.cross(CORNERS[1] - CORNERS[0], CORNERS[2] - CORNERS[0]),
)
FACET_NORMAL /= np.linalg.norm(FACET_NORMAL)


def flipped(mesh):
    return mesh[0], mesh[1][:, ::-1]


def turned_part(mesh, faces):
    """Return a mesh of which some faces run the other way round."""
    turned = mesh[1].copy()
    turned[faces] = turned[faces][:, ::-1]
    return mesh[0], turned


def pulled(mesh, vertex, to):
    vertices = mesh[0].copy()
    vertices[vertex] = to
    return vertices, mesh[1]


def ball(name, middle, radius):
    medium = {"interior": DROPLETS, "bsdf": {"type": "null"}}
    return {"type": "sphere", "id": name, "center": list(middle), "radius": radius} | medium


@pytest.mark.claim("cloud-meshes-refused", "clouds-are-closed")
@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            [(ring()[0], ring()[1][1:])],
            r"'0' .* not a closed surface: edge \d+-\d+ at \(.*\), one triangle meets it",
        ),
        ([turned_part(ring(), [7])], r"not a closed surface: edge \d+-\d+ at \(.*the same way"),
        (
            [joined([ring(), placed(flipped(torus(31.0, 9.0, (17, 9))), FAR)])],
            r"is inside out, at edge \d+-\d+ at",
        ),
        ([flipped(ring())], r"is inside out, at edge \d+-\d+ at \("),
        (
            [pulled(ring(), 0, (-180.0, 10.0, 5.0))],
            r"crosses itself: edge \d+-\d+ at \(.*passes through triangle \d+",
        ),
        ([ring(), ring((90.3, 20.1, 4.7))], r"'0' and '1' overlap: edge \d+-\d+ at"),
        (
            [ring(), placed(box((7.0, 6.0, 5.0)), WITHIN)],
            r"'1' lies within that of shape '0', at edge \d+-\d+",
        ),
        (
            [joined([ring(), placed(box((7.0, 6.0, 5.0)), WITHIN)])],
            r"has a part within another, at edge \d+-\d+",
        ),
    ],
    ids=[
        "open",
        "turned",
        "part-inside-out",
        "inside-out",
        "self-crossing",
        "overlap",
        "nested",
        "nested-part",
    ],
)
def test_meshes_that_bound_no_body_are_refused_with_an_edge(parts, message):
    named = {str(number): cloud(str(number), mesh) for number, mesh in enumerate(parts)}
    with pytest.raises(InputError, match=message):
        check_bodies(loaded(sun=SUN, **named))


def test_a_hollow_cloud_and_a_cloud_in_its_hollow_are_taken():
    tubes = [torus(101.0, width, (23, 17)) for width in (41.0, 17.0, 5.0)]
    shell = joined([tubes[0], flipped(tubes[1])])
    check_bodies(loaded(sun=SUN, shell=cloud("shell", shell), core=cloud("core", tubes[2])))


@pytest.mark.parametrize(
    ("middle", "radius", "message"),
    [
        (FAR, 30.0, None),
        (WITHIN, 3.0, "one holds the other"),
        (WITHIN, 400.0, "one holds the other"),
        (WITHIN, 60.0, "'ring' and 'ball' overlap"),
        (BESIDE + 1.01 * FACET_NORMAL, 1.0, None),
        (BESIDE + 0.99 * FACET_NORMAL, 1.0, "'ring' and 'ball' overlap"),
    ],
    ids=["apart", "within", "around", "across", "beside-a-facet", "in-a-facet"],
)
def test_spheres_beside_meshes_that_are_not_convex(middle, radius, message):
    scene = loaded(sun=SUN, ring=cloud("ring", ring()), ball=ball("ball", middle, radius))
    if message is None:
        check_bodies(scene)
        return
    with pytest.raises(InputError, match=message):
        check_bodies(scene)


@pytest.mark.claim("media-refused")
@pytest.mark.parametrize("gap", [-0.01, 0.01])
@pytest.mark.parametrize(
    "pair",
    [
        lambda gap: (ball("a", (0, 0, 0), 0.7), ball("b", (1.2 + gap, 0, 0), 0.5)),
        lambda gap: (
            ball("a", (0, 0, 0), 0.7),
            cloud("b", placed(box((1.0, 1.2, 1.4)), (1.2 + gap, 0.1, 0))),
        ),
        # At an edge of the cube: its distance from the centre of the sphere
        # counts, not its planes'.
        lambda gap: (
            cloud(
                "a",
                placed(
                    box((1.0, 1.2, 1.4)), (*(np.array([0.5, 0.6]) + (0.7 + gap) / np.sqrt(2)), 0)
                ),
            ),
            ball("b", (0, 0, 0), 0.7),
        ),
        lambda gap: (
            cloud("a", box((1.0, 1.2, 1.4))),
            cloud("b", placed(box((1.0, 1.2, 1.4)), (1.0 + gap, 0.3, 0.2))),
        ),
        lambda gap: (
            cloud("a", icosphere(2)),
            cloud("b", placed(box((0.2, 0.3, 0.4)), (0, 0, 0) if gap < 0 else (3.0, 0, 0))),
        ),
    ],
    ids=["spheres", "facet", "edge", "boxes", "nested"],
)
def test_convex_bounds_overlap_as_soon_as_they_do(pair, gap):
    """Pairs at a distance known from their sizes."""
    a, b = pair(gap)
    scene = mi.load_dict({"type": "scene", "a": a, "b": b})
    if gap > 0:
        check_bodies(scene)
        return
    with pytest.raises(InputError, match=r"shapes '[ab]' and '[ab]' overlap"):
        check_bodies(scene)


@pytest.mark.parametrize("unit", [1e-7, 1e-6, 1e4])
def test_how_far_convex_bodies_overlap_has_no_unit(unit):
    """A solver with a tolerance of 1e-7 judged every other pair of micrometre bodies wrongly."""
    random = np.random.default_rng(0)

    def body(normals, centre, unit):
        offsets = unit * (1 + normals @ centre)
        return Bounds("body", normals, offsets, np.zeros((0, 3, 3)), unit * centre, 1.7 * unit)

    for _ in range(30):
        sides = random.standard_normal((2, 12, 3))
        sides /= np.linalg.norm(sides, axis=2, keepdims=True)
        faces = [np.concatenate([each, np.eye(3), -np.eye(3)]) for each in sides]
        middles = np.zeros(3), 1.2 * random.standard_normal(3)
        common = [
            _common_sphere(*(body(*each, scale) for each in zip(faces, middles))) / scale
            for scale in (1.0, unit)
        ]
        assert common[1] == pytest.approx(common[0], abs=1e-6)
