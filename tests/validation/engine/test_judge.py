# SPDX-License-Identifier: BSD-3-Clause
"""Claim: an image of an engine is compared with the right layer of the reference, and
called right where it is.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.validation.comparison.images import compare_images
from airlight.validation.engine import judge as judging
from airlight.validation.engine.error_place import error_place
from airlight.validation.engine.hints import find_hints
from airlight.validation.engine.images import EngineImage, measure_image
from airlight.validation.engine.judge import compare_scene, judge_image, references
from airlight.validation.engine.observation import expected_layer, judged_layer, observation_of
from airlight.validation.engine.other_orders import OtherOrders
from airlight.validation.engine.verdict import Verdict, all_but_few, judge
from airlight.validation.estimates.quadrature import (
    reference_error,
    reference_layer,
    relative_error,
    shared_part,
)
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.scenes.loading import load_scene
from tests.helpers.scenes import scene_xml


def refused(text):
    return pytest.raises(InputError, match=re.escape(text))


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "own.xml"
    path.write_text(scene_xml())
    return str(path)


@pytest.fixture
def expected(scene, variant):
    return reference_image(load_scene(scene, (16, 12)).scene)


@pytest.fixture
def write(tmp_path):
    """Write layers as an EXR file."""

    def written(**layers):
        path = tmp_path / "engine.exr"
        write_exr(
            path,
            Image({name.replace("__", "."): values for name, values in layers.items()}),
            finite=False,
        )
        return path

    return written


@pytest.mark.claim("engine-layers")
def test_airlight_is_compared_where_there_is_one(scene, expected, write):
    verdict = compare_scene(scene, write(airlight=expected.airlight, surface=2 * expected.surface))
    assert (verdict.scene, verdict.size, verdict.expected, verdict.comparison.layer) == (
        "own",
        (16, 12),
        *["airlight"] * 2,
    )
    assert verdict.comparison.metrics.relative_rmse < 1e-6  # the file is float32
    assert (verdict.comparison.failures, verdict.hints.words) == ((), ())
    assert 0 <= relative_error(verdict.known) < 1e-6
    assert verdict.known.kind == "proven"
    verdict = compare_scene(
        scene, write(airlight=expected.airlight, surface=2 * expected.surface), layer="surface"
    )
    np.testing.assert_allclose(verdict.comparison.metrics.relative_bias, 1, rtol=1e-6)


@pytest.mark.claim("engine-layers")
def test_plain_channels_are_compared_with_all_light(scene, expected, write):
    total = reference_layer(expected, "total")
    for layers in ({"total": total}, {"Final__Combined": total}):
        verdict = compare_scene(scene, write(**layers))
        assert verdict.expected == "total"
        assert verdict.comparison.metrics.relative_rmse < 1e-6
    assert "airlight + surface, at pixel centres" in verdict.summary()


@pytest.mark.claim("engine-margin")
def test_margin_decides_without_standard_errors(scene, expected, write):
    file = write(airlight=1.01 * expected.airlight)
    assert compare_scene(scene, file, margin=0.011).comparison.failures == ()
    (reason,) = compare_scene(scene, file, margin=0.009).comparison.failures
    assert reason == "the relative bias, +0.01, is not within +-0.009"
    with refused("margin: got 0, expected a relative bias above 0"):
        compare_scene(scene, file, margin=0)
    nan = expected.airlight.copy()
    nan[2, 3] = np.nan
    assert len(compare_scene(scene, write(airlight=nan), margin=0.01).comparison.failures) == 1


@pytest.mark.claim("engine-margin")
def test_a_margin_holds_the_error_of_the_reference_too(scene, expected):
    """A bias of 1 % by a reference that may be off by 0.3 % is not shown to be within 1.1 %."""
    mean, loaded = expected.airlight.mean(), load_scene(scene, (16, 12))
    mask, spread = np.ones((12, 16), dtype=bool), np.full((12, 16, 3), 0.02 * mean)
    mask[:, 8:] = False

    def failures(spread, margin, mask=None):
        own = replace(expected, airlight_se=spread, surface_se=0 * spread)
        image = Image({"airlight": 1.01 * expected.airlight})
        judged = judged_layer(image, "own.exr", name="airlight")
        more = {"pixel": "centre", "margin": margin, "mask": mask}
        compared = judge_image(image, judged, loaded, lambda pixel: own, **more)
        return compared.comparison.failures

    assert failures(0 * spread, 0.011) == failures(spread, 0.014) == ()
    (reason,) = failures(spread, 0.011)
    assert "is not shown to be within +-0.011: the mean of the reference may be off by" in reason
    # With standard errors of the image the error of the reference that is no noise counts as well.
    total = reference_layer(expected, "total")
    sure = np.full(total.shape, 1e-6 * mean)
    image = Image({"total": 1.01 * total, "total_se": sure})
    judged = judged_layer(image, "own.exr", name="total")
    for error, right in ((0 * total, True), (2e-3 * total, False), (None, False)):
        own = replace(expected, surface_error=error)
        compared = judge_image(
            image, judged, loaded, lambda pixel, own=own: own, pixel="centre", margin=0.0105
        )
        assert (compared.comparison.failures == ()) == right
    # Pixels outside of a mask count nowhere.
    outside = np.where(mask[..., None], 0.0, spread)
    assert failures(outside, 0.011) != ()
    assert failures(outside, 0.011, mask) == ()


def test_a_masked_image_that_fits_the_centres_needs_no_means_over_areas(scene, expected):
    """It took the time of means over pixels: what a mask leaves out fitted nothing."""
    image, mask = expected.airlight.copy(), np.ones((12, 16), dtype=bool)
    image[:, 8:], mask[:, 8:] = 100.0, False
    judged = judged_layer(Image({"airlight": image}), "own.exr", name="airlight")
    compared = judge_image(
        Image({"airlight": image}),
        judged,
        load_scene(scene, (16, 12)),
        {"centre": expected}.__getitem__,
        mask=mask,
    )
    assert (compared.pixel, compared.verdict.right) == ("centre", True)


def test_pixels_outside_of_a_mask_count_nowhere_beside_further_orders(
    scene, expected, write, tmp_path, monkeypatch
):
    """The verdict that names further orders was that of all pixels."""
    image, mask = 1.4 * expected.airlight, np.ones((12, 16, 3))
    image[:, 8:] *= 100
    mask[:, 8:] = 0.0
    write_exr(tmp_path / "mask.exr", Image({"total": mask}))
    found = OtherOrders("own", more=0.5, excess=0.4)
    monkeypatch.setattr(judging, "other_orders", lambda *args: found)
    file = write(airlight=image)
    compared = compare_scene(scene, file, pixel="centre", mask=tmp_path / "mask.exr")
    assert found.words in compared.verdict.reasons
    assert 0.3 < compared.verdict.block_error < 0.41


def test_a_light_that_a_layer_does_not_show_is_no_part_of_how_well_it_is_known(scene, expected):
    seen, loaded = np.full(expected.airlight.shape, 100.0), load_scene(scene, (16, 12))
    none = 0 * seen
    lit = replace(expected, emitted=seen, airlight_se=none, surface_se=none, emitted_se=0.1 * seen)
    total = expected.airlight + expected.surface
    for made, value in (({}, total + seen), ({"airlight:scene": "own"}, total)):
        image = Image({"total": value}, attributes=made)
        judged = judged_layer(image, "own.exr", name="total")
        known = judge_image(image, judged, loaded, lambda pixel: lit, pixel="centre").known
        assert known.value == pytest.approx(value.mean())
        assert (known.error > 1) == judged.emitted == (not made)


AREA = """<shape type="rectangle"><transform name="to_world"><scale value="0.3"/>
    <lookat origin="0.6, 0.3, 1.2" target="0.2, -4.1, 1.3" up="0, 0, 1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"/></shape>"""


@pytest.fixture(scope="module")
def area_lit(variant, tmp_path_factory):
    """A scene under an area light that the camera sees: its file, the scene at 16 x 12
    pixels and its reference.
    """
    path = tmp_path_factory.mktemp("area") / "area.xml"
    path.write_text(scene_xml(AREA))
    loaded = load_scene(str(path), (16, 12))
    return str(path), loaded, reference_image(loaded.scene)


def test_an_area_light_in_view_is_part_of_the_total_of_an_engine_but_not_of_our_files(
    area_lit, write
):
    """The same engine image was right in the live view and wrong in `compare` and `report
    --images`, or the reverse.
    """
    path, loaded, expected = area_lit
    assert expected.emitted.max() > 10 * (expected.airlight + expected.surface).max()
    file = write(total=reference_layer(expected, "total"))
    assert compare_scene(path, file, pixel="centre").verdict.right
    judged, *_ = measure_image(
        EngineImage("area", "engine", file), loaded, references(loaded), surfaces=True
    )
    assert judged.verdict.right
    dark = compare_scene(path, write(total=expected.airlight + expected.surface), pixel="centre")
    assert not dark.verdict.right
    assert dark.hints.words == (
        "the image does not show the area lights that the camera sees: compare its airlight",
    )
    for layers, made in (({"emitted": expected.emitted}, {}), ({}, {"airlight:scene": "area"})):
        own = judged_layer(
            Image({"total": expected.airlight + expected.surface, **layers}, attributes=made),
            "own.exr",
            name="",
        )
        np.testing.assert_array_equal(expected_layer(expected, own), own.values)
    # Neither a fit nor a diagnosis explains the radiance of the light itself.
    image = read_exr(file)
    left = observation_of(image, judged_layer(image, file), loaded.scene)[0].used
    assert 0.7 < left.mean() < 1
    assert not left.reshape(12, 16)[expected.emitted.any(axis=2)].any()


@pytest.mark.claim("engine-margin", tolerance="1e-5: files are float32")
@pytest.mark.parametrize("layer", ["airlight", "total"])
def test_the_references_own_standard_errors_count_as_those_of_its_file(
    tmp_path, area_lit, write, layer
):
    """Under an area light, `compare SCENE IMAGE` says what `compare REFERENCE.exr
    IMAGE` says; it left them out.
    """
    path, _, expected = area_lit
    values = reference_layer(expected, layer)
    errors = reference_error(expected, layer)
    sure = np.full(values.shape, 1e-5 * values.mean())  # an image that is surer than the reference
    image = {layer: values + 1e-4 * values.mean(), f"{layer}_se": sure}
    reference = tmp_path / "reference.exr"
    made = {"airlight:batches": 8, "airlight:shared": shared_part(expected, layer)}
    write_exr(reference, Image({layer: values, f"{layer}_se": errors}, attributes=made))
    by_file = compare_images(
        read_exr(reference), read_exr(write(**image)), layer=layer, margin=0.01
    ).statistics
    compared = compare_scene(path, write(**image), layer=layer, pixel="centre", margin=0.01)
    by_scene = compared.comparison.statistics
    assert by_scene.reference_variance_fraction == pytest.approx(
        by_file.reference_variance_fraction, rel=1e-5
    )
    assert by_scene.relative_bias_ci == pytest.approx(by_file.relative_bias_ci, rel=1e-5, abs=1e-7)
    assert by_file.reference_variance_fraction > 0.9
    assert compared.known.kind == "statistical"
    assert compared.known.error >= errors.mean()


def test_layers_that_are_not_there_are_refused(scene, expected, write):
    total = reference_layer(expected, "total")
    with refused("has no layer 'airlihgt'"):
        compare_scene(scene, write(airlight=expected.airlight), layer="airlihgt")
    file = write(A__Combined=total, B__Combined=total)
    with refused("it has A.Combined, B.Combined; name one by --layer"):
        compare_scene(scene, file)
    assert compare_scene(scene, file, layer="B.Combined").comparison.metrics.relative_rmse < 1e-6


@pytest.mark.parametrize(
    ("size", "value"), [((1, 1), 0.0), ((4, 3), -1.0), ((1, 1), np.nan), ((4, 3), 3e38)]
)
def test_odd_images_get_a_verdict_and_no_number_that_is_none(tmp_path, variant, size, value):
    """All warnings are errors in the tests; the text of an image without
    failures has no nan and no inf.
    """
    path = tmp_path / "own.xml"
    path.write_text(scene_xml(size=size))
    write_exr(
        tmp_path / "odd.exr",
        Image({"total": np.full((size[1], size[0], 3), value, dtype=np.float32)}),
        finite=False,
    )
    compared = compare_scene(str(path), tmp_path / "odd.exr", all_metrics=True)
    assert not compared.verdict.right
    assert "nan" not in compared.summary()
    assert not re.search(r"\binf\b", compared.summary())


SIZE = (80, 60)


@pytest.fixture(
    scope="module", params=["open-fog", pytest.param("sphere-spot", marks=pytest.mark.slow)]
)
def traced(request, variant, tmp_path_factory):
    """The image of a path tracer with a box filter: means over pixels, with its noise.

    Every value has Gaussian noise of 2 %, values next to the lamp of 30 %, as LuxCore's had at 512
    paths a pixel, and the pixel of the lamp is twice as bright as it should be: its variance is
    infinite.
    """
    expected = reference_image(load_scene(request.param, SIZE).scene, pixel="area")
    total = reference_layer(expected, "total")
    beside = expected.light_angle < 3 * np.deg2rad(58 / SIZE[0])
    noise = np.where(beside, 0.3, 0.02)[:, :, None] * np.random.default_rng(7).standard_normal(
        (*total.shape[:2], 1)
    )
    noise[np.unravel_index(expected.light_angle.argmin(), expected.light_angle.shape)] += (
        1.0 if beside.any() else 0.0
    )
    return (
        request.param,
        expected,
        np.maximum(1 + noise, 0) * total,
        tmp_path_factory.mktemp("traced"),
    )


def compared(traced, image):
    scene, _, _, folder = traced
    path = folder / "image.exr"
    write_exr(path, Image({"total": image}), finite=False)
    return compare_scene(scene, path)


@pytest.mark.claim("engine-verdict", "engine-pixels")
def test_the_right_image_of_a_path_tracer_is_called_right_without_options(traced):
    _, _, image, _ = traced
    judged = compared(traced, image)
    assert judged.pixel == "area"
    assert judged.verdict.right
    assert judged.comparison.failures == judged.hints.words == ()
    np.testing.assert_allclose(judged.hints.factor, 1, atol=0.002)
    assert (
        judged.summary()
        .splitlines()[-1]
        .startswith("verdict          right: means over 6 x 6 pixels are within")
    )


@pytest.mark.claim("engine-verdict", "engine-pixels")
def test_the_right_image_of_pixel_centres_is_called_right_too(traced):
    scene, *_ = traced
    centre = reference_layer(reference_image(load_scene(scene, SIZE).scene), "total")
    noise = 1 + 0.02 * np.random.default_rng(8).standard_normal((*centre.shape[:2], 1))
    judged = compared(traced, noise * centre)
    assert (judged.pixel, judged.verdict.right) == ("centre", True)


def moved(image):
    """An image that is one pixel too low, as LuxCore's are."""
    return np.concatenate([image[:1], image[:-1]])


