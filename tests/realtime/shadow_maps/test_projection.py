# SPDX-License-Identifier: BSD-3-Clause
"""Claim: perspective and orthographic maps are one homogeneous map; its inverse finds (u, v, s) of a point again."""

import numpy as np
import pytest

from tests.helpers.scenes import spot, tiny_scene
from tests.helpers.sunlit import shaded


@pytest.mark.parametrize("kind", ["point", "spot", "directional"])
def test_points_on_rays_of_the_map_have_their_place_and_height(variant, kind):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.projection import light_projection, map_ray

    scenes = {"point": tiny_scene(), "spot": tiny_scene(lamp=spot()), "directional": shaded()}
    light = read_scene(mi.load_dict(scenes[kind]), "double").lights[0]
    assert light.kind == kind
    projection = light_projection(light)
    assert (projection.w, projection.faces) == {"point": (1, 6), "spot": (1, 1), "directional": (0, 1)}[kind]
    rng = np.random.default_rng(7)
    face = mi.UInt32(rng.integers(0, projection.faces, 500).astype(np.uint32))
    u, v = (mi.Float64(rng.uniform(-1, 1, 500)) for _ in range(2))
    distance = mi.Float64(rng.uniform(0.1, 3, 500) * (1 if projection.w else float(projection.depth[0]) / 3))
    start, unit = map_ray(light, face, u, v)
    away = start + unit * distance - light.position
    a, b, s, c = (np.array(part) for part in projection.homogeneous(face, away, 1))
    # The rectangle of a directional light is rounded to float32 in any precision: its sides are across it to 1e-7.
    allowed = 1e-12 if projection.w else 1e-6
    np.testing.assert_allclose(a / c, np.array(u), atol=allowed)
    np.testing.assert_allclose(b / c, np.array(v), atol=allowed)
    expected = np.array(projection.inverse_depth((u, v), distance))
    np.testing.assert_allclose(s / c, expected, rtol=1e-9, atol=allowed)
    # Linear in (vector, weight): a point that moves by a direction moves by that direction's coordinates.
    moved = projection.homogeneous(face, away + unit * 0.3, 1)
    steps = projection.homogeneous(face, unit * 0.3, 0)
    for before, after, step in zip((a, b, s, c), moved, steps):
        np.testing.assert_allclose(np.array(after), before + np.array(step), atol=1e-12)
