# SPDX-License-Identifier: BSD-3-Clause
"""The kernels to beat: midpoint steps and nodes in theta."""

import numpy as np
import pytest

from realtime.errors import InputError


def values(kernel, precision="double", *, phase="isotropic", **parameters):
    """Evaluate a kernel on moderate rays: the light in front, well away from the ray."""
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    rng = np.random.default_rng(17)
    foot, height, sigma_t = rng.uniform(0.5, 2, 300), rng.uniform(0.5, 2, 300), rng.uniform(0.1, 1, 300)
    types = array_types(precision)
    medium = Medium((types.scalar(sigma_t),), types.color(1), named_phase(phase, g=0.4 if phase == "hg" else None))
    geometry = RayGeometry(types.scalar(foot), types.scalar(height), None, None)
    ends = types.scalar(0), types.scalar(3.1)
    return np.array(kernel(geometry, *ends, medium, Light(None, None), **parameters), dtype=np.float64)


@pytest.mark.claim("declared-orders")
@pytest.mark.parametrize("phase", ["isotropic", "hg"])
@pytest.mark.parametrize("name", ["uniform", "equiangular"])
def test_midpoint_steps_are_of_second_order(variant, name, phase):
    from realtime.kernels.registry import KERNELS

    exact = values(KERNELS["exact"].function, phase=phase)
    steps = np.array([32, 64, 128, 256])
    errors = [np.median(np.abs(values(KERNELS[name].function, phase=phase, steps=int(n)) / exact - 1)) for n in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2, abs=0.05)


@pytest.mark.claim("declared-orders")
def test_nodes_in_theta_converge_geometrically(variant):
    from realtime.kernels.registry import KERNELS

    exact = values(KERNELS["exact"].function)
    nodes = np.array([2, 4, 6, 8])
    errors = [np.median(np.abs(values(KERNELS["quadrature-theta"].function, nodes=int(n)) / exact - 1)) for n in nodes]
    assert np.all(np.diff(np.log(errors)) < -2)  # two more nodes, at least a factor of 7
    assert errors[-1] < 1e-6


@pytest.mark.parametrize(
    ("name", "parameter"), [("uniform", "steps"), ("equiangular", "steps"), ("quadrature-theta", "nodes")]
)
def test_no_steps_are_refused(variant, name, parameter):
    from realtime.kernels.registry import KERNELS

    with pytest.raises(InputError, match=f"{parameter}: got 0"):
        values(KERNELS[name].function, **{parameter: 0})


def test_endless_rays(variant):
    """20 optical depths end uniform steps, pi/2 ends the angle."""
    from realtime.kernels.registry import KERNELS
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types = array_types("double")
    medium = Medium((types.scalar(0.4),), types.color(1), named_phase("isotropic"))
    geometry = RayGeometry(types.scalar(1.3), types.scalar(0.9), None, None)
    light = Light(None, None)

    def run(name, **parameters):
        ends = types.scalar(0), types.scalar(np.inf)
        return float(KERNELS[name].function(geometry, *ends, medium, light, **parameters)[0])

    exact = run("exact")
    assert run("uniform", steps=20000) == pytest.approx(exact, rel=1e-6)
    assert run("equiangular", steps=20000) == pytest.approx(exact, rel=1e-6)
    assert run("quadrature-theta", nodes=64) == pytest.approx(exact, rel=1e-5)
