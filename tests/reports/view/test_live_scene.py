# SPDX-License-Identifier: BSD-3-Clause
"""A live scene shows what one made again shows, bit by bit, and makes no more than it must;
its pictures and errors.
"""

import threading

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame.image import render_frame
from airlight.realtime.scene.read_scene import read_scene
from airlight.reports.plotting.pictures import NOT_FINITE, tone_mapped
from airlight.reports.view.live_scene import LiveScene
from airlight.reports.view.picture import LAYERS, Pictures
from airlight.reports.view.reference import KnownReference, ReferenceInBackground, view_error
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import configuration, prepared

pytestmark = pytest.mark.usefixtures("variant")

SIZE = (32, 24)
CAMERA = {
    "camera.origin": (0.6, -0.3, 0.4),
    "camera.target": (0.2, 0.1, 4.0),
    "camera.up": (0.0, 1.0, 0.0),
}
LIGHT = {"light.position": (0.41, 0.3, 4.2), "light.intensity": (31.0, 43.0, 57.0)}
MEDIUM = {"medium.sigma_t": (0.41,), "medium.albedo": (0.7, 0.6, 0.5)}
FAR = {
    "camera.origin": (-4.1, -8.3, 1.5),
    "camera.target": (1.0, 2.7, 2.2),
    "camera.up": (0.0, 0.0, 1.0),
}
LAMP = {"light.position": (5.4, 1.7, 4.1), "medium.g": (0.21,)}


def live(name="sphere-spot", method="shadow-planes", **parameters):
    return LiveScene(name, SIZE, configuration(method, None, parameters), {})


def shown(scene):
    frame = scene.on_host(scene.frame())
    return frame.airlight, frame.surface, frame.distance


def made_again(scene):
    """The layers of the scene as a command would render it."""
    loaded = load_scene(scene.name, scene.size, scene.changes)
    frame = render_frame(prepared(read_scene(loaded.scene), scene.chosen))
    return frame.airlight, frame.surface, frame.distance


def recordings(scene):
    return {
        name: getattr(getattr(scene.renderer.stages, name), "n_recordings", 0)
        for name in ("surface", "shade", "render")
    }


@pytest.mark.claim("view-shows-the-scene", tolerance="bit by bit")
@pytest.mark.parametrize(
    ("name", "method", "moves"),
    [
        ("sphere-spot", "shadow-planes", (CAMERA, LIGHT, MEDIUM)),
        pytest.param("colonnade", "light-volumes", (FAR, LAMP), marks=pytest.mark.slow),
        ("sphere-spot", "ray-march", ({"medium.g": (0.3,)}, LIGHT | {"medium.g": (0.0,)})),
    ],
)
def test_after_each_change_the_frame_is_that_of_a_scene_made_anew(name, method, moves):
    scene = live(name, method)
    frames = [shown(scene)]
    for move in moves:
        scene.change(move)
        frames.append(shown(scene))
        for layer, fresh in zip(frames[-1], made_again(scene), strict=True):
            np.testing.assert_array_equal(layer, fresh)
        assert not np.array_equal(frames[-1][0], frames[-2][0])


@pytest.mark.claim("view-changes-record-nothing")
def test_camera_light_and_medium_record_nothing():
    scene = live()
    shown(scene)
    scene.change(LIGHT)
    shown(scene)  # the first frame that shades what was cast before
    scene.change(CAMERA)
    shown(scene)
    before = recordings(scene)
    for fraction in (1.1, 1.2, 1.3):
        scene.change(
            {"camera.origin": tuple(fraction * value for value in CAMERA["camera.origin"])}
        )
        shown(scene)
        scene.change(
            {"light.position": tuple(fraction * value for value in LIGHT["light.position"])}
        )
        shown(scene)
        scene.change({"medium.sigma_t": (0.41 * fraction,)})
        shown(scene)
    assert recordings(scene) == before


@pytest.mark.slow
@pytest.mark.claim("view-changes-record-nothing")
def test_a_parameter_records_the_methods_stages_and_not_the_surface():
    scene = live("colonnade", "ray-march", steps=4)
    shown(scene)
    scene.change(LAMP)
    shown(scene)
    before, first = recordings(scene), scene.renderer
    scene.choose(configuration("ray-march", None, {"steps": 5}))
    layers = shown(scene)
    after = recordings(scene)
    assert scene.renderer is not first
    assert (after["surface"], after["shade"]) == (before["surface"], before["shade"])
    assert after["render"] == 1
    for layer, fresh in zip(layers, made_again(scene), strict=True):
        np.testing.assert_array_equal(layer, fresh)
    scene.choose(configuration("ray-march", None, {"steps": 4}))
    shown(scene)
    assert scene.renderer is first
    assert recordings(scene) == before


