# SPDX-License-Identifier: BSD-3-Clause
"""Claim: figures of Bouthors's clouds are light over light, of the pixels that they name."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.clouds.collector_search import Collector
from airlight.realtime.methods.interface.method import method_parameters
from airlight.validation.papers import clouds
from airlight.validation.timing import Timing


def test_a_ratio_of_light_has_the_interval_of_the_paths():
    image, expected, error = np.ones((2, 2, 3)), np.full((2, 2, 3), 2.0), np.full((2, 2, 3), 0.1)
    where = np.array([[True, True], [False, False]])
    found = clouds._ratio(image, expected, error, where)
    half = 1.96 * 0.3 * np.sqrt(2)  # colours of one pixel are added, pixels as squares
    assert found[:3] == pytest.approx((0.5, 6 / (12 + half), 6 / (12 - half)), rel=1e-4)


def test_figures_are_of_their_scenes_and_pixels(monkeypatch):
    """The gap is 2 of 4 pixels with a third of the light, of which half is lost."""
    asked = []
    lit = np.array([[1.0, 1.0], [2.0, 2.0]])[..., None] * np.ones(3)

    def pair_of(loaded, samples):
        asked.append((loaded.name, samples))
        factor = {"stratocumulus": 0.9, "cumulus": 1.1}.get(loaded.name, 0.5)
        return factor * lit, lit, 0.01 * lit

    monkeypatch.setattr(clouds, "SIZE", (2, 2))
    monkeypatch.setattr(clouds, "shown", lambda name, size: SimpleNamespace(name=name, scene=None))
    monkeypatch.setattr(clouds, "pair_of", pair_of)
    monkeypatch.setattr(clouds, "read_clouds", lambda scene: None)
    monkeypatch.setattr(clouds, "_shaded", lambda read: np.array([True, True, False, False]))
    monkeypatch.setattr(clouds, "_two_collectors", lambda loaded: np.zeros((2, 2), dtype=bool))
    figures = clouds.clouds_figures()
    assert asked == [("stratocumulus", 512), ("cumulus", 512), ("ring", 128)]
    assert (figures["stratocumulus"].value, figures["cumulus"].value) == (
        pytest.approx(0.9),
        pytest.approx(1.1),
    )
    lost = figures["gap, lost"]
    assert lost.value == pytest.approx(100 / 3 * 0.5)
    # Half of the interval: 0.03 a pixel in the shade counts 5/6 there, 0.06 beside it 1/6, over 18.
    half = 1.96 * np.sqrt(2 * (0.03 * 5 / 6) ** 2 + 2 * (0.06 / 6) ** 2) / 18
    assert (lost.value - lost.low, lost.high - lost.value) == pytest.approx(
        (100 * half, 100 * half), rel=1e-4
    )
    assert figures["lobes, two"] == "no pixel has two collectors"
    monkeypatch.setattr(
        clouds, "_two_collectors", lambda loaded: np.array([[False, True], [False, False]])
    )
    assert clouds.clouds_figures()["lobes, two"].value == pytest.approx(0.5)
    assert asked[-1] == ("two-lobes", 128)


def test_pixels_with_two_collectors_are_those_whose_searches_end_apart(monkeypatch):
    """By set of orders: places, light and widths, of searches from the left and from the right."""
    zero, one = np.zeros((1, 4, 3)), np.ones((1, 4))
    away = zero + np.array([[0.0], [3.0], [3.0], [3.0]])  # sqrt(27) m in three pixels

    def searched(scene, aside):
        light = one * (1.0 if aside < 0 else np.array([1.0, 1.0, 0.0, 1.0]))
        width = 2 * one * np.array([1.0, 1.0, 1.0, 3.0])
        return [(zero if aside < 0 else away, light, width), (zero, light, width)]

    monkeypatch.setattr(clouds, "_searched_from", searched)
    monkeypatch.setattr(clouds, "read_scene", lambda scene: scene)
    found = clouds._two_collectors(SimpleNamespace(scene=None))
    # alike, apart, dark, and within one wide spread
    assert found.tolist() == [[False, True, False, False]]


def test_collectors_stand_beside_their_points(variant):
    collector = Collector(mi.Point3f([1, 2], 3, 4), mi.Float([5, 0]))
    ((moved,), other) = clouds._each(
        ((collector,), collector), lambda each: clouds._beside(each, -250.0)
    )
    for each in (moved, other):
        assert np.array(each.centre).T.tolist() == [[-250, 0, 0]] * 2
        assert np.array(each.width).tolist() == [60, 0]  # where there is none, none is made


def test_points_are_shaded_where_their_way_to_the_sun_enters_a_cloud_again(variant):
    """A ball of radius 1 m under one of 0.5 m, seen from below: its own light leaves it,
    and may enter the other.
    """
    balls = {
        "lower": {"type": "sphere", "radius": 1.0},
        "upper": {"type": "sphere", "center": [0.0, 0.0, 5.0], "radius": 0.5},
    }
    aside = np.linspace(-0.15, 0.15, 61)
    direction = np.stack([aside, 0.3 * aside, np.ones(61)], axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin, down = np.array([0.0, 0.0, -8.0]), np.array([0.0, 0.0, -1.0])
    scene = mi.load_dict({"type": "scene", **balls})
    sun = SimpleNamespace(direction=down)
    shaded = clouds._shaded(
        SimpleNamespace(scene=scene, suns=(sun,), origin=origin, direction=direction)
    )
    along = direction @ -origin
    inside = along**2 - 63  # of the root of the distance to the lower ball
    hit = inside > 0
    point = origin + (along - np.sqrt(np.maximum(inside, 0)))[:, None] * direction
    assert 10 < hit.sum() < 61
    assert (shaded == (hit & (np.hypot(point[:, 0], point[:, 1]) < 0.5))).all()
    assert 10 < shaded.sum() < hit.sum()


def test_a_frame_with_moved_light_makes_its_maps_and_its_light(monkeypatch):
    timings = iter([Timing(3.0, 2.0, 4.0, 7), Timing(10.0, 9.0, 12.0, 5)])
    # The parameters must be those of the method.
    monkeypatch.setattr(
        clouds, "frame_renderer", lambda scene, method, **how: method_parameters(method, how)
    )
    monkeypatch.setattr(clouds, "first_frame", lambda renderer: None)
    monkeypatch.setattr(clouds, "time_repeated", lambda work, seconds: next(timings))
    assert clouds._light_moved(None) == Timing(13.0, 11.0, 16.0, 5)


@pytest.mark.slow  # two transports through clouds
@pytest.mark.parametrize("name", ["stratocumulus", "ring"])
def test_pairs_are_of_the_scenes_themselves(variant, name):
    """The method and light paths through a cloud that is not convex: of the same order."""
    image, paths, error = clouds.pair_of(clouds.shown(name, (12, 9)), 16)
    assert image.shape == paths.shape == error.shape == (9, 12, 3)
    assert 0.5 < image.sum() / paths.sum() < 2
    assert 0 < error.sum() < paths.sum()
