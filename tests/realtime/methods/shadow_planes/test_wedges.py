# SPDX-License-Identifier: BSD-3-Clause
"""The wedge of a ray holds every plane that the ray crosses."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.methods.shadow_planes.plane_table import planes_of_rays
from tests.helpers.planes import CAMERA, LIGHT, bundles, crossings, index_of, listed_planes, occluders_of, rays_of

NAMES = ["torus", "crossing spheres", "open cylinder", "Moebius strip", "mixed winding", "boxes sharing an edge"]
CAMERAS = {
    "aside": CAMERA,
    "behind the casters": 1.3 * CAMERA - 0.9 * LIGHT,
    "near the light": LIGHT - (0.02, 0.01, 0.03),
}


@pytest.mark.claim("lists-hold-every-plane")
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", NAMES)
def test_wedges_hold_every_plane_that_a_ray_crosses(variant, name, camera):
    for spread, end in ((0.004, np.inf), (0.1, 3.1)):
        index = index_of(occluders_of(name), camera=CAMERAS[camera])
        ways = bundles(960, spread=spread, camera=CAMERAS[camera])
        crossed = crossings(index, ways)[0] < end
        listed = listed_planes(index, rays_of(index, ways, np.full(960, end)))
        # One ray in a thousand passes the end of an edge within rounding.
        missed = [set(np.flatnonzero(own).tolist()) - set(numbers.tolist()) for own, numbers in zip(crossed, listed)]
        assert sum(map(bool, missed)) <= 1
        assert all(len(set(numbers.tolist())) == len(numbers) for numbers in listed)
    assert crossed.any()


def test_wedges_stay_in_the_index_whatever_the_azimuth(variant):
    """The azimuth about a light that is at the camera is no number: a load from wedge 2^32 - 1 ended the process."""
    index = index_of(occluders_of("torus"))
    azimuths = mi.Float([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.5])
    way = (mi.Float([0.6] * 6), mi.Float([0.0] * 6), mi.Float([0.8] * 6))
    first, count = planes_of_rays(index, azimuths, way, mi.Float([0.0] * 6))
    assert np.all(np.array(first) + np.array(count) <= len(index.entries))
