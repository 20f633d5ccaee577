# SPDX-License-Identifier: BSD-3-Clause
"""Closed meshes around clouds: what lies inside, and where a camera may be."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.closed_mesh import closed_mesh, encloses
from realtime.scene.read_scene import read_scene
from tests.helpers.clouds import DROPLETS, SUN, TURN, cloud, cloud_of, cloud_scene, loaded, ring
from validation.scenes.meshes import joined, placed, torus

pytestmark = pytest.mark.usefixtures("variant")


def flipped(mesh):
    return mesh[0], mesh[1][:, ::-1]


WITHIN = np.array([3.71, -0.13, 2.03]) + 101.37 * TURN[:, 0]  # in the middle of the tube of the ring


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
