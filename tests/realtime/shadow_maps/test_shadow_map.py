# SPDX-License-Identifier: BSD-3-Clause
"""A shadow map says what rays say, away from the edges of shadows, and is never read outside."""

import numpy as np
import pytest

from tests.helpers.scenes import spot, tiny_scene


@pytest.mark.claim("march-maps", tolerance="1 % of the points")
@pytest.mark.parametrize("kind", ["point", "spot"])
def test_map_agrees_with_rays_away_from_edges(variant, kind):
    import drjit as dr
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.shadow_map import cast_shadow_map, lit_in_map

    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}))))
    light = scene.lights[0]
    rng = np.random.default_rng(5)
    points = rng.uniform((-2, -2, 0.05), (2, 2, 2.5), (20000, 3))
    if kind == "spot":
        away = points - np.array(light.position).ravel()
        inside = away @ np.array(light.axis).ravel() > np.cos(np.deg2rad(32)) * np.linalg.norm(away, axis=1)
        points = points[inside]
    p = mi.Vector3f(points.T)
    by_map = np.array(lit_in_map(cast_shadow_map(scene.geometry, light, 512), light, p))
    by_ray = np.array(~scene.geometry.ray_test(light.shadow_ray(p)))
    # Disagreement only within a texel of a shadow edge: a share of about (perimeter x texel) of the volume.
    assert np.mean(by_map != by_ray) < 0.01
    assert 0.02 < np.mean(~by_ray) < 0.98
    assert dr.width(p) == len(points)


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_a_look_up_stays_in_the_map_whatever_the_point(variant, kind):
    """At the light itself a place on a face is no number: a load from there ended the process."""
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.shadow_map import cast_shadow_map, lit_in_map

    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}))))
    light = scene.lights[0]
    shadow_map = cast_shadow_map(scene.geometry, light, 8)
    odd = np.array([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.0, 1.0])
    points = np.array(np.meshgrid(odd, odd, odd)).reshape(3, -1)
    place = np.array(light.position).reshape(3, 1)
    assert np.array(lit_in_map(shadow_map, light, mi.Vector3f(np.hstack([points, place + points, place])))).size == 687
