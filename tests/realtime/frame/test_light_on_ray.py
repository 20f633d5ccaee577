# SPDX-License-Identifier: BSD-3-Clause
"""Protects the claim that no frame holds what is not finite, and that a light on a ray is refused by its distance."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from realtime.errors import InputError
from realtime.frame.light_on_ray import check_radiance
from realtime.methods.registry import FOG_METHODS
from tests.helpers import frames
from tests.helpers.scenes import tiny_scene


def render(method, *, position, size=(9, 9), changes=None, **parameters):
    """Render a scene whose camera looks along +y, its middle pixel along the axis."""
    scene = tiny_scene(size=size, floor=None)
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, -5, 1], [0, 0, 1], [0, 0, 1])
    scene["lamp"]["position"] = position
    scene |= {"ball": {"type": "cube", "to_world": mi.ScalarTransform4f().translate([2, 3, 0]).scale(0.3)}} | (
        changes or {}
    )
    return frames.render(scene, method, **parameters)


@pytest.mark.claim("light-on-a-ray-refused")
@pytest.mark.parametrize("method", FOG_METHODS)
@pytest.mark.parametrize("position", [[0.0, -5.0, 1.0], [0.0, 0.0, 1.0], [1e-8, 0.0, 1.0]])
def test_a_light_at_the_camera_or_on_a_ray_is_refused_by_its_distance(variant, method, position):
    with pytest.raises(InputError, match=r"light 1 is [\d.e-]+ m from the (camera|ray .* column 4 of row 4)"):
        render(method, position=position)


@pytest.mark.parametrize("position", [[0.0, -9.0, 1.0], [0.0, 9.0, 1.0], [1e-4, 0.0, 1.0], [0.0, -4.999, 1.03]])
def test_a_light_on_the_line_of_a_ray_but_not_on_it_is_rendered(variant, position):
    """Behind the camera, behind a wall, a little aside."""
    wall = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0, 4, 1]).scale(0.5)}
    frame = render("unshadowed", position=position, changes={"wall": wall})
    assert np.isfinite(frame.airlight).all()
    assert frame.airlight[4, 4].min() > 0


@pytest.mark.parametrize(
    ("method", "parameters"),
    [
        ("ray-march", {}),
        ("ray-march", {"sum": "transitions"}),
        ("soft-shafts", {"spacing": "equiangular", "steps": 100, "filter": "none"}),
    ],
)
def test_a_ray_straight_away_from_a_light_has_its_airlight(variant, method, parameters):
    """All angles at the light are 90 degrees there, and equal steps in them had no length."""
    J, _ = quad(lambda x: np.exp(-0.31 * (2 * x + 4)) / (x + 4) ** 2, 0, np.inf)
    wanted = J * 0.31 * np.array([0.9 * 5, 0.8 * 4, 0.7 * 3]) / (4 * np.pi)
    for away in (0.0, 1e-7, 1e-4):
        found = render(method, position=[away, -9.0, 1.0], **parameters).airlight[4, 4]
        # Both ends of an angle of 1/1024 are rounded to 2^-24: 1.2e-4, and as much for the places of its steps.
        np.testing.assert_allclose(found, wanted, rtol=3e-4)


def test_what_is_not_finite_is_refused_whatever_the_reason():
    values = np.ones((2, 3, 3))
    values[1, 2, 0] = np.nan
    scene = SimpleNamespace(lights=(), medium=SimpleNamespace(clear=False))
    for layers in ((values, np.ones_like(values)), (np.ones_like(values), values)):
        with pytest.raises(InputError, match="1 of 6 pixels is not finite, first in column 2 of row 1: nan, 1, 1"):
            check_radiance(scene, "unshadowed", *layers, np.full((2, 3), np.inf))