FAULTS = {
    "pi": (lambda image, expected: np.pi * image, "(pi), +1.65 stops"),
    "a factor of 3 %": (lambda image, expected: 1.03 * image, "the best factor is 0.97"),
    "upside down": (lambda image, expected: image[::-1], "upside down"),
    "a gamma": (lambda image, expected: image ** (1 / 2.2), ""),
    "a pixel too low": (lambda image, expected: moved(image), "off"),
    "a haze of 5 %": (lambda image, expected: image + 0.05 * image.mean(), "off"),
    "fog that ends": (
        lambda image, expected: (
            image - 0.1 * expected.airlight * (np.arange(SIZE[0]) < 30)[:, None]
        ),
        "off",
    ),
    "black": (lambda image, expected: 0 * image, "the image is black everywhere"),
}


@pytest.mark.claim("engine-verdict")
@pytest.mark.parametrize("fault", FAULTS)
def test_injected_faults_are_not_called_right(traced, fault):
    _, expected, image, _ = traced
    change, words = FAULTS[fault]
    judged = compared(traced, change(image, expected))
    assert not judged.verdict.right
    assert words in judged.verdict.words
    assert judged.summary().splitlines()[-1].startswith("verdict          not right: ")


@pytest.mark.claim("engine-verdict", tolerance="1e-12 relative")
def test_the_place_of_the_error_is_that_of_the_worst_pixels():
    expected = np.ones((20, 30, 3))
    image = expected.copy()
    image[7, 11] += 3
    image[0, 0] += 0.03
    lamp = np.full((20, 30), 50.0)
    lamp[6:9, 10:13] = 1
    place = error_place(expected, image, lamp)
    assert (place.pixels, place.worst, place.kind, place.few) == (1, (11, 7), "lamp", True)
    np.testing.assert_allclose(place.fraction, 9 / (9 + 0.0009), rtol=1e-12)
    np.testing.assert_allclose(place.relative_rmse_without, np.sqrt(0.0009 / 599), rtol=1e-12)
    assert (
        "100 % of the squared error in 1 pixel (beside a light, in column 11, row 7)" in place.words
    )
    assert error_place(expected, expected, lamp) is None
    assert not error_place(expected, 1.1 * expected, lamp).few
    # Nothing is relative to a black reference: that was said to be 0 %.
    black = error_place(0 * expected, image - expected, lamp)
    assert np.isnan(black.relative_rmse_without)
    assert black.few
    assert "relative rmse" not in black.words


