# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: against sums over small steps, limits with a known answer, and marching."""

from dataclasses import replace
from functools import partial

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from reference.scene.read import read_reference
from tests.helpers import airlight_sum, frames
from tests.helpers.frames import relative_rmse
from tests.helpers.scenes import bounded_medium, clear_scene, tiny_scene
from tests.helpers.sunlit import box_part, cube, fog_sphere, sphere_part
from validation.estimates.quadrature import reference_image
from validation.scenes.loading import load_scene
from validation.study.configuration import configuration, prepared

SPHERE_AT, RADIUS = (-0.8, 0.4, 0.7), 0.6
CUBE_AT = (0.9, 0.5, 0.6)
SPHERE, CUBE = sphere_part(SPHERE_AT, RADIUS), box_part(CUBE_AT)
render = partial(frames.render, precision="double")


def reference_of(scene):
    return read_reference(mi.load_dict(scene))


def summed(scene, parts, *, steps=500, **how):
    """Sum the airlight over small steps of every chord."""
    reference = reference_of(scene)
    lamp = airlight_sum.Light(reference.lights[0].position, 1.0, reference.lights[0].intensity)
    image = [
        airlight_sum.airlight_sum(reference.origin, direction, lamp, parts, steps=steps, **how)
        for direction in reference.direction
    ]
    return np.array(image).reshape(reference.height, reference.width, 3)


@pytest.mark.claim("bounded-media-of-methods", tolerance="relative RMSE 3e-5")
@pytest.mark.parametrize(
    "lamp", [(0.9, 0.7, 1.9), (-2.9, 0.6, 0.5), (0.8, 0.6, 0.7)], ids=["above", "through one to the other", "within"]
)
def test_two_media_against_sums_over_small_steps(variant, lamp):
    light = tiny_scene()["lamp"] | {"position": list(lamp)}
    scene = clear_scene(lamp=light, ball=fog_sphere(SPHERE_AT, RADIUS), cube=cube(centre=CUBE_AT))
    expected = summed(scene, [SPHERE, CUBE])
    # Segments are cut where the edges of the box bend the leg's length: 1e-5 is left, of the steps of the sums.
    assert relative_rmse(render(scene).airlight, expected) < 3e-5
    assert relative_rmse(render(scene, precision="single").airlight, expected) < 3e-5


@pytest.mark.claim("mean-distance-of-the-paper", tolerance="relative RMSE 1e-4")
def test_the_mean_distance_of_the_paper_is_a_constant_in_the_exponent(variant):
    """With R for the light's leg the sum over the chord has one factor more, exp(-sigma_t R)."""
    scene = clear_scene(ball=fog_sphere(SPHERE_AT, RADIUS, sigma_t=0.7))
    airlight = render(scene, "shadow-planes", media="paper").airlight

    part = replace(SPHERE, sigma_t=np.full(3, 0.7))
    expected = summed(scene, [part], shadow_scale=0.0) * np.exp(-0.7 * 1.2 * 0.6)
    # Six nodes on smooth chords, against 500 steps: 1e-5 each.
    assert relative_rmse(airlight, expected) < 1e-4


def test_surfaces_are_seen_and_lit_through_bounded_media(variant):
    """A floor with and without a medium between: the ratio is the transmittance of both legs."""
    floor = tiny_scene()["floor"]
    seen = render(clear_scene(floor=floor, ball=fog_sphere(SPHERE_AT, RADIUS)))
    clear = render(clear_scene(floor=floor, ball=fog_sphere(SPHERE_AT, RADIUS, sigma_t=0.0)))
    assert np.array_equal(seen.distance, clear.distance)
    reference = reference_of(clear_scene(floor=floor, ball=fog_sphere(SPHERE_AT, RADIUS)))
    distance = seen.distance.ravel()
    hit = np.isfinite(distance) & (clear.surface[..., 0].ravel() > 0)
    point = reference.origin + distance[hit, None] * reference.direction[hit]
    light = reference.lights[0].position
    way = np.linalg.norm(point - light, axis=1)
    length = np.zeros(len(point))
    for origin, towards, end in (
        (reference.origin, reference.direction[hit], distance[hit]),
        (light, (point - light) / way[:, None], way),
    ):
        near, far = np.clip(SPHERE.chord(origin, towards), 0, end)
        length += far - near
    ratio = (seen.surface / np.where(clear.surface > 0, clear.surface, 1)).reshape(-1, 3)[hit]
    assert np.any(length > 0.3)
    # Mitsuba's rays are float32; distances to the floor are good to 1e-6.
    assert ratio == pytest.approx(np.exp(-length[:, None] * SPHERE.sigma_t), rel=1e-4)


def test_an_ambient_field_fills_bounded_media(variant):
    scene = clear_scene(ball=fog_sphere(SPHERE_AT, RADIUS, sigma_t=0.7))
    gain = render(scene, "shadow-planes", ambient=0.3).airlight - render(scene, "shadow-planes").airlight
    reference = reference_of(scene)
    near, far = SPHERE.chord(reference.origin, reference.direction)
    chord = far - near
    expected = 0.3 * np.array([0.9, 0.4, 0.3]) * (1 - np.exp(-0.7 * chord))[:, None]
    assert gain.reshape(-1, 3) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (lambda: {"ball": fog_sphere((0.2, -4.1, 1.3), RADIUS)}, "inside of shape"),
        (lambda: {"disk": bounded_medium({"type": "disk"}, 0.5, (0.5, 0.5, 0.5))}, "is a disk"),
    ],
)
def test_refusals_name_what_is_in_the_way(variant, changes, message):
    with pytest.raises((InputError, RuntimeError), match=message):
        render(clear_scene(**changes()))


@pytest.mark.claim("bounded-media-of-methods", tolerance="relative RMSE 1e-5 to 1e-4, by scene")
@pytest.mark.parametrize(
    ("scene", "bound"),
    [
        ("random:2", 1e-5),
        pytest.param("random:84", 5e-5, marks=pytest.mark.slow),
        pytest.param("random:146", 1e-5, marks=pytest.mark.slow),
    ],
)
def test_random_scenes_against_the_reference(variant, scene, bound):
    """What sweeps found; the error before, at 160 x 120, and at rays that meet edges what is left.

    Legs graze spheres in the fog around them (2: 9e-5); light from infinity bends at the 72 facets of two bodies (84:
    1.7e-3); legs pass edges of boxes on their way to fog and other boxes (146: 1.2e-3).
    """
    loaded = load_scene(scene, (64, 48)).scene
    reference = reference_image(loaded).airlight
    frame = render_frame(prepared(read_scene(loaded), configuration("shadow-planes")))
    assert relative_rmse(frame.airlight, reference) < bound
