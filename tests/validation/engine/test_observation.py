# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what is known of an engine's image before it is judged: how many samples its
lights need, what a pixel is.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from airlight.reference.storage.exr import Image
from airlight.validation.engine import observation
from airlight.validation.engine.observation import (
    PixelKind,
    decide_pixel,
    layers_of,
    needed_samples,
    relative_errors,
    stopped,
    with_rest,
)


@pytest.fixture
def images(monkeypatch):
    """Return a dictionary of what a dim pixel beside a bright one has by the number of samples."""
    dim: dict[int, float] = {}

    def model(view, samples):
        layers = np.zeros((2, 2, 3))
        layers[0], layers[1, 0], layers[1, 1] = 0.0, 1.0, dim.get(samples, 0.02)
        return SimpleNamespace(layers=lambda fog: layers)

    monkeypatch.setattr(observation, "scene_fog", lambda reference: None)
    monkeypatch.setattr(observation, "view_of", lambda reference, pixels: None)
    monkeypatch.setattr(observation, "scattering_paths", lambda view, samples: samples)
    monkeypatch.setattr(observation, "FogModel", model)
    return dim


def test_samples_of_a_light_are_doubled_until_dim_pixels_stay_too(images):
    lit, unlit = (SimpleNamespace(area=area, width=2, height=1) for area in (("lamp",), ()))
    first = observation.SAMPLES
    assert needed_samples(lit) == first
    # a fiftieth of the bright pixel, and off by its half and its quarter
    images[first], images[2 * first] = 0.08, 0.04
    assert needed_samples(lit) == 4 * first
    assert needed_samples(unlit) == first
    images.update({first * 2**n: 0.02 * 2.0**-n for n in range(12)})
    assert needed_samples(lit) == observation._MOST_SAMPLES


def test_errors_are_relative_to_the_larger_and_at_least_to_a_floor():
    predicted, shown = np.array([1.0, 4.0, 0.1, np.nan, 0.0]), np.array([2.0, 1.0, 0.2, 1.0, 0.0])
    np.testing.assert_allclose(relative_errors(predicted, shown, 0.5), [0.5, -0.75, 0.2, 1.0, 0.0])


def test_values_stop_where_eight_are_the_largest():
    values = np.r_[np.linspace(0, 0.9, 20), np.ones(8), np.nan]
    assert stopped(values).sum() == 8
    assert not stopped(values[1:][values[1:] < 1]).any()
    assert not stopped(values[:27]).any()
    assert not stopped(np.zeros(20)).any()


def test_the_kind_of_a_pixel_is_the_one_that_leaves_less_and_is_said():
    errors = {"centre": 0.02, "area": 0.5}
    kind, found = decide_pixel(
        ("area", "centre"), str.upper, lambda all: [errors[each.lower()] for each in all]
    )
    assert (kind.pixel, found) == ("centre", "CENTRE")
    assert kind.words == "centres fit: 2 % off where the two differ; means over the area: 50 % off"
    kind, found = decide_pixel(
        ("area", "centre"), str.upper, lambda all: [], exact=lambda found: True
    )
    assert (kind, found) == (PixelKind("area"), "AREA")
    assert kind.words == "judged by means over the area"


def test_surfaces_are_what_all_light_has_beyond_the_airlight():
    fog, rest = np.full((2, 3, 3), 0.5), np.zeros((2, 3, 3))
    rest[0] = 0.25
    rest[1, 0] = 1e-4  # less than the last bit of a half
    image = Image({"airlight": fog, "total": fog + rest})
    found = with_rest(image)
    np.testing.assert_allclose(found.layers["total - airlight"][0], 0.25)
    assert not found.layers["total - airlight"][1].any()
    layers = layers_of(found, "", None, None)
    assert [(each.name, each.holds) for each in layers] == [
        ("airlight", "airlight"),
        ("total - airlight", "surface"),
    ]
    assert [each.name for each in layers_of(found, "", "total", None)] == ["total"]
    # Where a file has surfaces they are its own; fog that is all light has none beside it.
    for layers_there in ({"airlight": fog, "total": fog}, {"airlight": fog}, {"total": fog}):
        assert with_rest(Image(layers_there)).layers == layers_there
    own = Image({"airlight": fog, "total": fog + rest, "surface": rest})
    assert "total - airlight" not in with_rest(own).layers
    assert [each.name for each in layers_of(own, "", None, None)] == ["airlight", "surface"]
