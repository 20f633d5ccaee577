# SPDX-License-Identifier: BSD-3-Clause
"""Claim: right beside a sphere light in fog, airlight has the closed form, however few samples stand for the light."""

import mitsuba as mi
import numpy as np
import pytest

from tests.evidence.closed_forms import sphere_airlight
from tests.helpers.area_lights import BLACK, fog, lamp, lit_scene
from tests.helpers.frames import read, relative_rmse, render

SIGMA_T, RADIUS, FAR, END, SIZE = 0.21, 0.41, 5.0, 20.0, (24, 18)


def beside_a_sphere(**shapes):
    light = lamp("sphere", radiance=(1, 1, 1), center=[0.0, 0.0, FAR], radius=RADIUS)
    wall = {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().translate([0, 0, END]).scale([-50, 50, 50]),
        "bsdf": BLACK,
    }
    return read(lit_scene(size=SIZE, medium=fog(SIGMA_T, 1.0), lamp=light, wall=wall, **shapes))


@pytest.mark.claim("sphere-light-beside", tolerance="of the midpoint rule with 32 places a ray, 2e-3")
def test_fog_beside_a_sphere_light_has_the_closed_form(variant):
    """By 64 samples without it 9 %, by 16 27 %."""
    scene = beside_a_sphere()
    frame = render(scene, "shadow-planes", points=16)
    tangent = np.tan(np.radians(30.0)) * 2 / SIZE[0]
    column, row = np.meshgrid(*(np.arange(count) - 0.5 * (count - 1) for count in SIZE))
    slope = tangent * np.hypot(column, row)
    height, foot, end = FAR * slope / np.hypot(1, slope), FAR / np.hypot(1, slope), END * np.hypot(1, slope)
    beside = height > RADIUS
    rays = zip(height[beside], foot[beside], end[beside], strict=True)
    closed = np.array([sphere_airlight(SIGMA_T, h, RADIUS, foot=f, x0=0.0, x1=x1) for h, f, x1 in rays])
    expected = np.repeat(closed[:, None], 3, axis=1) * SIGMA_T / (4 * np.pi)
    assert relative_rmse(frame.airlight[beside], expected) < 2e-3
    # Before the lamp circles end at the ray, where the rule is of second order: samples without it err by 30 %.
    many = render(scene, "unshadowed", points=1024)
    assert relative_rmse(frame.airlight[~beside], many.airlight[~beside]) < 0.05


def test_what_is_in_the_shadow_of_a_sphere_light_stays_dark(variant):
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0, 0, FAR]).scale(1.0), "bsdf": BLACK}
    assert render(beside_a_sphere(box=box), "shadow-planes", points=16).airlight.max() < 1e-6
