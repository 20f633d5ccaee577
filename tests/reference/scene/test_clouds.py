# SPDX-License-Identifier: BSD-3-Clause
"""Claim: clouds are read from closed meshes alone; what has no place among them is refused by name."""

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.scene.clouds import read_clouds
from validation.scenes.meshes import icosphere, placed, torus
from validation.scenes.parts import camera, fog, medium_boundary, mitsuba_mesh, point_light, sky, sun


def cloud(mesh, name="puff"):
    return medium_boundary(name, mesh, fog(0.7, (0.9, 0.9, 0.9)))


def read(**parts):
    usual = {
        "sensor": camera((0.3, -7.1, 0.7), (0, 0, 0), fov=41.0, size=(4, 3), in_fog=False),
        "sun": sun((0.1, 0.2, -0.9), (1.3, 1.1, 0.9)),
    }
    return read_clouds(mi.load_dict({"type": "scene"} | {k: v for k, v in (usual | parts).items() if v is not None}))


def test_non_convex_and_several_clouds_are_read(variant):
    clouds = read(a=cloud(torus(0.9, 0.3, (17, 9)), "a"), b=cloud(placed(icosphere(1), (2.9, 0, 0)), "b"))
    assert [each.name for each in clouds.clouds] == ["a", "b"]
    assert clouds.camera_cloud == -1
    inside = read(puff=cloud(torus(0.9, 0.3, (17, 9))), b=None)
    assert len(inside.suns) == 1


def test_other_lights_and_scenes_without_clouds_are_refused(variant):
    ball = icosphere(1)
    with pytest.raises(InputError, match="light 'lamp' is a PointLight; clouds are lit by"):
        read(puff=cloud(ball), lamp=point_light((0, 0, 4), (1.0, 1.1, 1.2)))
    with pytest.raises(InputError, match="the scene has no cloud"):
        read(a=mitsuba_mesh("solid", ball, (0.3, 0.4, 0.5)))
    with pytest.raises(InputError, match="no light; wanted"):
        read(puff=cloud(ball), sun=None)
    np.testing.assert_allclose(read(puff=cloud(ball), sky=sky((0.1, 0.2, 0.3))).sky, (0.1, 0.2, 0.3), rtol=1e-6)
