# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

import reference.quadrature.light_airlight as light_airlight
import reference.quadrature.ray_values as quadrature
from analytic.errors import InputError
from reference.quadrature.image import quadrature_image
from reference.scene.read import read_truth
from reference.scene.shapes import Shapes, read_shapes
from reference.visibility.lit_intervals import point_leg
from reference.visibility.random_checks import checked_geometry
from reference.visibility.triangles import EXACT_EDGE, geometric_intervals
from tests.helpers.polygons import box_scene, rays_of, visibility_test
from tests.helpers.scenes import tiny_scene
from validation.scenes.loading import load_scene


def setup(scene):
    truth = read_truth(mi.load_dict(scene))
    return truth, *rays_of(truth)


def cylinder(**changes):
    """Return a pipe beside the sphere."""
    return {"type": "cylinder", "p0": [0.7, -0.2, 0.1], "p1": [0.8, 0.1, 1.3], "radius": 0.1} | changes


@pytest.mark.claim("exact-shadows")
def test_polygons_and_balls_are_exact_and_other_shapes_are_cast(variant):
    from reference.visibility.lit_intervals import lit_intervals

    for scene in (tiny_scene(), box_scene()):
        truth, light, rays, ends = setup(scene)
        assert lit_intervals(truth, light, rays, ends=ends).edge == EXACT_EDGE
    with pytest.raises(InputError, match="edges is 'both'; wanted 'geometry', 'rays' or 'auto'"):
        lit_intervals(truth, light, rays, ends=ends, edges="both")
    truth, light, rays, ends = setup(tiny_scene(pipe=cylinder()))
    assert lit_intervals(truth, light, rays, ends=ends).edge > EXACT_EDGE
    with pytest.raises(InputError, match="'pipe' is a Cylinder; wanted meshes, rectangles and spheres"):
        lit_intervals(truth, light, rays, ends=ends, edges="geometry")


@pytest.mark.claim("shadow-ray-certificate")
def test_certificate_of_both_routes_is_clean(variant):
    from reference.visibility.lit_intervals import lit_intervals

    truth, light, rays, ends = setup(box_scene())
    rays_used = int(np.sum(ends[1] > ends[0]))
    for edges in ("geometry", "rays"):
        known = lit_intervals(truth, light, rays, ends=ends, samples=256, edges=edges).random_checks
        assert known.checked >= 32 * rays_used
        assert known.left == 0
        assert known.missed < 1e-3


@pytest.mark.claim("shadow-ray-certificate")
def test_wrong_geometry_is_found_and_left_in_doubt(variant):
    """Intervals from which one box is missing contradict the shadow rays, and the test of all triangles."""
    truth, light, rays, ends = setup(box_scene())
    shapes = read_shapes(truth.occluders)
    wrong = geometric_intervals(truth, light, rays, ends=ends, shapes=Shapes(shapes.triangles[12:]))
    visible = visibility_test(truth.occluders, light.position, rays)
    checked = checked_geometry(wrong, visible, (point_leg(light.position, rays), shapes), ends=ends, checks=16)
    assert checked.random_checks.left > 20
    assert checked.doubt is not None
    assert len(checked.doubt[0]) == checked.random_checks.left
    # Shadow rays that are wrong themselves are overruled by the float64 test.
    right = geometric_intervals(truth, light, rays, ends=ends, shapes=shapes)

    def unreliable(ray, theta):
        lit = visible(ray, theta)
        lit[::701] ^= True
        return lit

    checked = checked_geometry(right, unreliable, (point_leg(light.position, rays), shapes), ends=ends, checks=4)
    assert checked.random_checks.disagreements > 0
    assert checked.random_checks.left == 0
    assert checked.doubt is None


@pytest.mark.claim("shadow-ray-certificate")
def test_doubt_widens_the_bound(variant, monkeypatch):
    truth, light, rays, _ = setup(box_scene())
    plain = quadrature.ray_values(truth)
    compute = light_airlight.lit_intervals

    def doubtful(*arguments, **settings):
        intervals = compute(*arguments, **settings)
        return replace(intervals, doubt=(np.array([5]), np.array([0.1]), np.array([1e-3])))

    monkeypatch.setattr(light_airlight, "lit_intervals", doubtful)
    doubted = quadrature.ray_values(truth)
    assert np.array_equal(doubted.airlight, plain.airlight)
    assert np.flatnonzero((doubted.bound > plain.bound).any(axis=1)).tolist() == [5]
    # In theta the integrand is exp(-sigma_t (x + r)) p/h: a milliradian about 0.1, if it were lit, is worth less than
    # what the bound grew by, and that is no more than its worth in a vacuum.
    height, foot = rays[2][5], (light.position - truth.origin) @ truth.direction[5]
    way = foot + height * np.tan(0.1) + height / np.cos(0.1)
    most = truth.medium.albedo * truth.medium.sigma_t * light.intensity / (4 * np.pi) * 1e-3 / height
    grown = doubted.bound[5] - plain.bound[5]
    assert np.all(grown >= most * np.exp(-truth.medium.sigma_t * way))
    assert np.all(grown <= most * (1 + 1e-9))


@pytest.mark.claim("bound-in-every-pixel", tolerance="1e-5 relative")
def test_a_built_in_scene_is_certain_to_1e_minus_5(variant):
    """The figure to reach, at a size for tests: every bound below 1e-5 of its pixel, and nothing contradicted."""
    image = quadrature_image(read_truth(load_scene("colonnade", size=(32, 24)).scene))
    reached = image.airlight_bound < 1e-5 * image.airlight
    assert np.mean(reached[image.airlight > 0]) > 0.999
    assert (image.disagreements, image.left) == (0, 0)
    assert image.checked == 32 * 32 * 24
