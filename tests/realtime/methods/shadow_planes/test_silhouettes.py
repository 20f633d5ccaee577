# SPDX-License-Identifier: BSD-3-Clause
"""Silhouettes count the layers over every direction; layers before the camera are
counted as triangles say.
"""

from collections import Counter
from itertools import pairwise

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from airlight.errors import InputError
from airlight.realtime.methods.shadow_planes.plane_table import (
    index_planes,
    layers_between,
    light_basis,
)
from airlight.realtime.methods.shadow_planes.silhouettes import components_in_view, silhouette
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.scene.camera import read_camera
from airlight.realtime.scene.mesh_adjacency import make_occluders
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import grid, joined, placed, rotation
from tests.helpers.occluders import ALL, closed_sphere
from tests.helpers.scenes import tiny_scene

LIGHTS = {"aside": (2.9, -1.7, 2.3), "near": (0.31, 0.47, 0.71), "inside": (0.11, -0.05, 0.17)}

small = st.integers(-3, 3)
points = st.tuples(small, small, small)


def occluders_of(mesh):
    return make_occluders([("mesh", *mesh)])


def determinant(a, b, c):
    return np.einsum("...i,...i->...", a, np.cross(b, c))


def layers_over(occluders, light, way):
    """How many layers lie over a direction, triangle by triangle: those of a closed
    component that face the light.
    """
    a, b, c = (occluders.vertices[occluders.triangles[:, k]] - light for k in range(3))
    # the normal is turned to the light if the corners run clockwise from outside
    towards = -determinant(a, b, c)
    sides = np.stack([determinant(p, q, way) for p, q in ((a, b), (b, c), (c, a))])
    hit = np.all(sides > 0, axis=0) | np.all(sides < 0, axis=0)
    # All corners lie on the far side of the light, or the three sides agree behind it.
    hit &= np.sign(determinant(a, b, c)) * sides[0] > 0
    counts = hit & ((towards > 0) | (~occluders.closed[occluders.component] & (towards != 0)))
    return int(counts.sum())


def layers_gained(occluders, contour, light, start, end):
    """Layers gained, by the silhouette, on the way from one direction to
    another along the shorter arc.
    """
    a, b = (
        occluders.vertices[contour.edges[:, 0]] - light,
        occluders.vertices[contour.edges[:, 1]] - light,
    )
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
    """Whole numbers, so that lights lie in planes, on edges and on vertices, and
    triangles lie upon one another.
    """
    mesh = np.array(vertices, dtype=float), np.array(faces) % len(vertices)
    occluders = occluders_of(mesh)
    assume(len(occluders.triangles))
    assert_is_cycle(silhouette(occluders, np.array(light, dtype=float)))
    assert_counts_layers(occluders, light, seed=seed, count=4)


def heap_of_balls():
    """Return many balls that touch and run into one another, one component each."""
    ways = random_directions(7, 9)
    return joined(
        [placed(closed_sphere(1), 0.5 * way, rotation((1, 0.3, 0.2), 40.0)) for way in ways]
    )


SUMMED = {
    "heap of balls": heap_of_balls,
    "open strip": ALL["open grid"],
    "four-fold edge": ALL["boxes sharing an edge"],
    "Moebius strip": ALL["Moebius strip"],
    "mixed winding": ALL["mixed winding"],
    "torus": ALL["torus"],
}
PLACES = {name: (*light, 1.0) for name, light in LIGHTS.items()} | {"sun": (0.3, -0.5, 0.8, 0.0)}


@pytest.mark.claim("silhouettes-count-layers")
@pytest.mark.parametrize("light", PLACES)
@pytest.mark.parametrize("name", SUMMED)
def test_a_coefficient_is_the_sum_over_the_triangles_at_an_edge(name, light):
    """The definition, c_e = sum_t s_te w_t, summed edge by edge and triangle by triangle."""
    occluders = occluders_of(SUMMED[name]())
    place = np.array(PLACES[light])
    expected: Counter = Counter()
    for corners, component in zip(occluders.triangles.tolist(), occluders.component, strict=True):
        a, b, c = occluders.vertices[corners]
        front = int(np.sign(np.cross(b - a, c - a) @ (place[:3] - place[3] * a)))
        weight = max(front, 0) if occluders.closed[component] else front
        for tail, head in ((0, 1), (1, 2), (2, 0)):
            edge = corners[tail], corners[head]
            expected[min(edge), max(edge)] += weight if edge[0] < edge[1] else -weight
    contour = silhouette(occluders, place)
    summed = dict(
        zip(map(tuple, contour.edges.tolist()), contour.coefficient.tolist(), strict=True)
    )
    assert summed == {edge: value for edge, value in expected.items() if value}
    assert summed or light == "inside"


def test_edges_of_more_layers_than_a_plane_has_room_for_are_refused(variant):
    """Pages of a book that meet at its spine: the light sees the fronts of all of them."""
    angle = np.linspace(0.1, 0.4, 40)
    pages = np.stack([np.cos(angle), np.sin(angle), np.zeros(40)], axis=1)
    vertices = np.concatenate([[[0, 0, -0.5], [0, 0, 0.5]], pages])
    faces = [(0, 1, 2 + page) for page in range(40)]
    used = np.ones(1, dtype=bool)
    light, camera = np.array([0.1, 3.0, 0.2]), np.array([3.0, 0.1, 0.4])
    few, many = (make_occluders([("book", vertices, faces[:count])]) for count in (31, 40))
    assert silhouette(few, light).coefficient.max() == 31
    index_planes(few, light, camera, used=used, types=array_types("single"))
    with pytest.raises(InputError, match=r"40 layers; expected .* of 31: use simpler occluders"):
        index_planes(many, light, camera, used=used, types=array_types("single"))


# Layers between light and camera ------------------------------------------------------------------


def count_between(occluders, light, camera):
    """Layers between two points, triangle by triangle: a closed component by its
    facing or its averted ones.
    """
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
        ("closed", rng.normal(size=(4, 3)), faces if rng.random() < 0.5 else faces[:, ::-1])
        for _ in range(components)
    ]
    meshes.append(("open", rng.normal(size=(9, 3)), np.arange(9).reshape(3, 3)))
    occluders = make_occluders(meshes)
    used = np.ones(len(occluders.closed), dtype=bool)
    for _ in range(4):
        light, camera = rng.normal(size=(2, 3)) * rng.choice([0.3, 1.0, 3.0], (2, 1))
        basis = light_basis(light, camera)
        assert layers_between(occluders, light, basis, used=used) == count_between(
            occluders, light, camera
        )
        assert layers_between(occluders, light, basis, used=~used) == 0


@pytest.mark.claim("no-ray-slips-through")
def test_axis_through_edges_and_vertices_counts_each_layer_once():
    """The axis runs through edges and vertices of a grid: of the triangles there one counts."""
    occluders = make_occluders([("grid", *grid((-1, -1, 0), (2, 0, 0), (0, 2, 0), (4, 4)))])
    used = np.ones(1, dtype=bool)
    for x, y in ((0, 0), (0.5, 0.5), (0.25, 0), (0, 0.25), (0.25, 0.25), (0.1, 0.3)):
        light, camera = np.array([x, y, 1.0]), np.array([x, y, -1.0])
        assert layers_between(occluders, light, light_basis(light, camera), used=used) == 1


# No occluder is left out whose shadow is seen -----------------------------------------------------


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
    # A third at least has its shadow elsewhere: the test is worth its time only if
    # there is something to drop.
    assert dropped > 100
