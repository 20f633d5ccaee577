# SPDX-License-Identifier: BSD-3-Clause
"""Layers between light and camera are counted as triangles say; no ray slips through at an edge."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from realtime.methods.shadow_planes.plane_table import layers_between, light_basis
from realtime.scene.mesh_adjacency import make_occluders
from validation.scenes.meshes import grid


def count_between(occluders, light, camera):
    """Layers between two points, triangle by triangle: a closed component by its facing or its averted ones."""
    corner = occluders.vertices[occluders.triangles]
    edge, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    way = camera - light
    across = np.cross(way, other)
    scale = np.sum(edge * across, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        start = light - corner[:, 0]
        u = np.sum(start * across, axis=1) / scale
        turned = np.cross(start, edge)
        v = turned @ way / scale
        t = np.sum(other * turned, axis=1) / scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)
    total = 0
    for component, closed in enumerate(occluders.closed):
        mine = hit & (occluders.component == component)
        facing = int(np.sum(mine & (scale > 0)))
        total += max(facing, int(mine.sum()) - facing) if closed else int(mine.sum())
    return total


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), components=st.integers(1, 4))
def test_layers_between_light_and_camera(seed, components):
    rng = np.random.default_rng(seed)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    meshes = [
        ("closed", rng.normal(size=(4, 3)), faces if rng.random() < 0.5 else faces[:, ::-1]) for _ in range(components)
    ]
    meshes.append(("open", rng.normal(size=(9, 3)), np.arange(9).reshape(3, 3)))
    occluders = make_occluders(meshes)
    used = np.ones(len(occluders.closed), dtype=bool)
    for _ in range(4):
        light, camera = rng.normal(size=(2, 3)) * rng.choice([0.3, 1.0, 3.0], (2, 1))
        basis = light_basis(light, camera)
        assert layers_between(occluders, light, basis, used=used) == count_between(occluders, light, camera)
        assert layers_between(occluders, light, basis, used=~used) == 0


@pytest.mark.claim("no-ray-slips-through")
def test_axis_through_edges_and_vertices_counts_each_layer_once():
    """The axis runs through edges and vertices of a grid: of the triangles there one counts."""
    occluders = make_occluders([("grid", *grid((-1, -1, 0), (2, 0, 0), (0, 2, 0), (4, 4)))])
    used = np.ones(1, dtype=bool)
    for x, y in ((0, 0), (0.5, 0.5), (0.25, 0), (0, 0.25), (0.25, 0.25), (0.1, 0.3)):
        light, camera = np.array([x, y, 1.0]), np.array([x, y, -1.0])
        assert layers_between(occluders, light, light_basis(light, camera), used=used) == 1
