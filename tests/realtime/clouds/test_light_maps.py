# SPDX-License-Identifier: BSD-3-Clause
"""Light maps of clouds: heights and normals of the lit side, means over the cloud alone, and nothing that is not finite
beside it."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.clouds.light_maps import LitSurfaces, cast_surfaces, filtered_map, filtered_surface, slope_normals
from realtime.numerics.array_types import aligned_array
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
    """Through a saw tooth whose steep sides hide, the mean plane is level: unit normals lean to the light."""
    scene = read(clear_scene(lamp=sun((0.0, 0.0, -1.0)), cube=cube()), "single")
    basis = filtered_map([_saw()], scene.lights[0]).projection.basis
    width = 2 * float(np.linalg.norm(np.array(basis[0]))) / SIZE
    light_map = filtered_map([_saw(width)], scene.lights[0])
    surface = filtered_surface(light_map, mi.Vector3f(light_map.position), mi.Float(4 * width))
    assert float(np.array(surface.normal).ravel() @ -np.array(basis[2]).ravel()) > 0.9999


def _saw(width=1.0):
    """Return a surface that rises by a texel's width a texel, eight texels long, and falls back in a step."""
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
    normal = np.array(slope_normals(surfaces, light_map.projection)).T[in_rows].reshape(SIZE, SIZE, 3)
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
        np.testing.assert_allclose(surface.thickness[0], (front - back)[square][there[square]].mean(), rtol=1e-3)
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
    assert (np.linalg.norm(np.array(surface.middle).T - MIDDLE, axis=1) < 0.51 * np.linalg.norm(SIDES)).all()
    assert (np.array(surface.normal).T @ unit(ALONG) < 0).all()
    assert (np.array(surface.thickness) > 0).all()
