# SPDX-License-Identifier: BSD-3-Clause
"""Rays as a light sees them, from their pixels, against the geometry of rays in float64, which has other formulas."""

import numpy as np
import pytest

SIZE = (120, 88)
ORIGIN = np.array([1.37, -2.11, 0.83], dtype=np.float32).astype(float)
FORWARD = np.array([0.48, 0.6, -0.64])
SINGLE = float(np.finfo(np.float32).eps)


def camera_of(types, fov=50.0):
    """Return a camera and the unit directions of its pixels, float64, (pixels, 3)."""
    import drjit as dr

    from realtime.scene.camera import Camera, pixel_grid
    from realtime.scene.lights import with_low

    side = np.cross([0.0, 0.0, 1.0], FORWARD)
    side /= np.linalg.norm(side)
    scale = 2 * np.tan(np.deg2rad(fov) / 2) / SIZE[0]
    vectors = [FORWARD / np.linalg.norm(FORWARD), side * scale, np.cross(FORWARD, side) * scale]
    parts = [[types.vector(*(float(x) for x in part)) for part in with_low(vector, types)] for vector in vectors]
    high, low = zip(*parts)
    origin = types.vector(*(float(x) for x in ORIGIN))
    dr.make_opaque(origin, high, low)
    camera = Camera(*SIZE, origin, *high, *low, grid=pixel_grid(*SIZE, types.scalar))
    kept = [sum(np.array(part, dtype=float).ravel() for part in pair) for pair in parts]
    row, column = np.divmod(np.arange(SIZE[0] * SIZE[1]), SIZE[0])
    aim = kept[0] + ((SIZE[0] - 1) / 2 - column)[:, None] * kept[1] + ((SIZE[1] - 1) / 2 - row)[:, None] * kept[2]
    return camera, aim / np.linalg.norm(aim, axis=1)[:, None]


def light_at(types, place, spot=None):
    import drjit as dr

    from realtime.scene.lights import Light, spot_fields

    position = types.vector(*(float(x) for x in place))
    dr.make_opaque(position)
    if spot is None:
        return Light(position, types.color(1))
    axis, cutoff, beam = spot
    axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    fields = spot_fields(axis, np.deg2rad(cutoff), np.deg2rad(beam), types)
    dr.make_opaque(fields)
    return Light(position, types.color(1), **fields)


def geometries(place, spot=None):
    """Return the geometry in float32 by pixel and in float64 by ray, and both lights' cones."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.shadow_planes.pixel_rays import aim_at, read_spot, seen_rays
    from realtime.methods.shadow_planes.plane_table import light_basis
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import ray_geometry
    from realtime.scene.camera import read_camera

    single, double = array_types("single"), array_types("double")
    camera, ways = camera_of(single)
    light = light_at(single, place, spot)
    basis = light_basis(np.asarray(place, dtype=float), ORIGIN)
    axes, distance = basis.axes, basis.distance
    aim = aim_at(read_camera(camera), axes, read_spot(light), single)
    dr.make_opaque(aim)
    pixel = mi.UInt32(np.arange(SIZE[0] * SIZE[1], dtype=np.uint32))
    seen = seen_rays(aim, camera, pixel, dr.opaque(single.scalar, distance), light)
    way = np.stack([np.array(component, dtype=float) for component in (seen.x, seen.y, seen.z)], axis=1)
    assert np.max(np.abs(way - ways @ axes.T)) < 4 * SINGLE
    truth = ray_geometry(
        double.vector(*(float(x) for x in ORIGIN)), double.vector(ways.T.copy()), light_at(double, place, spot)
    )
    return seen.geometry, truth


def numbers(value):
    return np.array(value, dtype=np.float64)


def in_image(column, row, depth):
    """Return a place that is seen at a column and row."""
    from realtime.numerics.array_types import array_types

    _, ways = camera_of(array_types("double"))
    grid = ways.reshape(SIZE[1], SIZE[0], 3)
    c, r = int(column), int(row)
    return (
        (ORIGIN + depth * (grid[r, c] + (column - c) * (grid[r, c + 1] - grid[r, c]))).astype(np.float32).astype(float)
    )


PLACES = {
    "between pixels": lambda: in_image(50.3, 30, 4.0),
    "at a pixel": lambda: in_image(61, 40, 7.0),
    "at the edge": lambda: in_image(0.1, 87, 2.0),
    "behind": lambda: ORIGIN - 3.7 * (in_image(70.4, 20, 1.0) - ORIGIN),
    "beside": lambda: ORIGIN + 5 * np.cross(FORWARD, [0.0, 0.0, 1.0]),
    "nearly beside": lambda: ORIGIN + 5 * np.cross(FORWARD, [0.0, 0.0, 1.0]) + 0.05 * FORWARD,
}


@pytest.mark.parametrize("name", PLACES)
def test_foot_and_height(variant, name):
    place = np.asarray(PLACES[name](), dtype=np.float32).astype(float)
    seen, truth = geometries(place)
    distance = np.linalg.norm(place - ORIGIN)
    assert np.max(np.abs(numbers(seen.foot) - numbers(truth.foot))) < 3 * SINGLE * distance
    height = numbers(truth.height)
    # The place of the light is rounded before both; a light at a pixel is beside it by that.
    error = np.abs(numbers(seen.height) - height) / height
    assert error[height > 1e-6 * distance].max() < 4 * SINGLE
    assert error.max() < 1e-3


SPOTS = {
    "beside the cone": ((0.2, 0.1, -1.0), 24.0, 24.0),
    "within the cone": ((-0.4, -0.7, 0.6), 70.0, 70.0),
    "soft": ((0.2, 0.1, -1.0), 33.0, 21.0),
    "narrow": ((1.0, 0.3, 0.1), 3.0, 3.0),
}


@pytest.mark.parametrize("spot", SPOTS)
@pytest.mark.parametrize("name", PLACES)
def test_where_rays_are_in_the_cone(variant, name, spot):
    """As distances, or as angles at the light if these differ less: ends far beyond the light are ill-posed as lengths.

    One rounding of the distances; the cone's own roots lose up to 2/cos^2 (`realtime.rays.spot_cone`). Chords of rays
    that nearly touch the cone are roots of what is left of the discriminant, 1e-10 of the height's square.
    """
    place = np.asarray(PLACES[name](), dtype=np.float32).astype(float)
    seen, truth = geometries(place, SPOTS[spot])
    foot, height = numbers(truth.foot), numbers(truth.height)
    cos_square = np.cos(np.deg2rad(SPOTS[spot][1])) ** 2
    ends = [("enter", "leave")] + [("beam_enter", "beam_leave")] * (spot == "soft")
    for pair in ends:
        mine, wanted = (np.array([numbers(getattr(geometry, field)) for field in pair]) for geometry in (seen, truth))
        missed, misses = np.isneginf(mine[1]), np.isneginf(wanted[1])
        assert np.sum(missed != misses) <= 1
        hit = ~missed & ~misses & (height > 1e-6 * np.linalg.norm(place - ORIGIN))
        there = np.arctan((mine - foot) / height), np.arctan((wanted - foot) / height)
        cosine, sine = np.cos(there[1]), np.abs(np.sin(there[1]))
        scale = cosine**2 * (1 + np.abs(foot) / height) + sine * cosine + sine**2
        error = np.max(np.abs(there[0] - there[1]) / scale, axis=0)[hit] * cos_square
        assert error.size == 0 or error.max() < 8 * SINGLE
    if spot == "beside the cone" and name == "between pixels":
        assert 0.05 < np.mean(misses) < 0.95
