# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import numpy as np
import pytest

from analytic.errors import InputError
from tests.helpers.polygons import box, box_scene, lit_lengths, rays_of
from tests.helpers.scenes import tiny_scene


def setup(scene):
    import mitsuba as mi

    from reference.scene.read import read_truth

    truth = read_truth(mi.load_dict(scene))
    return truth, *rays_of(truth)


def cylinder(**changes):
    """Return a pipe beside the sphere."""
    return {"type": "cylinder", "p0": [0.7, -0.2, 0.1], "p1": [0.8, 0.1, 1.3], "radius": 0.1} | changes


@pytest.mark.claim("exact-shadows")
def test_polygons_and_balls_are_exact_and_other_shapes_are_cast(variant):
    from reference.visibility.lit_intervals import lit_intervals
    from reference.visibility.triangles import EXACT_EDGE

    for scene in (tiny_scene(), box_scene()):
        truth, light, rays, ends = setup(scene)
        assert lit_intervals(truth, light, rays, ends=ends).edge == EXACT_EDGE
    with pytest.raises(InputError, match="edges is 'both'; wanted 'geometry', 'rays' or 'auto'"):
        lit_intervals(truth, light, rays, ends=ends, edges="both")
    truth, light, rays, ends = setup(tiny_scene(pipe=cylinder()))
    assert lit_intervals(truth, light, rays, ends=ends).edge > EXACT_EDGE
    with pytest.raises(InputError, match="'pipe' is a Cylinder; wanted meshes, rectangles and spheres"):
        lit_intervals(truth, light, rays, ends=ends, edges="geometry")


def test_mixed_scenes_keep_needles_exact_beside_shapes_that_are_cast(variant):
    """A needle that few samples meet, a sphere and a pipe: the intersection is what all three leave, needle and all."""
    from reference.visibility.lit_intervals import lit_intervals
    from reference.visibility.triangles import geometric_intervals

    needle = box((0.5, -0.3, 0.9), (2e-4, 2e-4, 8.0))
    truth, light, rays, ends = setup(tiny_scene(pipe=cylinder(), needle=needle))
    intervals = lit_intervals(truth, light, rays, ends=ends, samples=32)
    assert intervals.random_checks.left == 0
    assert intervals.doubt is None
    # Cast densely, without the needle, whose shadow is narrower than what edges of cast rays leave open.
    bare, *_ = setup(tiny_scene(pipe=cylinder()))
    dense = lit_intervals(bare, light, rays, ends=ends, samples=1024, edges="rays")
    lost = lit_lengths(dense, ends) - lit_lengths(intervals, ends)
    assert lost.min() > -2e-5  # 2e-6 of the distance at each of a few edges, some of them grazing
    alone, *_ = setup(tiny_scene(ball=None, floor=None, needle=needle))
    of_needle = (ends[1] - ends[0]).clip(0) - lit_lengths(geometric_intervals(alone, light, rays, ends=ends), ends)
    crossed = of_needle > 1e-5
    assert crossed.sum() > 30
    assert np.all(lost[crossed] < of_needle[crossed] + 2e-5)
    assert np.mean(np.abs(lost - of_needle)[crossed] < 2e-5) > 0.7  # elsewhere the needle stands in a shadow
    assert np.abs(lost[~crossed]).max() < 4e-5


@pytest.mark.claim("cast-shadows")
def test_only_shapes_that_are_cast(variant):
    from reference.visibility.lit_intervals import lit_intervals

    truth, light, rays, ends = setup(tiny_scene(ball=None, floor=None, pipe=cylinder()))
    auto, cast = (lit_intervals(truth, light, rays, ends=ends, edges=edges) for edges in ("auto", "rays"))
    assert np.array_equal(auto.low, cast.low)
    assert auto.transitions > 20


