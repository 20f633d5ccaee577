# SPDX-License-Identifier: BSD-3-Clause
"""Frames of one-dimensional min/max mipmaps against the truth, and against light volumes of the same map."""

import numpy as np
import pytest

from realtime.errors import InputError
from tests.helpers.frames import frame, relative_rmse, truth
from tests.helpers.scenes import spot, tiny_scene

SIZE = (48, 36)
MAP = 256


def lamp(position):
    return {"type": "point", "position": list(position), "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]}}


def sensor(origin, target):
    import mitsuba as mi

    look = mi.ScalarTransform4f().look_at(list(origin), list(target), [0, 0, 1])
    return tiny_scene(size=SIZE)["sensor"] | {"to_world": look}


def coloured_fog():
    colours = {"type": "rgb", "value": [0.1, 0.4, 0.9]}
    return {"type": "homogeneous", "id": "fog", "sigma_t": colours, "albedo": 0.8, "phase": {"type": "hg", "g": 0.5}}


CHANGES = {
    "light beside the view": dict,
    "light in view": lambda: {"sensor": sensor((-2.5, -2.2, 0.3), (0.9, 0.7, 1.9))},
    "light behind": lambda: {"sensor": sensor((1.7, 1.6, 2.9), (-0.9, -0.7, -0.1))},
    "camera in shadow": lambda: {"sensor": sensor((-0.5, -0.5, 0.1), (2, 1.5, 0.9))},
    "spot": lambda: {"lamp": spot()},
    "spot in view": lambda: {"lamp": spot(), "sensor": sensor((-2.5, -2.2, 0.3), (0.5, 0.0, 1.5))},
    "colour, HG": lambda: {"fog": coloured_fog()},
    "three lights": lambda: {"second": lamp((-1, 1.4, 0.6)), "third": spot(beam=11.0)},
}


#: One of a kind; the others are for `slow`.
FEW = ("light in view", "light behind", "spot")
ALL = [change if change in FEW else pytest.param(change, marks=pytest.mark.slow) for change in CHANGES]


def scene_with(change="light beside the view", size=SIZE, **more):
    return tiny_scene(size=size, **(CHANGES[change]() | more))


def render(scene, method, **parameters):
    return frame(scene, method, **parameters).airlight


@pytest.mark.claim("tree-of-bounds", tolerance="a fifth of the shadows; 0.4 of the error with an eighth of the texel")
@pytest.mark.parametrize("change", ALL)
def test_every_pixel_comes_to_the_truth_as_the_map_grows(variant, change):
    """Where the map jumps a wall leans over one texel: the error falls as its size, as its root at grazing rays."""
    scene = scene_with(change)
    expected = truth(scene).airlight
    errors = [
        relative_rmse(render(scene, "min-max", map=size, sampling="pixels", slices=1600), expected)
        for size in (64, 512)
    ]
    bare = relative_rmse(render(scene, "unshadowed"), expected)
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 0.2 * bare


@pytest.mark.claim("slices-converge", tolerance="relative RMSE 2e-3")
@pytest.mark.parametrize("change", ALL)
def test_slices_converge_to_the_light_volume(variant, change):
    """It has the same height field, in another way."""
    scene = scene_with(change)
    expected = render(scene, "light-volumes", map=MAP, walls="slanted")
    errors = [
        relative_rmse(render(scene, "min-max", map=MAP, sampling="pixels", slices=count), expected)
        for count in (200, 1600)
    ]
    # Measured 1.5e-3 at most, what sampling the height field once more is wrong by.
    assert errors[1] < 2e-3
    # First order, down to that and to rounding.
    assert errors[1] < max(0.6 * errors[0], 1e-6)


@pytest.mark.parametrize("size", [(1, 1), (3, 50)])
def test_images_of_any_size(variant, size):
    scene = scene_with("light in view")
    scene["sensor"]["film"] = scene["sensor"]["film"] | {"width": size[0], "height": size[1]}
    # The ray of an only pixel passes the light closely.
    scene["lamp"] = lamp((0.93, 0.7, 1.9))
    expected = render(scene, "light-volumes", map=MAP, walls="slanted")
    image = render(scene, "min-max", map=MAP, sampling="pixels", slices=1600)
    # As above, but for few pixels one that grazes a jump of the map counts: it is wrong by what a texel covers.
    assert np.mean(np.abs(image - expected) > 2e-3 * expected.mean()) < 0.03
    for settings in ({}, {"slices": 1}):
        assert np.all(np.isfinite(render(scene, "min-max", map=32, **settings)))


@pytest.mark.claim("slices-converge", tolerance="relative RMSE 6e-3")
@pytest.mark.parametrize("change", ALL)
def test_samples_converge_to_all_pixels(variant, change):
    scene = scene_with(change)
    expected = render(scene, "min-max", map=MAP, sampling="pixels", slices=1600)
    fine, coarse = (
        relative_rmse(render(scene, "min-max", map=MAP, **settings), expected)
        for settings in ({"slices": 200, "samples": 256, "step": 1}, {"slices": 30, "samples": 32, "step": 16})
    )
    assert fine < max(0.25 * coarse, 1e-6)
    # Measured 3.8e-3 at most: slices are half a pixel apart, and the mean of two is as wrong as the nearest.
    assert fine < 6e-3


@pytest.mark.claim("without-occluders")
@pytest.mark.parametrize("sampling", ["slices", "pixels"])
def test_without_casters_it_is_the_unshadowed_frame(variant, sampling):
    scene = scene_with(ball=None, floor=None)
    assert np.array_equal(render(scene, "min-max", sampling=sampling), render(scene, "unshadowed"))


@pytest.mark.slow
def test_samples_in_a_medium_bounded_by_a_mesh(variant):
    """The planes of a mesh are written to a table on the way, which a branch over the samples must not hold."""
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.exact import exact
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from validation.scenes.loading import load_scene

    scene = read_scene(load_scene("three-media", (32, 24)).scene)
    settings = {"map": 64, "samples": 1024, "slices": 400, "step": 4}
    images = [
        render_frame(frame_renderer(scene, METHODS["min-max"], kernel=exact, sampling=sampling, **settings)).airlight
        for sampling in ("slices", "pixels")
    ]
    assert all(np.all(np.isfinite(image)) for image in images)
    assert np.mean(images[1]) > 0
    # The slices only interpolate between samples that the pixels take one by one: dense enough, the mean agrees.
    assert abs(np.mean(images[0]) / np.mean(images[1]) - 1) < 0.01


@pytest.mark.claim("memory-before-it-is-taken")
def test_memory_is_counted_before_it_is_taken(variant, monkeypatch):
    import realtime.memory

    monkeypatch.setattr(realtime.memory, "usable_memory", lambda: realtime.memory.Memory(10**9, "this machine has"))
    scene = scene_with()
    message = r"needs [0-9.]+ GB of memory, this machine has 1 GB; use a smaller map"
    with pytest.raises(InputError, match=r"map: 8192 texels, slices: .*" + message):
        render(scene, "min-max", map=8192)
    with pytest.raises(InputError, match=r"map: 512 texels, slices: 65536 .*" + message):
        render(scene, "min-max", slices=65536)
    with pytest.raises(InputError, match=r"map: 8192 texels .*" + message):
        render(scene, "ray-march", shadow="map", map=8192)
    assert np.all(np.isfinite(render(scene, "min-max", map=64)))


@pytest.mark.claim("a-lit-share")
@pytest.mark.parametrize("name", ["random:427", pytest.param("random:705", marks=pytest.mark.slow)])
def test_no_pixel_is_brighter_than_without_shadows(variant, name):
    """Lights in view and sharp phase functions: shares of a rough estimate made an image 363 times too bright."""
    from realtime.scene.read_scene import read_scene
    from validation.configurations.methods import configuration, prepared
    from validation.scenes.loading import load_scene

    scene = read_scene(load_scene(name, (80, 60)).scene)
    image, bare = (
        np.asarray(prepared_image(prepared(scene, configuration(method, None, {}))))
        for method in ("min-max", "unshadowed")
    )
    # Sums over lit intervals and the whole ray are rounded differently, and in float32 by the quadrature's size.
    assert (image <= bare * 1.01 + 1e-4 * bare.mean()).all()
    assert image.mean() < bare.mean()


def prepared_image(renderer):
    from realtime.frame.renderer import render_frame

    return render_frame(renderer).airlight
