# SPDX-License-Identifier: BSD-3-Clause
"""Where nothing casts a shadow a method is prepared as anywhere else, and what a scene
does not need costs nothing.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame.renderer import (
    frame_renderer,
    run_cast_and_shade,
    run_method,
    run_stages,
)
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import FOG_METHODS, METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import Configuration, prepared
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
    """An area light in fog, and nothing else."""
    return read_scene(mi.load_dict(tiny_scene(lamp=lamp(), ball=None, floor=None)))


def rendered(scene, method, points):
    """Return the airlight as an image, and how many operations the largest
    kernel of the method has.
    """
    parameters = SETTINGS.get(method.name, {}) | {"points": points, "pattern": "sobol"}
    renderer = frame_renderer(scene, method, kernel=KERNELS["exact"], **parameters)
    state = renderer.prepare(renderer.scene)
    cast, lit = run_cast_and_shade(renderer)
    dr.eval(run_method(renderer, state, cast, lit))  # records, and makes the tables of lights
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        airlight = run_method(renderer, state, cast, lit).airlight
        dr.eval(airlight)
        kernels = [launch for launch in dr.kernel_history() if launch["type"] == dr.KernelType.JIT]
    pixel = np.array(renderer.pixel)
    image = np.array(airlight).T[np.argsort(pixel)].reshape(12, 16, 3)
    return image, max(kernel["operation_count"] for kernel in kernels)


@pytest.mark.parametrize("name", FOG_METHODS)
def test_kernels_do_not_grow_with_the_points_of_a_light(empty, name):
    """Up to 4096 points were unrolled where a table of them was missing."""
    (image, few), (_, many) = (rendered(empty, METHODS[name], points) for points in (POINTS, 16))
    assert many == few
    error = np.abs(image / rendered(empty, METHODS["unshadowed"], POINTS)[0] - 1)
    # The steps meet a kink where a ray enters the half-space of a point: (1/60)^2 of an interval. A
    # froxel next to the lamp is as bright as its middle; half of all rays are as right as their
    # slices.
    assert np.median(error) < 2e-3 if name == "froxel-fog" else np.max(error) < 3e-4


# The same kernels and planes: no time can say it better -------------------------------------------


def kernels_of(renderer):
    """The kernels of a replayed frame: what each is by its hash, and how many lanes it has."""
    ready = renderer.prepare(renderer.scene)
    run_stages(renderer, ready)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        run_stages(renderer, ready)
        return [
            (kernel["type"], kernel.get("hash"), kernel["size"]) for kernel in dr.kernel_history()
        ]


@pytest.mark.claim("without-occluders", "not-needed-costs-nothing")
def test_without_occluders_shadow_planes_run_the_kernels_of_unshadowed(variant):
    """The same machine code on the same lanes."""
    scene = read_scene(load_scene("open-fog", (16, 12)).scene)
    planes, plain = (
        prepared(scene, Configuration(method, "exact"))
        for method in ("shadow-planes", "unshadowed")
    )
    recorded = kernels_of(planes)
    assert recorded
    # Arrays from NumPy are aligned as Dr.Jit's: the code that loads them would
    # differ with their alignment.
    assert recorded == kernels_of(plain)
