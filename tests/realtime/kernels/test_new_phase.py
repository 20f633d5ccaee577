# SPDX-License-Identifier: BSD-3-Clause
"""A phase function that only this test knows: no kernel asks for names.

Claim: a new phase function is a class with a name and values. Every kernel takes it, or says in one line that it
cannot.
"""

from dataclasses import dataclass

import numpy as np
import pytest

REFUSED = {"table", "table-tail", "closed-form", "taylor", "taylor-printed"}


def oval():
    """Return 1 + cos^3: forward, smooth, of mean 1; and J of a ray in vacuum by SciPy."""
    from realtime.scene.phase import Phase

    @dataclass(frozen=True)
    class Oval(Phase):
        name = "oval"

        def evaluate_half(self, down, up):
            cos = up - down
            return 1 + cos * cos * cos

    return Oval()


def case(sigma_t=0.3):
    """Return foot, height, x0, x1 and sigma_t of a few rays, and their J."""
    from scipy.integrate import quad

    rays = np.array([[1.3, 0.7, 0.2, 4.1], [-0.4, 1.1, 0.0, 2.3], [2.9, 0.3, 0.5, 2.6], [1.7, 0.9, 1.6, 1.75]])

    def integrand(x, foot, height):
        r = np.hypot(x - foot, height)
        return np.exp(-sigma_t * (x + r)) * (1 + ((foot - x) / r) ** 3) / r**2

    truth = [quad(integrand, x0, x1, args=(foot, height), epsabs=0, epsrel=1e-11)[0] for foot, height, x0, x1 in rays]
    return rays.T, sigma_t, np.array(truth)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_every_kernel_takes_it_or_refuses_it_in_a_line(variant, precision):
    from realtime.errors import InputError
    from realtime.kernels.registry import KERNELS
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium

    types = array_types(precision)
    (foot, height, x0, x1), sigma_t, truth = case()
    medium = Medium((types.scalar(sigma_t),), types.color(1), oval())
    geometry = RayGeometry(types.scalar(foot), types.scalar(height))
    refused = set()
    for name, kernel in KERNELS.items():
        given = geometry, types.scalar(x0), types.scalar(x1), medium, Light(None, None)
        if name in REFUSED:
            with pytest.raises(InputError, match=r"^[^\n]*phase function 'oval'[^\n]*use the kernel [^\n]*$"):
                kernel.function(*given)
            refused.add(name)
            continue
        value = np.array(kernel.function(*given), dtype=np.float64)
        # Steps in the distance and a rule of 16 steps are coarse by design; the others are quadratures.
        allowed = {"uniform": 2e-3, "equiangular": 5e-3}.get(name, 2e-6 if precision == "single" else 2e-7)
        assert np.max(np.abs(value / truth - 1)) < allowed, name
    assert refused == REFUSED


def test_a_frame_in_a_bounded_medium_takes_it(variant):
    """Claim: the legs through bounded media ask for no names either; the airlight is that of marching finely."""
    from dataclasses import replace

    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from tests.helpers.suns import brick, pearl, sunny

    lamp = {"type": "point", "position": [-0.3, -0.7, 1.9], "intensity": {"type": "rgb", "value": 3.0}}
    for light in ({}, {"sun": lamp}):
        scene = read_scene(mi.load_dict(sunny(brick=brick(), pearl=pearl(), size=(6, 4), **light)), "double")
        bounded_media = tuple(
            replace(bounded_medium, medium=replace(bounded_medium.medium, phase=oval()))
            for bounded_medium in scene.medium.bounded_media
        )
        scene = replace(scene, medium=replace(scene.medium, bounded_media=bounded_media))
        kernel = KERNELS["exact"].function
        airlight = render_frame(frame_renderer(scene, METHODS["unshadowed"], kernel=kernel)).airlight
        marched = frame_renderer(scene, METHODS["ray-march"], shadow="none", steps=600)
        wanted = render_frame(marched).airlight
        assert wanted.max() > 0
        assert np.max(np.abs(airlight - wanted)) < 5e-3 * wanted.max()
