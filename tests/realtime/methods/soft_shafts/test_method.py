# SPDX-License-Identifier: BSD-3-Clause
"""Soft shafts are the sum of their light samples, less what steps, scale, sharing
and filters take from it.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame import renderer
from airlight.realtime.frame.image import render_frame
from airlight.realtime.image_filters import Raster, depth_guide
from airlight.realtime.methods.soft_shafts.sources import AUTO_WIDTH, few_pixels, penumbra_width
from airlight.realtime.numerics.array_types import two_numbers
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.configuration import SHARED_POINTS, configuration, prepared
from tests.helpers.frames import frame, relative_rmse
from tests.helpers.lamps import lamp_scene
from tests.helpers.scenes import bounded_medium, spot, tiny_scene

NONE = {"filter": "none", "surfaces": "ray"}


@pytest.mark.claim("soft-shafts-sum-of-points", tolerance="2e-3 relative RMSE: 400 steps")
@pytest.mark.parametrize("shape", ["disk", "sphere"])
def test_without_filter_it_is_the_sum_of_its_points(variant, shape, monkeypatch):
    # planes alone scale samples of a sphere
    monkeypatch.setattr(renderer, "sphere_scales", lambda *scene: None)
    box = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f()
        .translate([0.1, 0.1, 0.7])
        .rotate([1, 2, 3], 31)
        .scale(0.33),
    }
    scene = lamp_scene(shape, size=(40, 32), ball=box)
    exact = frame(scene, "shadow-planes", points=3, pattern="ring")
    ours = frame(
        scene,
        "soft-shafts",
        points=3,
        pattern="ring",
        steps=400,
        shadow="ray",
        spacing="equiangular",
        **NONE,
    )
    assert relative_rmse(ours.airlight, exact.airlight) < 2e-3
    # Shadow rays and planes may differ in pixels on an edge.
    assert np.mean(np.abs(ours.surface - exact.surface) > 1e-5) < 0.02


def test_ordinary_lights_are_one_point(variant):
    body = bounded_medium(
        {"type": "sphere", "center": [0.1, 0.2, 0.9], "radius": 1.1}, 0.7, (0.8, 0.7, 0.6)
    )
    clear = {"fog": None, "body": body, "sensor": tiny_scene()["sensor"] | {"medium": None}}
    clear["sensor"] = {key: entry for key, entry in clear["sensor"].items() if entry is not None}
    sun = {
        "type": "directional",
        "direction": [0.2, 0.3, -0.9],
        "irradiance": {"type": "rgb", "value": 3.0},
    }
    scenes = [
        tiny_scene(),
        tiny_scene(lamp=spot(beam=20.0)),
        tiny_scene(**clear),
        tiny_scene(lamp=sun, **clear),
    ]
    for scene in scenes:
        march = frame(scene, "ray-march", steps=40)
        ours = frame(scene, "soft-shafts", steps=40, shadow="ray", spacing="equiangular", **NONE)
        np.testing.assert_allclose(ours.airlight, march.airlight, rtol=2e-4, atol=1e-6)
        np.testing.assert_allclose(ours.surface, march.surface, atol=1e-6)


def test_a_light_with_extent_in_bounded_media_is_the_sum_of_its_points(variant):
    body = bounded_medium(
        {"type": "sphere", "center": [0.1, 0.2, 0.9], "radius": 1.1}, 0.7, (0.8, 0.7, 0.6)
    )
    sensor = {key: entry for key, entry in tiny_scene()["sensor"].items() if key != "medium"}
    scene = lamp_scene(fog=None, body=body, sensor=sensor)
    march = frame(scene, "ray-march", steps=40, points=3)
    for shadow, tolerance in (("ray", 1e-3), ("map", 0.05)):
        ours = frame(
            scene,
            "soft-shafts",
            points=3,
            pattern="sobol",
            steps=40,
            shadow=shadow,
            spacing="equiangular",
            **NONE,
        )
        assert relative_rmse(ours.airlight, march.airlight) < tolerance


def test_maps_tend_to_rays(variant):
    scene = lamp_scene(size=(40, 32))
    rays = frame(scene, "soft-shafts", points=3, shadow="ray", **NONE)
    errors = [
        (relative_rmse(ours.airlight, rays.airlight), relative_rmse(ours.surface, rays.surface))
        for ours in (
            frame(scene, "soft-shafts", points=3, filter="none", map=map) for map in (64, 1024)
        )
    ]
    assert errors[1][0] < 0.25 * errors[0][0] < 0.1
    assert errors[1][1] < 0.5 * errors[0][1]


def test_few_pixels_are_interpolated(variant):
    """Linear between pixels: without surfaces the error falls as the square of their
    distance, but next to the lamp.
    """
    scene = lamp_scene(size=(48, 32), ball=None, floor=None)
    settings = {"points": 3, "steps": 64, "spacing": "equiangular"} | NONE
    whole = frame(scene, "soft-shafts", **settings).airlight
    errors = [
        np.median(np.abs(frame(scene, "soft-shafts", scale=scale, **settings).airlight / whole - 1))
        for scale in (2, 4)
    ]
    assert errors[0] < 0.3 * errors[1]
    assert errors[1] < 0.01


def test_pixels_share_points_and_steps(variant):
    """The mean over a tile of 4 x 4 is that of sixteen points and 16 x 8 steps
    where nothing changes in it.
    """
    scene = lamp_scene(size=(48, 32), ball=None)
    many = frame(scene, "soft-shafts", points=16, steps=128, spacing="equiangular", **NONE)
    shared = frame(
        scene,
        "soft-shafts",
        points=16,
        steps=8,
        spacing="equiangular",
        interleave=True,
        hz=1.0,
        **NONE,
    )
    alone = frame(scene, "soft-shafts", points=16, steps=8, spacing="equiangular", **NONE)
    inner = slice(4, -4), slice(4, -4)
    errors = [
        relative_rmse(image.airlight[inner], many.airlight[inner]) for image in (shared, alone)
    ]
    assert errors[0] < 0.02
    np.testing.assert_allclose(shared.surface[inner], many.surface[inner], rtol=1e-4, atol=1e-6)


@pytest.mark.claim("soft-shafts-steps", tolerance="half of the light; 2 % of it")
def test_equal_steps_miss_the_peak_next_to_a_light_and_equal_angles_do_not(variant):
    loaded = load_scene("random:1", (80, 60)).scene
    reference, scene = reference_image(loaded).airlight.mean(), read_scene(loaded)

    def missing(**settings):
        renderer = prepared(scene, configuration("soft-shafts", None, settings))
        return 1 - float(np.mean(np.asarray(render_frame(renderer).airlight))) / reference

    assert missing() > 0.5
    assert abs(missing(spacing="equiangular")) < 0.02


# Penumbrae on surfaces ----------------------------------------------------------------------------


def test_a_flat_light_leaves_dark_what_none_of_its_points_sees(variant):
    """A plate before a rectangle, where all pixels ask all points and a filter smooths their share."""
    scene = load_scene("penumbra-plane", (32, 24)).scene
    shown = render_frame(
        prepared(read_scene(scene), configuration("soft-shafts", None, {"interleave": False}))
    )
    expected = reference_image(scene).surface
    umbra = expected.max(axis=2) == 0
    assert 0.02 < umbra.mean() < 0.9
    # The filter takes some light over the edge of the umbra.
    assert np.median(shown.surface[umbra]) < 1e-3 * expected.mean()
    assert shown.surface.mean() == pytest.approx(expected.mean(), rel=0.02)


def staircase_error(width, levels, hd):
    """Return the RMS error of a linear penumbra, `width` pixels wide, from N levels
    filtered by a Gaussian of `hd`.
    """
    x = np.arange(-300, 301.0)
    taps = np.exp(-0.5 * (np.arange(-150, 151) / hd) ** 2)
    squares = []
    for shift in np.arange(12) / 12:
        true = np.clip((x + shift) / width + 0.5, 0, 1)
        filtered = np.convolve(
            np.floor(true * levels + 0.5 - 1e-9) / levels, taps / taps.sum(), "same"
        )
        squares.append(np.mean((filtered - true)[np.abs(x) < width] ** 2))
    return np.sqrt(np.mean(squares))


@pytest.mark.claim("auto-width-fits", tolerance="1.3 times the least error of any width")
@pytest.mark.parametrize("levels", [3, 5, 16])
@pytest.mark.parametrize("width", [32, 128])
def test_the_automatic_width_is_nearly_the_best(variant, levels, width):
    widths = np.geomspace(0.1, 1.0, 30) * width / levels
    least = min(staircase_error(width, levels, hd) for hd in widths)
    own = staircase_error(width, levels, AUTO_WIDTH * width / levels)
    assert own < 1.3 * least
    assert own < 0.6 * staircase_error(width, levels, 1e-3)


@pytest.mark.parametrize("ratios", [(0.7,), (0.2, 0.8)])
def test_the_width_of_a_penumbra_follows_from_similar_triangles(variant, ratios):
    """Bars over a floor: w = L (d_r - d_b) / d_b, over the size of a pixel there;
    of two the geometric mean.
    """
    camera = read_scene(mi.load_dict(tiny_scene(size=(160, 120)))).camera
    raster, distance = Raster(160, 120), dr.full(mi.Float, 3.0, 160 * 120)
    few, step = few_pixels(raster)
    assert (few, step) == (Raster(40, 30), 4)
    light = 0.31
    # Every second pixel is lit, and takes the width of its neighbours.
    blocked = mi.Float(np.tile([0.0, 1.0], few.count // 2))
    blockers = two_numbers(mi.Float)(blocked * sum(np.log(ratios)), blocked * len(ratios))
    guide = depth_guide(distance, 0.1)
    width = np.array(
        penumbra_width(blockers, distance, camera, mi.Float(light), raster, guide=guide)
    )
    pixel = 3.0 * np.linalg.norm(np.array(camera.left).ravel())
    np.testing.assert_allclose(
        width, light * np.prod(ratios) ** (1 / len(ratios)) / pixel, rtol=1e-4
    )


def test_narrow_penumbrae_of_shared_points_have_the_rest_of_their_groups(variant):
    """A pixel tests one of 16 light samples, and three more where its penumbra is narrow:
    33 % error, 48 % without.
    """
    turned = mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).rotate([1, 2, 3], 31).scale(0.33)
    scene = lamp_scene("disk", size=(40, 32), ball={"type": "cube", "to_world": turned})
    exact = frame(scene, "shadow-planes", points=64, pattern="sobol").surface
    assert (
        relative_rmse(frame(scene, "soft-shafts", **SHARED_POINTS | {"steps": 4}).surface, exact)
        < 0.4
    )
