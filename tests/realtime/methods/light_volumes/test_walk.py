# SPDX-License-Identifier: BSD-3-Clause
"""A walk finds each crossing once, also where many lie at one distance."""

import numpy as np

from tests.helpers.light_frames import differ, fence, render
from tests.helpers.scenes import tiny_scene


def test_crossings_at_one_distance_break_no_parity(variant, monkeypatch):
    """Of two crossings at the same distance one may be the last of a pass, and the other none of the next."""
    import drjit as dr
    import mitsuba as mi

    from realtime.methods.light_volumes import crossings as volume_crossings

    exact = volume_crossings.distance_at
    # Crossings of the bars, a quarter of a metre apart, come to lie at the same distances, most of them twice.
    monkeypatch.setattr(volume_crossings, "distance_at", lambda ray, t: 0.5 * dr.floor(2 * exact(ray, t)))
    monkeypatch.setattr(volume_crossings, "PLACES", 64)
    scene = mi.load_dict(tiny_scene(**fence()))
    at_once = render(scene, map=256).airlight
    for places in (2, 4, 8):
        monkeypatch.setattr(volume_crossings, "PLACES", places)
        assert differ(render(scene, map=256).airlight, at_once) < 1e-6, places  # float32: the order of the sum
    assert np.any(at_once > 0)
