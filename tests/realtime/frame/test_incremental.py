# SPDX-License-Identifier: BSD-3-Clause
"""Parts that a frame keeps of the last one, and large images in parts: the
same images, bit by bit.
"""

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.frame.renderer as module
from airlight.realtime.frame.image import image_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import FrameRenderer, frame_renderer, run_stages
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.animate import (
    closed_shapes,
    coloured_light,
    read_objects,
    thicker_medium,
    turned_light,
    turned_objects,
)
from airlight.realtime.scene.mesh_adjacency import read_occluders
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.scenes.meshes import rotation
from airlight.validation.scenes.parts import area_lamp
from airlight.validation.study.frame_times import timed_image
from tests.helpers.scenes import clear_scene, tiny_scene
from tests.helpers.sunlit import cube

STILL = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
#: Motion from frame to frame; together every pair of neighbours that matters.
STEPS = (
    "light",
    "medium",
    "colour",
    "camera",
    "light",
    "objects",
    "colour",
    "light",
    "objects",
    "camera",
    "medium",
)


def made(scene: Scene, method: str, **parameters) -> FrameRenderer:
    kernel = KERNELS["exact" if scene.medium.bounded_media else "taylor"]  # soon compiled
    return frame_renderer(scene, METHODS[method], kernel=kernel, **parameters)


def built_in(name: str) -> Scene:
    return read_scene(load_scene(name, (32, 24)).scene)


def sphere_scene() -> Scene:
    """A scene whose surfaces Mitsuba is asked for."""
    return read_scene(mi.load_dict(tiny_scene(size=(32, 24))))


def cube_of_fog() -> Scene:
    """A cube of fog by an occluder, over a floor; the kernels of `three-media` take ten
    times as long to compile.
    """
    turned = mi.ScalarTransform4f().translate([0.7, 0.4, 0.5]).rotate([1, 2, 3], 40).scale(0.17)
    occluder = {"type": "cube", "to_world": turned}
    return read_scene(
        mi.load_dict(
            clear_scene(
                size=(32, 24),
                cube=cube(centre=(0.9, 0.5, 0.6)),
                occluder=occluder,
                floor=tiny_scene()["floor"],
            )
        )
    )


def frames(scene: Scene, steps, fraction: float = 0.1):
    """Yield the scene after each step, and what moved."""
    objects = (
        read_objects(scene, closed_shapes(read_occluders(scene.geometry)))
        if "objects" in steps
        else None
    )
    turn = np.eye(3)
    for step in steps:
        moved = dict(STILL)
        if step == "light":
            about = np.array(scene.lights[0].position, dtype=np.float64).ravel() + np.array(
                [0.21, -0.13, 0.05]
            )
            scene = replace(
                scene, lights=tuple(turned_light(light, about, TURN) for light in scene.lights)
            )
            moved["light_moved"] = True
        elif step == "medium":
            scene = replace(scene, medium=thicker_medium(scene.medium, 1.3))
        elif step == "colour":
            scene = replace(
                scene, lights=tuple(coloured_light(light, fraction) for light in scene.lights)
            )
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
    pytest.param(
        sphere_scene, "ray-march", {"steps": 8}, ("light", "medium", "camera"), id="shadow rays"
    ),
]


