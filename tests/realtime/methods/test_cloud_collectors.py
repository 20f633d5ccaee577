# SPDX-License-Identifier: BSD-3-Clause
"""Clouds by collectors as a method: what a frame makes of a transport that is a formula here."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.methods.cloud_collectors as method
from airlight.realtime.clouds.canonical.coordinates import fraction_of_peak
from airlight.realtime.frame.image import image_frame, render_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.phase import HenyeyGreenstein
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import box, placed, rotation
from airlight.validation.scenes.parts import camera
from tests.helpers.clouds import DROPLETS, cloud, cloud_of, cloud_scene, ring
from tests.helpers.transport_formula import WEIGHTS, Formula, slabs_as_they_are, use_formula

THICKNESS, EXTINCTION = 143.7, 0.0363
TURN = rotation((0.3, 1.0, -0.2), 11.0)
MIDDLE = np.array([3.1, 0.2, -60.0])


@pytest.fixture(autouse=True)
def formula(monkeypatch):
    use_formula(monkeypatch)


def _sun(direction, irradiance=(3.1, 2.9, 2.3)) -> dict[str, Any]:
    return {
        "type": "directional",
        "direction": list(direction),
        "irradiance": {"type": "rgb", "value": list(irradiance)},
    }


def _slab(medium=None):
    medium = medium or (DROPLETS | {"sigma_t": EXTINCTION})
    return cloud("slab", placed(box((2500.0, 2500.0, THICKNESS)), tuple(MIDDLE), TURN), medium)


ALONG = np.asarray(TURN) @ (0.48, 0.36, -0.8)


def _scene(**parts):
    parts = parts or {"sun": _sun(ALONG), "slab": _slab()}
    sensor = camera(
        (30.83, -400.91, 257.03), (3.17, 0.29, 1.49), fov=47.9, size=(16, 12), in_fog=False
    )
    return {"type": "scene", "sensor": sensor} | parts


def _renderer(scene, precision="single", method="cloud-collectors", **parameters):
    return frame_renderer(read_scene(mi.load_dict(scene), precision), METHODS[method], **parameters)


def _frame(scene, precision="single", **parameters):
    return render_frame(_renderer(scene, precision, **parameters))


def _airlight(scene, precision="single", **parameters):
    """Return the light of orders 2 and above."""
    frame = _frame(scene, precision, extra_layers=True, **({"peak": "full"} | parameters))
    return np.array(frame.airlight) - np.array(frame.extra["airlight_1"])


def _rays(scene, precision="single"):
    camera = read_scene(mi.load_dict(scene), precision).camera
    pixels = mi.UInt32(np.arange(camera.width * camera.height))
    directions = np.array(ray_directions(camera, pixels)[0]).T
    return np.array(camera.origin, dtype=float).ravel(), directions.reshape(
        camera.height, camera.width, 3
    )


def _transported(directions, depth):
    """Return the light of a sun of irradiance 1 that the transport says, at a depth below
    the lit face of the slab.
    """
    normal, horizontal = np.asarray(TURN)[:, 2], np.asarray(TURN) @ (0.8, 0.6, 0.0)
    angles = (-directions @ axis for axis in (normal, horizontal, np.cross(normal, horizontal)))
    return sum(WEIGHTS) * Formula.radiance(EXTINCTION * THICKNESS, EXTINCTION * depth, *angles, 0.8)


def test_a_slab_sends_back_what_the_transport_says(variant):
    """All angles, lengths and sums over sets, colours and irradiance of the sun."""
    scene = _scene()
    image = _airlight(scene, iterations=30)
    _, directions = _rays(scene)
    expected = _transported(directions, 0)
    # rays that come down on the slab, far from its sides
    shown = directions @ np.asarray(TURN)[:, 2] < -0.3
    assert shown.mean() > 0.3
    for channel, irradiance in enumerate((3.1, 2.9, 2.3)):
        np.testing.assert_allclose(
            image[shown][:, channel], irradiance * expected[shown], rtol=4e-3
        )


def test_suns_add_up_and_so_does_a_sky_as_a_beam(variant):
    other = _sun((-0.6, 0.3, -0.7), (0.7, 0.9, 1.9))
    sky = {"type": "constant", "radiance": {"type": "rgb", "value": [0.11, 0.17, 0.31]}}
    above = _sun((0.0, 0.0, -1.0), np.pi * np.array([0.11, 0.17, 0.31]))
    parts = {"sun": _sun(ALONG), "other": other, "sky": sky}
    both = _airlight(_scene(slab=_slab(), **parts), sky="beams")
    alone = sum(_airlight(_scene(slab=_slab(), lamp=lamp)) for lamp in (parts["sun"], other, above))
    np.testing.assert_allclose(both, alone, rtol=2e-3)


def test_coloured_clouds_are_three_grey_ones(variant):
    sigma = (0.05, 0.03, 0.02)
    spectral = {"sigma_t": {"type": "rgb", "value": list(sigma)}, "has_spectral_extinction": True}
    coloured = _airlight(_scene(sun=_sun(ALONG), slab=_slab(medium=DROPLETS | spectral)))
    for channel, value in enumerate(sigma):
        grey = _airlight(_scene(sun=_sun(ALONG), slab=_slab(medium=DROPLETS | {"sigma_t": value})))
        np.testing.assert_allclose(coloured[..., channel], grey[..., channel], rtol=1e-4, atol=1e-7)


def test_what_does_not_scatter_has_no_light_and_needs_no_transport(variant, monkeypatch):
    """A channel without extinction is read with the albedo 0; a black cloud has it in all."""
    asked = []
    monkeypatch.setattr(method, "canonical_transport", lambda phase, albedo: asked.append(albedo))
    clear = {
        "sigma_t": {"type": "rgb", "value": [0.05, 0.03, 0.0]},
        "has_spectral_extinction": True,
    }
    image = _airlight(_scene(sun=_sun(ALONG), slab=_slab(medium=DROPLETS | clear)))
    assert np.isfinite(image).all()
    assert image[..., 0].max() > 0
    assert image[..., 1].max() > 0
    assert not image[..., 2].any()
    black = _slab(medium=DROPLETS | {"sigma_t": EXTINCTION, "albedo": 0.0})
    assert not _airlight(_scene(sun=_sun(ALONG), slab=black)).any()
    assert set(asked) == {1.0}


def test_the_peak_lowers_the_density(variant):
    """The fraction of the peak is what the slab loses in thickness; the printed half is more."""
    fraction = fraction_of_peak(HenyeyGreenstein(mi.Float(0.85)), array_types("single"))
    thin = _slab(medium=DROPLETS | {"sigma_t": (1 - fraction) * EXTINCTION})
    matched = _airlight(_scene(), peak="matched")
    np.testing.assert_allclose(
        matched, _airlight(_scene(sun=_sun(ALONG), slab=thin)), rtol=1e-3, atol=1e-6
    )
    published = {"method": "cloud-collectors-2008", "sky": "uniform"}
    assert (
        _airlight(_scene(), peak="half", thickness="slab", **published).mean()
        < 0.95 * matched.mean()
    )
    assert (
        _airlight(_scene(), thickness="light", **published).mean()
        > 1.02 * _airlight(_scene()).mean()
    )


def test_a_camera_in_the_cloud_is_its_point(variant):
    """The transport is asked for the depth of the camera below the lit face, in all directions."""
    depth = 51.3
    inside = MIDDLE + (0.5 * THICKNESS - depth) * np.asarray(TURN)[:, 2]
    held = mi.load_dict(DROPLETS | {"sigma_t": EXTINCTION})
    slab = cloud_of("slab", placed(box((2500.0, 2500.0, THICKNESS)), tuple(MIDDLE), TURN), held)
    scene = cloud_scene((16, 12), origin=tuple(inside), sun=_sun(ALONG), slab=slab)
    scene["sensor"]["medium"] = held
    image = _airlight(scene, iterations=40)
    _, directions = _rays(scene)
    np.testing.assert_allclose(image[..., 0], 3.1 * _transported(directions, depth), rtol=4e-3)


@pytest.mark.claim("collector-frames", tolerance="2e-3 of the mean")
def test_the_last_frame_s_collectors_go_on(variant, monkeypatch):
    """Three steps a frame end where forty end."""
    slabs_as_they_are(monkeypatch)
    scene = cloud_scene(
        (64, 48), origin=(30.83, -400.91, 57.03), sun=_sun(ALONG), ring=cloud("ring", ring())
    )
    whole = _airlight(scene, iterations=40)
    options = {"peak": "full", "extra_layers": True}
    renderer = _renderer(scene, start="previous", iterations=3, **options)
    still = {"camera_moved": False, "geometry_moved": False, "light_moved": False}

    cache, errors = None, []
    for _ in range(30):
        stages, cache = next_frame(renderer, renderer.scene, cache, **still)
        frame = image_frame(renderer, stages, cache.extra)
        airlight = frame.airlight - frame.extra["airlight_1"]
        errors.append(np.abs(airlight - whole).mean() / whole.mean())
    assert errors[0] > 0.02
    assert errors[-1] < 2e-3
    assert renderer.stages.render.n_recordings <= 3


@pytest.mark.claim("collector-shade", tolerance="1 % in the middle of the shade and beside it")
def test_another_cloud_in_the_light_dims_and_changes_no_thickness(variant):
    """Each cloud has its own maps: vacuum between two is no matter, and light fades on
    its way through the other.
    """
    normal, side = np.asarray(TURN)[:, 2], 20.0
    far = cloud("far", placed(box((300.0, 300.0, side)), tuple(MIDDLE - 900.0 * ALONG), TURN))
    alone = _airlight(_scene(sun=_sun(ALONG), slab=_slab()), map=1024)
    both = _airlight(_scene(sun=_sun(ALONG), slab=_slab(), far=far), map=1024)
    fraction = both / np.maximum(alone, 1e-9)
    faded = np.exp(-EXTINCTION * side / -(ALONG @ normal))
    assert fraction.max() < 1.01
    assert np.mean(np.abs(fraction - faded) < 0.01) > 0.1  # in the middle of the shade
    assert np.mean(np.abs(fraction - 1) < 0.01) > 0.2  # beside it
    assert fraction[alone > 0].min() > 0.98 * faded


@pytest.mark.claim(
    "uniform-sky-total", tolerance="1e-3: the fractions of a slab add up to 1, in float32"
)
def test_of_a_uniform_sky_comes_as_much_as_clouds_take(variant):
    """A cloud that absorbs nothing cannot be told from the sky around it; layers add
    up, and order 1 is a part.
    """
    sky = {"type": "constant", "radiance": {"type": "rgb", "value": [0.11, 0.17, 0.31]}}
    frame = _frame(_scene(sky=sky, cloud=cloud("ring", ring())), extra_layers=True)
    total = np.array([0.11, 0.17, 0.31]) * np.array(frame.extra["opacity"])
    np.testing.assert_allclose(frame.airlight, total, rtol=1e-3, atol=1e-5)
    layers = {name: np.array(layer) for name, layer in frame.extra.items() if name != "opacity"}
    np.testing.assert_allclose(sum(layers.values()), total, rtol=1e-3, atol=1e-5)
    assert 0.02 * total.mean() < layers["airlight_1"].mean() < 0.6 * total.mean()
