# SPDX-License-Identifier: BSD-3-Clause
"""The published light volumes: closed meshes without gaps, whose crossings count how
often they surround the eye.
"""

from collections import Counter
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from airlight.realtime.methods.published.billeter2010.mesh import VolumeMesh, volume_mesh
from airlight.realtime.methods.published.billeter2010.raster import signed_crossings
from airlight.realtime.methods.published.billeter2010.tessellation import (
    RING,
    _first_corner,
    _ring_offset,
    configuration,
    divide,
    edges,
    quads,
    triangles,
)
from airlight.realtime.scene.camera import Camera, pixel_grid
from airlight.realtime.scene.read_scene import read_scene
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map
from tests.helpers.scenes import spot, tiny_scene

# Tessellation -------------------------------------------------------------------------------------


def tessellated_heights(height, divided: list[Any]):
    """Return the heights of the tessellation at every corner of the texels,
    to compare with `height`.
    """
    size = 2 ** len(divided)
    flat = np.array(height, dtype=float).ravel()
    result = flat.copy()
    for level, numbers, sides in quads(divided):
        if level == len(divided):
            continue  # texels keep their heights
        for sides_now in np.unique(sides):
            chosen = numbers[sides == sides_now]
            first, step = _first_corner(chosen, level, size)
            ring = first[:, None] + [_ring_offset(k, step, size) for k in range(8)]
            weights, offsets = _weights(configuration(int(sides_now)), step, size)
            # As many quads at a time as have about a million corners.
            batch = max(1, 2**20 // len(offsets))
            for start in range(0, len(chosen), batch):
                some = slice(start, start + batch)
                result[first[some, None] + offsets] = flat[ring[some]] @ weights.T
    return result.reshape(height.shape)


def _weights(fan, step: int, size: int):
    """Return the weights of the ring at all corners of the texels of a quad, and
    their numbers from its first.
    """
    row, column = (part.ravel() for part in np.mgrid[: step + 1, : step + 1])
    point = np.stack([column * 2 / step, row * 2 / step, np.ones(len(row))])
    weights = np.zeros((len(row), 8))
    for triangle in fan:
        corners = np.array([(*RING[k], 1) for k in triangle], dtype=float).T
        barycentric = np.linalg.solve(corners, point).T
        inside = np.all(barycentric > -1e-9, axis=1)
        weights[inside] = 0
        weights[np.ix_(inside, triangle)] = barycentric[inside]
    return weights, row * (size + 1) + column


def directed_edges(corners):
    return Counter(
        (int(a), int(b))
        for triangle in corners
        for a, b in zip(triangle, np.roll(triangle, -1), strict=True)
    )


def areas(points, corners):
    """Twice the signed areas."""
    a, b, c = (points[corners[:, k]] for k in range(3))
    (p, q), (r, s) = (b - a).T, (c - a).T
    return p * s - q * r


def grid_points(numbers, size: int):
    return np.stack([numbers % (size + 1), numbers // (size + 1)], axis=-1)


def random_edges(rng, *, faces: int, levels: int, fraction: float):
    return [rng.random((faces, 2**level, 2**level)) < fraction for level in range(levels)]


@pytest.mark.claim("no-t-junctions")
def test_meshes_of_random_divisions_have_no_gaps():
    rng = np.random.default_rng(4)
    configurations = set()
    size = 32
    for fraction in (0.02, 0.1, 0.3):
        divided = divide(random_edges(rng, faces=1, levels=5, fraction=fraction))
        for _, _, sides in quads(divided):
            configurations |= set(sides.tolist())
        corners = triangles(divided)
        points = grid_points(np.arange((size + 1) ** 2), size)
        area = areas(points, corners)
        assert np.all(area > 0)
        assert area.sum() == 2 * size**2
        seen = directed_edges(corners)
        assert set(seen.values()) == {1}
        for a, b in seen:
            on_border = np.any((points[a] == points[b]) & ((points[a] == 0) | (points[a] == size)))
            assert ((b, a) in seen) != on_border
    assert configurations == set(range(16))


@pytest.mark.claim("no-t-junctions")
def test_divided_sides_differ_by_one_level():
    """Seen through the depth of the quad at every texel, not through the flags."""
    rng = np.random.default_rng(7)
    edge = random_edges(rng, faces=1, levels=6, fraction=0.01)
    divided = divide(edge)
    depth = np.zeros((64, 64), int)
    for flags in divided:
        depth += np.kron(flags[0], np.ones((64 // flags.shape[1],) * 2, int))
    assert abs(np.diff(depth, axis=0)).max() == 1
    assert abs(np.diff(depth, axis=1)).max() == 1
    assert depth.min() < 5  # something was left to be coarse
    for level, flags in enumerate(edge):
        fine = depth.reshape(2**level, 64 >> level, 2**level, 64 >> level).min(axis=(1, 3))
        assert np.all(fine[flags[0]] > level)


def height_of(function, size: int):
    u = np.linspace(-1, 1, size + 1)
    return function(u[None, None, :], u[None, :, None]) + np.zeros((1, size + 1, size + 1))


@pytest.mark.claim("tessellation-threshold")
def test_errors_stay_a_small_multiple_of_the_threshold():
    def bumps(u, v):
        return 1 + 0.4 * np.sin(5 * u + 3 * v) * np.cos(7 * v) + (u * u + v * v < 0.3) * 0.5

    height = height_of(bumps, 128)
    counts = []
    for threshold in (1e-3, 1e-2, 1e-1):
        divided = divide(edges(height, threshold))
        error = abs(tessellated_heights(height, divided) / height - 1).max()
        # The errors of a corner and of those it was interpolated from add up; on a smooth surface
        # they fall by 4 from level to level, which makes 4/3, and a diagonal sees the derivatives
        # along both sides.
        assert threshold / 8 < error < 4 * threshold
        counts.append(len(triangles(divided)))
    assert counts[0] > 2 * counts[1] > 4 * counts[2]


# Meshes -------------------------------------------------------------------------------------------


def map_of(kind: str, size: int):
    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}))))
    return cast_shadow_map(scene.geometry, scene.lights[0], size), scene.lights[0]


def assert_closed(mesh):
    """Every edge has two triangles of opposite direction, and the surface is one
    sphere: no vertex twice.
    """
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


# Signs of the triangles that a ray crosses --------------------------------------------------------


WIDTH, HEIGHT = 11, 8


def make_camera(origin, target=(0.0, 0.0, 0.0), *, fov=50.0, size=(WIDTH, HEIGHT)):
    """Return a camera, in float64."""
    origin = np.asarray(origin, dtype=float)
    forward = np.asarray(target) - origin
    forward /= np.linalg.norm(forward)
    left = np.cross((0.137, 0.211, 1.0), forward)
    pixel = 2 * np.tan(0.5 * np.deg2rad(fov)) / size[0]
    left *= pixel / np.linalg.norm(left)
    vectors = (origin, forward, left, np.cross(forward, left))
    return opaque_camera(size, vectors)


def simple_camera():
    """Return a camera at the origin that looks along z and has the pixel (i, j) in the
    direction (5 - i, 4 - j, 1).
    """
    return opaque_camera((11, 9), ((0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0)))


def opaque_camera(size, vectors):
    """Return a camera of these vectors, in float64; all such cameras share their
    kernels, as the product's do.
    """
    arrays = [mi.Vector3d(*map(float, vector)) for vector in vectors]
    dr.make_opaque(arrays)
    return Camera(*size, arrays[0], tuple(arrays[1:]), grid=pixel_grid(*size))


def tetrahedron(points) -> VolumeMesh:
    """Return a tetrahedron with outward normals."""
    points = np.asarray(points, dtype=float)
    triangles = np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    outward = np.linalg.det(points[triangles]).sum() > 0
    return VolumeMesh(
        np.column_stack((points, np.ones(4))), triangles if outward else triangles[:, ::-1]
    )


def light_pyramid(inverse, *, apex=(0.2, -0.1, 2.3), aim=(0.1, 0.3, -1.0)) -> VolumeMesh:
    """Return the volume of a spot: a grid displaced to the inverse depths given, joined
    to the light at its edges.
    """
    side = len(inverse)
    axis = np.asarray(aim) / np.linalg.norm(aim)
    across = np.cross((1.0, 0.0, 0.0), axis)
    across *= 0.6 / np.linalg.norm(across)
    up = np.cross(axis, across)
    u = np.linspace(-1, 1, side)
    direction = axis + u[None, :, None] * across + u[:, None, None] * up
    s = np.asarray(inverse, dtype=float)[..., None]
    vertices = np.concatenate((direction + s * np.asarray(apex), s), axis=2).reshape(-1, 4)
    number = np.arange(side * side).reshape(side, side)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    quads = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, d), (a, d, c))]
    border = np.concatenate((number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]))
    ring = np.stack((np.roll(border, -1), border, np.full_like(border, side * side)), axis=1)
    # (across, up, axis) is right-handed: u to v turns towards the axis, away from the light.
    return VolumeMesh(np.vstack((vertices, (*apex, 1.0))), np.concatenate((*quads, ring)))