def test_pixels_that_a_file_does_not_hold_are_not_among_the_few_that_are_wrong():
    """They were, as black ones: 'all is right but' named the columns outside of the data window."""
    reference, held = np.ones((40, 40, 3)), np.arange(40)[None, :] < np.full((40, 1), 38)
    image = reference * held[..., None]
    image[7:9, 5] = 3.0
    words = "all is right but 2 of 1520 pixels, in columns 5 to 5 and rows 7 to 8"
    assert words in all_but_few(reference, image, held)


def test_light_that_a_mask_leaves_out_does_not_hide_the_few_pixels_that_are_wrong():
    """The floor of relative errors was a fraction of the mean with the masked light."""
    reference = np.full((40, 40, 3), 1e-3)
    reference[:10] = 1e3
    held = np.arange(40)[:, None] >= np.full((1, 40), 10)
    image = reference.copy()
    image[20:22, 5] = 3e-3
    words = "all is right but 2 of 1200 pixels, in columns 5 to 5 and rows 20 to 21"
    assert words in all_but_few(reference, image, held)


def test_the_rest_of_an_error_is_that_of_the_pixels_that_are_compared():
    """It was a mean with the pixels that a mask leaves out, which have no error: half of it."""
    expected, lamp = np.ones((40, 40, 3)), np.full((40, 40), 99.0)
    image = expected.copy()
    image[:, :20] += 0.01
    image[5, 5] = 3.0
    masked = np.where(np.arange(40)[:, None, None] < 10, image, np.nan)
    place = error_place(expected, masked, lamp)
    others = np.isfinite(masked).all(axis=2)
    others[5, 5] = False
    metrics = error_metrics(expected, image, mask=others)
    assert place.relative_rmse_without == pytest.approx(metrics.relative_rmse)


