# SPDX-License-Identifier: BSD-3-Clause
"""Airlight of a directional light in bounded media: against a closed form, sums over small steps, and its laws."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.scene.convex_bounds import mesh_bounds
from tests.helpers import airlight_sum
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.scenes import clear_scene, tiny_scene
from tests.helpers.sunlit import (
    ALONG,
    CUBE_AT,
    box_part,
    cube,
    fog_sphere,
    plank,
    plank_part,
    rays,
    shaded,
    sphere_part,
    summed,
    sun,
    unit,
)
from validation.scenes.meshes import icosphere, rotation
from validation.scenes.parts import medium_boundary

SMALL = (8, 6)


def look(origin, target, *, size=SMALL, up=(0, 0, 1)):
    place = mi.ScalarTransform4f().look_at(list(origin), list(target), list(up))
    sensor = {key: entry for key, entry in tiny_scene(size=size)["sensor"].items() if key != "medium"}
    return sensor | {"to_world": place}


@pytest.mark.claim("directional-light-volumes", tolerance="relative RMSE 1e-6, in float32 1e-5")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_a_box_under_light_from_above_has_a_closed_form(variant, precision):
    """With the light coming straight down the leg is H - z, linear in x, and the integral is an exponential's.

    int_0^c exp(-sigma x - sigma (H - z_0 - x d_z)) dx = exp(-sigma (H - z_0)) (1 - exp(-k c))/k,  k = sigma (1 - d_z).
    """
    sides, centre, sigma, g = np.array([1.5, 2.0, 1.25]), np.array([0.25, 0.5, 0.75]), 0.8125, 0.4
    fog = cube(centre=tuple(centre), sides=sides, turn=np.eye(3), sigma_t=sigma, g=g)
    scene = read(clear_scene(lamp=sun((0, 0, -1)), cube=fog), precision)
    airlight = render(scene, precision="double").airlight.reshape(-1, 3)

    origin, direction = rays(scene)
    with np.errstate(divide="ignore"):
        low_planes, high_planes = (
            (centre - 0.5 * sides - origin) / direction,
            (centre + 0.5 * sides - origin) / direction,
        )
    enter, leave = np.minimum(low_planes, high_planes).max(axis=1), np.maximum(low_planes, high_planes).min(axis=1)
    chord, height = np.maximum(leave - enter, 0), (origin + enter[:, None] * direction)[:, 2]
    k = sigma * (1 - direction[:, 2])
    integral = np.exp(-sigma * (centre[2] + 0.5 * sides[2] - height)) * -np.expm1(-k * chord) / k
    phase = (1 - g * g) / (1 + g * g - 2 * g * direction[:, 2]) ** 1.5  # scattering angle: down, then against the ray
    expected = np.where(chord > 0, integral * phase * sigma, 0)[:, None]
    expected = expected * np.array([0.2, 0.5, 0.9]) * np.array([3.0, 2.0, 1.0]) / (4 * np.pi)
    assert np.count_nonzero(chord) > 10
    # The albedo and g are float32 numbers of Mitsuba's, 6e-8 each; chords of float32 rays near an edge lose more.
    assert relative_rmse(airlight, expected) < (1e-6 if precision == "double" else 1e-5)


CASES = {
    "two boxes": ({"cube": cube, "plank": plank}, (box_part, plank_part), ALONG),
    "box and sphere": ({"cube": cube, "ball": fog_sphere}, (box_part, sphere_part), ALONG),
    "from behind": ({"cube": cube, "plank": plank}, (box_part, plank_part), (-0.2, -1.0, 0.3)),
    "along a face": (
        {"cube": cube, "plank": plank},
        (box_part, plank_part),
        tuple(rotation((0.4, 1.0, 0.1), 33.0)[:, 2]),
    ),
}


@pytest.mark.claim("directional-light-volumes")
@pytest.mark.parametrize("case", CASES)
def test_bounded_media_against_sums_over_small_steps(variant, case):
    shapes, parts, along = CASES[case]
    scene = clear_scene(size=SMALL, lamp=sun(along), **{name: make() for name, make in shapes.items()})
    expected = summed(read(scene, "double"), [make() for make in parts], along=along)
    # Steps across the edges of the other medium's shade: 1e-4 of a chord, on few of the rays. Corners of media are
    # float32 numbers, 1e-7.
    assert relative_rmse(render(scene, precision="double").airlight, expected) < 1e-5
    assert relative_rmse(render(scene, precision="single").airlight, expected) < 3e-5


def test_media_of_many_planes_have_nodes(variant):
    """A faceted sphere of 80 planes: the bends within the nodes are small."""
    medium = {"type": "homogeneous", "sigma_t": 1.3, "albedo": 0.7}
    vertices, faces = icosphere(1)
    vertices = vertices + np.array([0.0, 0.0, 0.6])
    bounds = mesh_bounds("many", vertices.astype(np.float32).astype(np.float64), faces)

    def chord(start, direction):
        along = np.broadcast_to(direction, start.shape) @ bounds.normals.T
        with np.errstate(divide="ignore"):
            at = (bounds.offsets - start @ bounds.normals.T) / along
        low = np.maximum(np.where(along < 0, at, -np.inf).max(axis=-1), 0)
        return low, np.maximum(np.where(along > 0, at, np.inf).min(axis=-1), low)

    scene = clear_scene(size=SMALL, lamp=sun(), many=medium_boundary("many", (vertices, faces), medium))
    part = airlight_sum.Body(chord, np.full(3, 1.3), np.full(3, 0.7), airlight_sum.henyey_greenstein(0.0))
    expected = summed(read(scene, "double"), [part], steps=1000)
    assert np.any(expected > 0)
    # Kinks of the leg at 80 facets, between nodes that are spread over the chord.
    assert relative_rmse(render(scene, precision="double").airlight, expected) < 1e-3
    assert relative_rmse(render(scene, precision="single").airlight, expected) < 1e-3


def test_a_ray_along_the_light(variant):
    """The middle ray runs with the light."""
    axis = unit(ALONG)
    sensor = look(np.asarray(CUBE_AT) - 4 * axis, CUBE_AT, size=(5, 5))
    scene = clear_scene(sensor=sensor, lamp=sun(), cube=cube(), ball=fog_sphere())
    expected = summed(read(scene, "double"), [box_part(), sphere_part()])
    for method in ("unshadowed", "light-volumes"):
        airlight = render(scene, method, precision="double").airlight
        assert airlight[2, 2].min() > 0
        assert airlight[2, 2] == pytest.approx(expected[2, 2], rel=1e-5)
        assert relative_rmse(airlight, expected) < 1e-5


def test_surfaces_have_lambert_s_law_and_both_legs(variant):
    scene = shaded(solid=None, cube=None, ball=fog_sphere())
    frame = render(scene, precision="double")
    origin, direction = rays(read(scene, "double"))
    distance = frame.distance.ravel()
    seen = np.isfinite(distance)
    point = origin + distance[seen, None] * direction[seen]
    part, axis = sphere_part(), unit(ALONG)
    near, far = np.maximum(part.chord(origin, direction[seen]), 0)
    depth = np.clip(distance[seen] - near, 0, far - near)
    near, far = np.maximum(part.chord(point, -axis), 0)
    depth = depth + (far - near)
    expected = np.array([0.4, 0.4, 0.5]) * np.array([3.0, 2.0, 1.0]) * (-axis[2] / np.pi)
    expected = expected * np.exp(-depth[:, None] * part.sigma_t)
    assert np.ptp(depth) > 0.3
    # Mitsuba's rays are float32.
    assert frame.surface.reshape(-1, 3)[seen] == pytest.approx(expected, rel=1e-5)


@pytest.mark.claim("directional-wants-bounds")
@pytest.mark.parametrize("method", ["unshadowed", "ray-march", "light-volumes"])
def test_a_medium_without_bounds_is_refused(variant, method):
    with pytest.raises(InputError, match=r"directional light and a medium without bounds.*give the medium bounds"):
        render(tiny_scene(lamp=sun()), method)
