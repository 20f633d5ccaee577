# SPDX-License-Identifier: BSD-3-Clause
"""The interface holds a method that asks for all of it: `tests.helpers.veil`, through the door of the built-in ones."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer, image_frame, render_frame
from realtime.methods.interface.layers import Layers
from realtime.scene.animate import coloured_light
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from tests.helpers.veil import VEIL
from validation.study.configuration import configuration, prepared

SIZE = 24, 16
FAR = 99.0  # in place of no surface
NAME = "tests.helpers.veil:VEIL"


@pytest.fixture
def scene(variant):
    return read_scene(mi.load_dict(tiny_scene(size=SIZE)))


@pytest.fixture
def veil(variant):
    return VEIL


def frame(scene, method, **parameters):
    return render_frame(frame_renderer(scene, method, **parameters))


def softened(image, normal):
    """What the pass does to the first frame, in NumPy."""
    left = np.concatenate([image[:, :1], image[:, :-1]], axis=1)
    aside = np.concatenate([normal[:, :1], normal[:, :-1]], axis=1)
    alike = np.sum(normal * aside, axis=2, keepdims=True) > 0.9
    return np.where(alike, 0.5 * (image + left), image)


def exposed(scene, veil, name):
    """Return what a pass is given of the G-buffer, as an image."""

    def expose(layers, g_buffer, history, *, camera, parameters):
        value = getattr(g_buffer, name)
        value = dr.select(dr.isfinite(value), value, FAR)  # a frame may not be infinite
        return replace(layers, in_scattered=type(layers.in_scattered)(value))

    return frame(scene, replace(veil, passes=(expose,))).airlight


def test_two_frames_through_the_door_of_the_built_in_methods(scene, veil):
    """The second frame has other colours: 1/4 of what it shows is the first."""
    renderer = prepared(scene, configuration(NAME, None, {"keep": "0.25"}))
    coloured = replace(scene, lights=tuple(coloured_light(light, 0.4) for light in scene.lights))
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
    images = []
    cache = None
    for now in (scene, coloured, coloured):
        stages, cache = next_frame(renderer, now, cache, **still)
        images.append(image_frame(renderer, stages).airlight)
    normal = exposed(scene, veil, "normal")
    alone = [softened(frame(now, replace(veil, passes=())).airlight, normal) for now in (scene, coloured)]
    assert np.max(np.abs(alone[1] - alone[0])) > 0.01 * np.max(alone[0])
    np.testing.assert_allclose(images[0], alone[0], rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(images[1], 0.75 * alone[1] + 0.25 * alone[0], rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(images[2], 0.75 * alone[1] + 0.25 * images[1], rtol=1e-5, atol=1e-7)
    # None and a history: two recordings, and no third.
    assert (renderer.render.n_recordings, renderer.passes.n_recordings) == (1, 2)


def test_the_g_buffer_is_that_of_the_visible_surfaces(scene, veil):
    distance = frame(scene, veil).distance
    seen = np.isfinite(distance)
    assert 0.1 < seen.mean() < 1
    depth, normal, albedo = (exposed(scene, veil, name) for name in ("depth", "normal", "albedo"))
    np.testing.assert_array_equal(depth[..., 0], np.where(seen, distance, FAR))
    np.testing.assert_allclose(np.linalg.norm(normal, axis=2), seen, atol=1e-5)
    assert np.all((albedo.max(axis=2) > 0) == seen)


def test_a_frame_is_composed_by_the_formula(scene, veil):
    """surface visibility transmittance + transmittance background, the surface that of a method without layers."""

    def nothing(view, state, lists, *, kernel, parameters):
        return Layers(type(view.medium.albedo)(0), tuple(True for _ in view.lights))

    plain = frame(scene, replace(veil, render=nothing, passes=()))
    veiled = frame(scene, veil, share=0.3, veil=0.6)
    behind = np.where(np.isfinite(plain.distance)[..., None], 0, np.array([0.3, 0.4, 0.5]))
    assert np.max(plain.surface) > 0
    assert np.max(behind) > 0
    np.testing.assert_allclose(veiled.surface, 0.6 * (0.3 * plain.surface + behind), rtol=1e-5, atol=1e-8)


def test_a_method_that_casts_no_rays_and_asks_for_one_is_told_so(scene, veil):
    def asks(view, state, lists, *, kernel, parameters):
        return Layers(dr.select(view.visible(view.origin + view.direction, view.lights[0]), view.medium.albedo, 0))

    with pytest.raises(InputError, match="the method says that it casts no rays"):
        frame(scene, replace(veil, render=asks, passes=()))
