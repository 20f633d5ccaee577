# SPDX-License-Identifier: BSD-3-Clause
"""Light maps of clouds, and the collector search on shapes and with transports
whose fixed points are known.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.clouds.collector_search import Search, cold_start, collector_light
from airlight.realtime.clouds.light_maps import (
    LitSurfaces,
    cast_surfaces,
    filtered_map,
    filtered_surface,
    light_map,
    slope_normals,
)
from airlight.realtime.numerics.array_types import aligned_array
from airlight.validation.scenes.meshes import box, rotation
from airlight.validation.scenes.parts import medium_boundary
from tests.helpers.frames import read
from tests.helpers.scenes import clear_scene
from tests.helpers.sunlit import ALONG, SIDES, cube, sun, unit
from tests.helpers.sunlit import CUBE_AT as MIDDLE

SIZE = 64


def _cube_map(precision="single", *, size=SIZE, direction=ALONG):
    scene = read(clear_scene(lamp=sun(direction), cube=cube()), precision)
    cloud = mi.load_dict({"type": "scene", "cloud": cube()})
    surfaces = cast_surfaces(cloud, scene.lights[0], size)
    return surfaces, filtered_map([surfaces], scene.lights[0])


def _vectors(points):
    columns = np.asarray(points, dtype=np.float64).reshape(-1, 3).T
    return mi.Vector3f(*(aligned_array(mi.Float, column) for column in columns))


@pytest.mark.claim("collector-slopes", tolerance="1e-4 of the cosine, against 0.05 by unit normals")
def test_normals_of_levels_are_those_of_mean_slopes(variant):
    """Through a saw tooth whose steep sides hide, the mean plane is level: unit
    normals lean to the light.
    """
    scene = read(clear_scene(lamp=sun((0.0, 0.0, -1.0)), cube=cube()), "single")
    basis = filtered_map([_saw()], scene.lights[0]).projection.basis
    width = 2 * float(np.linalg.norm(np.array(basis[0]))) / SIZE
    light_map = filtered_map([_saw(width)], scene.lights[0])
    surface = filtered_surface(light_map, mi.Vector3f(light_map.position), mi.Float(4 * width))
    assert float(np.array(surface.normal).ravel() @ -np.array(basis[2]).ravel()) > 0.9999


def _saw(width=1.0):
    """Return a surface that rises by a texel's width a texel, eight texels long,
    and falls back in a step.
    """
    count = SIZE * SIZE
    column = np.arange(count) % SIZE
    return LitSurfaces(
        SIZE,
        mi.UInt32(np.arange(count, dtype=np.uint32)),
        mi.Bool(np.ones(count, dtype=bool)),
        mi.Float(200.0 + width * (column % 8)),
        mi.Float(np.full(count, 100.0)),
    )


def test_levels_are_means_over_the_cloud_alone(variant):
    """A premultiplied mean leaves out what lies beside the cloud, and knows where the rest is."""
    surfaces, light_map = _cube_map()
    in_rows = np.argsort(np.array(surfaces.place))
    parts = (np.array(value)[in_rows] for value in (surfaces.there, surfaces.front, surfaces.back))
    there, front, back = (part.reshape(SIZE, SIZE) for part in parts)
    normal = (
        np.array(slope_normals(surfaces, light_map.projection)).T[in_rows].reshape(SIZE, SIZE, 3)
    )
    level, checked = 3, 0
    side = 2**level
    basis = [np.array(vector, dtype=float).ravel() for vector in light_map.projection.basis]
    position = np.array(light_map.position, dtype=float).ravel()
    for row, column in np.ndindex(SIZE // side, SIZE // side):
        square = (slice(row * side, (row + 1) * side), slice(column * side, (column + 1) * side))
        if not there[square].any():
            continue
        u, v = (2 * side / SIZE * (place + 0.5) - 1 for place in (column, row))
        asked = position + u * basis[0] + v * basis[1]
        width = mi.Float(0.5 * side) * light_map.texel
        surface = filtered_surface(light_map, _vectors([asked]), width)
        np.testing.assert_allclose(surface.cover[0], there[square].mean(), rtol=1e-4)
        mean = normal[square][there[square]].mean(axis=0)
        np.testing.assert_allclose(np.array(surface.normal).ravel(), unit(mean), atol=1e-4)
        np.testing.assert_allclose(
            surface.thickness[0], (front - back)[square][there[square]].mean(), rtol=1e-3
        )
        rows, columns = np.nonzero(there[square])
        place = np.stack([columns + column * side, rows + row * side], axis=1).mean(axis=0)
        expected = (2 * place + 1) / SIZE - 1
        where = position + basis[0] * expected[0] + basis[1] * expected[1]
        where = where - basis[2] * front[square][there[square]].mean()
        np.testing.assert_allclose(np.array(surface.middle).ravel(), where, atol=2e-4)
        checked += there[square].mean() < 1
    assert checked > 4  # squares that the silhouette cuts


@pytest.mark.claim("collector-silhouettes", tolerance="within half the diagonal of the body")
@pytest.mark.parametrize("width", [0.0, 0.03, 0.4, 50.0])
def test_beside_the_cloud_is_what_is_nearest_of_it(variant, width):
    """Past the silhouette A = 0: there is no mean, and yet a surface."""
    _, light_map = _cube_map()
    rng = np.random.default_rng(7)
    points = np.asarray(MIDDLE) + rng.uniform(-3, 3, (500, 3))
    surface = filtered_surface(light_map, _vectors(points), dr.opaque(mi.Float, width))
    for value in (surface.cover, surface.middle, surface.thickness, surface.normal):
        assert np.isfinite(np.array(value)).all()
    assert (
        np.linalg.norm(np.array(surface.middle).T - MIDDLE, axis=1) < 0.51 * np.linalg.norm(SIDES)
    ).all()
    assert (np.array(surface.normal).T @ unit(ALONG) < 0).all()
    assert (np.array(surface.thickness) > 0).all()


# Collectors ---------------------------------------------------------------------------------------


SLAB_TURN = np.asarray(rotation((0.2, 1.0, 0.4), 21.0))
SLAB = np.array([9.0, 9.0, 0.8])
SLAB_AT = np.array([0.3, 9.4, 1.2])
EXTINCTION = 2.3


def _map(direction, *, sides=SLAB, turn=SLAB_TURN, size=256):
    entry = cube(centre=tuple(SLAB_AT), sides=sides, turn=turn)
    scene = read(clear_scene(lamp=sun(direction), cube=entry))
    return light_map([mi.load_dict({"type": "scene", "cloud": entry})], scene.lights[0], size)


def _search(light_map, transport, points, towards, *, behind=100.0, **options):
    point, toward = _vectors(points), _vectors(towards)
    light = collector_light(
        light_map,
        transport,
        0,
        point=point,
        toward=toward,
        extinction=mi.Float(EXTINCTION),
        behind=aligned_array(mi.Float, np.atleast_1d(behind)),
        start=cold_start(light_map, point),
        search=Search(**({"covered": False} | options)),
    )
    dr.eval(light)  # whatever is read of it
    return light


def _recording(slabs):
    """Return a transport whose collector stands at (0.7, -0.2) from the foot, and
    which notes what it is asked.
    """

    def transport(number, t, d, mu, cos_phi, sin_phi, mu_l):
        slabs.append([t, d, mu, cos_phi, sin_phi, mu_l])
        return d + 2 * t + 3 * mu + 5 * cos_phi * (1 - mu * mu) + 7 * sin_phi * (
            1 - mu * mu
        ) + 11 * mu_l, *map(mi.Float, (0.7, -0.2, 0.9))

    return transport


@pytest.mark.parametrize("lit_from_below", [False, True])
def test_a_slab_is_found_as_it_is(variant, lit_from_below):
    """Thickness, depth, both angles and the collector, in the frame of a slab that
    lies askew in the world.
    """
    normal = SLAB_TURN[:, 2] * (-1 if lit_from_below else 1)
    horizontal = unit(SLAB_TURN @ (0.6, 0.8, 0.0))
    cosine = 0.61
    axis = horizontal * np.sqrt(1 - cosine**2) - normal * cosine
    light_map = _map(axis)
    rng = np.random.default_rng(11)
    # where the skin of a slab, 0.01 mean free paths, changes none
    depths = rng.uniform(0.01, SLAB[2] - 0.01, 300)
    plane = rng.uniform(-1.5, 1.5, (300, 2)) @ SLAB_TURN[:, :2].T
    points = SLAB_AT + plane + np.outer(0.5 * SLAB[2] - depths, normal)
    towards = rng.normal(size=(300, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    beside = np.cross(normal, horizontal)
    mu, x, y = towards @ normal, towards @ horizontal, towards @ beside
    # the ray is in cloud as in the slab
    behind = EXTINCTION * np.where(mu < 0, depths, SLAB[2] - depths) / np.abs(mu)
    light = _search(light_map, _recording([]), points, towards, behind=behind, iterations=12)
    sine = np.sqrt(1 - mu**2)
    expected = EXTINCTION * (depths + 2 * SLAB[2]) + 3 * mu + (5 * x + 7 * y) * sine + 11 * cosine
    np.testing.assert_allclose(np.array(light.radiance), expected, rtol=2e-3, atol=5e-3)
    centre = points + np.outer(depths, normal) + (0.7 * horizontal - 0.2 * beside) / EXTINCTION
    np.testing.assert_allclose(np.array(light.collector.centre).T, centre, atol=2e-3)
    np.testing.assert_allclose(np.array(light.collector.width), 0.9 / EXTINCTION, rtol=1e-6)
    assert np.array(light.missed).max() < 2e-2


def test_as_printed_lengths_are_those_along_the_light(variant):
    normal = SLAB_TURN[:, 2]
    horizontal = SLAB_TURN[:, 0]
    cosine = np.cos(np.deg2rad(75.0))
    light_map = _map(horizontal * np.sin(np.deg2rad(75.0)) - normal * cosine)

    def transport(number, t, d, *angles):
        return t + 10 * d, 0 * t, 0 * t, 0 * t + 0.5

    point = SLAB_AT + 0.1 * normal
    below = EXTINCTION * (0.5 * SLAB[2] + 0.1)
    printed, corrected = (
        float(
            _search(
                light_map, transport, point, normal, behind=behind, along_light=choice
            ).radiance[0]
        )
        for choice, behind in ((True, below / cosine), (False, below))
    )
    np.testing.assert_allclose(
        corrected, EXTINCTION * (SLAB[2] + 10 * (0.5 * SLAB[2] - 0.1)), rtol=2e-3
    )
    np.testing.assert_allclose(printed / corrected, 3.8637, rtol=2e-3)


WEDGE_HEIGHT, WEDGE_SLOPE = 0.7, 0.05


def _wedge(axis):
    """Return the map of a cloud with a level face at z = 0 and a floor at -0.7 - 0.05
    x: its thickness tells x.
    """
    vertices, faces = box((12.0, 9.0, 1.0))
    vertices = np.array(vertices, dtype=float)
    below = vertices[:, 2] < 0
    vertices[:, 2] = np.where(below, -WEDGE_HEIGHT - WEDGE_SLOPE * vertices[:, 0], 0.0)
    entry = medium_boundary(
        "wedge", (vertices + np.array([0.0, 9.4, 0.0]), faces), {"type": "homogeneous"}
    )
    scene = read(clear_scene(lamp=sun(axis), cube=entry))
    return light_map([mi.load_dict({"type": "scene", "cloud": entry})], scene.lights[0], 256)


@pytest.mark.claim("collector-search", tolerance="a tenth of sigma")
@pytest.mark.parametrize(
    ("slope", "iterations"), [(0.6, 25), (0.0, 8), (-0.7, 12), (-1.0, 12), (-2.5, 15), (-6.0, 25)]
)
def test_the_search_ends_at_the_fixed_point_whatever_the_slope_of_the_map(
    variant, slope, iterations
):
    """A map whose slope is -1 goes to and fro between two places for ever, one of -2.5 runs
    away: half steps end it.
    """
    sine, fixed, slope = 0.3, 0.9, dr.opaque(mi.Float, slope)
    axis = np.array([sine, 0.0, -np.sqrt(1 - sine**2)])
    light_map = _wedge(axis)
    point = np.array([-0.6, 9.2, -0.2])

    def transport(number, t, d, mu, cos_phi, sin_phi, mu_l):
        length = t / (EXTINCTION * mu_l)
        x = (length * (mu_l - WEDGE_SLOPE * sine) - WEDGE_HEIGHT) / WEDGE_SLOPE
        wanted = fixed + slope * (x - fixed)
        return t, (wanted - float(point[0])) * EXTINCTION, 0 * t, 0 * t + 0.3 * EXTINCTION

    light = _search(light_map, transport, point, [0.0, 0.0, 1.0], iterations=iterations)
    np.testing.assert_allclose(
        np.array(light.collector.centre).ravel(), [fixed, 9.2, 0.0], atol=0.03
    )
    assert float(light.missed[0]) < 0.15