WIDTH, HEIGHT = 50, 37


@pytest.mark.claim(
    "view-error",
    tolerance="none for all pixels; 190 of 200 intervals of 95 % for a part, less 4 sigma",
)
def test_error_of_a_part_covers_that_of_the_whole():
    random = np.random.default_rng(7)
    reference = 1 + random.random((HEIGHT, WIDTH, 3))
    test = reference * (1 + 0.1 * random.standard_normal((HEIGHT, WIDTH, 3)))
    whole = error_metrics(reference, test)
    assert view_error(KnownReference.of_size(WIDTH, HEIGHT), test) is None
    flat, covered = reference.reshape(-1, 3), 0
    for seed in range(200):
        pixels = np.random.default_rng(seed).permutation(WIDTH * HEIGHT)[:400]
        known = KnownReference.of_size(WIDTH, HEIGHT)
        known.add(pixels, flat[pixels], flat[pixels], np.full((400, 3), 1e-9))
        error = view_error(known, test)
        assert (error.known, error.pixels) == (400, WIDTH * HEIGHT)
        covered += abs(error.relative_rmse - whole.relative_rmse) <= error.interval
    assert 177 <= covered <= 200
    known.add(np.arange(WIDTH * HEIGHT), flat, flat, np.full((WIDTH * HEIGHT, 3), 3e-9))
    error = view_error(known, test)
    assert error.interval == 0
    assert error.relative_rmse == pytest.approx(whole.relative_rmse, rel=1e-12)
    assert error.own_error == pytest.approx(3e-9 / reference.mean(), rel=1e-12)
    np.testing.assert_array_equal(known.filled(known.airlight), reference)


def test_a_pixel_that_is_not_finite_leaves_the_interval_of_the_error_as_wide_as_it_is():
    known = KnownReference.of_size(WIDTH, HEIGHT)
    for layer in (known.airlight, known.surface, known.error):
        layer[: HEIGHT // 2] = 1.0
    test = np.where(np.random.default_rng(3).random((HEIGHT, WIDTH, 1)) < 0.5, 1.1, 1.4) * np.ones(
        3
    )
    before = view_error(known, test)
    test[2, 3, 1] = np.nan
    after = view_error(known, test)
    assert after.interval == pytest.approx(before.interval, rel=0.02)
    nothing = view_error(known, np.full_like(test, np.nan))
    assert (nothing.relative_rmse, nothing.interval, nothing.known) == (None, None, before.known)


def test_a_reference_whose_process_has_ended_says_so_for_each_scene(variant):
    told = threading.Event()
    reference = ReferenceInBackground(told.set, variant)
    reference.end()
    assert told.wait(60)
    for _ in range(2):
        reference.start("open-fog", SIZE, {})
        assert "has ended" in reference.failure
        reference.stop()


def test_a_picture_of_a_frame_is_the_preview_within_a_level_and_what_is_not_finite_is_magenta(
    variant,
):
    random = np.random.default_rng(3)
    airlight, surface = (
        10 ** random.uniform(-5, 1, (12, 16, 3)).astype(np.float32) for _ in range(2)
    )
    airlight[0, 0] = 0
    surface[3, 4, 1] = np.nan
    order = random.permutation(12 * 16).astype(np.uint32)
    layers = {
        name: mi.Color3f(image.reshape(-1, 3)[order].T)
        for name, image in zip(("airlight", "surface"), (airlight, surface))
    }
    dr.eval(layers)
    picture = Pictures().of_frame(mi.UInt32(order), **layers, layer="total", factor=1.7)
    picture = np.frombuffer(picture, np.uint8).reshape(12, 16, 4)
    radiance = sum(
        weight * layer for weight, layer in zip(LAYERS["total"], (airlight, surface), strict=True)
    )
    expected = tone_mapped(radiance.astype(np.float64), 1.7)
    assert picture[3, 4, :3].tolist() == list(NOT_FINITE)
    finite = np.isfinite(radiance).all(axis=-1)
    assert np.abs(picture[..., :3].astype(int) - expected)[finite].max() <= 1
    assert (picture[..., 3] == 255).all()
    # The airlight alone is known there.
    shown = Pictures().of_frame(mi.UInt32(order), **layers, layer="airlight", factor=1.7)
    alone = np.frombuffer(shown, np.uint8).reshape(12, 16, 4)[..., :3].astype(int)
    assert np.abs(alone - tone_mapped(airlight.astype(np.float64), 1.7)).max() <= 1