@pytest.mark.claim(
    "engine-verdict", tolerance="three standard deviations of the noise of a mean over 64 pixels"
)
def test_noise_of_pixels_is_told_from_an_error_of_blocks():
    expected = np.ones((160, 160, 3))
    image = expected * (1 + 0.04 * np.random.default_rng(2).standard_normal(expected.shape))
    verdict = judge(expected, image, find_hints(expected, image), ())
    assert verdict.right
    np.testing.assert_allclose([verdict.block_error, verdict.block_noise], 0.04 / 8, rtol=0.05)
    noisy = judge(expected, expected + 4 * (image - expected), find_hints(expected, image), ())
    assert "most of it scatter of single pixels" in noisy.words
    # A block of four pixels shows three quarters of their variance about its mean: 15 % were missing.
    four = image[:28, :]
    verdict = judge(expected[:28], four, find_hints(expected[:28], four), ())
    assert verdict.block == 2
    assert verdict.block_noise == pytest.approx(0.04 / 2, rel=0.05)
    # Single pixels do not show their own scatter: it was said to be 0 %.
    small = judge(expected[:12, :16], image[:12, :16], find_hints(expected, expected), ())
    assert (small.block, np.isnan(small.block_noise)) == (1, True)
    assert "scatter" not in small.words
    image[40:80, 40:80] *= 0.9
    verdict = judge(expected, image, find_hints(expected, image), ())
    assert "means over 8 x 8 pixels are" in verdict.words
    assert "scatter" not in verdict.words
    assert not judge(
        expected, expected, find_hints(expected, expected), ("2 pixels are negative",)
    ).right
    assert judge(expected, expected, find_hints(expected, expected), ()).right
    dark = judge(0 * expected, 0 * expected, find_hints(expected, expected), ())
    assert dark.words == "not right: nothing is lit in the pixels that are compared"


