# SPDX-License-Identifier: BSD-3-Clause
"""Airlight, surfaces and emission of lights with extent: against brute force, and as certain as they say."""

from functools import partial

import mitsuba as mi
import numpy as np
import pytest
from scipy.special import roots_legendre

from reference.quadrature import area_airlight as airlight_module
from reference.quadrature.area_surface import area_surface, surface_points, surface_rows, visible_share
from reference.quadrature.image import quadrature_image
from reference.quadrature.light_points import light_points, square_points
from reference.quadrature.replicates import standard_error
from reference.quadrature.surface import surface_hits
from reference.scene.read import read_truth
from reference.visibility.before_light import before_light
from reference.visibility.light_lines import Points
from reference.visibility.surface_shadows import segments_blocked
from tests.helpers.area_lights import (
    GREY,
    NULL,
    ball,
    fixed,
    flat,
    lamp,
    lit_room,
    lit_scene,
    turned,
)

LAMPS = {"rectangle": flat, "disk": partial(flat, "disk"), "sphere": ball}


def room(light, **changes):
    return lit_room(light, **({"size": (5, 4)} | changes))


def empty(light, **changes):
    return room(light, empty=True, **changes)


def test_one_point_by_plain_quadrature(variant):
    """The integral along the ray of cos_l V/r^2 exp(-sigma_t (x + r)), with the cosine as a dot product."""
    truth = empty(flat())
    point = light_points(truth.area[0], np.array([[0.3, 0.8]]))[0]
    nodes, weights = roots_legendre(2000)  # NumPy's takes ten seconds
    x = 3.5 * (nodes + 1)
    got = airlight_module._open_airlight(truth, [point], np.full(len(truth.direction), 7.0), 1.0)[0]
    for ray, direction in enumerate(truth.direction):
        away = truth.origin + x[:, None] * direction - point.position
        r = np.linalg.norm(away, axis=1)
        f = np.maximum(away @ point.axis / r, 0) / r**2 * np.exp(-truth.medium.sigma_t[0] * (x + r))
        expected = truth.medium.albedo * truth.medium.sigma_t * point.intensity / (4 * np.pi) * 3.5 * (f @ weights)
        assert got[ray] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("kind", LAMPS)
def test_a_light_does_not_shadow_itself_and_black_is_null_for_what_it_sends(variant, kind):
    images = [quadrature_image(room(LAMPS[kind](bsdf=bsdf)), plan=fixed(4)) for bsdf in (None, NULL)]
    clear = [image.distance == images[1].distance for image in images]
    same = clear[0]
    assert images[0].airlight[same] == pytest.approx(images[1].airlight[same], rel=1e-9)
    assert images[0].surface[same] == pytest.approx(images[1].surface[same], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("kind", ["rectangle", "sphere", pytest.param("disk", marks=pytest.mark.slow)])
def test_surfaces_by_many_shadow_rays(variant, kind):
    """Scan lines with exact visible parts against points of the light, each seen or not along one float64 ray."""
    truth = room(LAMPS[kind](), size=(8, 6))
    hits = surface_hits(truth)
    known = np.zeros((len(hits.distance), 3))
    lit = area_surface(truth, hits, known, plan=fixed(64), shadow_scale=1.0, tell=lambda share: None)
    rows = surface_rows(hits)
    points, bsdf = surface_points(truth, hits, rows)
    light, (_, shapes) = truth.area[0], before_light(truth, truth.area[0])
    count, replicates = 32, 8
    expected = np.zeros((len(rows), 3, replicates))
    for replicate in range(replicates):
        for point in light_points(light, square_points(fixed(count), 3, replicate, kind)):
            way = point.position - points.place
            r = np.linalg.norm(way, axis=1)
            way /= r[:, None]
            start = points.place + 1e-6 * points.normal
            end = np.broadcast_to(point.position + 1e-6 * point.axis, start.shape)
            seen = ~segments_blocked(start, end, shapes) & (np.sum(way * points.normal, axis=1) > 0)
            sent = np.maximum(-way @ point.axis, 0) / r**2 * seen
            leg = np.exp(-np.outer(r + hits.distance[rows], truth.medium.sigma_t))
            expected[..., replicate] += bsdf(np.arange(len(rows)), way) * sent[:, None] * leg * point.intensity / count
    assert 0.1 < np.mean(lit[rows, 0].mean(axis=1) > 0) < 1
    difference = lit[rows].mean(axis=2) - expected.mean(axis=2)
    error = np.hypot(standard_error(lit[rows]), standard_error(expected))
    scale = expected.mean()
    # Student's value with seven degrees of freedom that one value in 100 000 exceeds; 1e-5: the rays' start.
    assert np.all(np.abs(difference) <= 9.1 * error + 1e-5 * scale)
    assert np.sqrt(np.mean(error**2)) < 0.02 * scale


def test_a_lamp_that_cuts_the_floor(variant):
    """Half of a sphere is under the floor: what is above it is seen as if nothing were below."""
    low = lamp("sphere", center=[0.3, 0.4, 0.0], radius=0.4)
    place = np.array([[2.3, 0.4, 0.0], [-1.1, 1.7, 0.0]])
    floor = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(5.1), "bsdf": GREY}
    truth = room(low, block=None, ball=None, floor=floor)
    points = Points(place, np.tile([0.0, 0, 1], (2, 1)))
    # By symmetry the horizon halves the disk that a point on the floor sees.
    assert visible_share(truth, 0, points, 16).mean(axis=1) == pytest.approx([0.5, 0.5], abs=2e-2)
    above = Points(np.array([[2.3, 0.4, 1.1]]), np.array([[0.0, 0, 1]]))
    up = Points(above.place, np.array([[-1.0, 0, 0]]))
    assert visible_share(truth, 0, above, 16).mean() < 0.01
    assert 0.5 < visible_share(truth, 0, up, 16).mean() < 0.95


def test_emission_is_seen_through_fog_and_not_from_behind(variant):
    light = lamp(to_world=turned((0.0, 0.0, 0.0), 0, (0.3, 0.3, 1.0)), bsdf=NULL)
    facing = read_truth(lit_scene(size=(9, 9), to_world=turned((0.0, 0.0, 2.0), 180, (1, 1, 1)), lamp=light))
    behind = read_truth(lit_scene(size=(9, 9), to_world=turned((0.0, 0.0, -2.0), 0, (1, 1, 1)), lamp=light))
    image = quadrature_image(facing, plan=fixed(2))
    assert image.emitted[4, 4] == pytest.approx(np.array([3, 2, 1]) * np.exp(-0.21 * 2), rel=1e-6)
    assert (image.emitted[0, 0] == 0).all()
    assert quadrature_image(behind, plan=fixed(2)).emitted.max() == 0
