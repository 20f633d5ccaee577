# SPDX-License-Identifier: BSD-3-Clause
"""Epipolar slices of a light at infinity, in bounded media.

Claim: the error falls as the shadow map and the slices grow, to that of the same map without slices.
"""

import mitsuba as mi
import pytest

from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.sunlit import shaded, sun
from tests.realtime.methods.shadow_planes.test_directional import solid
from validation.estimates.quadrature import reference_image

FINE = {"sampling": "pixels", "slices": 6000}


@pytest.mark.parametrize("name", ["aslant", "along the view"])
def test_against_the_reference(variant, name):
    scene = shaded(solid=solid((0.5, 0.4, 0.3), (0.33, 0.27, 1.75)))
    if name == "along the view":
        # The image of the light is the middle of the image: rays beside it lie along the slices.
        scene = shaded(solid=solid((0.4, 0.3, 0.3), (0.753, -1.67, 1.17)), lamp=sun((-0.1, 4.1, -0.7)))
    reference = reference_image(mi.load_dict(scene)).airlight
    loaded = read(scene)
    errors = [relative_rmse(render(loaded, "min-max", map=size, **FINE).airlight, reference) for size in (64, 1024)]
    # A texel of the slanted walls at every jump, in a shadow that takes a fair part of the light.
    assert errors[1] < min(0.05, 0.4 * errors[0])
    # The height field of the map itself, with slanted walls, is about as far from the reference.
    walked = relative_rmse(render(loaded, "light-volumes", map=1024, walls="slanted").airlight, reference)
    assert errors[1] < 3 * walked + 2e-3