@pytest.mark.claim("kept-frames", tolerance="none: equal bit by bit")
@pytest.mark.parametrize(("scene", "method", "parameters", "steps"), CASES)
def test_images_are_those_of_frames_made_afresh(variant, scene, method, parameters, steps):
    renderer, afresh = (
        made(scene := scene() if callable(scene) else scene, method, **parameters) for _ in range(2)
    )
    stages, kept = next_frame(renderer, renderer.scene, None, **STILL)
    last = host(renderer, stages)
    for now, moved in frames(renderer.scene, steps):
        stages, kept = next_frame(renderer, now, kept, **moved)
        images = host(renderer, stages)
        wanted = host(afresh, run_stages(replace(afresh, scene=now), afresh.prepare(now)))
        for name, image in images.items():
            np.testing.assert_array_equal(image, wanted[name], err_msg=f"{name} after {moved}")
        # each step does change the image
        assert np.any(images["airlight"] != last["airlight"]), moved
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
@pytest.mark.parametrize(("method", "shades"), [("shadow-planes", 0), ("ray-march", 1)])
def test_frames_replay_whatever_moves(variant, method, shades):
    """No stage is recorded again, except for the camera rays, once, where part of Mitsuba's scene
    is another. Shadow planes light the surfaces themselves: nobody else shades them.
    """
    renderer = made(built_in("two-pens"), method)
    _, kept = next_frame(renderer, renderer.scene, None, **STILL)
    for now, moved in frames(renderer.scene, STEPS):
        _, kept = next_frame(renderer, now, kept, **moved)
    stages = renderer.stages
    assert stages.surface.n_recordings <= 2
    assert [stage.n_recordings for stage in (stages.shade, stages.render)] == [shades, 1]


# Large images in parts ----------------------------------------------------------------------------


# No method sees the rays of another part, and a part begins where a block of
# tiles does: the same bits.
IN_PARTS = {
    "shadow-planes": {},
    "light-volumes, a disk": {"map": 64, "points": 3},
}


def scene_of_parts(*, lamp=False):
    disk = area_lamp("disk", (0.31, -0.57, 1.93), (0.13, 0.29, -1.0), 0.17, (5.3, 4.9, 4.1))
    lamps = {"lamp": disk} if lamp else {}
    box = (
        mi.ScalarTransform4f().translate([0.13, 0.17, 0.71]).rotate([0.3, 1, 0.2], 29.0).scale(0.37)
    )
    built = mi.load_dict(tiny_scene(ball={"type": "cube", "to_world": box}, **lamps))
    resize(built, (83, 47))
    return read_scene(built)


def renderer_of_parts(name):
    method = METHODS[name.partition(",")[0]]
    return frame_renderer(
        scene_of_parts(lamp="disk" in name), method, kernel=KERNELS["exact"], **IN_PARTS[name]
    )


def same(frame, other):
    for layer in ("airlight", "surface", "distance"):
        np.testing.assert_array_equal(getattr(frame, layer), getattr(other, layer))


@pytest.mark.parametrize("name", IN_PARTS)
def test_frames_of_an_animation_are_the_same_in_parts(name, variant, monkeypatch):
    """A later frame that is shaded again is shaded in parts too; all parts share one state."""
    made = renderer_of_parts(name)
    read, turn = made.scene, rotation([0.3, 0.9, -0.2], 11.0)
    turned = replace(
        read,
        lights=tuple(turned_light(light, np.array([0.1, 0.2, 0.3]), turn) for light in read.lights),
    )
    coloured = replace(turned, lights=tuple(coloured_light(light, 0.4) for light in turned.lights))
    moves = [
        (read, {}),
        (turned, {"light_moved": True}),
        (coloured, {}),
        (read, {"light_moved": True}),
    ]
    moves += [(read, {"geometry_moved": True, "light_moved": True})]
    expected, cache = [], None
    for now, moved in moves:
        stages, cache = next_frame(made, now, cache, **(STILL | moved))
        expected.append(image_frame(replace(made, scene=now), stages))
    assert np.any(expected[0].airlight != expected[1].airlight) or not read.lights
    monkeypatch.setattr(module, "_LARGE", 2048)
    monkeypatch.setattr(module, "_PART", 1024)
    prepared, kept = [], None
    prepare = made.stages.prepare
    stages = replace(made.stages, prepare=lambda scene: prepared.append(scene) or prepare(scene))
    counted = replace(made, stages=stages)
    for (now, moved), whole in zip(moves, expected, strict=True):
        frame, kept, _ = timed_image(counted, now, kept, **(STILL | moved))
        same(frame, whole)
        assert len(kept) == 4
    if not read.area_lights:
        assert len(prepared) <= len(moves)  # not once for each part
