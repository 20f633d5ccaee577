# SPDX-License-Identifier: BSD-3-Clause
"""The published mesh of a light volume is closed, whatever its levels of detail."""

import numpy as np
import pytest

from tests.helpers.scenes import spot, tiny_scene

KINDS = ["point", "spot"]
TESSELLATIONS = ["static", "adaptive"]


def map_of(kind: str, size: int, **changes):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.shadow_map import cast_shadow_map

    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}), **changes)))
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
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [4, 32])
@pytest.mark.parametrize("tessellation", TESSELLATIONS)
def test_mesh_is_closed(variant, kind, size, tessellation):
    from realtime.methods.light_volumes.published.mesh import volume_mesh

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


def random_cube(size: int, seed: int):
    """Return a map of six faces with random edges everywhere, also across the borders of faces."""
    import mitsuba as mi

    from realtime.methods.light_volumes.published.mesh import _welds
    from realtime.shadow_maps.projection import Projection
    from realtime.shadow_maps.shadow_map import ShadowMap

    rng = np.random.default_rng(seed)
    side = size + 1
    coarse = np.kron(rng.uniform(1, 3, (6, 4, 4)), np.ones((size // 4, size // 4)))
    distance = np.pad(coarse, ((0, 0), (0, 1), (0, 1)), "edge")
    distance = np.where(rng.random((6, side, side)) < 3 / size**2, 0.5, distance).ravel()
    twin, original = _welds(size)
    distance[twin] = distance[original]
    return ShadowMap(size, mi.Float(distance), Projection(None))


@pytest.mark.claim("closed-mesh")
@pytest.mark.parametrize("seed", range(2))
def test_faces_are_welded_without_cracks_whatever_the_levels(variant, seed):
    from realtime.methods.light_volumes.published.mesh import volume_mesh

    _, light = map_of("point", 4)
    shadow_map = random_cube(64, seed)
    mesh = volume_mesh(shadow_map, light, tessellation="adaptive", threshold=0.2)
    assert_closed(mesh)
    static = volume_mesh(shadow_map, light)
    assert_closed(static)
    assert len(mesh.triangles) < 0.9 * len(static.triangles)
    # The vertices of faces of different handedness still look outwards.
    place = np.array(light.position, dtype=float).ravel()
    points = mesh.vertices[:, :3] / mesh.vertices[:, 3:] - place
    a, b, c = (points[mesh.triangles[:, k]] for k in range(3))
    assert np.all(np.linalg.det(np.stack([a, b, c], axis=1)) > 0)
