# SPDX-License-Identifier: BSD-3-Clause
"""One image of another renderer has one reference: Mitsuba's own image of a visible light is our total."""

import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature.image import quadrature_image
from reference.quadrature.ray_values import TruthImage
from reference.quadrature.replicates import PointPlan
from reference.scene.read import read_truth
from tests.helpers.area_lights import NULL, fog, lamp, lit_scene
from validation.estimates.agreement import truth_estimate
from validation.estimates.quadrature import reference_error, reference_layer
from validation.statistics.comparison import Estimate, compare_statistics


def test_the_total_of_a_seen_light_is_what_mitsuba_shows(variant):
    """Without albedo a pixel inside the light is Le exp(-sigma_t x): volpath's paths see the light or are absorbed."""
    place = mi.ScalarTransform4f().translate([0.0, 0.0, 2.5]).rotate([1, 0, 0], 180).scale([5.1, 4.7, 1.0])
    scene = lit_scene(size=(3, 2), medium=fog(0.21, 0.0), lamp=lamp(to_world=place, bsdf=NULL))
    seen = read_truth(scene)
    truth = quadrature_image(seen, plan=PointPlan(error=0.0, first=2, most=2))
    paths, shown = 1 << 14, {}
    ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(0.0), mi.Vector3f(np.repeat(seen.direction, paths, axis=0).T)))
    for hidden in (False, True):
        integrator = mi.load_dict({"type": "volpath", "max_depth": 2, "hide_emitters": hidden})
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1, 6 * paths)
        colour = integrator.sample(scene, sampler, ray, scene.sensors()[0].get_medium())[0]
        shown[hidden] = np.array(colour, dtype=np.float64).T.reshape(2, 3, paths, 3).mean(axis=2)
    # A path passes with probability p >= 0.43: four standard errors sqrt((1 - p)/(p paths)) of its mean are 3.6 %.
    expected = reference_layer(truth, "total")
    assert expected.min() > 0.4
    assert shown[False] == pytest.approx(expected, rel=0.04)
    assert shown[True].max() == 0
    assert reference_layer(truth, "total", emitted=False).max() == 0


def test_variances_of_the_total_add_up():
    layer = np.ones((1, 1, 3))
    none = np.full((1, 1), np.inf)
    plain = TruthImage(layer, 0 * layer, 2 * layer, none, none, 0, 0.0)
    lit = TruthImage(
        layer, 0 * layer, 2 * layer, none, none, 0, 0.0, emitted=5 * layer, airlight_se=3 * layer, surface_se=4 * layer
    )
    assert reference_error(plain, "total") is None
    assert reference_layer(plain, "total") == pytest.approx(3 * layer)
    assert reference_layer(lit, "total") == pytest.approx(8 * layer)
    assert reference_layer(lit, "total", emitted=False) == pytest.approx(3 * layer)
    assert reference_error(lit, "total") == pytest.approx(5 * layer)
    assert reference_error(lit, "surface") == pytest.approx(4 * layer)


@pytest.mark.parametrize("common", [1.0, 0.0], ids=["all pixels are wrong together", "each by itself"])
def test_errors_of_points_that_all_pixels_share_add_up(common):
    """200 references of 12 x 8 pixels with the mean 1: the interval of the image holds 1 in 95 % of them.

    The binomial law leaves 0.89 to 1 once in 10 000 runs. Pixels taken for independent held it in a third of them.
    """
    random = np.random.default_rng(4)
    mask, held, apart = np.ones((8, 12), dtype=bool), 0, 0
    for _ in range(200):
        own, shared = random.normal(size=(8, 12, 3, 8)), random.normal(size=(1, 1, 3, 8))
        replicates = 0.5 + 0.01 * (common * shared + (1 - common) * own)
        replicates = np.stack([replicates, replicates])  # airlight and surface
        errors = replicates.std(axis=-1, ddof=1) / np.sqrt(8)
        none = np.full((8, 12), np.inf)
        values = 0.5 + replicates.mean(axis=-1)  # and 0.5 from a point light
        more = {"emitted": errors[0], "airlight_se": errors[0], "surface_se": errors[1]}
        means = replicates.mean(axis=(1, 2)).swapaxes(1, 2)
        truth = TruthImage(values[0], 0 * values[0], values[1], none, none, 0, 0.0, **more, replicate_means=means)
        sure = Estimate(np.ones((8, 12, 3)), np.full((8, 12, 3), 1e-9), 64)
        statistics = compare_statistics(truth_estimate(truth, "airlight", sure, mask), sure, mask=mask)
        held += statistics.relative_bias_ci_batches[0] <= 0 <= statistics.relative_bias_ci_batches[1]
        apart += statistics.relative_bias_ci[0] <= 0 <= statistics.relative_bias_ci[1]
    assert held / 200 > 0.89
    assert apart / 200 < 0.5 if common else apart / 200 > 0.89
