# SPDX-License-Identifier: BSD-3-Clause
"""A method and a medium that ask for most of the interface, or write no more than they must."""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import image_frame, render_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.scene.animate import coloured_light
from airlight.realtime.scene.media.medium import Medium
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.parts import mitsuba_mesh
from airlight.validation.study.configuration import configuration, prepared
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.occluders import closed_sphere
from tests.helpers.scenes import spot, tiny_scene
from tests.helpers.veil import Veil

SIZE = 24, 16
NAME = "tests.helpers.veil:Veil"


@pytest.fixture
def scene(variant):
    return read_scene(mi.load_dict(tiny_scene(size=SIZE)))


def frame(scene, method, **parameters):
    return render_frame(frame_renderer(scene, method, **parameters))


def test_frames_through_the_door_of_the_built_in_methods(scene):
    """The second frame has other colours: 1/4 of what it shows is the first."""
    renderer = prepared(scene, configuration(NAME, None, {"keep": "0.25"}))
    coloured = replace(scene, lights=tuple(coloured_light(light, 0.4) for light in scene.lights))
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    images = []
    cache = None
    for now in (scene, coloured, coloured):
        stages, cache = next_frame(renderer, now, cache, **still)
        images.append(image_frame(renderer, stages).airlight)
    alone = [frame(now, Veil, keep=0.25).airlight for now in (scene, coloured)]
    assert np.max(np.abs(alone[1] - alone[0])) > 0.01 * np.max(alone[0])
    np.testing.assert_allclose(images[0], alone[0], rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(images[1], 0.75 * alone[1] + 0.25 * alone[0], rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(images[2], 0.75 * alone[1] + 0.25 * images[1], rtol=1e-5, atol=1e-7)
    # without a last frame and with one, and no third
    assert renderer.stages.render.n_recordings == 2


def test_a_frame_is_composed_by_the_formula(scene):
    """surface visibility transmittance + transmittance background, the surface that of
    a method without layers.
    """

    @dataclass(frozen=True)
    class Nothing(Veil):
        carries = False

        def render(self, view, state, kernel):
            return Layers(type(view.medium.albedo)(0), tuple(True for _ in view.lights))

    plain = frame(scene, Nothing)
    veiled = frame(scene, Veil, fraction=0.3, veil=0.6)
    behind = np.where(np.isfinite(plain.distance)[..., None], 0, np.array([0.3, 0.4, 0.5]))
    assert np.max(plain.surface) > 0
    assert np.max(behind) > 0
    np.testing.assert_allclose(
        veiled.surface, 0.6 * (0.3 * plain.surface + behind), rtol=1e-5, atol=1e-8
    )


def test_a_method_that_casts_no_rays_and_asks_for_one_is_told_so(scene):
    @dataclass(frozen=True)
    class Asks(Veil):
        def render(self, view, state, kernel):
            return Layers(
                dr.select(
                    view.visible(view.origin + view.direction, view.lights[0]),
                    view.medium.albedo,
                    0,
                )
            )

    with pytest.raises(InputError, match="the method says that it casts no rays"):
        frame(scene, Asks)


def lights_of_two_kinds(**changes):
    """A spot between two point lights: a frame has them in another order than the scene."""
    other = {
        "type": "point",
        "position": [-1.1, -0.6, 1.2],
        "intensity": {"type": "rgb", "value": [1.0, 4.0, 2.0]},
    }
    scene = read(tiny_scene(spot=spot(beam=21.0), other=other, **changes))
    assert [light.kind for light in scene.lights] == ["point", "spot", "point"]
    return scene


def test_states_of_lights_that_come_at_once_belong_to_their_lights(variant):
    @dataclass(frozen=True)
    class Told(Method):
        name = "told"
        at_once = True
        uses_kernel = False

        def prepare(self, scene, light):
            return light.intensity

        def airlight(self, view, light, state, kernel):
            return dr.abs(state - light.intensity) + 0 * view.distance

    assert np.max(render(lights_of_two_kinds(), Told).airlight) == 0


@pytest.mark.parametrize("once", [True, False])
def test_what_a_user_s_own_preparation_makes_belongs_to_the_lights_of_its_view(variant, once):
    """Also for what it reads before all frames, and where a light is moved from frame to frame."""

    @dataclass(frozen=True)
    class Own(Method):
        name = "own"
        at_once = once
        uses_kernel = False

        def preparation(self, scene):
            kinds = [light.kind for light in scene.lights]

            def places(now):
                several = len(now.lights) == len(kinds)
                assert not several or [light.kind for light in now.lights] == kinds
                return tuple(light.position + 0 for light in now.lights)

            return places

        def render(self, view, state, kernel):
            away = [dr.norm(a - b.position) for a, b in zip(state, view.lights, strict=True)]
            return Layers(view.medium.albedo * (dr.sum(away) + 0 * view.distance))

    scene = lights_of_two_kinds()
    moved = {"camera_moved": False, "geometry_moved": False, "light_moved": True}
    made, cache = frame_renderer(scene, Own), None
    for step in range(3):
        last = scene.lights[-1]
        lights = (*scene.lights[:-1], replace(last, position=last.position + 0.1 * step))
        stages, cache = next_frame(made, replace(scene, lights=lights), cache, **moved)
        assert np.max(image_frame(made, stages).airlight) == 0


def test_planes_of_lights_in_one_buffer_belong_to_their_lights(variant):
    """Ambient light puts all lights into one group."""
    scene = lights_of_two_kinds(ball=mitsuba_mesh("ball", closed_sphere(), (0.3, 0.4, 0.5)))
    alone, together = (
        render(scene, "shadow-planes-2006", ambient=each).airlight for each in (0.0, 1e-9)
    )
    assert relative_rmse(together, alone) < 1e-6


# A medium of two functions ------------------------------------------------------------------------


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

    def longest(self, rays, light, x, change):
        return change / (2 * self.sigma_t)

    def length_of(self, depth):
        return depth / self.sigma_t

    def thicker(self, factor):
        return replace(self, sigma_t=factor * self.sigma_t)


@pytest.mark.parametrize(
    "method", ["shadow-planes", "light-volumes", "ray-march", "froxel-fog", "soft-shafts"]
)
def test_a_medium_of_two_functions(variant, method):
    """Panels of any medium against the kernel; depths by segments, against one product."""
    place = mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.3)
    box = {"type": "cube", "to_world": place, "bsdf": {"type": "diffuse"}}
    scene = read(tiny_scene(lamp=spot(beam=21.0), ball=box), "double")
    own = scene.medium
    media = own, Fog(own.sigma_t[0], own.albedo, own.phase)
    homogeneous, fog = (render(replace(scene, medium=medium), method) for medium in media)
    assert relative_rmse(fog.airlight, homogeneous.airlight) < 1e-7
    assert fog.surface == pytest.approx(homogeneous.surface, rel=1e-9)