def test_a_mask_does_not_change_the_verdict_on_the_pixels_that_it_leaves():
    """Masked pixels made the mean lower, below which a block says nothing: dim blocks counted."""
    expected = np.ones((80, 80, 3))
    expected[:, 40:] = 0.02
    image = expected.copy()
    image[:, 70:] *= 1.04
    hints = find_hints(expected, image)
    alone = judge(expected, image, hints, ())
    masked = np.concatenate([image, np.full((240, 80, 3), np.nan)])
    verdict = judge(np.concatenate([expected] * 4), masked, hints, ())
    assert alone.right
    assert (verdict.right, verdict.block_error) == (True, alone.block_error)


@pytest.mark.claim("engine-suspects", tolerance="none: 12 % of noise, another shape by 20 %")
@pytest.mark.parametrize(("noise", "shape", "named"), [(0.12, 0.0, True), (0.01, 0.2, False)])
def test_a_curve_that_leaves_another_image_is_not_suspected(noise, shape, named):
    """Dim values that a curve makes brighter lose nine tenths of their error to its inverse,
    whatever is left.
    """
    rng = np.random.default_rng(5)
    places = np.linspace(0, 6 * np.pi, 80)[None, :, None]
    expected = 0.01 * np.exp(1.2 * rng.standard_normal((60, 80, 3)))
    encoded = 1.055 * np.maximum(expected, 0.0031308) ** (1 / 2.4) - 0.055
    encoded = np.where(expected > 0.0031308, encoded, 12.92 * expected)
    image = encoded * np.exp(noise * rng.standard_normal(expected.shape) + shape * np.sin(places))
    assert bool(find_hints(expected, image).words) is named


