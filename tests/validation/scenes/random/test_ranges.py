# SPDX-License-Identifier: BSD-3-Clause
"""Claim: ranges can be set, and what cannot be drawn is refused by name."""

import pytest

from analytic.errors import InputError
from validation.scenes.random.design import ranges_from
from validation.scenes.random.scene import draw_stage


@pytest.mark.claim("random-ranges", tolerance="none: what is drawn lies within the range")
def test_what_is_set_is_drawn():
    ranges = ranges_from(
        {"optical_depth": [0.5, 0.7], "lights": 2, "light_kinds": {"spot": 1}, "media": {"endless": 1}}
    )
    for seed in range(12):
        drawn = draw_stage(seed, ranges)
        assert [light.kind for light in drawn.lights] == ["spot", "spot"]
        assert [medium.bounds for medium in drawn.media] == ["endless"]
        assert 0.5 <= drawn.media[0].optical_depth <= 0.7


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"optical_dept": [1, 2]}, "got 'optical_dept', wanted some of scale, .*did you mean 'optical_depth'"),
        ({"fov": [50, 20]}, r"fov is \[50, 20\]; wanted \[from, to\], two numbers from 1 to 160"),
        ({"light_kinds": {"laser": 1}}, "got 'laser', wanted some of point, spot"),
        ({"light_kinds": {"point": 0}}, "no weight is above 0"),
        ({"light_kinds": {"point": -1}}, "point has the weight -1; wanted a number of 0 or more"),
        ({"meshes": "/nowhere/at/all"}, "wanted a folder of .obj and .ply files"),
    ],
)
def test_what_cannot_be_drawn_is_refused_by_name(table, words):
    with pytest.raises(InputError, match=words):
        ranges_from(table)
