# SPDX-License-Identifier: BSD-3-Clause
"""The error of an image by its causes: the parts are what they are called, and add up to the whole.

Protects the claim on `airlight study decomposition`.
"""

import mitsuba as mi
import numpy as np
import pytest

from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.estimates.quadrature import truth_image
from validation.study.configuration import configuration
from validation.study.decompose import decompose


def split(method, kernel=None, *, size=(24, 20), render=None, **parameters):
    cube = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0.1, 0.1, 0.7]).scale(0.3)}
    lamp = {"type": "point", "position": [0.3, 0.4, 3.1], "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]}}
    scene = mi.load_dict(tiny_scene(size=size, ball=cube, lamp=lamp))
    truth = truth_image(scene).airlight
    return decompose(read_scene(scene), configuration(method, kernel, parameters), truth, render=render)


def causes(parts):
    return [(part["cause"], part["without"]) for part, _ in parts[1:]]


@pytest.mark.claim("error-by-cause", tolerance="1e-6 of the mean of the truth, pixel by pixel")
@pytest.mark.parametrize(
    ("method", "kernel", "parameters"),
    [
        ("ray-march", None, {"steps": 9, "shadow": "map", "map": 64, "tolerance": 0.01}),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("unshadowed", "taylor", {}),
                ("shadow-planes", "taylor", {"order": "none", "tolerance": 0.1}),
                ("light-volumes", None, {"map": 64}),
                ("min-max", None, {"map": 64}),
                ("froxel-fog", None, {"width": 8, "height": 6, "slices": 8, "map": 64}),
            )
        ),
    ],
)
def test_the_parts_add_up_to_the_whole(variant, method, kernel, parameters):
    (whole, error), *parts = split(method, kernel, **parameters)
    mean = error.mean() / whole["relative_bias"]  # of the truth
    np.testing.assert_allclose(np.sum([image for _, image in parts], axis=0), error, atol=1e-6 * mean)
    assert sum(part["share"] for part, _ in parts) == pytest.approx(1, abs=1e-9)
    assert whole["relative_rmse"] > 1e-4


def test_a_cause_that_is_gone_takes_its_part_along(variant):
    coarse = split("ray-march", steps=9, shadow="map", map=16)
    better = split("ray-march", steps=9)
    assert causes(coarse) == [("map", "shadow=ray"), ("steps", "reference")]
    assert causes(better) == [("steps", "reference")]
    np.testing.assert_array_equal(coarse[2][1], better[1][1])
    np.testing.assert_allclose(coarse[1][1], coarse[0][1] - better[0][1], atol=1e-15)


def test_a_method_of_ones_own_is_rendered_by_its_caller(variant):
    asked = []

    def render(chosen):
        asked.append(chosen.method)
        return np.ones((20, 24, 3))

    whole = split("tests.helpers.veil:Veil", render=render)
    assert asked == ["tests.helpers.veil:Veil"]
    assert causes(whole) == [("rest", "reference")]
