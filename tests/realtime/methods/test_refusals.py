# SPDX-License-Identifier: BSD-3-Clause
"""Claim: parameters that a method cannot have, or not with one another, are refused by name
before a frame is drawn.
"""

import pytest

from airlight.errors import InputError
from tests.helpers.frames import renderer
from tests.helpers.lamps import lamp_scene


@pytest.mark.parametrize(
    ("method", "parameters", "message"),
    [
        (
            "froxel-fog",
            {"width": 4096, "height": 4096, "slices": 4096},
            "froxels: needs .* GB of memory",
        ),
        ("soft-shafts", {"hr": 0}, "hr: got 0.0, expected a number above 0"),
        (
            "soft-shafts",
            {"hd": "auto"},
            "hd: auto has the depth for a guide; expected filter=bilateral guide=depth",
        ),
        (
            "soft-shafts",
            {"scale": 8},
            "scale: got 8 and an image of 18 x 12, expected one that divides both sides",
        ),
        (
            "soft-shafts",
            {"interleave": True},
            "interleave: got 5 points of a light, expected 1, 2, 4, 8 or 16",
        ),
        ("light-volumes", {"map": 500}, "map: got 500, expected a power of two from 4 to 8192"),
        (
            "light-volumes",
            {"tessellation": "adaptive"},
            "got a parameter 'tessellation'.*see light-volumes-2010",
        ),
        ("shadow-planes", {"order": "paper"}, "got a parameter 'order'.*see shadow-planes-2006"),
        ("shadow-planes-2006", {"rows": 2000}, "rows: got 2000, expected .* from 2 to 64"),
        ("shadow-planes", {"points": 0}, "points: got 0, expected a whole number from 1 to 4096"),
        (
            "shadow-planes",
            {"pattern": "spiral"},
            "pattern: got 'spiral', expected one of ring, sobol",
        ),
        (
            "ray-march",
            {"jitter": "white", "sum": "transitions"},
            "jitter: got white with sum=transitions",
        ),
        (
            "ray-march",
            {"depth": "running", "sum": "transitions"},
            "depth: got running with sum=transitions",
        ),
        ("ray-march", {"animate": "golden"}, "animate: got golden without jitter"),
    ],
)
def test_parameters_that_cannot_be_are_refused_by_name(variant, method, parameters, message):
    scene = lamp_scene(size=(18, 12), ball=None)
    with pytest.raises(InputError, match=message) as caught:
        renderer(scene, method, **parameters)
    assert "\n" not in str(caught.value)
