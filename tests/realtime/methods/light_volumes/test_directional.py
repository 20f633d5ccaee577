# SPDX-License-Identifier: BSD-3-Clause
"""The map and the light volume of a directional light."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.helpers.scenes import clear_scene, tiny_scene
from tests.helpers.sunlit import (
    ALONG,
    box_part,
    cube,
    fog_sphere,
    read,
    relative_rmse,
    render,
    shaded,
    summed,
    sun,
    unit,
)
from validation.scenes.parts import rotation


def cast(scene, size):
    from realtime.shadow_maps.shadow_map import cast_shadow_map

    return cast_shadow_map(scene.geometry, scene.lights[0], size)


def face_of(shadow_map, light):
    """Return position, across, up and axis in NumPy."""
    vectors = (light.position, *shadow_map.projection.basis)
    return [np.array(vector, dtype=float).ravel() for vector in vectors]


def test_depths_are_measured_along_the_light(variant):
    """A floor alone: every ray of the map meets z = 0 where the plane says."""
    scene = read(shaded(solid=None))
    shadow_map = cast(scene, 16)
    position, across, up, axis = face_of(shadow_map, scene.lights[0])
    assert axis == pytest.approx(unit(ALONG), abs=1e-7)
    for first, second in ((across, up), (across, axis), (up, axis)):
        assert abs(first @ second) < 1e-6
    u = np.linspace(-1, 1, 17)
    start = position + u[None, :, None] * across + u[:, None, None] * up - float(shadow_map.projection.depth[0]) * axis
    depth = np.array(shadow_map.distance, dtype=float).reshape(17, 17)
    # Rays are float32, of lengths of about 10 m.
    assert depth == pytest.approx(-start[..., 2] / axis[2], rel=1e-6)


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
@pytest.mark.parametrize("size", [8, 64])
def test_the_walk_against_steps_through_the_height_field(variant, size):
    """The same map, met by a sum over 10 000 steps of every ray in NumPy."""
    scene = read(shaded(size=(12, 8)))
    frame = render(scene, "light-volumes", map=size, walls="slanted")
    walked, distance = frame.airlight, frame.distance
    expected = summed(scene, [box_part()], distance=distance, lit=height_field(scene, size))
    without = render(scene).airlight
    assert relative_rmse(without, expected) > 0.05  # there is a shadow
    # A step of 1e-4 of a chord at each edge.
    assert relative_rmse(walked, expected) < 2e-4


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


@pytest.mark.slow
def test_marching_with_the_map_comes_to_the_same(variant):
    scene = read(shaded(size=(16, 12)))
    walked = render(scene, "light-volumes", map=2048).airlight
    marched = render(scene, "ray-march", steps=4000, shadow="map", map=2048).airlight
    # The marcher takes the nearest value and has a step of half a texel where the walk has a slope.
    assert relative_rmse(marched, walked) < 5e-3


def test_a_map_of_rays_that_miss_all_media(variant):
    """A camera that looks away from the media: points at infinity have no place in a map."""
    scene = shaded(size=(8, 8), floor=None)
    import mitsuba as mi

    scene["sensor"] |= {"to_world": mi.ScalarTransform4f().look_at([0.2, -4.1, 1.3], [0.1, -9.0, 4.6], [0, 0, 1])}
    for precision in ("single", "double"):
        for method, parameters in (("ray-march", {"shadow": "map"}), ("ray-march", {}), ("light-volumes", {})):
            assert np.all(render(scene, method, precision=precision, **parameters).airlight == 0)


def test_single_precision_against_double(variant):
    """The map is the same in both: what differs is rounding along the rays."""
    scene = shaded(size=(32, 24))
    single, double = (render(scene, "light-volumes", map=256, precision=name).airlight for name in ("single", "double"))
    assert np.abs(single - double).max() < 1e-5 * double.max()
    maps = [np.array(cast(read(scene, name), 64).distance, dtype=float) for name in ("single", "double")]
    assert np.array_equal(*maps)


@pytest.mark.slow
def test_several_lights_have_a_volume_each(variant):
    lamp = tiny_scene()["lamp"] | {"position": [1.9, -0.7, 2.9]}
    of_sun, of_lamp = render(shaded(), "light-volumes", map=128), render(shaded(lamp=lamp), "light-volumes", map=128)
    both = render(shaded(other=lamp), "light-volumes", map=128)
    assert np.abs(both.airlight - of_sun.airlight - of_lamp.airlight).max() < 1e-12 * both.airlight.max()
    assert np.abs(both.surface - of_sun.surface - of_lamp.surface).max() < 1e-12 * both.surface.max()


def test_a_light_that_turns_is_the_light_of_a_turned_scene(variant):
    from realtime.scene.animate import coloured_light, thicker_medium, turned_light

    turn = rotation((0.2, 0.1, 1.0), 57.0)
    scene = read(shaded())
    moved = replace(scene, lights=(turned_light(scene.lights[0], np.zeros(3), turn),))
    there = read(shaded(lamp=sun(turn @ np.asarray(ALONG))))
    for method in ("unshadowed", "light-volumes", "ray-march"):
        # The direction is Mitsuba's, in float32.
        assert relative_rmse(render(moved, method).airlight, render(there, method).airlight) < 1e-4
    red = replace(scene, lights=(coloured_light(scene.lights[0], 1 / 3),))
    shares = render(red).airlight / render(scene).airlight.clip(1e-30)
    lit = render(scene).airlight.min(axis=2) > 0
    assert shares[lit] == pytest.approx(np.broadcast_to([1 / 3, 3 / 2, 2.0], shares[lit].shape))
    assert np.all(render(replace(scene, medium=thicker_medium(scene.medium, 0.0))).airlight == 0)


def test_one_frame_serves_a_light_that_moves(variant):
    """What was recorded for one direction is replayed for another."""
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.animate import turned_light

    scene = read(shaded(), "single")
    renderer = frame_renderer(scene, METHODS["light-volumes"], kernel=KERNELS["exact"].function, map=64)
    first = render_frame(renderer).airlight
    moved = replace(scene, lights=(turned_light(scene.lights[0], np.zeros(3), rotation((0, 0, 1), 40.0)),))
    again = render_frame(replace(renderer, scene=moved)).airlight
    assert relative_rmse(again, render(moved, "light-volumes", map=64).airlight) < 1e-6
    assert relative_rmse(again, first) > 0.01


def test_a_plan_counts_the_light(variant):
    from realtime.scene.features import describe

    assert describe(read(shaded()).features)["lights"] == "1 directional"


def test_the_map_needs_the_memory_of_one_face(variant):
    from realtime.shadow_maps.shadow_map import map_memory

    scene = read(shaded(), "single")
    assert map_memory(scene.lights[0], 64) == 4 * 65**2
    assert len(np.array(cast(scene, 64).distance)) == 65**2
