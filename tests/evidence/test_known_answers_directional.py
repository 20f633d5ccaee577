# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from tests.evidence.known_answers import directional as directional_answers
from tests.evidence.known_answers.record import ESTIMATORS

EXACT_FOR_ALL = ("albedo_linear", "irradiance_linear", "units", "enclosed")


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("law", ["lights_add_up", "turned", "vertical_light"])
def test_quadrature_obeys(variant, law):
    answer = getattr(directional_answers, law)()
    assert answer.passed, answer
    assert answer.reason


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("law", EXACT_FOR_ALL)
@pytest.mark.parametrize(
    "estimator",
    # volpath's kernels take half a minute to compile, and each of these scenes has its own
    [pytest.param(name, marks=pytest.mark.slow) if name == "volpath" else name for name in ESTIMATORS],
)
def test_all_estimators_obey(variant, law, estimator):
    answer = getattr(directional_answers, law)(estimator)
    assert answer.passed, answer


def test_the_laws_are_tried_on_a_scene_with_shadows_and_colours(variant):
    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth
    from tests.evidence.certified.model import load_fog

    truth = read_truth(load_fog(directional_answers.base_scene()))
    image = quadrature_image(truth)
    assert len(truth.directional) == 1
    assert not truth.lights
    assert len(set(truth.media[0].sigma_t)) == 3
    assert image.transitions > 20
    assert 0 < np.sum(image.airlight[..., 0] == 0) < image.airlight[..., 0].size


def test_a_law_that_is_broken_is_seen(variant, monkeypatch):
    """A sun whose light falls off with the distance, a forgotten lamp, an albedo counted twice: each fails its law."""
    airlight = directional_answers._airlight

    def image(change):
        return lambda scene, estimator: airlight(scene, estimator) * change(scene)

    monkeypatch.setattr(directional_answers, "_airlight", image(lambda scene: scene["body"]["interior"]["scale"]))
    assert not directional_answers.units().passed
    assert directional_answers.irradiance_linear().passed
    albedo = image(lambda scene: scene["body"]["interior"]["albedo"]["value"][0])
    monkeypatch.setattr(directional_answers, "_airlight", albedo)
    assert not directional_answers.albedo_linear().passed
    monkeypatch.setattr(directional_answers, "_airlight", image(lambda scene: 1.0 if "sun" in scene else 0.0))
    assert not directional_answers.lights_add_up().passed
