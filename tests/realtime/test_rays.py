# SPDX-License-Identifier: BSD-3-Clause
"""Claim: foot and height of a ray, what a cone lights of it, and a light sample's
cosine keep their digits.
"""

import mitsuba as mi
import mpmath
import numpy as np
import pytest
from mpmath import mp
from scipy.integrate import quad

from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.rays import ray_geometry
from airlight.realtime.scene.lights import Facing, Light, spot_fields
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import HenyeyGreenstein, Isotropic
from tests.helpers.kernel_values import opaque, vectors


def point_light(types, position):
    return opaque(Light(vectors(types, position), types.color(1)))


def spot_light(types, position, axis, degrees):
    angle = float(np.deg2rad(degrees))
    fields = spot_fields(np.asarray(axis) / np.linalg.norm(axis), angle, angle, types)
    return opaque(Light(vectors(types, position), types.color(1), **fields))


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_rounding_of_light_and_direction_is_no_height(variant, kind):
    """Where light - origin is computed in float32, as the direction, 1e-7 m of a
    height of 1e-4 m are lost.
    """
    types = array_types()
    rng = np.random.default_rng(8)
    light, origin = (
        np.float32(place).astype(np.float64)
        for place in ((1.237, -2.519, 3.751), (-0.33, 0.71, 0.123))
    )
    direction = light - origin + 10.0 ** rng.uniform(-4, 0, (2000, 1)) * rng.normal(size=(2000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    axis = np.array([0.48, 0.6, -0.64])
    lamp = point_light(types, light) if kind == "point" else spot_light(types, light, axis, 40.0)
    at = types.vector(*(float(x) for x in origin))
    geometry = ray_geometry(at, vectors(array_types("double"), direction), lamp)
    cross = np.cross(light - origin, direction)
    height = np.linalg.norm(cross, axis=1)
    # three roundings of a component and a norm
    assert np.max(np.abs(np.array(geometry.height) / height - 1)) < 4e-7
    if kind == "spot":
        offset = np.cross(cross, direction) @ axis
        assert np.max(np.abs(np.array(geometry.offset) - offset) / height) < 4e-7


@pytest.mark.parametrize(("sine", "cosine"), [(0.6, 0.8), (0.8, 0.6)])
def test_rays_parallel_to_a_line_on_the_cone(variant, sine, cosine):
    """The quadratic equation has one root: a half line inside the cone, or on the other
    side of the axis nothing.

    The other root is infinite, or at 1e7 m by the rounding of sine and cosine.
    """
    types = array_types()
    light = spot_light(types, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), np.rad2deg(np.arcsin(sine)))
    assert np.array(light.cos_cutoff)[0] == np.float32(cosine)
    # In the cone |x| <= tan z; from (-1, 0, 0) that is 1 - sine t <= sine t on one side,
    # and always on the other.
    for x, sign, wanted in (
        (-1, 1, (0.5 / sine, np.inf)),
        (1, 1, None),
        (-1, -1, None),
        (1, -1, None),
    ):
        direction = types.vector(sign * sine, 0.0, sign * cosine)
        beside = ray_geometry(types.vector(x, 0.0, 0.0), direction, light)
        low, high = (
            np.array(end)[0] for end in beside.lit_segment(types.scalar(0), types.scalar(np.inf))
        )
        if wanted is None:
            assert low == high == 0 or low > 1e7
        else:
            assert low == pytest.approx(wanted[0], rel=1e-6)
            assert high > 1e7


@pytest.mark.claim("spot-falloff", tolerance="2e-6 over the width of the edge")
@pytest.mark.parametrize(("cutoff", "beam"), [(3.0, 2.0), (33.0, 0.0), (70.0, 69.0)])
def test_falloff_near_the_axis_and_the_edge(variant, cutoff, beam):
    """Against the angle from the cross product in float64; an arc cosine in float32 is
    off by 3e-4 near the axis.
    """
    types = array_types()
    rng = np.random.default_rng(12)
    light, origin = (
        np.float32(place).astype(np.float64)
        for place in ((1.237, -2.519, 3.751), (-0.33, 0.71, 0.123))
    )
    axis = np.array([0.48, 0.6, -0.64])
    angle = np.deg2rad(cutoff)
    fields = spot_fields(axis, float(angle), float(np.deg2rad(beam)), types)
    lamp = Light(types.vector(*(float(x) for x in light)), types.color(1), **fields)
    across = np.cross(axis, rng.normal(size=(3000, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    aim = np.concatenate(
        [10.0 ** rng.uniform(-6, 0, 1000), 1 - 10.0 ** rng.uniform(-6, 0, 1000), rng.random(1000)]
    )
    distance = rng.uniform(0.5, 5, (3000, 1))
    point = light + distance * (axis + np.tan(aim * angle)[:, None] * across)
    x = np.linalg.norm(point - origin, axis=1)
    direction = (point - origin) / x[:, None]
    at = types.vector(*(float(component) for component in origin))
    geometry = ray_geometry(at, vectors(array_types("double"), direction), lamp)
    x = x.astype(np.float32).astype(np.float64)
    away = origin + x[:, None] * direction - light
    exact = np.arctan2(np.linalg.norm(np.cross(axis, away), axis=1), away @ axis)
    wanted = np.clip((angle - exact) / (angle - np.deg2rad(beam)), 0, 1)
    profile = np.array(geometry.falloff(lamp, types.scalar(x)))
    # Distances of up to 10 m, rounded, over a distance from the light of 0.5
    # m or more; measured 9e-7.
    assert np.max(np.abs(profile - wanted)) * (angle - np.deg2rad(beam)) < 2e-6
    assert np.mean((wanted > 0) & (wanted < 1)) > 0.05


# Rays that graze a spot's cone --------------------------------------------------------------------


# Rounded to float32; their difference is not.
LIGHT, CAMERA = np.array([[0.237, -0.371, 4.119], [2.253, -5.127, 1.879]], dtype=np.float32).astype(
    np.float64
)
AXIS = np.array([0.31, 0.23, -0.92]) / np.linalg.norm([0.31, 0.23, -0.92])


def aimed(degrees, excess, distance, rng):
    """Return unit directions to points beside the light's cone, at a fraction `excess`
    of its radius within it.

    A ray to a point of a cone does not graze it there, unless the plane through the ray and the
    light does: the points are where the tangent planes from the camera meet the cone.
    """
    angle = np.deg2rad(degrees)
    across = np.cross(AXIS, [0.6, 0.0, 0.8])
    across /= np.linalg.norm(across)
    above = np.cross(AXIS, across)
    away = CAMERA - LIGHT
    # The normal cos(b) radial - sin(b) axis of the tangent plane along radial is
    # at right angles to `away`.
    a, b, c = (
        np.cos(angle) * (away @ across),
        np.cos(angle) * (away @ above),
        np.sin(angle) * (away @ AXIS),
    )
    around = np.arctan2(b, a) + rng.choice([-1, 1], len(excess)) * np.arccos(
        np.clip(c / np.hypot(a, b), -1, 1)
    )
    radial = np.cos(around)[:, None] * across + np.sin(around)[:, None] * above
    point = np.cos(angle) * AXIS + (np.sin(angle) * (1 - excess))[:, None] * radial
    direction = LIGHT + distance[:, None] * point - CAMERA
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def exact_interval(direction, angle):
    """Return where a ray is in the cone, and its foot and height, by the angle
    at the light in 40 digits.

    The cosine between axis and direction from the light is m cos(theta - theta_m): see
    `reference.visibility.planes`.
    """
    with mp.workdps(40):
        d, away, axis = (
            mpmath.matrix([mp.mpf(float(x)) for x in v]) for v in (direction, LIGHT - CAMERA, AXIS)
        )
        d, axis = d / mp.norm(d), axis / mp.norm(axis)
        foot = mp.fdot(away, d)
        n = foot * d - away
        height = mp.norm(n)
        axial, across = mp.fdot(axis, d), mp.fdot(axis, n) / height
        ratio = mp.cos(mp.mpf(angle)) / mp.hypot(axial, across)
        half = mp.acos(ratio) if ratio < 1 else -1
        middle = mp.atan2(axial, across)
        low, high = max(middle - half, -mp.pi / 2), min(middle + half, mp.pi / 2)
        if low >= high:
            return -np.inf, -np.inf, float(foot), float(height)
        ends = (
            foot + height * mp.tan(t) if abs(t) < mp.pi / 2 else mp.sign(t) * mp.inf
            for t in (low, high)
        )
        return *(float(x) for x in ends), float(foot), float(height)


def ends_of(direction, degrees, precision):
    """Return `enter` and `leave` of rays as computed and as they are, their feet and heights."""
    types = array_types(precision)
    angle = float(np.deg2rad(degrees))
    fields = spot_fields(AXIS, angle, angle, types)
    light = opaque(Light(types.vector(*(float(x) for x in LIGHT)), types.color(1), **fields))
    origin = opaque(types.vector(*(float(x) for x in CAMERA)))
    geometry = ray_geometry(origin, vectors(array_types("double"), direction), light)
    ends = np.array(
        [np.array(geometry.enter, dtype=np.float64), np.array(geometry.leave, dtype=np.float64)]
    )
    enter, leave, foot, height = np.array([exact_interval(ray, angle) for ray in direction]).T
    return ends, np.array([enter, leave]), foot, height


def largest_error(ends, wanted, foot, height):
    """Return the larger error of both ends by ray: of the distance, or of the angle at
    the light if that is less.

    Ends far beyond the light are ill-posed as distances: there A is close to 0, and they
    may be found at infinity.
    """
    there = np.arctan((ends - foot) / height), np.arctan((wanted - foot) / height)
    cosine, sine = np.cos(there[1]), np.abs(np.sin(there[1]))
    return np.max(
        np.abs(there[0] - there[1])
        / (cosine**2 * (1 + np.abs(foot) / height) + sine * cosine + sine**2),
        axis=0,
    )


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("degrees", [3.0, 24.3, 45.0, 71.0])
def test_rays_that_graze_the_cone(variant, degrees, precision):
    """Chords that float32 alone would change by up to 1e-3 of the distance, or miss."""
    rng = np.random.default_rng(17)
    n = 150
    excess = rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-9, -0.1, n)
    direction = aimed(degrees, excess, 10.0 ** rng.uniform(-1, 1, n), rng)
    ends, wanted, foot, height = ends_of(direction, degrees, precision)
    assert np.array_equal(np.isneginf(ends[1]), np.isneginf(wanted[1]))
    assert 0.1 < np.mean(np.isneginf(wanted[1])) < 0.9
    error = largest_error(ends, wanted, foot, height) * np.cos(np.deg2rad(degrees)) ** 2
    if precision == "single":
        # One rounding of the distances; A and C lose up to 2/cos^2 (see
        # `realtime.rays`). Measured 1.5.
        assert np.max(error) < 4 * np.finfo(np.float32).eps
    else:
        # The rounding errors of the test's own directions are not known: a chord
        # loses its fraction of them.
        assert np.max(error * np.sqrt(np.abs(excess))) < 4 * np.finfo(np.float64).eps


# Light samples, against adaptive quadrature that shares nothing -----------------------------------


COUNT = 500


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.fixture(scope="module")
def rays():
    rng = np.random.default_rng(20161)
    far = 10 ** rng.uniform(-1, 1.5, COUNT)
    return {
        "light": 1.3 * rng.normal(size=(COUNT, 3)),
        "normal": unit(rng.normal(size=(COUNT, 3))),
        "origin": 2 * rng.normal(size=(COUNT, 3)),
        "direction": unit(rng.normal(size=(COUNT, 3))),
        "x0": far * rng.uniform(0, 0.9, COUNT),
        "x1": far,
        "sigma_t": 10 ** rng.uniform(-3, 0.7, COUNT),
        "g": rng.uniform(-0.85, 0.85, COUNT),
    }


def by_scipy(rays, number, isotropic):
    """Return J by scipy, in the angle at the light, over what of the
    segment lies before the plane.
    """
    one = {name: values[number] for name, values in rays.items()}
    toward = one["light"] - one["origin"]
    foot = toward @ one["direction"]
    height = np.linalg.norm(np.cross(toward, one["direction"]))
    rate, start = one["normal"] @ one["direction"], -one["normal"] @ toward
    low, high = one["x0"], one["x1"]
    if rate > 0:
        low = max(low, -start / rate)
    else:
        high = min(high, -start / rate)
    if low >= high:
        return 0.0

    def value(theta):
        s, r = height * np.tan(theta), height / np.cos(theta)
        x, g = foot + s, one["g"]
        phase = 1.0 if isotropic else (1 - g * g) / (1 + g * g + 2 * g * s / r) ** 1.5
        return np.exp(-one["sigma_t"] * (x + r)) * phase * (start + rate * x) / r / height

    ends = (np.arctan2(x - foot, height) for x in (low, high))
    return quad(value, *ends, epsabs=0, epsrel=1e-13, limit=400)[0]


def integrals(rays, kernel, precision, isotropic):
    types = array_types(precision)
    real = np.float32 if precision == "single" else np.float64

    def vector(values):
        return types.vector(*(types.scalar(values[:, k].astype(real)) for k in range(3)))

    def number(name):
        return types.scalar(rays[name].astype(real))

    normal, direction = (
        mi.Vector3d(*(mi.Float64(c) for c in rays[name].T)) for name in ("normal", "direction")
    )
    light = Light(
        vector(rays["light"]), types.color(1), facing=Facing(normal, None, None), source=0
    )
    geometry = ray_geometry(vector(rays["origin"]), direction, light)
    phase = Isotropic() if isotropic else HenyeyGreenstein(number("g"))
    medium = Homogeneous((number("sigma_t"),), types.color(1), phase)
    x0, x1 = number("x0"), number("x1")
    return np.array(
        KERNELS[kernel].function(geometry, *geometry.lit_segment(x0, x1), medium, light)
    ).ravel()


@pytest.mark.claim(
    "light-samples-exact",
    tolerance="1e-10: both are adaptive or have many nodes; float32 1e-6 in 9 of 10",
)
@pytest.mark.parametrize("isotropic", [True, False])
def test_exact_integrates_the_cosine(variant, rays, isotropic):
    values = np.array([by_scipy(rays, number, isotropic) for number in range(COUNT)])
    lit = values > 0
    assert 200 < lit.sum() < 400
    double = integrals(rays, "exact", "double", isotropic)
    np.testing.assert_allclose(double[lit], values[lit], rtol=1e-10)
    assert np.all(double[~lit] == 0)
    np.testing.assert_allclose(
        integrals(rays, "quadrature", "double", isotropic)[lit], values[lit], rtol=1e-4
    )
    error = np.abs(integrals(rays, "exact", "single", isotropic)[lit] / values[lit] - 1)
    # The rest of a segment next to the plane is only as accurate as its ends.
    assert np.median(error) < 3e-7
    assert np.quantile(error, 0.9) < 2e-6
