# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of a light sample, with the cosine at its normal, against adaptive quadrature that shares nothing."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from realtime.kernels.registry import KERNELS
from realtime.numerics.array_types import array_types
from realtime.rays import ray_geometry
from realtime.scene.lights import Facing, Light
from realtime.scene.media.medium import Homogeneous
from realtime.scene.phase import HenyeyGreenstein, Isotropic

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


def wanted(rays, number, isotropic):
    """Return J by scipy, in the angle at the light, over what of the segment lies before the plane."""
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

    normal, direction = (mi.Vector3d(*(mi.Float64(c) for c in rays[name].T)) for name in ("normal", "direction"))
    light = Light(vector(rays["light"]), types.color(1), facing=Facing(normal, None, None), source=0)
    geometry = ray_geometry(vector(rays["origin"]), direction, light)
    phase = Isotropic() if isotropic else HenyeyGreenstein(number("g"))
    medium = Homogeneous((number("sigma_t"),), types.color(1), phase)
    x0, x1 = number("x0"), number("x1")
    return np.array(KERNELS[kernel].function(geometry, *geometry.lit_segment(x0, x1), medium, light)).ravel()


@pytest.mark.claim(
    "light-samples-exact", tolerance="1e-10: both are adaptive or have many nodes; float32 1e-6 in 9 of 10"
)
@pytest.mark.parametrize("isotropic", [True, False])
def test_exact_integrates_the_cosine(variant, rays, isotropic):
    values = np.array([wanted(rays, number, isotropic) for number in range(COUNT)])
    lit = values > 0
    assert 200 < lit.sum() < 400
    double = integrals(rays, "exact", "double", isotropic)
    np.testing.assert_allclose(double[lit], values[lit], rtol=1e-10)
    assert np.all(double[~lit] == 0)
    np.testing.assert_allclose(integrals(rays, "quadrature", "double", isotropic)[lit], values[lit], rtol=1e-4)
    error = np.abs(integrals(rays, "exact", "single", isotropic)[lit] / values[lit] - 1)
    # What remains of a segment next to the plane is known as badly as its ends.
    assert np.median(error) < 3e-7
    assert np.quantile(error, 0.9) < 2e-6
