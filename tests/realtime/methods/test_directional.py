# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes, shadow planes and epipolar slices of a light at infinity, in bounded media."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.scenes.height_fog import register_height_fog
from airlight.validation.scenes.meshes import box, placed
from airlight.validation.scenes.parts import camera, height_fog, mitsuba_mesh
from tests.helpers import airlight_sum
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.sunlit import ALONG, CUBE_AT, SIDES, TURN, plank, rays, shaded, sun, unit


def solid_box(sides, centre) -> Any:
    """Return a box that casts shadows."""
    return mitsuba_mesh("solid", placed(box(sides), centre), (0.4, 0.5, 0.3))


def shadowed() -> dict[str, dict[str, Any]]:
    """Return sunlit shadowed with occluders that are meshes, by what is hard about them."""
    beam = solid_box((0.5, 0.4, 0.3), (0.33, 0.27, 1.75))
    return {
        "two media": shaded(
            solid=beam, plank=plank(), other=solid_box((0.2, 0.3, 0.9), (-0.6, 0.1, 2.6))
        ),
        # Four sides of the box are edge-on, and its upright edges are points as the light sees it.
        "parallel to edges": shaded(solid=beam, lamp=sun((0.0, 0.0, -1.0))),
    }


@pytest.mark.parametrize("name", ["two media", "parallel to edges"])
def test_shadow_planes_are_the_reference(variant, name):
    scene = shadowed()[name]
    reference = reference_image(mi.load_dict(scene)).airlight
    loaded = read(scene, "double")
    unshadowed = render(loaded).airlight
    assert relative_rmse(unshadowed, reference) > 0.02  # there is a shadow
    # The panels of two media leave 3e-6 without any shadow; the rest is the
    # reference's rays, cast in float32.
    allowed = 1e-5 if name == "two media" else 2e-6
    assert relative_rmse(render(loaded, "shadow-planes").airlight, reference) < allowed
    assert relative_rmse(render(scene, "shadow-planes").airlight, reference) < 5e-5


FINE = {"sampling": "pixels", "slices": 6000}


@pytest.mark.parametrize("name", ["aslant", "along the view"])
def test_slices_come_to_the_reference_as_the_map_grows(variant, name):
    scene = shaded(solid=solid_box((0.5, 0.4, 0.3), (0.33, 0.27, 1.75)))
    if name == "along the view":
        # The image of the light is the middle of the image: rays beside it lie along the slices.
        scene = shaded(
            solid=solid_box((0.4, 0.3, 0.3), (0.753, -1.67, 1.17)), lamp=sun((-0.1, 4.1, -0.7))
        )
    reference = reference_image(mi.load_dict(scene)).airlight
    loaded = read(scene)
    errors = [
        relative_rmse(render(loaded, "min-max", map=size, **FINE).airlight, reference)
        for size in (64, 1024)
    ]
    # A texel of the slanted walls at every jump, in a shadow that takes a fair part of the light.
    assert errors[1] < min(0.05, 0.4 * errors[0])
    # The height field of the map itself, with slanted walls, is about as far from the reference.
    walked = relative_rmse(
        render(loaded, "light-volumes", map=1024, walls="slanted").airlight, reference
    )
    assert errors[1] < 3 * walked + 2e-3


def summed(scene, distance, lit):
    """Sum the airlight of the sun over small steps of every chord of the box of fog;
    `scene` is for its camera.
    """
    chord = airlight_sum.box(CUBE_AT, 0.5 * SIDES, TURN)
    box = airlight_sum.Body(
        chord, np.full(3, 1.1), np.array([0.2, 0.5, 0.9]), airlight_sum.henyey_greenstein(0.4)
    )
    light = airlight_sum.Light(-unit(ALONG), 0.0, np.array([3.0, 2.0, 1.0]))
    origin, directions = rays(scene)
    image = [
        airlight_sum.airlight_sum(origin, direction, light, [box], steps=10_000, end=end, lit=lit)
        for direction, end in zip(directions, distance.ravel(), strict=True)
    ]
    return np.array(image).reshape(scene.camera.height, scene.camera.width, 3)


def height_field(scene, size):
    """Return the function that tells whether points are lit by the triangles
    over the texels of a map.
    """
    shadow_map = cast_shadow_map(scene.geometry, scene.lights[0], size)
    vectors = scene.lights[0].position, *shadow_map.projection.basis
    position, across, up, axis = (np.array(vector, dtype=float).ravel() for vector in vectors)
    depth = np.array(shadow_map.distance, dtype=float).reshape(size + 1, size + 1)
    # Where nothing is hit the height is 0 at the plane where the media end, and at any
    # depth behind it the same.
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
    expected = summed(scene, distance, height_field(scene, size))
    without = render(scene).airlight
    assert relative_rmse(without, expected) > 0.05  # there is a shadow
    # A step of 1e-4 of a chord at each edge.
    assert relative_rmse(walked, expected) < 2e-4


def test_a_map_of_rays_that_miss_all_media(variant):
    """A camera that looks away from the media: points at infinity have no place in a map."""
    scene = shaded(size=(8, 8), floor=None)
    scene["sensor"] |= {
        "to_world": mi.ScalarTransform4f().look_at([0.2, -4.1, 1.3], [0.1, -9.0, 4.6], [0, 0, 1])
    }
    for method, parameters in (("ray-march", {"shadow": "map"}), ("light-volumes", {})):
        assert np.all(render(scene, method, **parameters).airlight == 0)


@pytest.mark.parametrize("method", ["light-volumes", "min-max"])
def test_fog_without_sides_is_lit_beside_and_behind_the_map(variant, method):
    """A camera below all shapes saw no light, nor did one that looked past them: light volumes
    were 80 % off where a plate hung over the camera.
    """
    register_height_fog()
    seen = {
        "below the shapes": ((0.3, -6.0, -3.1), (0.1, 0.0, -2.3)),
        "past them": ((0.3, -6.0, 1.1), (7.0, 0.0, 1.3)),
    }
    for origin, target in seen.values():
        scene = {
            "type": "scene",
            "fog": height_fog(
                [(0.11, 0.0, 4.1)], -30.0, 40.0, albedo=(0.9, 0.7, 0.5), phase={"type": "isotropic"}
            ),
            "sensor": camera(origin, target, fov=61.0, size=(32, 24)),
            "sun": sun(),
            "plate": solid_box((2.3, 1.9, 0.2), (0.2, 0.1, 1.3)),
        }
        reference = reference_image(mi.load_dict(scene)).airlight
        assert relative_rmse(render(scene, method, map=256).airlight, reference) < 0.02
