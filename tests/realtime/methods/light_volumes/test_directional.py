# SPDX-License-Identifier: BSD-3-Clause
"""The map and the light volume of a directional light."""

from itertools import pairwise

import numpy as np
import pytest

from tests.helpers.scenes import clear_scene
from tests.helpers.sunlit import (
    box_part,
    cube,
    fog_sphere,
    read,
    relative_rmse,
    render,
    shaded,
    summed,
    sun,
)


def cast(scene, size):
    from realtime.shadow_maps.shadow_map import cast_shadow_map

    return cast_shadow_map(scene.geometry, scene.lights[0], size)


def face_of(shadow_map, light):
    """Return position, across, up and axis in NumPy."""
    vectors = (light.position, *shadow_map.projection.basis)
    return [np.array(vector, dtype=float).ravel() for vector in vectors]


@pytest.mark.claim("directional-light-volumes")
def test_the_face_just_covers_the_media(variant):
    """The corners of the box and the sphere fill the rectangle from side to side; nothing is before or behind it."""
    from realtime.scene.directional_extent import media_spheres

    scene = read(clear_scene(lamp=sun(), cube=cube(), ball=fog_sphere()))
    spheres = media_spheres(scene.medium.bounded_media)
    assert len(spheres) == 8 + 1
    shadow_map = cast(scene, 4)
    position, across, up, axis = face_of(shadow_map, scene.lights[0])
    for side in (across, up):
        half = np.linalg.norm(side)
        places = (spheres[:, :3] - position) @ side / half  # [m]
        # It has 0.1 % of its size to spare.
        assert (places + spheres[:, 3]).max() == pytest.approx(half, rel=2e-3)
        assert (places - spheres[:, 3]).min() == pytest.approx(-half, rel=2e-3)
        assert (places + spheres[:, 3]).max() < half
    depths = (spheres[:, :3] - position) @ axis
    assert (depths + spheres[:, 3]).max() < 0
    assert (depths - spheres[:, 3]).min() > -float(shadow_map.projection.depth[0])


def height_field(scene, size):
    """Return the function that tells whether points are lit by the triangles over the texels of a map."""
    shadow_map = cast(scene, size)
    position, across, up, axis = face_of(shadow_map, scene.lights[0])
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
    scene, size = read(shaded(size=(12, 8))), 64
    frame = render(scene, "light-volumes", map=size, walls="slanted")
    walked, distance = frame.airlight, frame.distance
    expected = summed(scene, [box_part()], distance=distance, lit=height_field(scene, size))
    without = render(scene).airlight
    assert relative_rmse(without, expected) > 0.05  # there is a shadow
    # A step of 1e-4 of a chord at each edge.
    assert relative_rmse(walked, expected) < 2e-4


@pytest.mark.slow
def test_the_error_falls_as_the_map_grows(variant):
    """Against the truth, which casts its own rays and shares nothing with this side."""
    import mitsuba as mi

    from validation.estimates.quadrature import truth_image

    scene = shaded(size=(32, 24))
    truth = truth_image(mi.load_dict(scene)).airlight
    loaded = read(scene, "single")

    def error(size, walls):
        return relative_rmse(render(loaded, "light-volumes", map=size, walls=walls).airlight, truth)

    errors = [error(size, "slanted") for size in (32, 128, 512, 2048)]
    # As 1/size where shadow edges are crossed, as its root for the few rays that graze the shadow of the sphere.
    assert all(fine < 0.65 * coarse for coarse, fine in pairwise(errors))
    assert errors[-1] < 5e-3
    # Walls that stand upright where rays found them are worth a map of eight times the size.
    assert error(128, "upright") < 1.5 * errors[2]
    assert error(512, "upright") < errors[3]


def test_a_map_of_rays_that_miss_all_media(variant):
    """A camera that looks away from the media: points at infinity have no place in a map."""
    scene = shaded(size=(8, 8), floor=None)
    import mitsuba as mi

    scene["sensor"] |= {"to_world": mi.ScalarTransform4f().look_at([0.2, -4.1, 1.3], [0.1, -9.0, 4.6], [0, 0, 1])}
    for method, parameters in (("ray-march", {"shadow": "map"}), ("light-volumes", {})):
        assert np.all(render(scene, method, precision="single", **parameters).airlight == 0)
