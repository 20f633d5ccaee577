# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import numpy as np
import pytest

from tests.evidence.known_answers import point_lights as known_answers
from tests.evidence.known_answers.point_lights import ESTIMATORS, KnownAnswer, base_scene

EXACT_FOR_ALL = ("albedo_linear", "intensity_linear", "units", "enclosed")
OF_QUADRATURE = (
    "lights_add_up",
    "turned",
    "moved",
    "mirrored",
    "vacuum_limit",
    "vacuum",
    "fluence",
    "absorbing_medium",
)


def assert_passed(answer: KnownAnswer):
    assert answer.passed, answer
    assert answer.reason


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("law", OF_QUADRATURE)
def test_quadrature_obeys(variant, law):
    assert_passed(getattr(known_answers, law)())


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("law", EXACT_FOR_ALL)
@pytest.mark.parametrize(
    "estimator",
    # volpath's kernels take half a minute to compile, and each of these scenes has its own
    [pytest.param(name, marks=pytest.mark.slow) if name == "volpath" else name for name in ESTIMATORS],
)
def test_all_estimators_obey(variant, law, estimator):
    assert_passed(getattr(known_answers, law)(estimator))


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("estimator", ["quadrature", "single-scatter"])
def test_absorbing_sphere(variant, estimator):
    assert_passed(known_answers.absorbing_sphere(estimator))


def test_the_laws_are_tried_on_a_scene_that_has_it_all(variant):
    """Shadows, a soft spot, three colours and both endless and ended rays: else the laws would say little."""
    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth
    from tests.evidence.certified.model import load_fog, mitsuba_dict

    scene = base_scene()
    image = quadrature_image(read_truth(load_fog(mitsuba_dict(scene))))
    assert image.transitions > 20
    assert 0 < np.isfinite(image.distance).sum() < image.distance.size
    assert len(set(scene.sigma_t)) == 3
    assert any(light.beam < light.cutoff for light in scene.lights)


def test_a_law_that_is_broken_is_seen(variant, monkeypatch):
    """An estimator that squares the albedo, or that forgets the far light, fails the laws about them."""
    image = known_answers._airlight

    def squared(scene, estimator):
        return image(replace(scene, albedo=tuple(value**2 for value in scene.albedo)), estimator)

    monkeypatch.setattr(known_answers, "_airlight", squared)
    assert not known_answers.albedo_linear().passed
    assert known_answers.intensity_linear().passed
    monkeypatch.setattr(known_answers, "_airlight", lambda s, e: image(replace(s, lights=s.lights[:1]), e))
    assert not known_answers.lights_add_up().passed
    monkeypatch.setattr(known_answers, "_airlight", lambda s, e: image(replace(s, sigma_t=(0.25,) * 3), e))
    assert not known_answers.units().passed
