# SPDX-License-Identifier: BSD-3-Clause
"""Frames of one-dimensional min/max mipmaps against marching with many steps over the same shadow map."""

import numpy as np
import pytest

from realtime.errors import InputError
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene

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
    "light straight above": lambda: {
        "sensor": sensor((0.9, -2.7, 1.9), (0.1, 0.7, 1.9)),
        "lamp": lamp((0.9, -2.7, 2.9)),
    },
    "camera close to the light": lambda: {"sensor": sensor((0.9, 0.7001, 1.9), (0, 0, 0.9))},
    "camera in shadow": lambda: {"sensor": sensor((-0.5, -0.5, 0.1), (2, 1.5, 0.9))},
    "spot": lambda: {"lamp": spot()},
    "soft spot": lambda: {"lamp": spot(cutoff=37.0, beam=19.0)},
    "spot in view": lambda: {"lamp": spot(), "sensor": sensor((-2.5, -2.2, 0.3), (0.5, 0.0, 1.5))},
    "colour, HG": lambda: {"fog": coloured_fog()},
    "three lights": lambda: {"second": lamp((-1, 1.4, 0.6)), "third": spot(beam=11.0)},
}


#: One of a kind; the others are for `slow`.
FEW = ("light in view", "light behind", "spot")
ALL = [change if change in FEW else pytest.param(change, marks=pytest.mark.slow) for change in CHANGES]


def scene_with(change="light beside the view", size=SIZE, **more):
    import mitsuba as mi

    return mi.load_dict(tiny_scene(size=size, **(CHANGES[change]() | more)))


def render(scene, method, precision="single", **parameters):
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    chosen = METHODS[method]
    kernel = KERNELS["exact"].function
    return render_frame(frame_renderer(read_scene(scene, precision), chosen, kernel=kernel, **parameters)).airlight


def relative_rmse(image, expected):
    return np.sqrt(np.mean((image - expected) ** 2)) / expected.mean()


def marched(scene, steps=600):
    return render(scene, "ray-march", steps=steps, shadow="map", map=MAP)


@pytest.mark.claim("tree-of-bounds", tolerance="relative RMSE 8e-3")
@pytest.mark.parametrize("change", ALL)
def test_every_pixel_is_that_of_the_marcher(variant, change):
    scene = scene_with(change)
    expected = marched(scene)
    error = relative_rmse(render(scene, "min-max", map=MAP, sampling="pixels", slices=200), expected)
    # The marcher takes the nearest texel, the trees are linear between them: half a texel of a 256 map at shadow edges,
    # and half a slice of 200.
    assert error < 8e-3
    bare = relative_rmse(render(scene, "unshadowed"), expected)
    if bare > 1e-4:  # else no shadow is seen; the marcher itself is 1e-5 off
        assert error < 0.2 * bare


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


@pytest.mark.slow
@pytest.mark.parametrize("sampling", ["slices", "pixels"])
def test_bounded_media(variant, sampling):
    import mitsuba as mi

    occluders = {name: tiny_scene()[name] for name in ("ball", "floor")}
    smoke = bounded_medium({"type": "sphere", "center": [-0.2, 0.3, 0.9], "radius": 1.3}, 0.7, (0.9, 0.8, 0.7))
    scene = mi.load_dict(clear_scene(size=SIZE, smoke=smoke, **occluders))
    expected = marched(scene)
    settings = {"sampling": sampling, "slices": 200, "samples": 128, "step": 4}
    assert relative_rmse(render(scene, "min-max", map=MAP, **settings), expected) < 0.02
    assert relative_rmse(render(scene, "unshadowed"), expected) > 0.04


@pytest.mark.claim("without-occluders")
@pytest.mark.parametrize("sampling", ["slices", "pixels"])
def test_without_casters_it_is_the_unshadowed_frame(variant, sampling):
    scene = scene_with(ball=None, floor=None)
    assert np.array_equal(render(scene, "min-max", sampling=sampling), render(scene, "unshadowed"))


@pytest.mark.parametrize("sampling", ["slices", "pixels"])
def test_where_no_shadow_is_seen_it_is_unshadowed(variant, sampling):
    """A sphere behind the light: there is a map, and nothing in view is dark."""
    sphere = {"type": "sphere", "center": [4.9, 5.7, 2.9], "radius": 0.41}
    scene = scene_with(ball=sphere, floor=None)
    image = render(scene, "min-max", sampling=sampling, step=1, samples=128, slices=200)
    expected = render(scene, "unshadowed")
    # Every pixel by itself: rounding. Between samples: what is interpolated is smooth, but not linear.
    assert relative_rmse(image, expected) < (1e-6 if sampling == "pixels" else 2e-3)


@pytest.mark.parametrize("sampling", ["slices", "pixels"])
def test_camera_at_the_light(variant, sampling):
    """All that it sees is lit, and the airlight there is infinite; so near it is large and finite."""
    there, near = (scene_with(sensor=sensor((0.9, 0.7 + away, 1.9), (0, 0, 0.9))) for away in (0, 1e-5))
    for method, settings in (("min-max", {"map": 32, "sampling": sampling}), ("unshadowed", {})):
        with pytest.raises(InputError, match=r"light 1 is .* m from the camera"):
            render(there, method, **settings)
    image = render(near, "min-max", map=32, sampling=sampling)
    assert relative_rmse(image, render(near, "unshadowed")) < 1e-6


