# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the light volume of a directional light is that of its map."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.shadow_maps.shadow_map import cast_shadow_map
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.sunlit import box_part, shaded, summed


def height_field(scene, size):
    """Return the function that tells whether points are lit by the triangles over the texels of a map."""
    shadow_map = cast_shadow_map(scene.geometry, scene.lights[0], size)
    vectors = scene.lights[0].position, *shadow_map.projection.basis
    position, across, up, axis = (np.array(vector, dtype=float).ravel() for vector in vectors)
    depth = np.array(shadow_map.distance, dtype=float).reshape(size + 1, size + 1)
    # Where nothing is hit the height is 0 at the plane where the media end, and at any depth behind it the same.
    height = np.maximum(float(shadow_map.projection.depth[0]) - depth, 0)

    def lit(point):
        away = point - position
        x, y = (0.5 * size * (away @ side / (side @ side) + 1) for side in (across, up))
        i, j = (np.clip(np.floor(coordinate).astype(int), 0, size - 1) for coordinate in (x, y))
        a, b = x - i, y - j
        s00, s10, s01, s11 = height[j, i], height[j, i + 1], height[j + 1, i], height[j + 1, i + 1]
        below = s00 + a * (s10 - s00) + b * (s11 - s10)
        above = s00 + b * (s01 - s00) + a * (s11 - s01)
        return -(away @ axis) > np.where(a >= b, below, above)

    return lit


@pytest.mark.claim("directional-light-volumes", tolerance="relative RMSE 2e-4: the steps' own")
def test_the_walk_against_steps_through_the_height_field(variant):
    """The same map, met by a sum over 10 000 steps of every ray in NumPy."""
    scene, size = read(shaded(size=(12, 8)), "double"), 64
    frame = render(scene, "light-volumes", map=size, walls="slanted")
    walked, distance = frame.airlight, frame.distance
    expected = summed(scene, [box_part()], distance=distance, lit=height_field(scene, size))
    without = render(scene).airlight
    assert relative_rmse(without, expected) > 0.05  # there is a shadow
    # A step of 1e-4 of a chord at each edge.
    assert relative_rmse(walked, expected) < 2e-4


def test_a_map_of_rays_that_miss_all_media(variant):
    """A camera that looks away from the media: points at infinity have no place in a map."""
    scene = shaded(size=(8, 8), floor=None)
    scene["sensor"] |= {"to_world": mi.ScalarTransform4f().look_at([0.2, -4.1, 1.3], [0.1, -9.0, 4.6], [0, 0, 1])}
    for method, parameters in (("ray-march", {"shadow": "map"}), ("light-volumes", {})):
        assert np.all(render(scene, method, **parameters).airlight == 0)
