# SPDX-License-Identifier: BSD-3-Clause
"""References by quadrature: from the cache, refused where they are infinite, and what
images are compared with.
"""

from dataclasses import fields, replace

import mitsuba as mi
import numpy as np
import pytest

import airlight.validation.estimates.quadrature as module
from airlight.errors import InputError
from airlight.reference.quadrature import area_lights
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.ray_values import ReferenceImage
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.validation.estimates.agreement import layer_masks, reference_estimate
from airlight.validation.estimates.images import layered_reference
from airlight.validation.estimates.monte_carlo import monte_carlo_batches
from airlight.validation.estimates.quadrature import (
    known_to,
    known_words,
    reference_error,
    reference_image,
    reference_layer,
    reference_of_pixels,
)
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.statistics.comparison import NoisyImage, compare_statistics
from airlight.validation.statistics.estimate import Estimate
from tests.helpers.area_lights import NULL, fog, lamp, lit_scene
from tests.helpers.scenes import spot, tiny_scene


@pytest.fixture
def scene(variant):
    return mi.load_dict(tiny_scene(size=(8, 6)))


@pytest.fixture
def computed(monkeypatch):
    """Count how often a reference image is computed."""
    import airlight.validation.estimates.quadrature

    calls = []
    compute = airlight.validation.estimates.quadrature.quadrature_image

    def counted(*args, **kwargs):
        calls.append(kwargs)
        return compute(*args, **kwargs)

    monkeypatch.setattr(airlight.validation.estimates.quadrature, "quadrature_image", counted)
    return calls


def assert_same(actual, expected):
    for field in fields(actual):
        np.testing.assert_array_equal(
            getattr(actual, field.name), getattr(expected, field.name), err_msg=field.name
        )
        assert type(getattr(actual, field.name)) is type(getattr(expected, field.name))


def test_second_call_reads_the_same_numbers(scene, own_cache, computed):
    first, second = reference_image(scene, checks=4), reference_image(scene, checks=4)
    assert len(computed) == 1
    assert_same(first, second)
    assert first.airlight.shape == (6, 8, 3)
    assert np.isfinite(first.airlight).all()


def test_the_reference_of_some_pixels_is_that_of_the_image(scene, own_cache):
    pixels = np.array([3, 4, 40, 7])
    some, whole = reference_of_pixels(scene, pixels), reference_image(scene)
    for layer in ("airlight", "surface", "distance", "light_angle"):
        values = getattr(whole, layer)
        np.testing.assert_array_equal(
            getattr(some, layer)[0], values.reshape(-1, *values.shape[2:])[pixels]
        )


@pytest.mark.claim("area-light-goes-on")
def test_reference_of_an_area_light_goes_on_where_it_was_interrupted(own_cache, monkeypatch):
    scene = lit_scene(size=(2, 2), lamp=lamp("sphere", center=[0.3, 0.2, 3.0], radius=0.4))
    done, compute = [], area_lights._scattered

    def some(*arguments):
        if len(done) == 1:
            raise KeyboardInterrupt
        done.append(arguments)
        return compute(*arguments)

    monkeypatch.setattr(area_lights, "_scattered", some)
    with pytest.raises(KeyboardInterrupt):
        reference_image(scene)
    counted = []
    monkeypatch.setattr(
        area_lights, "_scattered", lambda *arguments: (counted.append(1), compute(*arguments))[1]
    )
    again = reference_image(scene)
    went_on = len(counted)
    assert not list(own_cache.glob("**/airlight-*"))
    assert_same(reference_image(scene), again)
    for path in own_cache.glob("**/quadrature-*.npz"):
        path.unlink()
    counted.clear()
    assert_same(reference_image(scene), again)
    assert len(counted) == went_on + 1
    image = layered_reference(LoadedScene("lamp", scene, "", ""), again)
    assert {"emitted", "airlight_se", "surface_se", "airlight_bound"} <= set(image.layers)
    assert image.attributes["airlight:batches"] == 8


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
    )
    assert reference_error(plain, "total") is None
    # The error of the airlight is not that of all layers: of surfaces there is
    # none, and so none of the sum.
    assert known_to(plain, "airlight") == Estimate(float(layer.mean()), 0.0, "proven")
    for unknown in ("surface", "total"):
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


def scene_with(position, *, size=(9, 9), **changes):
    """Return a scene whose camera looks along +y, its middle pixel along the axis."""
    scene = tiny_scene(size=size, floor=None, ball=None)
    scene["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, -5, 1], [0, 0, 1], [0, 0, 1])
    if position is not None:
        scene["lamp"]["position"] = position
    return mi.load_dict(
        {name: part for name, part in (scene | changes).items() if part is not None}
    )


def references(scene):
    """Return what gives the reference by each estimator."""

    def sampled(estimator):
        return lambda: monte_carlo_batches(scene, estimator, batches=2, samples=1).batches.mean

    return [lambda: reference_image(scene).airlight, sampled("single-scatter"), sampled("volpath")]


@pytest.mark.claim("light-on-a-ray-refused")
@pytest.mark.parametrize("position", [[0.0, -5.0, 1.0], [0.0, 0.0, 1.0], [1e-8, 0.0, 1.0]])
def test_every_estimator_refuses_a_light_at_the_camera_or_on_a_ray(variant, position):
    for reference in references(scene_with(position)):
        with pytest.raises(
            InputError,
            match=r"light 1 at .* is [\d.e-]+ m from the (camera|ray .* column 4 of row 4)",
        ):
            reference()


def test_a_spot_on_a_ray_is_refused_where_the_ray_is_in_its_cone(variant):
    def lamp(target):
        place = mi.ScalarTransform4f().look_at([0, 0, 1], target, [0, 0, 1])
        return spot() | {"to_world": place}

    assert np.isfinite(reference_image(scene_with(None, lamp=lamp([9, 0, 1]))).airlight).all()
    for target in ([0, 9, 1], [0.5, -4, 1]):
        with pytest.raises(InputError, match="light 1"):
            reference_image(scene_with(None, lamp=lamp(target)))


def test_the_mean_over_pixels_is_finite_where_a_centre_meets_a_light(variant):
    means = reference_image(scene_with([0.0, 0.0, 1.0], size=(3, 3)), pixel="area").airlight
    assert np.isfinite(means).all()
    assert means[1, 1].min() > means[0, 0].max()
    with pytest.raises(InputError, match="m from the camera"):
        reference_image(scene_with([0.0, -5.0, 1.0], size=(3, 3)), pixel="area")


def test_a_reference_that_is_not_finite_is_refused_and_not_kept(variant, own_cache, monkeypatch):
    scene = scene_with([1.0, 0.0, 1.0], size=(4, 3))
    whole = module.quadrature_image

    def broken(*arguments, **named):
        image = whole(*arguments, **named)
        image.surface[1, 2] = np.nan
        return replace(image, surface=image.surface)

    monkeypatch.setattr(module, "quadrature_image", broken)
    for _ in range(2):
        with pytest.raises(
            InputError,
            match="1 of 12 pixels whose surface is not finite, first in column 2 of row 1",
        ):
            module.reference_image(scene)
