# SPDX-License-Identifier: BSD-3-Clause
"""A medium that writes no more than it must is rendered by every method like one that knows better."""

from dataclasses import dataclass, replace
from typing import Any

import mitsuba as mi
import pytest

from realtime.scene.media.medium import Medium
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.scenes import spot, tiny_scene


@dataclass(frozen=True)
class Fog(Medium):
    """Homogeneous fog that says no more than it must."""

    sigma_t: Any  #: [1/m]
    albedo: Any
    phase: Any
    channels = 1
    vacuum = False

    def extinction(self, rays, x):
        return (self.sigma_t,)

    def optical_depth(self, rays, x0, x1):
        return (self.sigma_t * (x1 - x0),)

    def length_of(self, depth):
        return depth / self.sigma_t

    def thicker(self, factor):
        return replace(self, sigma_t=factor * self.sigma_t)


@pytest.mark.parametrize("method", ["shadow-planes", "light-volumes", "ray-march", "froxel-fog", "soft-shafts"])
def test_a_medium_of_two_functions(variant, method):
    """16 nodes in w on each side of the foot, against the kernel; depths by segments, against one product."""
    place = mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.3)
    box = {"type": "cube", "to_world": place, "bsdf": {"type": "diffuse"}}
    scene = read(tiny_scene(lamp=spot(beam=21.0), ball=box), "double")
    own = scene.medium
    media = own, Fog(own.sigma_t[0], own.albedo, own.phase)
    homogeneous, fog = (render(replace(scene, medium=medium), method) for medium in media)
    assert relative_rmse(fog.airlight, homogeneous.airlight) < 1e-7
    assert fog.surface == pytest.approx(homogeneous.surface, rel=1e-9)