@pytest.mark.claim(
    "engine-verdict", tolerance="none: one of 75 lit values is wrong by a tenth, 1.2 % RMS"
)
def test_one_wrong_block_of_few_is_not_forgiven():
    """A hundredth of the values may be wrong, which of 25 blocks is none; it
    used to be one at least.
    """
    expected = np.zeros((160, 160, 3))
    expected[:40, :40] = 1.0
    image = expected.copy()
    image[8:16, 8:16, 1] *= 1.1
    assert judge(expected, expected, find_hints(expected, expected), ()).right
    assert not judge(expected, image, find_hints(expected, image), ()).right
    # Of 400 lit blocks four may be as wrong as they like: that of a lamp, whose variance
    # is infinite, among them.
    lit = np.ones(expected.shape)
    image = lit.copy()
    image[8:16, 8:16] *= 3
    assert judge(lit, image, find_hints(lit, image), ()).right


@pytest.mark.parametrize(
    ("reasons", "noise", "alone"),
    [((), 0.08, True), (("one",), 0.08, True), (("one", "two"), 0.08, False), ((), 0.07, False)],
)
def test_noise_alone_explains_half_of_the_square_of_the_error_at_least(reasons, noise, alone):
    assert Verdict(False, reasons, 1, 0.1, noise).noise_alone is alone
