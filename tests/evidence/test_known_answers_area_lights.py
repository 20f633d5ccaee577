# SPDX-License-Identifier: BSD-3-Clause
"""The truth of lights with extent obeys its laws and meets the closed forms."""

import pytest

from tests.evidence.known_answers import area_lights

LAWS = ("albedo_linear", "radiance_linear", "units", "turned", "shrinking_rectangle", "shrinking_sphere")


@pytest.mark.claim("known-answers")
@pytest.mark.parametrize("law", LAWS)
def test_quadrature_obeys(variant, law):
    answer = getattr(area_lights, law)()
    assert answer.passed, answer


@pytest.mark.claim("known-answers")
@pytest.mark.claim("area-light-closed-forms", tolerance="1e-6 of the share by 8 x 32768 lines")
@pytest.mark.parametrize("lines", [64, pytest.param(32768, marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", ["half_plane_before_disk", "triangle_before_lights"])
def test_shares_of_a_light(variant, law, lines):
    answer = getattr(area_lights, law)(lines)
    assert answer.passed, answer


@pytest.mark.slow
@pytest.mark.claim("known-answers")
@pytest.mark.claim("area-light-closed-forms", tolerance="2e-6 by 8 x 16384 points, whose standard error is 5e-7")
def test_sphere_beside_a_ray(variant):
    answer = area_lights.sphere_beside_rays()
    assert answer.passed, answer


def test_the_laws_are_tried_on_a_scene_with_shadows(variant):
    truth = area_lights._truth(area_lights.base_scene())
    image = area_lights._image(truth)
    open_air = area_lights._image(area_lights._open(truth))
    assert truth.area[0].kind == "rectangle"
    assert 0.3 < image.airlight.mean() / open_air.airlight.mean() < 0.97
