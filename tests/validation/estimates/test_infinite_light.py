# SPDX-License-Identifier: BSD-3-Clause
"""Protects the claim that an infinite truth is refused by the distance of the light, by all three estimators."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

import validation.estimates.quadrature as module
from analytic.errors import InputError
from tests.helpers.scenes import spot, tiny_scene
from validation.estimates.monte_carlo import monte_carlo_batches
from validation.estimates.quadrature import truth_image


def scene_with(position, *, size=(9, 9), **changes):
    """Return a scene whose camera looks along +y, its middle pixel along the axis."""
    scene = tiny_scene(size=size, floor=None, ball=None)
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, -5, 1], [0, 0, 1], [0, 0, 1])
    if position is not None:
        scene["lamp"]["position"] = position
    return mi.load_dict({name: part for name, part in (scene | changes).items() if part is not None})


def truths(scene):
    """Return what gives the truth by each estimator."""

    def sampled(estimator):
        return lambda: monte_carlo_batches(scene, estimator, batches=2, samples=1).batches.mean

    return [lambda: truth_image(scene).airlight, sampled("single-scatter"), sampled("volpath")]


@pytest.mark.claim("light-on-a-ray-refused")
@pytest.mark.parametrize("position", [[0.0, -5.0, 1.0], [0.0, 0.0, 1.0], [1e-8, 0.0, 1.0]])
def test_every_estimator_refuses_a_light_at_the_camera_or_on_a_ray(variant, position):
    for truth in truths(scene_with(position)):
        with pytest.raises(InputError, match=r"light 1 at .* is [\d.e-]+ m from the (camera|ray .* column 4 of row 4)"):
            truth()


def test_a_spot_on_a_ray_is_refused_where_the_ray_is_in_its_cone(variant):
    def lamp(target):
        place = mi.ScalarTransform4f().look_at([0, 0, 1], target, [0, 0, 1])
        return spot() | {"to_world": place}

    assert np.isfinite(truth_image(scene_with(None, lamp=lamp([9, 0, 1]))).airlight).all()
    for target in ([0, 9, 1], [0.5, -4, 1]):
        with pytest.raises(InputError, match="light 1"):
            truth_image(scene_with(None, lamp=lamp(target)))


def test_the_mean_over_pixels_is_finite_where_a_centre_meets_a_light(variant):
    means = truth_image(scene_with([0.0, 0.0, 1.0], size=(3, 3)), pixel="area").airlight
    assert np.isfinite(means).all()
    assert means[1, 1].min() > means[0, 0].max()
    with pytest.raises(InputError, match="m from the camera"):
        truth_image(scene_with([0.0, -5.0, 1.0], size=(3, 3)), pixel="area")


def test_a_truth_that_is_not_finite_is_refused_and_not_kept(variant, own_cache, monkeypatch):
    scene = scene_with([1.0, 0.0, 1.0], size=(4, 3))
    whole = module.quadrature_image

    def broken(*arguments, **named):
        image = whole(*arguments, **named)
        image.surface[1, 2] = np.nan
        return replace(image, surface=image.surface)

    monkeypatch.setattr(module, "quadrature_image", broken)
    for _ in range(2):
        with pytest.raises(InputError, match="1 of 12 pixels whose surface is not finite, first in column 2 of row 1"):
            module.truth_image(scene)
