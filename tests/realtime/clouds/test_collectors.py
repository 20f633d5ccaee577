# SPDX-License-Identifier: BSD-3-Clause
"""The collector search on shapes and with transports whose fixed points are known."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.clouds.collector_search import Search, cold_start, collector_light
from realtime.clouds.light_maps import light_map
from realtime.numerics.array_types import aligned_array
from tests.helpers.frames import read
from tests.helpers.scenes import clear_scene
from tests.helpers.sunlit import cube, sun, unit
from validation.scenes.meshes import box, rotation
from validation.scenes.parts import medium_boundary

SLAB_TURN = np.asarray(rotation((0.2, 1.0, 0.4), 21.0))
SLAB = np.array([9.0, 9.0, 0.8])
MIDDLE = np.array([0.3, 9.4, 1.2])
EXTINCTION = 2.3


def _map(direction, *, sides=SLAB, turn=SLAB_TURN, size=256):
    entry = cube(centre=tuple(MIDDLE), sides=sides, turn=turn)
    scene = read(clear_scene(lamp=sun(direction), cube=entry))
    return light_map([mi.load_dict({"type": "scene", "cloud": entry})], scene.lights[0], size)


def _vectors(points):
    columns = np.asarray(points, dtype=np.float64).reshape(-1, 3).T
    return mi.Vector3f(*(aligned_array(mi.Float, column) for column in columns))


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
    """Return a transport whose collector stands at (0.7, -0.2) from the foot, and which notes what it is asked."""

    def transport(number, t, d, mu, cos_phi, sin_phi, mu_l):
        slabs.append([t, d, mu, cos_phi, sin_phi, mu_l])
        return d + 2 * t + 3 * mu + 5 * cos_phi * (1 - mu * mu) + 7 * sin_phi * (1 - mu * mu) + 11 * mu_l, *map(
            mi.Float, (0.7, -0.2, 0.9)
        )

    return transport


@pytest.mark.parametrize("lit_from_below", [False, True])
def test_a_slab_is_found_as_it_is(variant, lit_from_below):
    """Thickness, depth, both angles and the collector, in the frame of a slab that lies askew in the world."""
    normal = SLAB_TURN[:, 2] * (-1 if lit_from_below else 1)
    horizontal = unit(SLAB_TURN @ (0.6, 0.8, 0.0))
    cosine = 0.61
    axis = horizontal * np.sqrt(1 - cosine**2) - normal * cosine
    light_map = _map(axis)
    rng = np.random.default_rng(11)
    depths = rng.uniform(0.01, SLAB[2] - 0.01, 300)  # where the skin of a slab, 0.01 mean free paths, changes none
    plane = rng.uniform(-1.5, 1.5, (300, 2)) @ SLAB_TURN[:, :2].T
    points = MIDDLE + plane + np.outer(0.5 * SLAB[2] - depths, normal)
    towards = rng.normal(size=(300, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    beside = np.cross(normal, horizontal)
    mu, x, y = towards @ normal, towards @ horizontal, towards @ beside
    behind = EXTINCTION * np.where(mu < 0, depths, SLAB[2] - depths) / np.abs(mu)  # the ray is in cloud as in the slab
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

    point = MIDDLE + 0.1 * normal
    below = EXTINCTION * (0.5 * SLAB[2] + 0.1)
    printed, corrected = (
        float(_search(light_map, transport, point, normal, behind=behind, along_light=choice).radiance[0])
        for choice, behind in ((True, below / cosine), (False, below))
    )
    np.testing.assert_allclose(corrected, EXTINCTION * (SLAB[2] + 10 * (0.5 * SLAB[2] - 0.1)), rtol=2e-3)
    np.testing.assert_allclose(printed / corrected, 3.8637, rtol=2e-3)


WEDGE_HEIGHT, WEDGE_SLOPE = 0.7, 0.05


def _wedge(axis):
    """Return the map of a cloud with a level face at z = 0 and a floor at -0.7 - 0.05 x: its thickness tells x."""
    vertices, faces = box((12.0, 9.0, 1.0))
    vertices = np.array(vertices, dtype=float)
    below = vertices[:, 2] < 0
    vertices[:, 2] = np.where(below, -WEDGE_HEIGHT - WEDGE_SLOPE * vertices[:, 0], 0.0)
    entry = medium_boundary("wedge", (vertices + np.array([0.0, 9.4, 0.0]), faces), {"type": "homogeneous"})
    scene = read(clear_scene(lamp=sun(axis), cube=entry))
    return light_map([mi.load_dict({"type": "scene", "cloud": entry})], scene.lights[0], 256)


@pytest.mark.claim("collector-search", tolerance="a tenth of sigma")
@pytest.mark.parametrize(("slope", "iterations"), [(0.6, 25), (0.0, 8), (-0.7, 12), (-1.0, 12), (-2.5, 15), (-6.0, 25)])
def test_the_search_ends_at_the_fixed_point_whatever_the_slope_of_the_map(variant, slope, iterations):
    """A map whose slope is -1 goes to and fro between two places for ever, one of -2.5 runs away: half steps end it."""
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
    np.testing.assert_allclose(np.array(light.collector.centre).ravel(), [fixed, 9.2, 0.0], atol=0.03)
    assert float(light.missed[0]) < 0.15
    settled = _search(light_map, transport, point, [0.0, 0.0, 1.0], iterations=99, settled=0.05)
    assert float(settled.missed[0]) <= 0.05
    assert int(settled.steps[0]) < 99
