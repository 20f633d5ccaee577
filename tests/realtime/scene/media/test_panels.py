# SPDX-License-Identifier: BSD-3-Clause
"""Paths by a walk from facet to facet are those by all planes, and bounds hold what they
should; frames try panels.
"""

import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.numerics.array_types import aligned_array, array_types
from airlight.realtime.rays import ray_geometry
from airlight.realtime.scene.closed_mesh import (
    CELLS,
    Bounds,
    closed_mesh,
    holds,
    mean_distance,
    mesh_bounds,
    plane_neighbours,
    radial_planes,
    read_bounds,
)
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded import BoundedMedia
from airlight.realtime.scene.media.light_paths import LightPaths
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import Isotropic
from airlight.realtime.scene.read_media import make_bounded_medium
from airlight.validation.scenes.meshes import box, gem, icosphere, placed, prism, rotation, scaled

TURN = rotation((0.3, 1.0, 0.2), 27.3)
CENTRE = np.array([0.1, 0.2, 0.3])
#: Triangles with many at two corners; quads and two faces of twelve edges.
SOLIDS = {
    "gem": gem(13, 5),
    "ball": scaled(icosphere(2), (0.97, 0.79, 1.13)),
    "column": prism(np.array([[np.cos(a), np.sin(a)] for a in np.arange(12) * np.pi / 6]), 1.9),
}


def bounds_of(name):
    vertices, faces = placed(SOLIDS[name], CENTRE, TURN)
    return mesh_bounds(closed_mesh(name, vertices.astype(np.float32).astype(np.float64), faces))


@pytest.mark.parametrize("name", ["gem", "ball"])
def test_paths_to_points_by_a_walk_over_the_facets(variant, name):
    """Points anywhere: what a walk finds from facet to facet, and what all
    planes say of the same paths.
    """
    light, types = np.array([1.7, 0.4, 2.9]), array_types("double")
    body = make_bounded_medium(
        Homogeneous((types.scalar(1.0),), types.color(1.0), Isotropic()),
        bounds_of(name),
        types,
    )
    rng = np.random.default_rng(11)
    points = CENTRE + rng.normal(size=(4000, 3)) * 1.2
    start = types.vector(
        *(aligned_array(types.scalar, c) for c in (points - np.array(body.centre).ravel()).T)
    )
    for w, toward in (
        (1.0, light - np.array(body.centre).ravel()),
        (0.0, light / np.linalg.norm(light)),
    ):
        towards = types.vector(*(float(c) for c in toward))
        paths = LightPaths(body, w, towards, start, dr.zeros(types.vector))
        zero = types.scalar(0)
        r = dr.norm(towards - start) if w else types.scalar(1)
        lengths = (
            np.array(paths.length_at(zero, r)),
            np.array(paths.length(paths.envelopes_at(zero), zero, r)),
        )
        assert np.count_nonzero(lengths[1]) > 400
        assert lengths[0] == pytest.approx(lengths[1], abs=1e-12)


BOX_TURN = rotation((0.3, 1.0, 0.2), 27.3)


def bounds_of_mesh(mesh, name="solid"):
    vertices, faces = mesh
    return mesh_bounds(closed_mesh(name, vertices.astype(np.float32).astype(np.float64), faces))


def sphere_bounds(centre, radius):
    return Bounds(
        "sphere", np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3, 3)), np.array(centre), radius
    )


def test_a_body_of_micrometres_has_the_airlight_of_one_of_metres(variant):
    """Panels were 8 micrometres long at least, and went over facets in a small body."""
    types, (vertices, faces) = array_types("single"), placed(SOLIDS["gem"], CENTRE, TURN)
    vertices = vertices.astype(np.float32).astype(np.float64)
    aim = CENTRE + np.random.default_rng(5).normal(size=(64, 3)) * 0.3 - (3.0, 0.4, 0.5)

    def airlight(length):
        def vector(columns):
            return types.vector(*(aligned_array(types.scalar, column) for column in columns))

        def fog(sigma_t):
            return Homogeneous((dr.opaque(types.scalar, sigma_t),), types.color(1.0), Isotropic())

        bounds = mesh_bounds(closed_mesh("gem", length * vertices, faces))
        body = make_bounded_medium(fog(2.0 / length), bounds, types)
        medium = BoundedMedia(*vars(fog(0.0)).values(), bounded_media=(body,), clear=True)
        light = Light(types.vector(1.7 * length, 0.4 * length, 2.9 * length), types.color(1.0))
        origin = types.vector(3.0 * length, 0.4 * length, 0.5 * length)
        rays = medium.rays(origin, vector((aim / np.linalg.norm(aim, axis=1)[:, None]).T))
        lit = medium.lit(rays, light, ray_geometry(origin, rays.aim, light))
        ends = (dr.full(types.scalar, end, len(aim)) for end in (0.0, np.inf))
        return length**2 * np.array(lit.airlight(*ends), dtype=np.float64)

    metres = airlight(1.0)
    assert np.count_nonzero(metres[0]) > 8
    np.testing.assert_allclose(airlight(2.0**-16), metres, rtol=1e-5)


