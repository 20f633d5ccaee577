# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the time that a reference is said to take counts what its estimator does."""

from types import SimpleNamespace

import pytest

from airlight.reports.api.reference import _check_work
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study import cost


@pytest.mark.parametrize(("estimator", "lights"), [("single-scatter", 32), ("volpath", 1)])
def test_samples_are_for_each_light_or_for_one_by_chance(variant, monkeypatch, estimator, lights):
    told = []
    monkeypatch.setattr(cost, "check_work", lambda what, works: told.extend(works) or ())
    scene = load_scene("lanterns", (8, 6)).scene
    assert len(scene.emitters()) == 32
    loaded = SimpleNamespace(name="lanterns", scene=scene, size=(8, 6))
    _check_work(loaded, estimator, "centre", SimpleNamespace(samples=4), clouds=False)
    assert told == [cost.sampled_work((8, 6), 4, lights=lights)]