@pytest.mark.parametrize("change", ["light in view", "spot in view"])
def test_rays_through_the_light(variant, change):
    """An odd number of pixels, the light in the middle of one: its ray passes by at some hundredth of a millimetre."""
    at = (0.90001, 0.7, 1.9) if change == "light in view" else (0.70001, -0.3, 2.6)
    changes = CHANGES[change]() | {"sensor": sensor((-2.5, -2.2, 0.3), at)}
    changes["sensor"]["film"] = changes["sensor"]["film"] | {"width": 33, "height": 25}
    import mitsuba as mi

    scene = mi.load_dict(tiny_scene(**changes))
    expected = render(scene, "unshadowed")
    for sampling in ("slices", "pixels"):
        image = render(scene, "min-max", map=64, sampling=sampling)
        assert not np.any(np.isnan(image))
        assert np.all(image >= 0)
    # The light is seen, so its pixel holds all but the part of the ray that lies behind something.
    assert image[12, 16, 0] == pytest.approx(expected[12, 16, 0], rel=0.01)


def test_both_precisions_agree(variant):
    scene = scene_with("light in view")
    single, double = (render(scene, "min-max", precision, map=64) for precision in ("single", "double"))
    # Both read a map of float32 distances; a few rays pass an edge on the other side.
    assert relative_rmse(single, double) < 1e-3
    assert np.median(np.abs(single - double) / double) < 1e-5


@pytest.mark.parametrize("size", [(1, 1), (16, 1), (3, 50)])
def test_images_of_any_size(variant, size):
    import mitsuba as mi

    # The ray of an only pixel passes the light at a micrometre, where what is in shadow behind it is one part in 1e6.
    changes = {"sensor": sensor((-2.5, -2.2, 0.3), (0.900001, 0.7, 1.9))}
    changes["sensor"]["film"] = changes["sensor"]["film"] | {"width": size[0], "height": size[1]}
    scene = mi.load_dict(tiny_scene(**changes))
    expected = render(scene, "unshadowed")
    for settings in ({}, {"sampling": "pixels"}, {"slices": 1}):
        image = render(scene, "min-max", map=32, **settings)
        assert np.all(np.isfinite(image))
        # Little of this view is in shadow; that of one pixel is as exact as its kernel.
        assert relative_rmse(image, expected) < (1e-5 if size == (1, 1) else 0.3)


def test_a_frame_follows_its_light(variant):
    """Recorded once, replayed with the epipole elsewhere: outside the image instead of in it."""
    from dataclasses import replace

    from realtime.frame.renderer import frame_renderer, image_frame, run_stages
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    here = read_scene(scene_with("light in view"))
    there = read_scene(scene_with("light in view", lamp=lamp((2.9, -1.7, 1.4))))
    renderer = frame_renderer(here, METHODS["min-max"], kernel=KERNELS["exact"].function, map=64)
    for scene in (here, here, here):
        run_stages(renderer, renderer.prepare(scene))
    moved = replace(renderer, scene=replace(here, lights=there.lights))
    replayed = image_frame(moved, run_stages(moved, renderer.prepare(moved.scene))).airlight
    expected = render(scene_with("light in view", lamp=lamp((2.9, -1.7, 1.4))), "min-max", map=64)
    assert replayed == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    "settings", [{"map": 100}, {"slices": -1}, {"samples": 70000}, {"step": 3}, {"sampling": "rows"}]
)
def test_bad_parameters_are_refused(variant, settings):
    (name,) = settings
    with pytest.raises(InputError, match=f"{name}: got"):
        render(scene_with(), "min-max", **settings)


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


@pytest.mark.parametrize("threads", [1, 2])
def test_a_light_point_that_lights_rays_from_deep_fog_on(variant, threads):
    # random:5: rays along the plane of a light point had shares of 1e13, by one thread, which keeps denormal numbers.
    import drjit as dr

    from realtime.frame.renderer import render_frame
    from realtime.scene.read_scene import read_scene
    from validation.configurations.methods import configuration, prepared
    from validation.scenes.loading import load_scene

    before = dr.thread_count()
    dr.set_thread_count(threads)
    try:
        scene = read_scene(load_scene("random:5", (80, 60)).scene)
        slices, pixels = (
            np.asarray(render_frame(prepared(scene, configuration("min-max", None, settings))).airlight)
            for settings in ({}, {"sampling": "pixels"})
        )
    finally:
        dr.set_thread_count(before)
    assert np.abs(slices - pixels).max() < 0.5 * pixels.mean()
    assert (np.abs(slices - pixels) < 0.3 * pixels).all()


@pytest.mark.claim("a-lit-share")
@pytest.mark.parametrize("name", ["random:427", "random:705", "clutter"])
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
