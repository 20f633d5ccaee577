# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every kernel takes a phase function that it never heard of and empty rays, or says
in a line why it cannot.
"""

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.phase import Phase
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.kernel_values import RAY, kernel_values
from tests.helpers.scenes import tiny_scene

REFUSED = {"table", "closed-form", "taylor", "taylor-printed"}


@dataclass(frozen=True)
class Oval(Phase):
    """1 + cos^3: forward, smooth, of mean 1."""

    name = "oval"

    def evaluate_half(self, down, up):
        cos = up - down
        return 1 + cos * cos * cos


@pytest.mark.parametrize("name", KERNELS)
def test_a_phase_function_that_no_kernel_knows_is_taken_or_refused_in_a_line(variant, name):
    foot, height, x0, x1 = np.array(
        [[1.3, 0.7, 0.2, 4.1], [-0.4, 1.1, 0.0, 2.3], [2.9, 0.3, 0.5, 2.6], [1.7, 0.9, 1.6, 1.75]]
    ).T

    def integrand(x, foot, height):
        r = np.hypot(x - foot, height)
        return np.exp(-0.3 * (x + r)) * (1 + ((foot - x) / r) ** 3) / r**2

    kernel = KERNELS[name].function
    if name in REFUSED:
        with pytest.raises(
            InputError, match=r"^[^\n]*phase function 'oval'[^\n]*use the kernel [^\n]*$"
        ):
            kernel_values(kernel, (foot, height, x0, x1, 0.3), Oval())
        return
    reference = [
        quad(integrand, *ray[2:], args=tuple(ray[:2]), epsrel=1e-11)[0]
        for ray in zip(foot, height, x0, x1)
    ]
    value = kernel_values(kernel, (foot, height, x0, x1, 0.3), Oval())
    # Steps in the distance and a rule of 16 steps are coarse by design; the others are quadratures.
    assert np.max(np.abs(value / reference - 1)) < {"uniform": 2e-3, "equiangular": 5e-3}.get(
        name, 2e-6
    )


@pytest.mark.parametrize("name", sorted(set(KERNELS) - {"uniform", "equiangular", "table"}))
def test_segments_without_length_are_dark(variant, name):
    rays = ([1.0, 1.0, -2.0], 0.3, [0.0, 1.0, 5.0], [0.0, 1.0, 5.0], 0.7)
    assert np.all(kernel_values(KERNELS[name].function, rays) == 0)


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("quadrature", {"nodes": 0}, "nodes: got"),
        ("quadrature-theta", {"nodes": 0}, "nodes: got 0"),
        ("uniform", {"steps": 0}, "steps: got 0"),
        ("table", {"size": 1}, "size: got 1"),
    ],
)
def test_numbers_that_a_kernel_does_not_have_are_refused(variant, name, parameters, message):
    with pytest.raises(InputError, match=message):
        kernel_values(KERNELS[name].function, RAY, **parameters)


@pytest.mark.parametrize("name", ["quadrature", "exact"])
def test_a_light_beside_the_segment_on_the_ray(variant, name):
    """Height 0: the closed form int exp(-sigma_t (x + |x - t|)) / (x - t)^2 dx,
    behind and before the light.
    """
    values = kernel_values(KERNELS[name].function, ([-0.5, 2.5], 0.0, 0.0, 1.0, 0.7))
    for value, t in zip(values, (-0.5, 2.5), strict=True):
        expected = quad(lambda x, t=t: np.exp(-0.7 * (x + abs(x - t))) / (x - t) ** 2, 0, 1)[0]
        assert value == pytest.approx(expected, rel=6e-6)  # the bound of certified isotropic values


@pytest.mark.claim("refused-phase-functions")
@pytest.mark.parametrize("method", ["unshadowed", "light-volumes"])
def test_a_refusal_from_the_body_of_a_loop_stays_one(variant, method):
    """Dr.Jit wraps what is raised there: `random:13` ended `airlight render` with a traceback."""
    entries = tiny_scene()
    fog = entries["fog"] | {"phase": {"type": "tabphase", "values": "1.1, 0.4, 1.7"}}
    block = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.31),
    }
    scene = read_scene(mi.load_dict(entries | {"fog": fog, "ball": block}))
    with pytest.raises(InputError, match="no Taylor series"):
        render_frame(frame_renderer(scene, METHODS[method], kernel=KERNELS["taylor"]))
