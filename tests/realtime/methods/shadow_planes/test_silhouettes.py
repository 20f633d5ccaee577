# SPDX-License-Identifier: BSD-3-Clause
"""A silhouette counts the layers over every direction, of any triangles and any light."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from realtime.methods.shadow_planes.silhouettes import silhouette
from realtime.scene.mesh_adjacency import make_occluders
from tests.helpers.occluders import ALL

LIGHTS = {"aside": (2.9, -1.7, 2.3), "near": (0.31, 0.47, 0.71), "inside": (0.11, -0.05, 0.17)}

small = st.integers(-3, 3)
points = st.tuples(small, small, small)


def occluders_of(mesh):
    return make_occluders([("mesh", *mesh)])


def determinant(a, b, c):
    return np.einsum("...i,...i->...", a, np.cross(b, c))


def layers_over(occluders, light, way):
    """How many layers lie over a direction, triangle by triangle: those of a closed component that face the light."""
    a, b, c = (occluders.vertices[occluders.triangles[:, k]] - light for k in range(3))
    towards = -determinant(a, b, c)  # the normal is turned to the light if the corners run clockwise from outside
    sides = np.stack([determinant(p, q, way) for p, q in ((a, b), (b, c), (c, a))])
    hit = np.all(sides > 0, axis=0) | np.all(sides < 0, axis=0)
    # All corners lie on the far side of the light, or the three sides agree behind it.
    hit &= np.sign(determinant(a, b, c)) * sides[0] > 0
    counts = hit & ((towards > 0) | (~occluders.closed[occluders.component] & (towards != 0)))
    return int(counts.sum())


def layers_gained(occluders, contour, light, start, end):
    """What the silhouette says is gained on the way from one direction to another, along the shorter arc."""
    a, b = occluders.vertices[contour.edges[:, 0]] - light, occluders.vertices[contour.edges[:, 1]] - light
    across = np.sign(determinant(a, b, start)) - np.sign(determinant(a, b, end))
    within = determinant(start, end, a) * determinant(start, end, b) < 0
    # Two great circles meet twice: the arcs do if a crossing lies on the near side of both.
    crossing = np.cross(np.cross(a, b), np.cross(start, end))
    with np.errstate(invalid="ignore"):
        middle = a / np.linalg.norm(a, axis=1)[:, None] + b / np.linalg.norm(b, axis=1)[:, None]
    near = np.sum(crossing * middle, axis=-1) * np.sum(crossing * (start + end), axis=-1) > 0
    # As the light sees it, w is to the left of the way from a to b where det(a, b, w) < 0.
    return int(np.sum(contour.coefficient * across * (within & near)) / 2)


def random_directions(seed, count):
    ways = np.random.default_rng(seed).normal(size=(count, 3))
    return ways / np.linalg.norm(ways, axis=1)[:, None]


def assert_counts_layers(occluders, light, *, seed=3, count=12):
    light = np.asarray(light, dtype=float)
    contour = silhouette(occluders, light)
    ways = random_directions(seed, count)
    for start, end in pairwise(ways):
        change = layers_over(occluders, light, end) - layers_over(occluders, light, start)
        assert layers_gained(occluders, contour, light, start, end) == change


def assert_is_cycle(contour):
    balance: Counter = Counter()
    for (a, b), c in zip(contour.edges.tolist(), contour.coefficient.tolist()):
        balance[a] += c
        balance[b] -= c
    assert not any(balance.values())


@pytest.mark.claim("silhouettes-count-layers")
@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("name", ALL)
def test_silhouette_counts_layers(name, light):
    occluders = occluders_of(ALL[name]())
    assert_counts_layers(occluders, LIGHTS[light], count=30)
    assert_is_cycle(silhouette(occluders, np.array(LIGHTS[light])))


@pytest.mark.claim("silhouettes-count-layers")
@settings(max_examples=80, deadline=None)
@given(
    vertices=st.lists(points, min_size=4, max_size=9, unique=True),
    faces=st.lists(st.tuples(*3 * [st.integers(0, 8)]), min_size=1, max_size=14),
    light=points,
    seed=st.integers(0, 1000),
)
def test_any_triangles_and_any_light(vertices, faces, light, seed):
    """Whole numbers, so that lights lie in planes, on edges and on vertices, and triangles lie upon one another."""
    mesh = np.array(vertices, dtype=float), np.array(faces) % len(vertices)
    occluders = occluders_of(mesh)
    assume(len(occluders.triangles))
    assert_is_cycle(silhouette(occluders, np.array(light, dtype=float)))
    assert_counts_layers(occluders, light, seed=seed, count=4)
