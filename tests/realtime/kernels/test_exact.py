# SPDX-License-Identifier: BSD-3-Clause
"""The default kernel against the certified values: the bars that it has to meet."""

import numpy as np
import pytest

from analytic.cases import read_cases


@pytest.fixture(scope="module", params=["airlight_integral.csv", "airlight_integral_rays.csv"])
def cases(request, data_folder):
    return read_cases(data_folder / request.param)


def errors(cases, kernel, precision):
    from validation.kernels.cases import integrate_cases

    values = integrate_cases(cases, kernel, precision)
    assert np.all(np.isfinite(values))
    assert np.all(values >= 0)
    # Below 1e-37 float32 has no normal numbers: such values are compared in absolute terms.
    return np.abs(values - cases.value) / np.maximum(cases.value, 1e-37)


@pytest.mark.claim("exact-keeps-its-bar", tolerance="3e-5, 1e-4 where |g| > 0.9; 99 % 3e-6, median 3e-7")
def test_single_precision_meets_its_bar(variant, cases):
    """Issue: largest 3e-5 for |g| <= 0.9 and 1e-4 up to 0.95, 99 % at 3e-6, median 3e-7."""
    error = errors(cases, "exact", "single")
    sharp = np.abs(cases.g) > 0.9
    assert error[~sharp].max() < 3e-5
    assert error[sharp].max() < 1e-4
    assert np.percentile(error, 99) < 3e-6
    assert np.median(error) < 3e-7


@pytest.mark.claim("exact-in-float32", tolerance="4e-6 and 1.5e-5 relative, the figures stated")
def test_errors_are_those_that_the_documents_state(variant, data_folder):
    """README, limits: two figures, one for each file of certified values."""
    for name, stated in (("airlight_integral.csv", 4e-6), ("airlight_integral_rays.csv", 1.5e-5)):
        assert errors(read_cases(data_folder / name), "exact", "single").max() < stated, name


@pytest.mark.claim("exact-keeps-its-bar", tolerance="1e-10 relative")
def test_double_precision_meets_its_bar(variant, cases):
    assert errors(cases, "exact", "double").max() < 1e-10


@pytest.mark.parametrize("name", ["rayleigh", "hg", "murky"])
def test_limits(variant, name):
    """Zero length, vacuum, endless rays, the light beside the segment at height 0, against the truth."""
    from analytic.panels import airlight_segments
    from analytic.phase import PhaseFunction
    from realtime.kernels.exact import exact
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    foot = np.array([1.0, 1.0, 1.5, -0.7, 2.5, 0.3])
    height = np.array([0.5, 0.5, 0.25, 0.0, 0.0, 2.0])
    x0 = np.array([0.75, 0.0, 0.0, 0.0, 0.0, 1.0])
    x1 = np.array([0.75, 3.0, np.inf, 2.0, 2.0, np.inf])
    sigma_t = np.array([0.4, 0.0, 0.7, 0.3, 0.3, 0.0])
    types = array_types("double")
    medium = Medium((types.scalar(sigma_t),), types.color(1), named_phase(name, g=0.6 if name == "hg" else None))
    geometry = RayGeometry(types.scalar(foot), types.scalar(height), None, None)
    value = np.array(exact(geometry, types.scalar(x0), types.scalar(x1), medium, Light(None, None)))
    phase = PhaseFunction(name, g=0.6 if name == "hg" else 0.0)
    expected, _ = airlight_segments(foot, height, x0, x1, sigma_t, phase)
    assert value[0] == 0
    assert value[1:] == pytest.approx(expected[1:], rel=1e-9)


def wide_rays(count):
    """Random rays: optical depth 1e-6 to 50, height over distance 1e-7 to 1, before and behind the light."""
    rng = np.random.default_rng(1)
    distance, ratio = 10 ** rng.uniform(-1, 1, count), 10 ** rng.uniform(-7, 0, count)
    height = (distance * ratio).astype(np.float32).astype(np.float64)
    foot = rng.choice([-1, 1], count) * np.sqrt(np.maximum(distance**2 - height**2, 0))
    foot = foot.astype(np.float32).astype(np.float64)
    sigma_t = (10 ** rng.uniform(-6, 1.7, count) / distance).astype(np.float32).astype(np.float64)
    length = (distance * 10 ** rng.uniform(-2, 2, count)).astype(np.float32).astype(np.float64)
    return foot, height, np.where(rng.random(count) < 0.5, np.inf, length), sigma_t


