# SPDX-License-Identifier: BSD-3-Clause
"""Meshes around clouds: what is refused, with the name of an edge, and what is taken."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.closed_mesh import closed_mesh, encloses
from realtime.scene.read_scene import read_scene
from tests.helpers.clouds import DROPLETS, SUN, TURN, cloud, cloud_of, cloud_scene, loaded, ring
from validation.scenes.meshes import box, joined, placed, torus

pytestmark = pytest.mark.usefixtures("variant")


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


FAR = (400.3, 20.1, -30.7)
WITHIN = np.array([3.71, -0.13, 2.03]) + 101.37 * TURN[:, 0]  # in the middle of the tube of the ring


@pytest.mark.claim("cloud-meshes-refused")
@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([(ring()[0], ring()[1][1:])], r"'0' .* not a closed surface: edge \d+-\d+ at \(.*\), one triangle meets it"),
        ([turned_part(ring(), [7])], r"not a closed surface: edge \d+-\d+ at \(.*the same way"),
        ([joined([ring(), placed(flipped(torus(31.0, 9.0, (17, 9))), FAR)])], r"is inside out, at edge \d+-\d+ at"),
        ([flipped(ring())], r"is inside out, at edge \d+-\d+ at \("),
        ([pulled(ring(), 0, (-180.0, 10.0, 5.0))], r"crosses itself: edge \d+-\d+ at \(.*passes through triangle \d+"),
        ([ring(), ring((90.3, 20.1, 4.7))], r"'0' and '1' overlap: edge \d+-\d+ at"),
        ([ring(), placed(box((7.0, 6.0, 5.0)), WITHIN)], r"'1' lies within that of shape '0', at edge \d+-\d+"),
        ([joined([ring(), placed(box((7.0, 6.0, 5.0)), WITHIN)])], r"has a part within another, at edge \d+-\d+"),
    ],
    ids=["open", "turned", "part-inside-out", "inside-out", "self-crossing", "overlap", "nested", "nested-part"],
)
def test_meshes_that_bound_no_body_are_refused_with_an_edge(parts, message):
    named = {str(number): cloud(str(number), mesh) for number, mesh in enumerate(parts)}
    with pytest.raises(InputError, match=message):
        read_scene(loaded(sun=SUN, **named))


def test_a_hollow_cloud_and_a_cloud_in_its_hollow_are_taken():
    shell = joined(
        [placed(torus(101.0, 41.0, (23, 17)), (0, 0, 0)), placed(flipped(torus(101.0, 17.0, (23, 17))), (0, 0, 0))]
    )
    core = placed(torus(101.0, 5.0, (23, 17)), (0, 0, 0))
    read = read_scene(loaded(sun=SUN, shell=cloud("shell", shell), core=cloud("core", core)))
    assert read.features.concave == ("shell", "core")
    mesh = closed_mesh("shell", *shell)
    assert [encloses(mesh, np.array([x, 0.3, 0.1])) for x in (101.0, 125.0, 150.0, 0.0)] == [False, True, False, False]


def test_a_camera_in_a_cloud_references_it():
    with pytest.raises(InputError, match="the camera is inside of shape 'ring'"):
        read_scene(mi.load_dict(cloud_scene(origin=tuple(WITHIN))))
    medium = mi.load_dict(DROPLETS)
    scene = cloud_scene(origin=tuple(WITHIN), sun=SUN, ring=cloud_of("ring", ring(), medium))
    scene["sensor"]["medium"] = medium
    assert read_scene(mi.load_dict(scene)).features.concave == ("ring",)
