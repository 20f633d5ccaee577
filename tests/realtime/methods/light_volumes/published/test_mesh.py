# SPDX-License-Identifier: BSD-3-Clause
"""The published mesh of a light volume is closed, whatever its levels of detail."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.methods.light_volumes.published.mesh import volume_mesh
from realtime.scene.read_scene import read_scene
from realtime.shadow_maps.shadow_map import cast_shadow_map
from tests.helpers.scenes import spot, tiny_scene


def map_of(kind: str, size: int):
    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}))))
    return cast_shadow_map(scene.geometry, scene.lights[0], size), scene.lights[0]


def assert_closed(mesh):
    """Every edge has two triangles of opposite direction, and the surface is one sphere: no vertex twice."""
    ends = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    count = len(mesh.vertices)
    keys = ends[:, 0] * count + ends[:, 1]
    assert len(np.unique(keys)) == len(keys)
    assert np.array_equal(np.sort(keys), np.sort(ends[:, 1] * count + ends[:, 0]))
    assert np.array_equal(np.unique(mesh.triangles), np.arange(count))
    assert count - len(keys) // 2 + len(mesh.triangles) == 2  # Euler


@pytest.mark.claim("closed-mesh")
@pytest.mark.parametrize("kind", ["point", "spot"])
@pytest.mark.parametrize("size", [4, 32])
@pytest.mark.parametrize("tessellation", ["static", "adaptive"])
def test_mesh_is_closed(variant, kind, size, tessellation):
    shadow_map, light = map_of(kind, size)
    mesh = volume_mesh(shadow_map, light, tessellation=tessellation)
    assert_closed(mesh)
    assert np.all(mesh.vertices[:, 3] >= 0)
    if tessellation == "static":
        cells = shadow_map.faces * size**2
        assert len(mesh.triangles) == 2 * cells + (4 * size if kind == "spot" else 0)
        assert len(mesh.vertices) == ((size + 1) ** 2 + 1 if kind == "spot" else cells + 2)
    elif size == 32:
        assert len(mesh.triangles) < shadow_map.faces * size**2
