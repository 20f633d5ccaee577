# SPDX-License-Identifier: BSD-3-Clause
"""Froxel fog: the same sums in plain NumPy, its limits, and its order,
under lamps and area lights.
"""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.methods.froxel_fog.grid import Grid, accumulated, column_rays
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import Isotropic
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers import probes
from tests.helpers.frames import frame, read, reference_of, relative_rmse, render
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene
from tests.helpers.suns import brick, pearl, sunny

COARSE = {"width": 5, "height": 4, "slices": 7, "far": 7.3}


def lamp_behind(**changes):
    """A lamp far beside the image: no ray comes near it, so that the integrand is smooth."""
    return {
        "type": "point",
        "position": [2.9, -3.7, 2.3],
        "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
    } | changes


def lamp_above():
    """A lamp over the image, whose shadow of the ball is in it."""
    return lamp_behind(position=[0.3, 0.4, 3.1])


def hazy(sigma_t=(0.11, 0.37, 0.93)):
    return {
        "type": "homogeneous",
        "id": "fog",
        "sigma_t": {"type": "rgb", "value": list(sigma_t)},
        "albedo": {"type": "rgb", "value": [0.9, 0.8, 0.7]},
        "phase": {"type": "hg", "g": 0.43},
        "has_spectral_extinction": True,
    }


def by_hand(scene, *, width, height, slices, far):
    """Do what the method does in NumPy, from the formulas of its
    documentation; no shadows, no bounds.
    """
    reference = read_reference(mi.load_dict(scene))
    matrix = np.array(
        mi.load_dict(scene).sensors()[0].world_transform().matrix, dtype=float
    ).reshape(4, 4)
    origin, forward = matrix[:3, 3], matrix[:3, 2]
    half = np.tan(np.radians(0.5 * scene["sensor"]["fov"]))
    left, up = matrix[:3, 0] * half, matrix[:3, 1] * half * reference.height / reference.width

    def depth(s):
        return far / 8 * (9**s - 1)

    sigma, albedo, g = reference.medium.sigma_t, reference.medium.albedo, 0.43
    sums = np.zeros((slices + 1, height, width, 3))
    for j in range(height):
        for i in range(width):
            ray = forward + left * (1 - 2 * (i + 0.5) / width) + up * (1 - 2 * (j + 0.5) / height)
            stretch, kept = np.linalg.norm(ray), np.ones(3)
            for k in range(slices):
                begin, end = depth(k / slices), depth((k + 1) / slices)
                point = origin + 0.5 * (begin + end) * ray
                source = np.zeros(3)
                for light in reference.lights:
                    toward = light.position - point
                    r = np.linalg.norm(toward)
                    cosine = toward @ ray / (r * stretch)
                    phase = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
                    strength = 1.0
                    if getattr(light, "axis", None) is not None:
                        angle = np.degrees(np.arccos(-toward @ light.axis / r))
                        cutoff, beam = scene["spot"]["cutoff_angle"], scene["spot"]["beam_width"]
                        strength = np.clip((cutoff - angle) / (cutoff - beam), 0, 1)
                    source += strength * light.intensity * phase * np.exp(-sigma * r) / r**2
                source *= albedo * sigma / (4 * np.pi)
                length = (end - begin) * stretch
                sums[k + 1, j, i] = (
                    sums[k, j, i] + kept * source * (1 - np.exp(-sigma * length)) / sigma
                )
                kept *= np.exp(-sigma * length)
    # Between the middles of columns and the ends of slices: rays that meet no
    # surface end at the last slice.
    image = np.zeros((reference.height, reference.width, 3))
    for row in range(reference.height):
        for column in range(reference.width):
            x = np.clip((column + 0.5) / reference.width * width - 0.5, 0, width - 1)
            y = np.clip((row + 0.5) / reference.height * height - 0.5, 0, height - 1)
            for i in range(width):
                for j in range(height):
                    fraction = max(0, 1 - abs(x - i)) * max(0, 1 - abs(y - j))
                    image[row, column] += fraction * sums[slices, j, i]
    return image


@pytest.mark.claim("froxel-sums", tolerance="1e-6 relative: positions are float32")
def test_the_sums_are_those_of_plain_numpy(variant):
    scene = tiny_scene(
        size=(13, 11),
        ball=None,
        floor=None,
        fog=hazy(),
        lamp=lamp_behind(),
        spot=spot(cutoff=41.0, beam=12.0),
    )
    np.testing.assert_allclose(
        frame(scene, "froxel-fog", precision="double", **COARSE).airlight,
        by_hand(scene, **COARSE),
        rtol=2e-6,
    )