@pytest.mark.parametrize(
    ("name", "g"),
    [("isotropic", 0.0), ("rayleigh", 0.0), ("hazy", 0.0), ("murky", 0.0), ("hg", -0.95), ("hg", 0.5), ("hg", 0.95)],
)
def test_wide_rays(variant, name, g):
    """Float32: the nodes leave 5e-6, and rounding of the exponent 6e-8 times an optical depth of up to 300."""
    from analytic.panels import airlight_segments
    from analytic.phase import PhaseFunction
    from realtime.kernels.exact import exact
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    foot, height, x1, sigma_t = wide_rays(5000)
    expected, _ = airlight_segments(foot, height, 0.0, x1, sigma_t, PhaseFunction(name, g=g))
    for precision, bound in (("single", 3e-5), ("double", 1e-10)):
        types = array_types(precision)
        phase = named_phase(name, g=types.scalar(g) if name == "hg" else None)
        geometry = RayGeometry(types.scalar(foot), types.scalar(height), None, None)
        medium = Medium((types.scalar(sigma_t),), types.color(1), phase)
        light = Light(None, None)
        value = np.array(exact(geometry, types.scalar(0), types.scalar(x1), medium, light), dtype=np.float64)
        error = np.abs(value - expected) / np.maximum(expected, 1e-37)
        assert error.max() < bound, (precision, foot[error.argmax()], height[error.argmax()], x1[error.argmax()])


@pytest.mark.parametrize("g", [-0.95, -0.6, 0.95])
def test_endless_rays_through_a_vacuum_with_sharp_lobes(variant, g):
    """A backward lobe holds its light at large E: the far end must not be cut before it."""
    from analytic.panels import airlight_segments
    from analytic.phase import PhaseFunction
    from realtime.kernels.exact import exact
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    foot, height = np.array([1.5, -2.0, 0.01, 3.0]), np.array([0.7, 0.3, 1e-3, 2.0])
    for precision, bound in (("single", 5e-6), ("double", 1e-10)):
        types = array_types(precision)
        medium = Medium((types.scalar(0.0),), types.color(1), named_phase("hg", g=types.scalar(g)))
        geometry = RayGeometry(types.scalar(foot), types.scalar(height), None, None)
        light = Light(None, None)
        value = np.array(exact(geometry, types.scalar(0), types.scalar(np.inf), medium, light), dtype=np.float64)
        expected, _ = airlight_segments(foot, height, 0.0, np.inf, 0.0, PhaseFunction("hg", g=g))
        assert value == pytest.approx(expected, rel=bound)


@pytest.mark.claim("infinite-through-the-light")
def test_rays_that_meet_the_light_are_infinite(variant):
    from realtime.kernels.exact import exact
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types = array_types()
    for name in ("isotropic", "rayleigh"):
        medium = Medium((types.scalar(0.5),), types.color(1), named_phase(name))
        geometry = RayGeometry(types.scalar([1.0, 0.0, 2.0, 3.0]), types.scalar(0.0), None, None)
        light = Light(None, None)
        value = np.array(exact(geometry, types.scalar(0.0), types.scalar(2.0), medium, light))
        assert np.isinf(value[:3]).all()  # on it, camera at the light, surface at the light
        assert np.isfinite(value[3])


def test_gamma_is_the_integral_from_the_camera(variant):
    from realtime.kernels.exact import exact
    from realtime.kernels.registry import airlight_integral, gamma
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types = array_types("double")
    medium = Medium((types.scalar(0.5),), types.color(1), named_phase("rayleigh"))
    geometry = RayGeometry(types.scalar(1.1), types.scalar(0.4), None, None)
    light = Light(None, None)
    ends = types.scalar(0.7), types.scalar(2.3)
    difference = [float(gamma(exact, geometry, x, medium=medium, light=light)[0]) for x in ends]
    direct = airlight_integral(exact, geometry, *ends, medium=medium, light=light)
    assert difference[1] - difference[0] == pytest.approx(float(direct[0]), rel=1e-12)
