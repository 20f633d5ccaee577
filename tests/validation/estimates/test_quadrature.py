# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import fields

import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature import area_lights
from tests.helpers.area_lights import lamp, lit_scene
from tests.helpers.scenes import tiny_scene
from validation.estimates.images import layered_truth
from validation.estimates.quadrature import truth_image, truth_of_pixels
from validation.scenes.loading import LoadedScene


@pytest.fixture
def scene(variant):
    return mi.load_dict(tiny_scene(size=(8, 6)))


@pytest.fixture
def computed(monkeypatch):
    """Count how often a truth image is computed."""
    import validation.estimates.quadrature

    calls = []
    compute = validation.estimates.quadrature.quadrature_image

    def counted(*args, **kwargs):
        calls.append(kwargs)
        return compute(*args, **kwargs)

    monkeypatch.setattr(validation.estimates.quadrature, "quadrature_image", counted)
    return calls


def assert_same(actual, expected):
    for field in fields(actual):
        np.testing.assert_array_equal(getattr(actual, field.name), getattr(expected, field.name), err_msg=field.name)
        assert type(getattr(actual, field.name)) is type(getattr(expected, field.name))


def test_second_call_reads_the_same_numbers(scene, own_cache, computed):
    first, second = truth_image(scene, checks=4), truth_image(scene, checks=4)
    assert len(computed) == 1
    assert_same(first, second)
    assert first.airlight.shape == (6, 8, 3)
    assert np.isfinite(first.airlight).all()


def test_other_phase_function_has_another_truth(scene, own_cache, computed):
    """The phase function has no parameters that a key could see; an isotropic truth would pass for it."""
    fog = tiny_scene()["fog"] | {"phase": {"type": "rayleigh"}}
    plain = truth_image(scene, checks=4)
    rayleigh = truth_image(mi.load_dict(tiny_scene(size=(8, 6), fog=fog)), checks=4)
    assert len(computed) == 2
    assert np.abs(rayleigh.airlight / plain.airlight - 1).max() > 0.05


def test_the_truth_of_some_pixels_is_that_of_the_image(scene, own_cache):
    pixels = np.array([3, 4, 40, 7])
    some, whole = truth_of_pixels(scene, pixels), truth_image(scene)
    for layer in ("airlight", "surface", "distance", "light_angle"):
        values = getattr(whole, layer)
        np.testing.assert_array_equal(getattr(some, layer)[0], values.reshape(-1, *values.shape[2:])[pixels])


@pytest.fixture
def loaded(scene):
    return LoadedScene("tiny", scene, "A tiny scene.", "")


@pytest.mark.claim("area-light-goes-on")
def test_truth_of_an_area_light_goes_on_where_it_was_interrupted(own_cache, monkeypatch):
    scene = lit_scene(size=(2, 2), lamp=lamp("sphere", center=[0.3, 0.2, 3.0], radius=0.4))
    done, compute = [], area_lights._scattered

    def some(*arguments):
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append(arguments)
        return compute(*arguments)

    monkeypatch.setattr(area_lights, "_scattered", some)
    with pytest.raises(KeyboardInterrupt):
        truth_image(scene)
    counted = []
    monkeypatch.setattr(area_lights, "_scattered", lambda *arguments: (counted.append(1), compute(*arguments))[1])
    again = truth_image(scene)
    went_on = len(counted)
    assert not list(own_cache.glob("**/airlight-*"))
    assert_same(truth_image(scene), again)
    for path in own_cache.glob("**/quadrature-*.npz"):
        path.unlink()
    counted.clear()
    assert_same(truth_image(scene), again)
    assert len(counted) == went_on + 5
    image = layered_truth("lamp", again)
    assert {"emitted", "airlight_se", "surface_se", "airlight_bound"} <= set(image.layers)
    assert image.attributes["airlight:batches"] == 8
