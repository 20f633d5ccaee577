# SPDX-License-Identifier: BSD-3-Clause
"""Where nothing casts a shadow a method is prepared as anywhere else.

Its kernels do not grow with the points of an area light, and its airlight is the sum over these points.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.renderer import frame_renderer, render_frame, run_cast_and_shade, run_method
from realtime.kernels.exact import exact
from realtime.methods.registry import FOG_METHODS, METHODS
from realtime.methods.user_method import user_method
from realtime.scene.camera import ray_directions
from realtime.scene.light_samples import with_light_samples
from realtime.scene.read_scene import read_scene
from tests.helpers.lamps import lamp
from tests.helpers.scenes import tiny_scene

#: How methods that march resolve this light.
SETTINGS = {
    "ray-march": {"steps": 60},
    "froxel-fog": {"width": 32, "height": 24, "slices": 96},
    "soft-shafts": {"steps": 60, "spacing": "equiangular", "filter": "none"},
}
POINTS = 4


@pytest.fixture(scope="module")
def empty(variant):
    """A area light in fog, and nothing else."""
    return read_scene(mi.load_dict(tiny_scene(lamp=lamp(), ball=None, floor=None)))


def rendered(scene, method, points):
    """Return the airlight as an image, and how many operations the largest kernel of the method has."""
    parameters = SETTINGS.get(method.name, {}) | {"points": points, "pattern": "sobol"}
    renderer = frame_renderer(scene, method, kernel=exact, **parameters)
    state = renderer.prepare(renderer.scene)
    cast, by_light = run_cast_and_shade(renderer)
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        airlight = run_method(renderer, state, cast, by_light).airlight
        dr.eval(airlight)
        kernels = [launch for launch in dr.kernel_history() if launch["type"] == dr.KernelType.JIT]
    pixel = np.array(renderer.pixel)
    image = np.array(airlight).T[np.argsort(pixel)].reshape(12, 16, 3)
    return image, max(kernel["operation_count"] for kernel in kernels)


def sum_over_points(scene):
    """Return the airlight of the points by a hundred Gauss-Legendre nodes in the angle at each, for unbounded rays."""
    lit = with_light_samples(scene, POINTS, "sobol")
    pixel = dr.arange(type(dr.zeros(dr.uint32_array_t(lit.camera.origin.x))), 16 * 12)
    direction = np.array(ray_directions(lit.camera, pixel)[0], dtype=np.float64).T
    origin = np.array(lit.camera.origin, dtype=np.float64).ravel()
    sigma, nodes, weights = 0.31, *np.polynomial.legendre.leggauss(100)
    total = np.zeros((len(direction), 3))
    for light in lit.lights:
        place, normal = (np.array(value, dtype=np.float64).ravel() for value in (light.position, light.normal))
        foot = direction @ (place - origin)
        height = np.linalg.norm(place - origin - foot[:, None] * direction, axis=1)
        begin = np.arctan2(-foot, height)
        theta = begin[:, None] + 0.5 * (0.5 * np.pi - begin[:, None]) * (1 + nodes)
        x = foot[:, None] + height[:, None] * np.tan(theta)
        r = height[:, None] / np.cos(theta)
        away = origin + x[..., None] * direction[:, None] - place
        value = np.exp(-sigma * (x + r)) * np.maximum(away @ normal, 0) / r
        J = value @ weights * 0.5 * (0.5 * np.pi - begin) / height
        total += J[:, None] * np.array(light.intensity, dtype=np.float64).ravel()
    return (total * sigma * np.array([0.9, 0.8, 0.7]) / (4 * np.pi)).reshape(12, 16, 3)


@pytest.mark.parametrize("name", FOG_METHODS)
def test_kernels_do_not_grow_with_the_points_of_a_light(empty, name):
    """Up to 4096 points were unrolled where a table of them was missing."""
    (image, few), (_, many) = (rendered(empty, METHODS[name], points) for points in (POINTS, 16))
    assert many == few
    error = np.abs(image / sum_over_points(empty) - 1)
    # The nodes and the steps meet a kink where a ray enters the half-space of a point: (1/60)^2 of an interval.
    # A froxel next to the lamp is as bright as its middle; half of all rays are as right as their slices.
    assert np.median(error) < 2e-3 if name == "froxel-fog" else np.max(error) < 3e-4


def test_a_users_method_is_prepared(empty, tmp_path):
    path = tmp_path / "prepared.py"
    path.write_text("def mine(view): return view.prepared\nmine.prepare = lambda scene: lambda scene: 7.0\n")
    assert (render_frame(frame_renderer(empty, user_method(f"{path}:mine"), points=1)).airlight == 7).all()
