# SPDX-License-Identifier: BSD-3-Clause
"""No occluder is left out whose shadow is seen."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.methods.shadow_planes.silhouettes import components_in_view
from realtime.scene.camera import read_camera
from realtime.scene.mesh_adjacency import make_occluders
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene


def camera_at(origin, target, size=(40, 30)):
    scene = tiny_scene(size=size, ball=None, floor=None)
    look = mi.ScalarTransform4f().look_at(list(origin), list(target), [0.1, 0.3, 1])
    scene["sensor"] = scene["sensor"] | {"to_world": look}
    return read_camera(read_scene(mi.load_dict(scene)).camera)


def sees(camera, points):
    """Whether points lie in the image: along the ray through a pixel, by projection."""
    origin, forward, left, up = camera.origin, camera.forward, camera.left, camera.up
    away = points - origin
    depth = away @ forward
    across = away @ left / (left @ left) / np.where(depth > 0, depth, np.inf)
    upward = away @ up / (up @ up) / np.where(depth > 0, depth, np.inf)
    return (depth > 0) & (np.abs(across) < camera.width / 2) & (np.abs(upward) < camera.height / 2)


def boxes(rng, count):
    """Boxes of triangles, one a component."""
    corners = np.array([[i >> k & 1 for k in range(3)] for i in range(8)], dtype=float)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]])
    meshes = []
    for number in range(count):
        size, place = rng.uniform(0.1, 1.2, 3), rng.normal(size=3) * 3
        meshes.append((f"box {number}", corners * size + place, faces))
    return make_occluders(meshes)


@pytest.mark.claim("culled-occluders")
@pytest.mark.parametrize("w", [1.0, 0.0])
def test_no_component_is_dropped_whose_shadow_is_seen(variant, w):
    """From a light with a place, and from one at infinity in this direction."""
    rng = np.random.default_rng(11)
    dropped = 0
    for _ in range(40):
        occluders = boxes(rng, 8)
        light, origin, target = rng.normal(size=(3, 3)) * 3
        camera = camera_at(origin, target)
        used = components_in_view(occluders, camera, np.append(light, w))
        for component, (low, high) in enumerate(occluders.boxes):
            points = rng.uniform(low, high, (4000, 3))
            beyond = rng.exponential(3, (len(points), 1)) * (rng.random((len(points), 1)) < 0.9)
            if sees(camera, points + beyond * (w * points - light)).any():
                assert used[component]
        dropped += int(np.sum(~used))
    # A third at least has its shadow elsewhere: the test is worth its time only if there is something to drop.
    assert dropped > 100
