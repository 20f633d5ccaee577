# SPDX-License-Identifier: BSD-3-Clause
"""What a frame keeps of the last one: the images are those of frames made afresh, bit by bit."""

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.incremental import next_frame
from realtime.frame.renderer import FrameRenderer, frame_renderer, image_frame, run_stages
from realtime.kernels.registry import KERNELS
from realtime.methods.interface.method import Method
from realtime.methods.registry import METHODS
from realtime.scene.animate import (
    closed_shapes,
    coloured_light,
    read_objects,
    thicker_medium,
    turned_light,
    turned_objects,
)
from realtime.scene.mesh_adjacency import read_occluders
from realtime.scene.read_scene import Scene, read_scene
from tests.helpers.scenes import clear_scene, tiny_scene
from tests.helpers.sunlit import cube
from validation.scenes.loading import load_scene

STILL = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
#: What moves from frame to frame; together every pair of neighbours that matters.
STEPS = ("light", "medium", "colour", "camera", "light", "objects", "colour", "light", "objects", "camera", "medium")


def made(scene: Scene, method: str, **parameters) -> FrameRenderer:
    kernel = KERNELS["taylor"].function
    return frame_renderer(scene, METHODS[method], kernel=kernel, **parameters)


def built_in(name: str) -> Scene:
    return read_scene(load_scene(name, (32, 24)).scene)


def sphere_scene() -> Scene:
    """A scene whose surfaces Mitsuba is asked for."""
    return read_scene(mi.load_dict(tiny_scene(size=(32, 24))))


def cube_of_fog() -> Scene:
    """A cube of fog by an occluder, over a floor; the kernels of `three-media` take ten times as long to compile."""
    turned = mi.ScalarTransform4f().translate([0.7, 0.4, 0.5]).rotate([1, 2, 3], 40).scale(0.17)
    occluder = {"type": "cube", "to_world": turned}
    return read_scene(
        mi.load_dict(
            clear_scene(
                size=(32, 24), cube=cube(centre=(0.9, 0.5, 0.6)), occluder=occluder, floor=tiny_scene()["floor"]
            )
        )
    )


def frames(scene: Scene, steps, share: float = 0.1):
    """Yield the scene after each step, and what moved."""
    objects = read_objects(scene, closed_shapes(read_occluders(scene.geometry))) if "objects" in steps else None
    turn = np.eye(3)
    for step in steps:
        moved = dict(STILL)
        if step == "light":
            about = np.array(scene.lights[0].position, dtype=np.float64).ravel() + np.array([0.21, -0.13, 0.05])
            scene = replace(scene, lights=tuple(turned_light(light, about, TURN) for light in scene.lights))
            moved["light_moved"] = True
        elif step == "medium":
            scene = replace(scene, medium=thicker_medium(scene.medium, 1.3))
        elif step == "colour":
            scene = replace(scene, lights=tuple(coloured_light(light, share) for light in scene.lights))
        elif step == "camera":
            scene = replace(scene, camera=aside(scene.camera))
            moved["camera_moved"] = True
        elif step == "objects":
            turn = turn @ TURN
            scene = turned_objects(scene, objects, turn)
            moved["geometry_moved"] = True
        yield scene, moved


def aside(camera):
    origin = type(camera.origin)(camera.origin + 0.03 * camera.forward + 9 * camera.left)
    dr.make_opaque(origin)
    return replace(camera, origin=origin)


def host(renderer, stages):
    frame = image_frame(renderer, stages)
    return {name: getattr(frame, name) for name in ("airlight", "surface", "distance")}


CASES = [
    pytest.param(lambda: built_in("two-pens"), "shadow-planes", {}, STEPS, id="planes"),
    pytest.param(lambda: built_in("two-pens"), "light-volumes", {"map": 64}, STEPS, id="volumes"),
    pytest.param(
        cube_of_fog,
        "shadow-planes",
        {},
        ("light", "medium", "camera", "colour"),
        id="bounded media",
    ),
    pytest.param(sphere_scene, "ray-march", {"steps": 8}, ("light", "medium", "camera"), id="shadow rays"),
]


@pytest.mark.claim("kept-frames", tolerance="none: equal bit by bit")
@pytest.mark.parametrize(("scene", "method", "parameters", "steps"), CASES)
def test_images_are_those_of_frames_made_afresh(variant, scene, method, parameters, steps):
    renderer, afresh = (made(scene := scene() if callable(scene) else scene, method, **parameters) for _ in range(2))
    stages, kept = next_frame(renderer, renderer.scene, None, **STILL)
    last = host(renderer, stages)
    for now, moved in frames(renderer.scene, steps):
        stages, kept = next_frame(renderer, now, kept, **moved)
        images = host(renderer, stages)
        wanted = host(afresh, run_stages(replace(afresh, scene=now), afresh.prepare(now)))
        for name, image in images.items():
            np.testing.assert_array_equal(image, wanted[name], err_msg=f"{name} after {moved}")
        assert np.any(images["airlight"] != last["airlight"]), moved  # each step does change the image
        last = images


def test_what_a_method_of_ones_own_prepares_is_made_anew_unless_it_says_otherwise(variant):
    """It may have looked at the medium."""

    @dataclass(frozen=True)
    class OfMedium(Method):
        uses_kernel = False

        def prepare(self, scene, light):
            return scene.medium.sigma_t[0]

        def airlight(self, view, light, state, kernel):
            return type(view.medium.albedo)(state + 0 * view.direction.x)

    renderer = frame_renderer(sphere_scene(), OfMedium)
    _, kept = next_frame(renderer, renderer.scene, None, **STILL)
    thick = replace(renderer.scene, medium=thicker_medium(renderer.scene.medium, 2.0))
    stages, _ = next_frame(renderer, thick, kept, **STILL)
    np.testing.assert_allclose(host(renderer, stages)["airlight"], 2 * 0.31, rtol=1e-6)


@pytest.mark.claim("frames-are-replayed")
def test_frames_replay_whatever_moves(variant):
    """No stage is recorded again, but for the camera rays, once, where part of Mitsuba's scene is another."""
    renderer = made(built_in("two-pens"), "shadow-planes")
    _, kept = next_frame(renderer, renderer.scene, None, **STILL)
    for now, moved in frames(renderer.scene, STEPS):
        _, kept = next_frame(renderer, now, kept, **moved)
    stages = renderer.stages
    assert stages.surface.n_recordings <= 2
    assert [stage.n_recordings for stage in (stages.shade, stages.render)] == [1, 1]
