# SPDX-License-Identifier: BSD-3-Clause
"""Claim: images are compared layer by layer, those of clouds order by
order, with failures by name.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.validation.columns import plain
from airlight.validation.comparison.images import compare_images, read_mask
from airlight.validation.metrics.colour import colour_difference
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.metrics.other_tools import published_errors

SHAPE = (9, 12, 3)


def compare_files(reference, test, **options):
    return compare_images(read_exr(reference), read_exr(test), **options)


@pytest.fixture
def pair():
    """Return a reference with standard errors and a test image, both with the same mean."""
    rng = np.random.default_rng(9)
    reference = rng.gamma(2.0, 0.3, SHAPE)
    error = 0.02 * reference
    layers = {
        "airlight": reference + error * rng.standard_normal(SHAPE),
        "airlight_se": error,
        "surface": 2 * reference,
    }
    return Image(layers, attributes={"airlight:batches": 64}), Image(
        {"airlight": reference, "surface": 2.02 * reference}
    )


def test_metrics_and_statistics_of_a_layer(pair):
    comparison = compare_images(*pair, margin=0.02)
    assert comparison.metrics == error_metrics(
        pair[0].layers["airlight"], pair[1].layers["airlight"]
    )
    assert comparison.statistics.tested == 9 * 12 * 3
    # The mean z of 324 values has the error 0.056; four of them.
    assert abs(comparison.statistics.z_mean) < 0.23
    assert comparison.statistics.equivalent is True
    assert comparison.failures == ()


def test_what_pixels_share_of_their_errors_is_a_number(pair):
    own = replace(pair[0], attributes={"airlight:shared": "all"})
    with pytest.raises(InputError, match="airlight:shared 'all'; expected a number from 0 on"):
        compare_images(own, pair[1])


def test_failures_name_what_is_wrong(pair):
    reference, test = pair
    wrong = 1.05 * test.layers["airlight"]
    wrong[0, 0, 0] = np.nan
    wrong[2, 1:3, 1] = -1e-9
    comparison = compare_images(reference, Image({"airlight": wrong}), margin=0.01)
    assert comparison.failures == (
        "1 pixel is NaN or infinite, in column 0, row 0",
        "2 pixels are negative in the test image, the first in column 1, row 2",
        "the relative bias is not shown to be within +-0.01",
    )
    assert comparison.metrics.relative_bias == pytest.approx(
        comparison.statistics.relative_bias, rel=1e-12
    )
    assert "NOT inside" in comparison.summary()


def bounded(values, bound, kind="proven", **layers):
    """Return an image as airlight 1.0 wrote it, with estimates in `airlight_bound` too."""
    return Image(
        {"airlight": values, "airlight_bound": bound, **layers}, attributes={"airlight:bound": kind}
    )


def test_stated_errors_of_both_files_count_in_the_verdict_on_a_margin():
    """By hand: a mean of 2 known to 0.02 and one of 2.02 known to 0.01; the bias of 1 % may
    be off by 0.01 + 0.0101.
    """
    reference, test = (np.full(SHAPE, value) for value in (2.0, 2.02))
    files = (
        bounded(reference, np.full(SHAPE, 0.02)),
        bounded(test, np.full(SHAPE, 0.01), "estimated"),
    )
    stated = compare_images(*files).stated
    assert (stated.reference.kind, stated.test.kind, stated.kind) == (
        "proven",
        "estimated",
        "estimated",
    )
    assert (stated.reference.value, stated.reference.error) == pytest.approx((2.0, 0.02))
    assert stated.bias_error == pytest.approx((0.01 + 0.02 * 1.01) / 1.98)
    # The bias alone is within 2 %; with its error of 1.5 % it is within 2.6 % and not
    # shown to be within 2.5 %.
    assert compare_images(*files, margin=0.026).failures == ()
    words = "the relative bias is not shown to be within +-0.025"
    assert compare_images(*files, margin=0.025).failures == (words,)
    # With noise of 0.1 % a pixel, 0.006 % of the image, the same bound counts on
    # both sides of the interval.
    noisy = bounded(test, np.full(SHAPE, 0.01), "estimated", airlight_se=0.001 * test)
    assert compare_images(files[0], noisy, margin=0.027).failures == ()
    assert compare_images(files[0], noisy, margin=0.025).failures == (words,)
    assert (
        compare_images(
            Image({"airlight": reference}), Image({"airlight": test, "airlight_se": 0.001 * test})
        ).stated
        is None
    )


def test_an_estimated_error_has_a_layer_of_its_own():
    """The name says the kind, whatever the header says of another layer."""
    values, error = np.full(SHAPE, 2.0), np.full(SHAPE, 0.02)
    new = Image({"airlight": values, "airlight_error": error})
    old = bounded(values, error, "estimated")
    assert compare_images(new, old).stated == compare_images(old, new).stated
    assert compare_images(new, new).stated.kind == "estimated"
    both = bounded(values, 0 * error, airlight_error=error)
    assert compare_images(both, new).stated == compare_images(new, new).stated


@pytest.mark.parametrize("odd", [np.nan, np.inf, -1.0, 3.0])
def test_a_bound_that_says_nothing_decides_nothing(odd):
    """It is no number, negative, or larger than the reference."""
    values = np.full(SHAPE, 2.0)
    reference = bounded(values, np.full(SHAPE, odd))
    for test in (
        Image({"airlight": values}),
        Image({"airlight": values, "airlight_se": 0.01 * values}),
    ):
        compared = compare_images(reference, test, margin=0.5)
        assert compared.stated.bias_error is None
        assert len(compared.failures) == 1


def test_a_file_is_known_to_no_more_than_its_rounding(tmp_path):
    write_exr(tmp_path / "a.exr", bounded(np.full(SHAPE, 0.3), np.full(SHAPE, 1e-14)))
    stated = compare_files(tmp_path / "a.exr", tmp_path / "a.exr").stated
    assert abs(stated.reference.value - 0.3) <= stated.reference.error < 0.3 * 2**-23


def test_a_kind_of_error_that_nobody_knows_is_refused():
    values = np.ones(SHAPE)
    with pytest.raises(InputError, match="airlight:bound 'certain'; expected proven or estimated"):
        compare_images(bounded(values, values, "certain"), Image({"airlight": values}))


def test_images_of_two_equations_or_kinds_of_pixels_say_so():
    """A mean over pixels and a value at centres, a model and physics, should differ."""
    layers = {"airlight": np.ones((3, 4, 3))}

    def notes(*attributes):
        return compare_images(*(Image(layers, attributes=each) for each in attributes)).notes

    centre, area = {"airlight:pixel": "centre"}, {"airlight:pixel": "area"}
    model = centre | {"airlight:model": "three"}
    assert notes(centre, area) == (
        "pixels of the reference: centre; pixels of the test image: area",
    )
    assert notes(model, centre) == (
        "equation of the reference: three; equation of the test image: physical",
    )
    # An image of another program says neither.
    assert notes(model, {}) == notes({}, {}) == notes(model, dict(model)) == ()


def test_a_mask_from_a_file(pair, tmp_path):
    mask = np.zeros(SHAPE, dtype=np.float32)
    mask[3:5, :, 1] = 1
    for name, image in zip("abm", (*pair, Image({"total": mask}))):
        write_exr(tmp_path / f"{name}.exr", image)
    comparison = compare_files(
        tmp_path / "a.exr", tmp_path / "b.exr", mask=read_mask(tmp_path / "m.exr")
    )
    assert (comparison.metrics.pixels, comparison.masked) == (24, 84)
    total = compare_files(tmp_path / "a.exr", tmp_path / "b.exr", layer="total")
    assert (total.statistics, total.metrics.pixels) == (None, 108)
    mask[0, 0, 0] = np.nan
    write_exr(tmp_path / "m.exr", Image({"total": mask}), finite=False)
    with pytest.raises(InputError, match=r"m\.exr as a mask has values that are not finite"):
        compare_files(tmp_path / "a.exr", tmp_path / "b.exr", mask=read_mask(tmp_path / "m.exr"))


def test_a_mask_of_another_size_is_refused_for_a_file_that_holds_a_part_of_the_frame_too():
    """It was left out without a word, and all pixels of the file were compared."""
    image = np.ones((8, 8, 3), dtype=np.float32)
    part = Image({"total": image}, window=(0, 0, 8, 7))
    mask = np.ones((4, 4), dtype=bool)
    for pair in ((part, Image({"total": image})), (Image({"total": image}), part), (part, part)):
        with pytest.raises(InputError, match=r"a mask of bool \(4, 4\); expected truth values"):
            compare_images(*pair, mask=mask)


def test_all_metrics_are_those_of_their_modules(pair):
    comparison = compare_images(*pair, all_metrics=True)
    reference, test = (image.layers["airlight"] for image in pair)
    assert comparison.errors == published_errors(reference, test)
    assert comparison.errors_normalised == published_errors(reference, test, unit=None)
    assert comparison.colour == colour_difference(reference, test)
    values = json.loads(json.dumps(plain(comparison), allow_nan=False))
    assert values["errors"]["mrse_pbrt"] == comparison.errors.mrse_pbrt
    assert values["colour"]["exposure"] == comparison.colour.exposure
    assert values["flip"].keys() >= {"value", "note"}
    assert values["metrics"].keys() >= {"relative_rmse", "p99", "nonfinite"}
    assert values["statistics"].keys() >= {"z_mean", "relative_bias_ci", "detectable_bias"}


def written(path, layers):
    random = np.random.default_rng(3)
    noise = {name: 1 + 0.01 * random.random((4, 5, 3)) for name in layers}
    values = {name: noise[name] * size for name, size in layers.items()}
    write_exr(path, Image(values, np.full((4, 5), np.inf), {}))
    return path


def test_layers_that_both_have_are_compared_in_their_order(tmp_path):
    reference = written(
        tmp_path / "a.exr",
        {"airlight": 2.0, "airlight_31_inf": 1.0, "airlight_3_4": 0.5, "airlight_1": 0.3},
    )
    mine = written(
        tmp_path / "b.exr",
        {"airlight": 2.0, "airlight_31_inf": 1.5, "airlight_3_4": 0.4, "airlight_2": 9.0},
    )
    compared = compare_files(reference, mine)
    assert [each.layer for each in compared.orders] == ["airlight_3_4", "airlight_31_inf"]
    # EXR files hold float32, and the noise of both files is drawn in the order of their layers.
    assert compared.orders[1].metrics.relative_bias == pytest.approx(0.5, abs=0.02)
    assert "airlight_31_inf" in compared.summary()