def winding_number(mesh: VolumeMesh, point) -> int | None:
    """Return how often a mesh surrounds a point, by its solid angle (Van Oosterom, Strackee
    1983); None if it is on it.

    Next to a triangle that a point is on (rounding apart), half of all
    directions end; there `top` is 0.
    """
    corner = mesh.vertices[:, :3] - mesh.vertices[:, 3:] * np.asarray(point)
    length = np.linalg.norm(corner, axis=1)
    if np.min(length) < 1e-9:
        return None
    a, b, c = np.moveaxis((corner / length[:, None])[mesh.triangles], 1, 0)
    top = np.sum(a * np.cross(b, c), axis=1)
    bottom = 1 + np.sum(a * b, axis=1) + np.sum(b * c, axis=1) + np.sum(c * a, axis=1)
    if np.any((np.abs(top) < 1e-9) & (bottom < 1e-9)):
        return None
    turns = 2 * np.arctan2(top, bottom).sum() / (4 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-6)
    return round(turns)


def check_signs(mesh: VolumeMesh, camera) -> None:
    inside = winding_number(mesh, np.array(camera.origin).ravel())
    if inside is None:
        return
    sums = np.zeros(camera.width * camera.height)
    for batch in signed_crossings(mesh, camera):
        assert np.all(np.array(batch.distance) >= 0)  # and so no NaN
        np.add.at(sums, np.array(batch.pixel), np.array(batch.sign))
    assert np.all(sums == inside)