def test_what_the_half_spaces_hold_is_what_the_box_holds():
    half_spaces = bounds_of_mesh(placed(box((1.3, 0.7, 2.1)), (3.1, -2.3, 0.9), BOX_TURN))
    points = np.random.default_rng(5).uniform(-2, 2, (200, 3)) + np.array([3.1, -2.3, 0.9])
    own = (points - (3.1, -2.3, 0.9)) @ BOX_TURN
    expected = np.all(np.abs(own) < (0.65, 0.35, 1.05), axis=1)
    assert [holds(half_spaces, point) for point in points] == expected.tolist()
    assert 0 < expected.sum() < len(points)


def divided_box(divisions):
    """Return a cube whose faces are grids of triangles."""
    ends = np.linspace(-1, 1, divisions + 1)
    u, v = (part.ravel() for part in np.meshgrid(ends, ends))
    first = np.arange(len(u)).reshape(divisions + 1, -1)[:-1, :-1].ravel()
    right, up, across = first + 1, first + divisions + 1, first + divisions + 2
    quads = np.concatenate(
        [np.stack(corners, axis=1) for corners in ((first, right, across), (first, across, up))]
    )
    vertices, faces = [], []
    for axis in range(3):
        for side in (-1, 1):
            face = np.stack([np.full(len(u), side), u, v], axis=1)
            vertices.append(np.roll(face, axis, axis=1))
            faces.append((quads if side > 0 else quads[:, ::-1]) + len(u) * len(faces))
    return np.concatenate(vertices), np.concatenate(faces)


@pytest.mark.parametrize("divisions", [1, 40])
def test_facets_in_one_plane_are_one_half_space(divisions):
    """However finely a face is divided, and wherever float32 puts its vertices."""
    bounds = bounds_of_mesh(placed(divided_box(divisions), (31.0, -2.3, 0.9), BOX_TURN))
    assert len(bounds.offsets) == 6
    facing = [int(np.argmin(bounds.normals @ normal)) for normal in bounds.normals]
    neighbours = [sorted(set(range(6)) - {plane, facing[plane]}) for plane in range(6)]
    assert np.sort(plane_neighbours(bounds), axis=1).tolist() == neighbours


def test_a_dent_and_a_twist_are_not_convex():
    """All vertices of the twisted prism, of Schoenhardt, are those of its hull."""
    vertices, faces = icosphere(3)
    # a vertex of the sphere rises 3e-3 above its neighbours
    for depth, convex in ((3e-3, True), (2e-2, False)):
        dented = np.concatenate([vertices[:1] * (1 - depth), vertices[1:]])
        assert (bounds_of_mesh((dented, faces)) is not None) == convex
    column, sides = prism(
        np.array([[np.cos(a), np.sin(a)] for a in np.arange(3) * 2 * np.pi / 3]), 1.9
    )
    for turn, convex in ((0.0, True), (30.0, False), (-30.0, True)):
        top = column[:, 2] > column[:, 2].mean()
        turned = np.where(top[:, None], column @ rotation((0, 0, 1), turn).T, column)
        assert (bounds_of_mesh((turned, sides)) is not None) == convex, turn


def test_a_smooth_body_is_read_in_seconds():
    """81 920 facets: all pairs of facets and vertices took 12 minutes and 57 GB."""
    start = time.process_time()
    bounds = bounds_of_mesh(icosphere(6))
    assert plane_neighbours(bounds).shape == (81_920, 3)
    assert len(radial_planes(bounds)) == CELLS**3
    assert time.process_time() - start < 20


def test_mean_distance_of_a_sphere_is_six_fifths_of_its_radius():
    assert mean_distance(sphere_bounds((1.0, 2.0, 3.0), 0.83)) == pytest.approx(1.2 * 0.83)
    # 1280 facets lie within 0.5 % of the sphere, the sum over random pairs within
    # 0.2 % (one standard error).
    assert mean_distance(bounds_of_mesh(icosphere(3))) == pytest.approx(1.2, rel=0.01)


def test_a_sphere_far_from_the_origin_keeps_its_radius(variant):
    """Its float32 box has sides that differ by 1e-4 m at 2 km: it was refused as an ellipsoid."""
    centre, radius = [1999.25, -1400.0, 40.0], 0.600239158
    sphere = mi.load_dict({"type": "sphere", "center": centre, "radius": radius})
    bounds, mesh = read_bounds(sphere)
    assert mesh is None
    assert bounds.is_sphere
    assert bounds.centre == pytest.approx(centre, abs=1e-9)
    assert bounds.radius == pytest.approx(radius, rel=1e-7)
