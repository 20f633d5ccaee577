# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import numpy as np
import pytest

from analytic.errors import InputError
from tests.polygons_for_tests import box, box_scene, rays_of
from tests.scenes_for_tests import tiny_scene


def setup(scene):
    import mitsuba as mi

    from reference.scene import read_truth

    truth = read_truth(mi.load_dict(scene))
    return truth, *rays_of(truth)


def test_spheres_are_cast_and_polygons_are_exact(variant):
    from reference.lit_geometry import EXACT_EDGE
    from reference.visibility import lit_intervals

    truth, light, rays, ends = setup(tiny_scene())
    assert lit_intervals(truth, light, rays, ends=ends).edge > EXACT_EDGE
    with pytest.raises(InputError, match="'ball' is a Sphere"):
        lit_intervals(truth, light, rays, ends=ends, edges="geometry")
    with pytest.raises(InputError, match="edges is 'both'; wanted 'geometry', 'rays' or 'auto'"):
        lit_intervals(truth, light, rays, ends=ends, edges="both")
    truth, light, rays, ends = setup(box_scene())
    assert lit_intervals(truth, light, rays, ends=ends).edge == EXACT_EDGE


def test_certificate_of_both_routes_is_clean(variant):
    from reference.visibility import lit_intervals

    truth, light, rays, ends = setup(box_scene())
    rays_used = int(np.sum(ends[1] > ends[0]))
    for edges in ("geometry", "rays"):
        known = lit_intervals(truth, light, rays, ends=ends, samples=256, edges=edges).certificate
        assert known.checked >= 32 * rays_used
        assert known.left == 0
        assert known.missed < 1e-3


def test_slivers_that_random_samples_meet_are_mended(variant):
    """From rays that are taken to be lit from end to end, random samples alone find the shadows of a row of posts."""
    from reference.certify import Rounding, Toggles, certified_cast
    from reference.lit_geometry import geometric_intervals
    from reference.visibility import _bisect, visibility_test

    posts = {f"post{i}": box((-0.9 + 0.31 * i, 0.1, 0.9), (0.03, 0.03, 3.0)) for i in range(6)}
    truth, light, rays, ends = setup(tiny_scene(ball=None, size=(24, 18), **posts))
    exact = geometric_intervals(truth, light, rays, ends=ends)
    used = np.flatnonzero(ends[1] > ends[0])
    nothing = Toggles(used, np.ones(len(used), bool), np.empty(0, np.int64), np.empty(0))
    found_by = Rounding(visibility_test(truth.occluders, light.position, rays), _bisect)
    found = certified_cast(nothing, found_by, ends=ends, checks=128)
    known = found.certificate
    assert known.disagreements > 1000
    assert known.refined == known.disagreements - known.left
    assert known.left < 0.05 * known.disagreements  # rays with more slivers than rounds
    shadow = [
        (ends[1] - ends[0])[used] - np.bincount(f.ray, f.high - f.low, len(ends[0]))[used] for f in (exact, found)
    ]
    assert np.abs(shadow[1] - shadow[0]).sum() < 0.05 * shadow[0].sum()


def test_intervals_stay_sorted_and_apart_after_mending(variant):
    from reference.visibility import lit_intervals

    posts = {f"post{i}": box((-0.9 + 0.31 * i, 0.1, 0.9), (0.017, 0.017, 3.0)) for i in range(6)}
    truth, light, rays, ends = setup(tiny_scene(ball=None, **posts))
    found = lit_intervals(truth, light, rays, ends=ends, samples=16, edges="rays")
    assert np.all(np.diff(found.ray) >= 0)
    assert np.all(found.high >= found.low)
    same = np.diff(found.ray) == 0
    assert np.all(found.low[1:][same] >= found.high[:-1][same])
    assert np.all((found.low >= ends[0][found.ray]) & (found.high <= ends[1][found.ray]))


def test_wrong_geometry_is_found_and_left_in_doubt(variant):
    """Intervals from which one box is missing contradict the shadow rays, and the test of all triangles."""
    from reference.certify import certified_geometry
    from reference.lit_geometry import geometric_intervals, scene_triangles
    from reference.visibility import visibility_test

    truth, light, rays, ends = setup(box_scene())
    triangles = scene_triangles(truth.occluders)
    wrong = geometric_intervals(truth, light, rays, ends=ends, triangles=triangles[12:])
    visible = visibility_test(truth.occluders, light.position, rays)
    found = certified_geometry(wrong, visible, (light.position, rays, triangles), ends=ends, checks=16)
    assert found.certificate.left > 20
    assert found.doubt is not None
    assert len(found.doubt[0]) == found.certificate.left
    # Shadow rays that are wrong themselves are overruled by the float64 test.
    right = geometric_intervals(truth, light, rays, ends=ends, triangles=triangles)

    def unreliable(ray, theta):
        lit = visible(ray, theta)
        lit[::701] ^= True
        return lit

    found = certified_geometry(right, unreliable, (light.position, rays, triangles), ends=ends, checks=4)
    assert found.certificate.disagreements > 0
    assert found.certificate.left == 0
    assert found.doubt is None


def test_doubt_widens_the_bound(variant, monkeypatch):
    import reference.quadrature as quadrature

    truth, *_ = setup(box_scene())
    plain = quadrature.ray_values(truth)
    compute = quadrature.lit_intervals

    def doubtful(*arguments, **settings):
        found = compute(*arguments, **settings)
        return replace(found, doubt=(np.array([5]), np.array([0.1]), np.array([1e-3])))

    monkeypatch.setattr(quadrature, "lit_intervals", doubtful)
    doubted = quadrature.ray_values(truth)
    assert np.array_equal(doubted.airlight, plain.airlight)
    assert np.flatnonzero((doubted.bound > plain.bound).any(axis=1)).tolist() == [5]
    # A milliradian of the ray's own airlight, if it were lit there, is worth less than that.
    assert np.all(doubted.bound[5] - plain.bound[5] > 0)


def test_a_built_in_scene_is_certain_to_1e_minus_5(variant):
    """The figure to reach, at a size for tests: every bound below 1e-5 of its pixel, and nothing contradicted."""
    from reference.quadrature import quadrature_image
    from reference.scene import read_truth
    from validation.load import load_scene

    image = quadrature_image(read_truth(load_scene("colonnade", size=(32, 24)).scene))
    reached = image.airlight_bound < 1e-5 * image.airlight
    assert np.mean(reached[image.airlight > 0]) > 0.999
    assert (image.disagreements, image.left) == (0, 0)
    assert image.checked == 32 * 32 * 24


def test_geometry_and_rays_give_the_same_image(variant):
    from reference.quadrature import quadrature_image

    truth, *_ = setup(box_scene())
    exact, cast = quadrature_image(truth, edges="geometry"), quadrature_image(truth, edges="rays")
    difference = np.abs(exact.airlight - cast.airlight)
    beyond = difference > exact.airlight_bound + cast.airlight_bound
    assert np.mean(beyond) < 0.02  # where cast rays still step over a sliver
    assert np.mean(exact.airlight_bound) < 1e-3 * np.mean(cast.airlight_bound)
