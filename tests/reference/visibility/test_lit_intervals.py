# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals of point lights, samples, spots and suns: against the definition,
closed forms, and cast rays.
"""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.quadrature import image as quadrature
from airlight.reference.quadrature import light_airlight
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shapes import Disks, Shapes
from airlight.reference.visibility.candidates import Ball, near_shapes
from airlight.reference.visibility.certificate import EXACT_EDGE, certified, segments_blocked
from airlight.reference.visibility.lit_intervals import Obstacles, lit_intervals, reaches
from airlight.reference.visibility.planes import cone_interval, falloff, rays_at
from airlight.validation.scenes.loading import load_scene
from tests.helpers.polygons import box_scene, rays_of
from tests.helpers.scenes import spot, tiny_scene


def unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def random_shapes(seed=4):
    """Return triangles, spheres and disks all around the origin."""
    draw = np.random.default_rng(seed)
    normal = draw.normal(size=(5, 3))
    disks = Disks(
        draw.uniform(-4, 4, (5, 3)),
        normal / np.linalg.norm(normal, axis=1)[:, None],
        draw.uniform(0.2, 1, 5),
    )
    triangles = draw.uniform(-4, 4, (60, 1, 3)) + draw.normal(size=(60, 3, 3)) * 0.6
    return Shapes(triangles, draw.uniform(-4, 4, (9, 3)), draw.uniform(0.1, 0.9, 9), disks)


def random_directions(count, seed=7):
    direction = np.random.default_rng(seed).normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def obstacles_of(shapes, ball, origin, direction, distance):
    return Obstacles(None, shapes, near_shapes(ball, origin, direction, distance, shapes), ball)


PLACES = {
    "beside": (np.array([0.9, -1.4, 2.1]), 1),
    "far": (np.array([30.0, 5.0, -7.0]), 1),
    "at the camera": (np.zeros(3), 1),
    "in a sphere": (None, 1),
    "sun": (unit([0.3, -0.5, 0.7]), 0),
    "sun overhead": (np.array([0.0, 0.0, 1.0]), 0),
    "low sun": (unit([-0.9, 0.02, 0.0]), 0),
}


@pytest.mark.claim("directional-reference", "exact-shadows")
@pytest.mark.parametrize(
    "place",
    [
        pytest.param(
            each, marks=pytest.mark.slow if each in ("far", "sun overhead", "low sun") else ()
        )
        for each in PLACES
    ],
)
def test_random_points_by_the_definition(variant, place):
    """Triangles, spheres and disks all around: points far from an edge are lit or not,
    by a test of each shape.
    """
    shapes, (light, w) = random_shapes(), PLACES[place]
    light = shapes.centre[2] + 0.03 if light is None else light
    direction = random_directions(300)
    rays = rays_at(np.zeros(3), direction, light, w)
    ends = np.full(300, 0.1), np.full(300, 5.0)
    known = obstacles_of(shapes, Ball(light, w=w), np.zeros(3), direction, ends[1])
    lit = lit_intervals(rays, ends, known, checks=0)
    ray = np.repeat(np.arange(300), 20)
    x = np.random.default_rng(3).uniform(0.1, 5.0, len(ray))
    inside, gap = np.zeros(len(ray), bool), np.full(len(ray), np.inf)
    for number, low, high in zip(lit.ray, lit.low, lit.high, strict=True):
        mine = ray == number
        inside[mine] |= (x[mine] > low) & (x[mine] < high)
        gap[mine] = np.minimum(gap[mine], np.minimum(np.abs(x[mine] - low), np.abs(x[mine] - high)))
    target = rays.point(ray, x)
    start = np.broadcast_to(light, target.shape) if w else target + 30 * light
    hidden = segments_blocked(start, target, shapes)
    assert 0.05 < hidden.mean() < 1 if place == "in a sphere" else 0.05 < hidden.mean() < 0.95
    # Where a plane all but touches a sphere, or a ray is all but along the
    # light, rounding is worth more.
    assert not np.any((inside == hidden)[gap > 1e-8])


@pytest.mark.claim("exact-shadows")
@pytest.mark.parametrize("radius", [0.0, 0.4])
@pytest.mark.parametrize("w", [1, 0])
def test_no_shape_in_the_light_is_left_out(variant, radius, w):
    """With every shape for every ray the intervals are the same; the lists are much shorter."""
    shapes = random_shapes()
    centre = np.array([0.9, -1.4, 3.1]) if w else unit([0.3, -0.5, 0.7])
    direction = random_directions(400)
    distance = np.where(np.arange(400) % 3 > 0, 4.0, np.inf if w else 9.0)
    draw = np.random.default_rng(2).normal(size=(400, 3))
    position = centre + radius * draw / np.linalg.norm(draw, axis=1)[:, None] if w else centre
    rays = rays_at(np.zeros(3), direction, position, w)
    ball = Ball(centre, radius * w, w)
    known = obstacles_of(shapes, ball, np.zeros(3), direction, distance)
    ends = np.zeros(400), distance
    some = lit_intervals(rays, ends, known, checks=0)
    counts = len(shapes.triangles), len(shapes.radius), len(shapes.disks.radius)
    every = [(np.zeros(400, np.int64), np.full(400, count), np.arange(count)) for count in counts]
    near = replace(known.near, triangles=every[0], spheres=every[1], disks=every[2])
    full = lit_intervals(rays, ends, replace(known, near=near), checks=0)
    listed = np.mean(known.near.triangles[1] - known.near.triangles[0])
    assert listed < (0.6 if w else 0.8) * counts[0]
    assert np.array_equal(some.ray, full.ray)
    assert some.low == pytest.approx(full.low, abs=1e-12)
    assert some.high == pytest.approx(full.high, abs=1e-12)


@pytest.mark.claim("directional-reference", tolerance="1e-13")
def test_one_triangle_in_closed_form(variant):
    """Light, triangle and ray in one plane: z - y cot for the corners, the crossing where
    it goes through the ray.
    """
    direction = np.array([[1.0, 0, 0]])
    light = unit([3.0, 0.0, 4.0])  # cot = 3/4 for a ray along x
    rays, ends = rays_at(np.zeros(3), direction, light, w=0), (np.zeros(1), np.array([10.0]))
    out = np.array([0.0, 0.3, 0.0])
    for corners, expected in (
        (((4.0, 0.0, 2.0), (6.0, 0.0, 1.0)), (2.5, 5.25)),
        (((4.0, 0.0, -2.0), (6.0, 0.0, 2.0)), (4.5, 5.0)),  # half of it lies on the dark side
    ):
        a, b = (np.array(end) for end in corners)
        shapes = Shapes(np.array([[a + out, a - out, b]]))
        known = obstacles_of(shapes, Ball(light, w=0), np.zeros(3), direction, ends[1])
        found = lit_intervals(rays, ends, known, checks=0)
        low, high = expected
        assert found.low == pytest.approx([0, high], abs=1e-13)
        assert found.high == pytest.approx([low, 10], abs=1e-13)
        assert found.transitions == 2


@pytest.mark.claim("exact-shadows", tolerance="1e-12")
def test_a_slit_of_a_billionth_is_found(variant):
    """A light at the height 2 over a ray, two sheets at the height 1 with a slit:
    its image is twice as wide.
    """
    slit, direction = 1e-9, np.array([[1.0, 0, 0]])
    sheets = [
        [[-9.0, -1, 1], [-9.0, 1, 1], [0.5, 1, 1]],
        [[-9.0, -1, 1], [0.5, 1, 1], [0.5, -1, 1]],
        [[0.5 + slit, -1, 1], [0.5 + slit, 1, 1], [9.0, 1, 1]],
        [[0.5 + slit, -1, 1], [9.0, 1, 1], [9.0, -1, 1]],
    ]
    shapes, light = Shapes(np.array(sheets)), np.array([0.25, 0.0, 2.0])
    rays, ends = rays_at(np.zeros(3), direction, light), (np.zeros(1), np.array([5.0]))
    known = obstacles_of(shapes, Ball(light), np.zeros(3), direction, ends[1])
    found = lit_intervals(rays, ends, known, checks=0)
    assert found.low == pytest.approx([0.75], abs=1e-12)
    # 1e-14 of rounding over 2e-9
    assert found.high - found.low == pytest.approx([2 * slit], rel=1e-5)


def setup(scene):
    reference = read_reference(mi.load_dict(scene))
    return reference, *rays_of(reference)


@pytest.mark.claim("shadow-ray-certificate")
def test_the_certificate_is_clean_and_notices_a_fault(variant):
    """Intervals from which one box is missing contradict the shadow rays, and
    the test of all triangles.
    """
    reference, rays, ends, known = setup(box_scene())
    right = lit_intervals(rays, ends, known)
    assert right.random_checks.checked == 32 * np.sum(ends[1] > ends[0])
    assert right.random_checks.left == 0
    assert right.random_checks.missed < 1e-3
    assert right.edge == EXACT_EDGE
    fewer = replace(known.shapes, triangles=known.shapes.triangles[12:])
    near = near_shapes(known.light, reference.origin, reference.direction, ends[1], fewer)
    wrong = lit_intervals(rays, ends, replace(known, shapes=fewer, near=near), checks=0)
    checked = certified(
        wrong, rays, ends, occluders=reference.occluders, shapes=known.shapes, checks=16
    )
    assert checked.random_checks.left > 20
    assert len(checked.doubt[0]) == checked.random_checks.left
    # Where a third of the rays is checked, what is in doubt stands for the others too.
    some = certified(
        wrong,
        rays,
        ends,
        occluders=reference.occluders,
        shapes=known.shapes,
        checks=16,
        every=3,
    )
    assert some.random_checks.left < 0.5 * checked.random_checks.left
    assert some.doubt[1].sum() == pytest.approx(checked.doubt[1].sum(), rel=0.45)


@pytest.mark.claim("shadow-ray-certificate")
@pytest.mark.parametrize("z", [5.0, -1.0], ids=["behind a wall", "behind the camera"])
def test_an_image_of_one_ray_along_the_line_of_the_light_is_not_checked(variant, z):
    wall = Shapes(np.array([[[-9.0, -9, 2], [9.0, -9, 2], [0.0, 9, 2]]]))
    light, direction, distance = np.array([0.0, 0.0, z]), np.array([[0.0, 0, 1]]), np.array([2.0])
    known = obstacles_of(wall, Ball(light), np.zeros(3), direction, distance)
    rays = rays_at(np.zeros(3), direction, light)
    lit = lit_intervals(rays, (np.zeros(1), distance), known)
    assert lit.random_checks.checked == 0
    # The wall ends the ray, before it or behind it no shape is in the light that comes this way.
    assert reaches(lit, distance).tolist() == [z < 0]


@pytest.mark.claim("shadow-ray-certificate")
def test_doubt_widens_the_bound(variant, monkeypatch):
    reference, rays, _, _ = setup(box_scene())
    light = reference.lights[0]
    plain = quadrature.ray_values(reference)
    compute = light_airlight.lit_intervals

    def doubtful(*arguments, **settings):
        return replace(compute(*arguments, **settings), doubt=(np.array([5]), np.array([1e-3])))

    monkeypatch.setattr(light_airlight, "lit_intervals", doubtful)
    doubted = quadrature.ray_values(reference)
    assert np.array_equal(doubted.airlight, plain.airlight)
    assert np.flatnonzero((doubted.airlight_error > plain.airlight_error).any(axis=1)).tolist() == [
        5
    ]
    # In theta the integrand is exp(-sigma_t (x + r)) p/h: a milliradian, if it were lit, is
    # worth no more than this.
    most = (
        reference.medium.albedo
        * reference.medium.sigma_t
        * light.intensity
        / (4 * np.pi)
        * 1e-3
        / rays.height[5]
    )
    assert doubted.airlight_error[5] - plain.airlight_error[5] == pytest.approx(most, rel=1e-9)


def test_surfaces_are_reached_as_rays_are(variant):
    """The last interval reaches the surface where a float64 segment from
    just above it meets nothing.
    """
    _, rays, ends, known = setup(box_scene())
    lit = lit_intervals(rays, ends, known, checks=0)
    seen = np.flatnonzero(np.isfinite(ends[1]))
    point = rays.point(seen, ends[1][seen] * (1 - 1e-7))
    blocked = segments_blocked(rays.position[seen], point, known.shapes)
    assert np.mean(reaches(lit, ends[1])[seen] == ~blocked) > 0.999
    assert 0.05 < blocked.mean() < 0.95


@pytest.mark.claim("bound-in-every-pixel", tolerance="1e-5 relative")
def test_a_built_in_scene_is_certain_to_1e_minus_5(variant):
    """The figure to reach, at a size for tests: every bound below 1e-5 of its pixel,
    and nothing contradicted.
    """
    image = quadrature_image(read_reference(load_scene("colonnade", size=(32, 24)).scene))
    reached = image.airlight_error < 1e-5 * image.airlight
    assert np.mean(reached[image.airlight > 0]) > 0.999
    assert (image.disagreements, image.left) == (0, 0)
    assert image.checked == 32 * 32 * 24


# Spots --------------------------------------------------------------------------------------------


@pytest.mark.claim("spot-falloff")
@pytest.mark.parametrize("degrees", [2.0, 31.0, 78.0, 89.5])
def test_interval_against_sampling(degrees):
    rng = np.random.default_rng(13)
    axis = np.array([0.3, -0.8, 0.5]) / np.linalg.norm([0.3, -0.8, 0.5])
    angle = np.deg2rad(degrees)
    light = ReferenceLight(np.array([0.2, 0.5, -0.4]), np.ones(3), axis, angle, angle)
    origin = np.array([1.1, -0.7, 0.9])
    direction = rng.normal(size=(500, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = rays_at(origin, direction, light.position)
    low, high = cone_interval(rays, light, angle)
    theta = np.linspace(-0.499 * np.pi, 0.499 * np.pi, 401)
    away = (
        direction[:, None] * np.sin(theta)[:, None] + rays.normal[:, None] * np.cos(theta)[:, None]
    )
    cosine = away @ axis
    clear = np.abs(cosine - np.cos(angle)) > 1e-9
    inside = (theta >= low[:, None]) & (theta <= high[:, None])
    assert np.array_equal(inside[clear], (cosine > np.cos(angle))[clear])
    assert inside.any()


@pytest.mark.claim("spot-falloff", tolerance="2e-5: acos of a float32 cosine")
def test_profile_is_that_of_mitsuba(variant):
    scene = mi.load_dict(tiny_scene(lamp=spot(cutoff=37.0, beam=14.0)))
    reference = read_reference(scene)
    light = reference.lights[0]
    rays = rays_at(reference.origin, reference.direction, light.position)
    normal = rays.normal
    theta = np.linspace(-1.3, 1.3, 57)
    value = falloff(np.broadcast_to(theta, (len(normal), 57)), rays, light)
    away = (
        reference.direction[:, None] * np.sin(theta)[:, None]
        + normal[:, None] * np.cos(theta)[:, None]
    )
    interaction = dr.zeros(mi.Interaction3f, away[..., 0].size)
    interaction.p = mi.Point3f((light.position + away).reshape(-1, 3).T)
    _, arriving = scene.emitters()[0].sample_direction(interaction, mi.Point2f(0.5))
    expected = np.array(arriving)[0].reshape(value.shape) / light.intensity[0]
    assert np.max(np.abs(value - expected)) < 2e-5  # acos of a float32 cosine close to 1
    assert value.max() == 1
    assert value.min() == 0
