# SPDX-License-Identifier: BSD-3-Clause
"""A medium that writes no more than it must is rendered by every method like one that knows better."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.renderer import frame_renderer, render_frame
from realtime.kernels.exact import exact
from realtime.methods.registry import METHODS
from realtime.scene.media.medium import Medium
from tests.helpers.frames import read, relative_rmse
from tests.helpers.scenes import spot, tiny_scene
from tests.helpers.sunlit import rays


@dataclass(frozen=True)
class Fog(Medium):
    """Fog that is as thick as its floor has it, and by `slope` thicker with every metre of height."""

    floor: Any  #: [1/m]
    slope: Any  #: [1/m^2]
    albedo: Any
    phase: Any
    channels = 1
    vacuum = False

    def extinction(self, rays, x):
        return (dr.fma(self.slope, rays.at(x).z, self.floor),)

    def optical_depth(self, rays, x0, x1):
        return (0.5 * (x1 - x0) * (self.extinction(rays, x0)[0] + self.extinction(rays, x1)[0]),)

    def length_of(self, depth):
        return depth / self.floor

    def thicker(self, factor):
        return replace(self, floor=factor * self.floor, slope=factor * self.slope)


def images(scene, method, slope):
    """Return the frame of a homogeneous medium, and that of a `Fog` in its place."""
    own = scene.medium
    Float = type(own.sigma_t[0])
    fog = Fog(own.sigma_t[0], dr.opaque(Float, slope), own.albedo, own.phase)
    both = scene, replace(scene, medium=fog)
    return [render_frame(frame_renderer(one, METHODS[method], kernel=exact)) for one in both]


@pytest.mark.parametrize("method", ["shadow-planes", "light-volumes", "ray-march", "froxel-fog", "soft-shafts"])
def test_a_medium_of_two_functions(variant, method):
    """16 nodes in w on each side of the foot, against the kernel; depths by segments, against one product."""
    place = mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.3)
    box = {"type": "cube", "to_world": place, "bsdf": {"type": "diffuse"}}
    homogeneous, fog = images(read(tiny_scene(lamp=spot(beam=21.0), ball=box), "double"), method, 0.0)
    assert relative_rmse(fog.airlight, homogeneous.airlight) < 1e-7
    assert fog.surface == pytest.approx(homogeneous.surface, rel=1e-9)


def test_a_medium_that_varies(variant):
    """Fog that is four times as thick at the lamp as on the floor, against 4000 steps in theta."""
    slope, lamp, floor = 0.5, np.array([0.9, 0.7, 1.9]), 0.31
    ground = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(1e3), "bsdf": {"type": "diffuse"}}
    scene = read(tiny_scene(size=(8, 6), ball=None, floor=ground), "double")
    _, frame = images(scene, "unshadowed", slope)
    origin, direction = rays(scene)
    for ray, found in zip(range(0, 48, 7), frame.airlight.reshape(-1, 3)[::7], strict=True):
        d = direction[ray]
        if d[2] < 0:  # ends on the ground, below which the fog would be thinner than nothing
            continue
        foot = (lamp - origin) @ d
        height = np.linalg.norm(np.cross(lamp - origin, d))
        begin, end = np.arctan2(0 - foot, height), 0.5 * np.pi
        theta = begin + (np.arange(4000) + 0.5) / 4000 * (end - begin)
        x, r = foot + height * np.tan(theta), height / np.cos(theta)
        z = origin[2] + x * d[2]
        depth = x * (floor + slope * 0.5 * (origin[2] + z)) + r * (floor + slope * 0.5 * (z + lamp[2]))
        integral = np.mean((floor + slope * z) * np.exp(-depth)) * (end - begin) / height
        expected = np.array([5.0, 4.0, 3.0]) * np.array([0.9, 0.8, 0.7]) * integral / (4 * np.pi)
        assert found == pytest.approx(expected, rel=1e-5)
