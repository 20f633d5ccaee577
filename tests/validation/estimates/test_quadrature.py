# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every layer of a reference says how far it may be off, and whether that is proven,
estimated or statistical.
"""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.quadrature.image import ReferenceImage, quadrature_image
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.reference.storage.exr import Image
from airlight.validation.comparison.images import compare_images
from airlight.validation.estimates.agreement import layer_masks, reference_estimate
from airlight.validation.estimates.images import layered_reference
from airlight.validation.estimates.quadrature import (
    known_to,
    known_words,
    off_by,
    reference_error,
    reference_layer,
)
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.statistics.comparison import NoisyImage, compare_statistics
from airlight.validation.statistics.estimate import INTERVAL, Estimate
from tests.helpers.area_lights import NULL, fog, lamp, lit_scene
from tests.helpers.scenes import tiny_scene


@pytest.mark.claim("corrected-for-the-epsilon")
def test_volpath_should_find_a_little_more_light(variant):
    """exp(-sigma_t r (1 - epsilon)) over exp(-sigma_t r): at most 1 + 2 epsilon
    where sigma_t r is below 2.
    """
    scene = load_scene("open-fog", (16, 12)).scene
    image = reference_image(scene)
    mask = layer_masks(read_reference(scene), image)["airlight"]
    plain = image.airlight[mask]
    shortened = reference_image(scene, shadow_scale=1 - measure_shadow_epsilon()).airlight[mask]
    lit = plain > 0
    assert lit.all(axis=1).any()
    more = shortened[lit] / plain[lit] - 1
    assert more.min() > 0
    assert more.max() < 2 * measure_shadow_epsilon()


def test_the_total_of_a_seen_light_is_what_mitsuba_shows(variant):
    """Without albedo a pixel inside the light is Le exp(-sigma_t x): volpath's paths see
    the light or are absorbed.
    """
    place = (
        mi.ScalarTransform4f()
        .translate([0.0, 0.0, 2.5])
        .rotate([1, 0, 0], 180)
        .scale([5.1, 4.7, 1.0])
    )
    scene = lit_scene(size=(3, 2), medium=fog(0.21, 0.0), lamp=lamp(to_world=place, bsdf=NULL))
    seen = read_reference(scene)
    reference = quadrature_image(seen, plan=PointPlan(error=0.0, first=2, most=2))
    paths, shown = 1 << 14, {}
    ray = mi.RayDifferential3f(
        mi.Ray3f(mi.Point3f(0.0), mi.Vector3f(np.repeat(seen.direction, paths, axis=0).T))
    )
    for hidden in (False, True):
        integrator = mi.load_dict({"type": "volpath", "max_depth": 2, "hide_emitters": hidden})
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1, 6 * paths)
        colour = integrator.sample(scene, sampler, ray, scene.sensors()[0].get_medium())[0]
        shown[hidden] = np.array(colour, dtype=np.float64).T.reshape(2, 3, paths, 3).mean(axis=2)
    # A path passes with probability p >= 0.43: four standard errors sqrt((1 - p)/(p
    # paths)) of its mean are 3.6 %.
    expected = reference_layer(reference, "total")
    assert expected.min() > 0.4
    assert shown[False] == pytest.approx(expected, rel=0.04)
    assert shown[True].max() == 0
    assert reference_layer(reference, "total", emitted=False).max() == 0


def stated(kind="proven", surface_error=2e-6, **more):
    """Return a reference of two pixels and an error of its airlight of 1e-9."""
    layer, none = np.ones((1, 2, 3)), np.full((1, 2), np.inf)
    errors = {"airlight_kind": kind, "surface_error": surface_error * layer}
    return ReferenceImage(layer, 1e-9 * layer, 2 * layer, none, none, 0, 0.0, **errors, **more)


@pytest.mark.parametrize(
    ("kind", "error", "header"),
    [("proven", "airlight_bound", "proven"), ("estimated", "airlight_error", None)],
)
def test_the_name_of_a_layer_says_what_its_error_is(variant, kind, error, header):
    loaded = LoadedScene("lamp", mi.load_dict(tiny_scene(size=(2, 1))), "", "")
    plain = layered_reference(loaded, stated(kind))
    assert set(plain.layers) == {"airlight", "surface", error, "surface_error"}
    assert plain.attributes.get("airlight:bound") == header
    layer = np.ones((1, 2, 3))
    lit = layered_reference(
        loaded, stated(kind, emitted=layer, airlight_se=layer, surface_se=layer)
    )
    more = {"emitted", "airlight_se", "surface_se"}
    assert set(lit.layers) == set(plain.layers) | more
    over = stated(kind, emitted=layer, airlight_se=layer, surface_se=layer, emitted_se=2 * layer)
    assert (layered_reference(loaded, over).layers["emitted_se"] == 2).all()
    assert lit.attributes["airlight:batches"] == 8
    for name in ("airlight", "surface"):
        compared = compare_images(plain, plain, layer=name)
        assert compared.stated.reference.kind == (kind if name == "airlight" else "estimated")
        wanted = {"airlight": 1e-9, "surface": 2e-6}[name]
        assert compared.stated.reference.error == pytest.approx(wanted)


def test_the_total_is_known_no_better_than_the_surface():
    plain = stated()
    assert known_to(plain, "airlight") == Estimate(1.0, pytest.approx(1e-9), "proven")
    assert known_to(plain, "surface") == Estimate(2.0, pytest.approx(2e-6), "estimated")
    assert known_to(plain, "total") == Estimate(3.0, pytest.approx(2e-6 + 1e-9), "estimated")
    assert known_words(known_to(plain, "surface")) == "known to 1e-06 of its mean (estimated)"


def test_a_mean_may_be_off_by_less_than_its_values():
    """Samples of two pixels: their standard errors add up as squares, those of channels do not."""
    layer, seen = np.ones((1, 2, 3)), {"airlight_se": np.full((1, 2, 3), 0.01)}
    reference = stated(emitted=2 * layer, surface_se=0.03 * layer, **seen)
    mean, value = off_by(reference, "airlight")
    assert mean == pytest.approx(2 * 0.01 / np.sqrt(2) + 1e-9, rel=1e-12)
    assert value == pytest.approx(2 * 0.01 + 1e-9, rel=1e-12)
    shown, alone = (off_by(reference, "total", emitted=each) for each in (True, False))
    assert alone == pytest.approx(np.multiply(shown, 5 / 3))
    assert off_by(stated(), "airlight") == pytest.approx((1e-9, 1e-9))
    assert off_by(replace(reference, surface_error=None), "surface") == (np.inf, np.inf)


def test_an_error_that_all_pixels_share_stays_in_their_mean(variant):
    """All rays have the same directions of a sky: its error was divided by the root of the pixels."""
    layer, random = np.ones((12, 16, 3)), np.random.default_rng(3)
    for shared in (False, True):
        size = (8, 1, 1, 1) if shared else (8, *layer.shape[:2], 1)
        replicates = 1 + 0.02 * random.normal(size=size) * layer
        spread = replicates.std(axis=0, ddof=1) / np.sqrt(8)
        means = np.stack([replicates.mean(axis=(1, 2)), np.zeros((8, 3))])
        image = ReferenceImage(layer, 0 * layer, 0 * layer, layer[..., 0], layer[..., 0], 0, 0.0)
        seen = {"airlight_se": spread, "surface_se": 0 * layer, "replicate_means": means}
        sampled = replace(image, surface_error=0 * layer, **seen)
        for name in ("airlight", "total"):
            mean, value = off_by(sampled, name)
            # Half of Student's interval for seven degrees of freedom.
            if shared:
                assert mean == pytest.approx(2.3646 * spread.mean(), rel=1e-4)
            else:
                assert mean < 3 * value / np.sqrt(12 * 16)
        # A comparison of its file has the same interval. Only the airlight is lit.
        dark = replace(sampled, surface=0 * layer)
        written = layered_reference(LoadedScene("a", mi.load_dict(tiny_scene()), "", ""), dark)
        found = compare_images(written, Image({"airlight": layer})).statistics
        half = 0.5 * (found.relative_bias_ci[1] - found.relative_bias_ci[0])
        assert half == pytest.approx(off_by(sampled, "airlight")[0], rel=1e-2 if shared else 0.1)
        # Nor is a block rejected for an error of all.
        assert found.rejected_blocks == 0


def test_variances_of_the_total_add_up():
    layer = np.ones((1, 1, 3))
    none = np.full((1, 1), np.inf)
    plain = ReferenceImage(layer, 0 * layer, 2 * layer, none, none, 0, 0.0)
    lit = ReferenceImage(
        layer,
        0 * layer,
        2 * layer,
        none,
        none,
        0,
        0.0,
        emitted=5 * layer,
        airlight_se=3 * layer,
        surface_se=4 * layer,
        surface_error=0 * layer,
    )
    assert reference_error(plain, "total") is None
    # The error of the airlight says nothing of surfaces. Where the error of surfaces is not known,
    # the error of the sum is not known either.
    assert known_to(plain, "airlight") == Estimate(float(layer.mean()), 0.0, "proven")
    for unknown in ("surface", "total"):
        assert known_to(replace(lit, surface_error=None), unknown).error is None
        assert known_to(plain, unknown).error is None
        assert known_words(known_to(plain, unknown)) == "its error is not known"
    assert reference_layer(plain, "total") == pytest.approx(3 * layer)
    assert reference_layer(lit, "total") == pytest.approx(8 * layer)
    assert reference_layer(lit, "total", emitted=False) == pytest.approx(3 * layer)
    assert reference_error(lit, "total") == pytest.approx(5 * layer)
    assert reference_error(lit, "surface") == pytest.approx(4 * layer)
    for name, error in (("airlight", 3), ("surface", 4), ("total", 5)):
        assert known_to(lit, name).error == pytest.approx(error * layer.mean())
        assert known_to(lit, name).kind == "statistical"
    # Light that an image does not show makes its layer no better known.
    shown = [known_to(lit, "total", emitted=each) for each in (True, False)]
    assert [each.value for each in shown] == pytest.approx([8.0, 3.0])
    assert shown[0].error == shown[1].error
    # Where it is a mean over pixels its variance is one of three.
    mean = replace(lit, emitted_se=12 * layer)
    assert reference_error(mean, "total") == pytest.approx(13 * layer)
    assert reference_error(mean, "total", emitted=False) == pytest.approx(5 * layer)
    assert reference_error(mean, "airlight") == pytest.approx(3 * layer)
    errors = [known_to(mean, "total", emitted=each).error for each in (True, False)]
    assert errors == pytest.approx([13.0, 5.0])
    by_value = [off_by(mean, "total", emitted=each)[1] for each in (True, False)]
    assert by_value == pytest.approx([INTERVAL * 13 / 8, INTERVAL * 5 / 3])


def test_pixels_outside_of_a_mask_put_no_mean_off():
    layer, errors = np.ones((1, 2, 3)), np.array([0.01, 5.0])[None, :, None] * np.ones(3)
    reference = stated(airlight_se=errors, surface_se=0 * layer)
    mean, value = off_by(reference, "airlight", mask=np.array([[True, False]]))
    assert mean == value == pytest.approx(INTERVAL * 0.01 + 1e-9, rel=1e-12)
    assert off_by(reference, "airlight")[0] > 4


@pytest.mark.parametrize(
    "common", [1.0, 0.0], ids=["all pixels are wrong together", "each by itself"]
)
def test_errors_of_points_that_all_pixels_share_add_up(common):
    """200 references of 12 x 8 pixels with the mean 1: the interval of the image
    holds 1 in 95 % of them.

    The binomial law leaves 0.89 to 1 once in 10 000 runs. Pixels taken for independent
    held it in a third of them.
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
        reference = ReferenceImage(
            values[0], 0 * values[0], values[1], none, none, 0, 0.0, **more, replicate_means=means
        )
        sure = NoisyImage(np.ones((8, 12, 3)), np.full((8, 12, 3), 1e-9), 64)
        statistics = compare_statistics(
            reference_estimate(reference, "airlight", sure, mask), sure, mask=mask
        )
        held += (
            statistics.relative_bias_ci_batches[0] <= 0 <= statistics.relative_bias_ci_batches[1]
        )
        apart += statistics.relative_bias_ci[0] <= 0 <= statistics.relative_bias_ci[1]
    assert held / 200 > 0.89
    assert apart / 200 < 0.5 if common else apart / 200 > 0.89