def test_what_is_lit_in_both(variant):
    """Two sets of intervals by hand: overlapping, nested, touching, missing; doubt and checks add up."""
    from reference.visibility.intervals import LitIntervals, RandomChecks, intersected

    ends = np.zeros(5), np.ones(5)
    ray, low, high = np.array([0, 0, 1, 2, 4]), np.array([0.0, 0.5, 0.2, 0.0, 0.0]), np.array([0.4, 1, 0.8, 0.5, 1])
    doubt = np.array([1]), np.array([0.3]), np.array([0.01])
    first = LitIntervals(ray, low, high, 5, edge=1e-11, doubt=doubt)
    ray, low, high = np.array([0, 1, 1, 2, 3]), np.array([0.3, 0.0, 0.6, 0.5, 0.0]), np.array([0.6, 0.4, 1.0, 1, 1])
    second = LitIntervals(ray, low, high, 5, random_checks=RandomChecks(7, 2, 1, 1, 0.1))
    for pair in ((first, second), (second, first)):
        both = intersected(*pair, ends)
        assert both.ray.tolist() == [0, 0, 1, 1]
        assert both.low.tolist() == [0.3, 0.5, 0.2, 0.6]
        assert both.high.tolist() == [0.4, 0.6, 0.4, 0.8]
        assert (both.transitions, both.edge) == (8, 2e-6)
        assert both.random_checks == RandomChecks(7, 2, 1, 1, 0.1)
        assert [part.tolist() for part in both.doubt] == [[1], [0.3], [0.01]]


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
def test_slivers_that_random_samples_meet_are_mended(variant):
    """From rays that are taken to be lit from end to end, random samples alone find the shadows of a row of posts."""
    from reference.visibility.lit_intervals import _bisect
    from reference.visibility.random_checks import Rounding, Toggles, checked_cast
    from reference.visibility.triangles import geometric_intervals
    from tests.helpers.visibility import visibility_test

    posts = {f"post{i}": box((-0.9 + 0.31 * i, 0.1, 0.9), (0.03, 0.03, 3.0)) for i in range(6)}
    truth, light, rays, ends = setup(tiny_scene(ball=None, size=(24, 18), **posts))
    exact = geometric_intervals(truth, light, rays, ends=ends)
    used = np.flatnonzero(ends[1] > ends[0])
    nothing = Toggles(used, np.ones(len(used), bool), np.empty(0, np.int64), np.empty(0))
    found_by = Rounding(visibility_test(truth.occluders, light.position, rays), _bisect)
    mended = checked_cast(nothing, found_by, ends=ends, checks=128)
    known = mended.random_checks
    assert known.disagreements > 1000
    assert known.refined == known.disagreements - known.left
    assert known.left < 0.05 * known.disagreements  # rays with more slivers than rounds
    shadow = [(ends[1] - ends[0])[used] - lit_lengths(f, ends)[used] for f in (exact, mended)]
    assert np.abs(shadow[1] - shadow[0]).sum() < 0.05 * shadow[0].sum()


@pytest.mark.claim("shadow-ray-certificate")
def test_wrong_geometry_is_found_and_left_in_doubt(variant):
    """Intervals from which one box is missing contradict the shadow rays, and the test of all triangles."""
    from reference.scene.shapes import Shapes, read_shapes
    from reference.visibility.lit_intervals import point_leg
    from reference.visibility.random_checks import checked_geometry
    from reference.visibility.triangles import geometric_intervals
    from tests.helpers.visibility import visibility_test

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
    import reference.quadrature.light_airlight as light_airlight
    import reference.quadrature.ray_values as quadrature

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
    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth
    from validation.scenes.loading import load_scene

    image = quadrature_image(read_truth(load_scene("colonnade", size=(32, 24)).scene))
    reached = image.airlight_bound < 1e-5 * image.airlight
    assert np.mean(reached[image.airlight > 0]) > 0.999
    assert (image.disagreements, image.left) == (0, 0)
    assert image.checked == 32 * 32 * 24
