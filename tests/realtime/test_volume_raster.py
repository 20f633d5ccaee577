# SPDX-License-Identifier: BSD-3-Clause
"""The sum of signs is exact for every closed mesh, the distances are those of an intersection in another form."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

WIDTH, HEIGHT = 11, 8


class Mesh(NamedTuple):
    vertices: np.ndarray
    triangles: np.ndarray


def make_camera(origin, target=(0.0, 0.0, 0.0), *, fov=50.0, size=(WIDTH, HEIGHT)):
    import mitsuba as mi

    from realtime.camera import Camera

    origin = np.asarray(origin, dtype=float)
    forward = np.asarray(target) - origin
    forward /= np.linalg.norm(forward)
    left = np.cross((0.1, 0.2, 1.0), forward)
    pixel = 2 * np.tan(0.5 * np.deg2rad(fov)) / size[0]
    left *= pixel / np.linalg.norm(left)
    vectors = (origin, forward, left, np.cross(forward, left), *np.zeros((3, 3)))
    return Camera(*size, *(mi.Vector3d(*map(float, vector)) for vector in vectors))


def simple_camera():
    """Return a camera at the origin that looks along z and has the pixel (i, j) in the direction (5 - i, 4 - j, 1)."""
    import mitsuba as mi

    from realtime.camera import Camera

    vectors = ((0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), *[(0, 0, 0)] * 3)
    return Camera(11, 9, *(mi.Vector3d(*map(float, vector)) for vector in vectors))


def closed_mesh(vertices, triangles) -> Mesh:
    """Return a mesh with outward normals from one that is closed and oriented either way; w may be given or not."""
    vertices, triangles = np.asarray(vertices, dtype=float), np.asarray(triangles)
    if vertices.shape[1] == 3:
        vertices = np.column_stack((vertices, np.ones(len(vertices))))
    points = vertices[triangles][..., :3]
    volume = np.linalg.det(points).sum()
    return Mesh(vertices, triangles if volume > 0 else triangles[:, ::-1])


def tetrahedron(points) -> Mesh:
    return closed_mesh(points, [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])


def light_pyramid(inverse, *, apex=(0.2, -0.1, 2.3), aim=(0.1, 0.3, -1.0)) -> Mesh:
    """Return the volume of a spot: a grid displaced to the inverse depths given, joined to the light at its edges."""
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
    return Mesh(np.vstack((vertices, (*apex, 1.0))), np.concatenate((*quads, ring)))


def winding_number(mesh: Mesh, point) -> int | None:
    """Return how often a mesh surrounds a point, by its solid angle (Van Oosterom, Strackee 1983); None if it is on it.

    Next to a triangle that a point is on (rounding apart), half of all directions end; there `top` is 0.
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


def found_crossings(mesh, camera, **settings):
    """Return pixel, distance and sign of all crossings, sorted by pixel and distance."""
    from realtime.volume_raster import signed_crossings

    batches = list(signed_crossings(mesh, camera, **settings))
    if not batches:
        return np.zeros(0, dtype=int), np.zeros(0), np.zeros(0)
    pixel, distance, sign = (
        np.concatenate([np.array(getattr(found, name)) for found in batches]) for name in ("pixel", "distance", "sign")
    )
    order = np.lexsort((distance, pixel))
    return pixel[order].astype(int), distance[order], sign[order]


def sums_of_signs(mesh, camera, **settings):
    pixel, distance, sign = found_crossings(mesh, camera, **settings)
    assert np.all(distance >= 0)  # and so no NaN
    return np.bincount(pixel, weights=sign, minlength=camera.width * camera.height)


def check_signs(mesh: Mesh, camera) -> None:
    inside = winding_number(mesh, np.array(camera.origin).ravel())
    if inside is not None:
        assert np.all(sums_of_signs(mesh, camera) == inside)


coordinates = st.floats(-3, 3, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates)
whole = st.integers(-4, 4)


@settings(max_examples=60, deadline=None)
@given(corners=st.lists(points, min_size=4, max_size=4), eye=points)
def test_signs_add_up_for_tetrahedra(variant, corners, eye):
    corners = np.array(corners)
    if abs(np.linalg.det(corners[1:] - corners[0])) < 1e-6 or np.linalg.norm(eye) < 1e-3:
        return
    check_signs(tetrahedron(corners), make_camera(eye))