@pytest.mark.claim(
    "froxel-slice", tolerance="1e-12 relative: the closed form, whatever the number of slices"
)
@pytest.mark.parametrize("sigma_t", [1e-9, 0.003, 0.9, 37.0])
@pytest.mark.parametrize("slices", [1, 5])
def test_slices_of_constant_light_add_up_to_the_closed_form(variant, sigma_t, slices):
    scene = read(tiny_scene(size=(2, 2)), "double")
    grid = Grid(2, 1, slices, scene.camera, mi.Float64(3.1))
    medium = Homogeneous((mi.Float64(sigma_t),), mi.Color3d(1), Isotropic())
    view = SimpleNamespace(medium=medium, distance=mi.Float64(0), origin=scene.camera.origin)
    light = dr.full(mi.Color3d, 1.7, 2 * slices)
    sums = np.array(accumulated(view, grid, column_rays(view, grid), light)).reshape(
        slices + 1, 2, 4
    )
    x = np.array(grid.depth(dr.arange(mi.Float64, slices + 1) / slices))[:, None]
    x = x * np.array(dr.norm(grid.column_ray(dr.arange(mi.UInt32, 2))))
    closed = 1.7 * -np.expm1(-sigma_t * x) / sigma_t
    for channel in range(3):
        np.testing.assert_allclose(sums[:, :, channel], closed, rtol=1e-12)


SMOOTH = {
    "one medium": lambda: tiny_scene(
        size=(24, 18), lamp=lamp_behind(), ball=None, fog=hazy((0.31, 0.31, 0.31))
    ),
    "three extinctions": lambda: tiny_scene(
        size=(24, 18), lamp=lamp_behind(), ball=None, fog=hazy()
    ),
    "spot": lambda: tiny_scene(
        size=(24, 18), lamp=None, spot=spot(cutoff=60.0, beam=5.0), ball=None
    ),
    "sphere of fog": lambda: clear_scene(
        size=(24, 18),
        lamp=lamp_behind(),
        fog=bounded_medium(
            {"type": "sphere", "center": [0.1, 0.2, 0.7], "radius": 0.9}, 0.9, (0.9, 0.4, 0.3)
        ),
    ),
    "sun": lambda: sunny(size=(24, 18), brick=brick(), pearl=pearl()),
}
OUTLINED = ("spot", "sphere of fog", "sun")


@pytest.mark.claim(
    "froxel-limit",
    tolerance=(
        "relative RMSE 2.5e-3, the light from beyond the grid; order 0.5 at the outline of a "
        "medium or a cone"
    ),
)
@pytest.mark.parametrize("name", SMOOTH)
def test_fine_grids_reach_the_integral_of_unshadowed_light(variant, name):
    """Middles of froxels and lines between them err as the square of their size.

    An outline that columns cut is wrong in a strip as wide as a column: by all of its light in n^-1
    of the pixels, so that the RMSE falls as n^-1/2 at least.
    """
    scene = SMOOTH[name]()
    exact = frame(scene, "unshadowed").airlight
    coarse, fine = (
        relative_rmse(
            frame(scene, "froxel-fog", width=4 * n, height=3 * n, slices=4 * n).airlight, exact
        )
        for n in (8, 24)
    )
    assert fine < 3**-0.5 * coarse
    assert fine < 2.5e-3 or name in OUTLINED


@pytest.mark.claim(
    "froxel-order", tolerance="at least 0.7 from three grids, a factor of four apart"
)
def test_the_error_falls_with_the_grid_in_order(variant):
    scene = tiny_scene(size=(32, 24), lamp=lamp_above())
    sizes = np.array([8, 16, 32])
    errors = [
        relative_rmse(
            frame(scene, "froxel-fog", width=2 * n, height=n, slices=n, shadow="ray").airlight,
            reference_of(scene).airlight,
        )
        for n in sizes.tolist()
    ]
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 0.7, errors


def test_a_sharp_lobe_keeps_its_digits_in_float32(variant):
    """A cosine has lost the angle: values were wrong by a hundredth."""
    ball = {"type": "sphere", "center": [0.1, 0.0, 0.6], "radius": 0.5}
    body = bounded_medium(ball, 0.9, (0.9,) * 3, phase={"type": "hg", "g": 0.996})
    sun = {"type": "directional", "direction": [0.1, -4.1, 0.7], "irradiance": 3.0}
    scene = clear_scene(lamp=sun, ball=body)
    scene["sensor"] = scene["sensor"] | {"fov": 2.0}
    single, double = (
        render(scene, "froxel-fog", precision=precision, width=16, height=12).airlight
        for precision in ("single", "double")
    )
    assert double.min() > 0
    np.testing.assert_allclose(single, double, rtol=3e-4)


def test_shadows_of_the_sun_are_there(variant):
    scene = probes.sun()
    exact = reference_of(scene).airlight
    without = frame(scene, "unshadowed").airlight
    froxels = frame(scene, "froxel-fog", shadow="ray").airlight
    assert relative_rmse(froxels, exact) < 0.25 * relative_rmse(without, exact)


@pytest.mark.slow
@pytest.mark.claim(
    "froxel-order", tolerance="at least 0.7 from four grids, a factor of eight apart"
)
def test_the_error_falls_with_the_grid_under_a_light_with_extent(variant):
    scene = read_scene(load_scene("penumbra-plane", (80, 60)).scene)
    exact = render(scene, "shadow-planes", points=4).airlight
    sizes = np.array([8, 16, 32, 64])
    errors = [
        relative_rmse(
            render(scene, "froxel-fog", points=4, width=2 * n, height=n, slices=n).airlight, exact
        )
        for n in sizes.tolist()
    ]
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 0.7, errors
    assert errors[-1] < 0.05