coordinates = st.floats(-3, 3, allow_subnormal=False)
places = st.tuples(coordinates, coordinates, coordinates)
whole = st.integers(-4, 4)


@pytest.mark.claim("signs-add-up", tolerance="none: whole numbers")
@settings(max_examples=60, deadline=None)
@given(corners=st.lists(st.tuples(whole, whole, whole), min_size=4, max_size=4))
def test_signs_add_up_where_edges_pass_through_pixel_centres(variant, corners):
    """Corners at whole coordinates before a camera at 0: every edge and plane meets
    centres, or passes the camera.
    """
    corners = np.array(corners, dtype=float)
    assume(abs(np.linalg.det(corners[1:] - corners[0])) > 0.5)
    check_signs(tetrahedron(corners), simple_camera())


@pytest.mark.claim("signs-add-up", tolerance="none: whole numbers")
@settings(max_examples=60, deadline=None)
@given(
    inverse=st.lists(st.sampled_from((0.0, 0.05, 0.2, 0.21, 0.5, 4.0)), min_size=36, max_size=36),
    eye=places,
    aim=places,
)
def test_signs_add_up_for_light_volumes(variant, inverse, eye, aim):
    """With vertices at infinity and behind the camera, the camera in the
    light, in shadow, or beside.
    """
    assume(np.linalg.norm(np.subtract(eye, aim)) >= 1e-3)
    check_signs(light_pyramid(np.reshape(inverse, (6, 6))), make_camera(eye, aim, fov=100.0))