@settings(max_examples=60, deadline=None)
@given(corners=st.lists(st.tuples(whole, whole, whole), min_size=4, max_size=4))
def test_signs_add_up_where_edges_pass_through_pixel_centres(variant, corners):
    """Corners at whole coordinates before a camera at 0: every edge and plane meets centres, or passes the camera."""
    corners = np.array(corners, dtype=float)
    if abs(np.linalg.det(corners[1:] - corners[0])) > 0.5:
        check_signs(tetrahedron(corners), simple_camera())


@settings(max_examples=60, deadline=None)
@given(
    inverse=st.lists(st.sampled_from((0.0, 0.05, 0.2, 0.21, 0.5, 4.0)), min_size=36, max_size=36),
    eye=points,
    aim=points,
)
def test_signs_add_up_for_light_volumes(variant, inverse, eye, aim):
    """With vertices at infinity and behind the camera, the camera in the light, in shadow, or beside."""
    if np.linalg.norm(np.subtract(eye, aim)) < 1e-3:
        return
    check_signs(light_pyramid(np.reshape(inverse, (6, 6))), make_camera(eye, aim, fov=100.0))


def test_a_camera_in_the_light_and_one_outside(variant):
    mesh = light_pyramid(np.full((5, 5), 0.0))
    assert winding_number(mesh, (0.2, 0.0, 0.0)) == 1
    assert np.all(sums_of_signs(mesh, make_camera((0.2, 0.0, 0.0), (5, 1, 0))) == 1)
    assert np.all(sums_of_signs(mesh, make_camera((3.0, 3.0, 2.5), (0, 0, 0))) == 0)
    beyond = found_crossings(mesh, make_camera((0.2, 0.0, 0.0), (0.2, 0.1, -1.0), fov=10.0))
    assert np.all(np.isinf(beyond[1]))
    assert len(beyond[1]) == WIDTH * HEIGHT


def test_every_pixel_of_a_shared_edge_belongs_to_one_triangle(variant):
    """A square of two triangles with all edges and the diagonal through pixel centres, as rasterizers are tested."""
    square = np.array([(-3, -2, 1, 1), (2, -2, 1, 1), (2, 3, 1, 1), (-3, 3, 1, 1)], dtype=float)
    for triangles in ([(0, 1, 2), (0, 2, 3)], [(1, 2, 3), (1, 3, 0)]):
        pixel, distance, sign = found_crossings(Mesh(square, np.array(triangles)), simple_camera())
        # Columns 5 - x and rows 4 - y; the left and upper edges belong to the square.
        columns, rows = np.meshgrid(np.arange(3, 8), np.arange(1, 6))
        assert np.array_equal(pixel, np.sort((rows * 11 + columns).ravel()))
        assert distance == pytest.approx(np.sqrt(1 + (5 - pixel % 11) ** 2 + (4 - pixel // 11) ** 2.0), rel=1e-15)
        assert np.all(sign == 1)  # the normal is +z, along the view


def test_distances_are_those_of_an_intersection(variant):
    """Against Moller and Trumbore's test in float64, ray by ray, for a volume that surrounds part of the camera."""
    rng = np.random.default_rng(3)
    mesh = light_pyramid(rng.uniform(0.1, 0.6, (9, 9)))
    camera = make_camera((0.4, 0.3, 0.2), (1.0, 0.5, -2.0), fov=80.0)
    origin, forward, left, up = (np.array(v).ravel() for v in (camera.origin, camera.forward, camera.left, camera.up))
    row, column = np.divmod(np.arange(WIDTH * HEIGHT), WIDTH)
    ray = forward + (5 - column)[:, None] * left + (3.5 - row)[:, None] * up
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    corner = (mesh.vertices[:, :3] / mesh.vertices[:, 3:])[mesh.triangles]
    e1, e2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    p = np.cross(ray[:, None], e2)
    determinant = np.sum(p * e1, axis=2)
    offset = origin - corner[:, 0]
    u = np.sum(p * offset, axis=2) / determinant
    q = np.cross(offset, e1)
    v = np.sum(ray[:, None] * q, axis=2) / determinant
    x = np.sum(e2 * q, axis=1) / determinant
    number, triangle = np.nonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (x > 0))
    order = np.lexsort((x[number, triangle], number))
    pixel, distance, sign = found_crossings(mesh, camera)
    assert np.array_equal(pixel, number[order])
    assert len(pixel) > 100
    # Rounding is 1e-16 of coordinates of up to 10 m, over the sine of the angle to the plane, 1e-3 at the least here.
    assert distance == pytest.approx(x[number, triangle][order], rel=1e-11)
    assert np.array_equal(sign, -np.sign(determinant[number, triangle][order]))


def test_batches_change_nothing(variant):
    mesh = light_pyramid(np.random.default_rng(4).choice((0.0, 0.2, 0.7), (9, 9)))
    camera = make_camera((2.4, 0.3, 0.2), (0.1, 0.5, -1.0))
    whole_run, pieces = found_crossings(mesh, camera), found_crossings(mesh, camera, batch=7)
    for one, other in zip(whole_run, pieces):
        assert np.array_equal(one, other)
    assert len(whole_run[0]) > 100


def test_a_mesh_out_of_sight_has_no_crossings(variant):
    from realtime.volume_raster import signed_crossings

    mesh = light_pyramid(np.full((5, 5), 0.5))
    assert list(signed_crossings(mesh, make_camera((0.0, 9.0, 0.0), (0.0, 19.0, 0.0)))) == []


@pytest.mark.parametrize("kind", ["point", "spot"])
@pytest.mark.parametrize("order", ["image", "tiles"])
def test_sum_over_a_convex_volume_is_one_integral(variant, kind, order):
    """A ray meets a tetrahedron in one interval: clipped by its four planes, not by crossings."""
    import drjit as dr
    import mitsuba as mi

    from realtime.camera import ray_directions, tiled_pixels
    from realtime.geometry import ray_geometry
    from realtime.kernels import airlight_integral
    from realtime.kernels.exact import exact
    from realtime.lights import Light
    from realtime.medium import Medium
    from realtime.phase import Phase
    from realtime.volume_raster import crossing_sum, signed_crossings

    corners = np.array([(0.1, 0.2, 1.9), (1.1, -0.8, -0.9), (-1.2, -0.7, -1.1), (0.1, 1.3, -0.8)])
    camera = make_camera((1.9, -2.3, 0.4), size=(32, 24))
    pixel = mi.UInt32(tiled_pixels(32, 24) if order == "tiles" else np.arange(32 * 24, dtype=np.uint32))
    lane = mi.UInt32(np.argsort(np.array(pixel)).astype(np.uint32)) if order == "tiles" else None
    direction, low = ray_directions(camera, pixel)
    rays = np.array(direction).T
    begin, end = np.zeros(len(rays)), np.full(len(rays), 3.1)  # the visible surface cuts some of the intervals
    for k in range(4):
        a, b, c, inner = np.roll(corners, -k, axis=0)
        normal = np.cross(b - a, c - a)
        normal *= np.sign(normal @ (inner - a))
        along, height = rays @ normal, (np.array(camera.origin).ravel() - a) @ normal
        begin = np.where(along > 0, np.maximum(begin, -height / along), begin)
        end = np.where(along < 0, np.minimum(end, -height / along), end)
    assert np.mean(end > begin) > 0.1
    assert np.any((end > begin) & (end == 3.1))
    cone = {"axis": mi.Vector3d(0.1, 0.2, -1.0) / np.sqrt(1.05), "cutoff": mi.Float64(0.45)}
    cone |= {"cos_cutoff": dr.cos(cone["cutoff"]), "cos_beam": dr.cos(cone["cutoff"])}
    arrays = {"position": mi.Vector3d(0.1, 0.2, 1.9), "intensity": mi.Color3d(1)}
    light = Light(kind, False, **arrays, **(cone if kind == "spot" else {}))
    medium = Medium((mi.Float64(0.4),), mi.Color3d(1), Phase("isotropic"))
    geometry = ray_geometry(camera.origin, direction, light, low=low)
    settings = {"medium": medium, "light": light}
    wanted = airlight_integral(exact, geometry, mi.Float64(begin), mi.Float64(np.maximum(begin, end)), **settings)
    batches = signed_crossings(tetrahedron(corners), camera)
    distance = mi.Float64(np.full(len(rays), 3.1))
    found = crossing_sum(batches, kernel=exact, geometry=geometry, distance=distance, lane=lane, **settings)
    # The nodes of J(0, x) and J(begin, end) differ; the kernel promises 1e-6 of each.
    assert np.array(found) == pytest.approx(np.array(wanted), abs=2e-6 * np.max(np.array(wanted)))
    assert np.max(np.array(wanted)) > 0.05
