# SPDX-License-Identifier: BSD-3-Clause
"""Claim: metrics are those of their formulas, by hand or by published pairs, without a
unit; FLIP of its package.
"""

import importlib.util
import os
from dataclasses import fields

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.validation.columns import plain
from airlight.validation.metrics.colour import ciede2000, colour_difference, delta_e_itp
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.metrics.flip import flip_hdr
from airlight.validation.metrics.other_tools import PublishedErrors, published_errors

EXACT = 1e-14  # some roundings of double precision


@pytest.mark.claim("error-formulas", tolerance="rounding")
def test_hand_computed_values():
    # mean(r) = 2.5; d = 1, 0, -1, 2: mean 0.5, mean square 6/4; |d|/r = 1, 0, 1/3,
    # 1/2 sorted 0, 1/3, 1/2, 1.
    reference = np.array([[1.0, 2.0], [3.0, 4.0]])
    metrics = error_metrics(reference, reference + np.array([[1.0, 0.0], [-1.0, 2.0]]))
    assert metrics.pixels == 4
    assert metrics.bias == 0.5
    assert metrics.relative_bias == pytest.approx(0.2, rel=EXACT)
    assert metrics.rmse == pytest.approx(np.sqrt(1.5), rel=EXACT)
    assert metrics.relative_rmse == pytest.approx(np.sqrt(1.5) / 2.5, rel=EXACT)
    assert metrics.p50 == pytest.approx(5 / 12, rel=EXACT)  # half-way between 1/3 and 1/2
    assert metrics.p99 == pytest.approx(1 / 2 + 0.97 / 2, rel=EXACT)  # position 0.99 * 3 = 2.97
    assert metrics.max == 1.0
    assert (metrics.nonfinite, metrics.negative) == (0, 0)


@pytest.mark.claim("error-formulas")
def test_channels_are_values_of_their_own():
    # Two pixels, three channels. mean(r) = 12/6 = 2; d = 3 in one value: bias 0.5, mean square 9/6.
    reference = np.array([[[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]]])
    test = reference.copy()
    test[0, 1, 2] += 3
    metrics = error_metrics(reference, test)
    assert metrics.pixels == 2
    assert metrics.bias == 0.5
    assert metrics.rmse == pytest.approx(np.sqrt(1.5), rel=EXACT)
    assert metrics.p50 == 0.0
    assert metrics.max == 3.0


@pytest.mark.claim("error-formulas")
def test_dim_values_are_measured_against_a_floor():
    # mean(r) = 1, so the black value has the denominator 0.001 and the dim one its own 0.004.
    reference = np.array([[0.0, 0.004, 2.996]])
    metrics = error_metrics(reference, reference + np.array([[0.002, 0.002, 0.0]]))
    assert metrics.max == pytest.approx(2.0, rel=EXACT)
    assert metrics.p50 == pytest.approx(0.5, rel=EXACT)


@pytest.mark.parametrize("factor", [2.0**-400, 1e-7, 3e9, 2.0**400])
def test_relative_numbers_have_no_unit(factor):
    rng = np.random.default_rng(6)
    reference = rng.gamma(0.4, 1.3, (11, 13, 3))
    test = reference * rng.normal(1, 0.1, reference.shape)
    plain, scaled = error_metrics(reference, test), error_metrics(factor * reference, factor * test)
    for name in ("relative_bias", "relative_rmse", "p50", "p99", "max"):
        assert getattr(scaled, name) == pytest.approx(getattr(plain, name), rel=1e-11), name
    assert scaled.rmse == pytest.approx(factor * plain.rmse, rel=1e-11)


@pytest.mark.claim("not-finite-is-counted")
def test_nonfinite_pixels_are_counted_and_left_out():
    reference = np.full((2, 3, 3), 2.0)
    test = np.full((2, 3, 3), 3.0)
    test[0, 0, 1] = np.nan
    test[0, 1] = np.inf
    reference[1, 2, 0] = -np.inf
    metrics = error_metrics(reference, test)
    assert (metrics.pixels, metrics.nonfinite) == (6, 3)
    assert (metrics.bias, metrics.rmse, metrics.relative_bias, metrics.max) == (1, 1, 0.5, 0.5)


def test_black_reference_has_absolute_errors_only():
    metrics = error_metrics(np.zeros((2, 2, 3)), np.full((2, 2, 3), 0.5))
    assert (metrics.bias, metrics.rmse) == (0.5, 0.5)
    as_json = plain(metrics)
    assert all(
        as_json[name] is None for name in ("relative_bias", "relative_rmse", "p50", "p99", "max")
    )
    assert as_json["rmse"] == 0.5


ROUNDINGS = 1e-13  # some roundings of double precision

# r = 0.09, 0.19, 0.99 and t = r + 0.1, r - 0.1, r: every denominator below is a number
# that a hand can divide by.
REFERENCE = np.array([[0.09, 0.19, 0.99]])
TEST = REFERENCE + np.array([[0.1, -0.1, 0.0]])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mse", (0.01 + 0.01) / 3),
        ("rmse", np.sqrt(0.02 / 3)),
        ("mae", 0.2 / 3),
        ("rae_tev", (0.1 / 0.1 + 0.1 / 0.2) / 3),
        ("rse_tev", (0.01 / 0.0181 + 0.01 / 0.0461) / 3),
        ("mrse_pbrt", (0.01 / 0.01 + 0.01 / 0.04) / 3),
        ("relmse", (0.01 / 0.0181 + 0.01 / 0.0461) / 3),
        ("relmse_trim", (0.01 / 0.0181 + 0.01 / 0.0461) / 3),  # 0.1 % of three values is none
        ("mape", (0.1 / 0.1 + 0.1 / 0.2) / 3),
        ("smape", (0.2 / (0.09 + 0.19 + 0.02) + 0.2 / (0.19 + 0.09 + 0.02)) / 3),
        ("mrse_jeri", (0.01 / 0.0082 + 0.01 / 0.0362) / 3),
        ("psnr", 10 * np.log10(0.99**2 * 3 / 0.02)),
        ("relative", (0.1 / 0.09 + 0.1 / 0.19) / 3),
        ("relative_max", 0.1 / 0.09),
        ("dark_max", 0.0),
    ],
)
def test_published_errors_by_hand(name, value):
    assert getattr(published_errors(REFERENCE, TEST), name) == pytest.approx(value, rel=ROUNDINGS)


def test_trimming_leaves_out_the_largest_thousandth():
    reference = np.ones((20, 50, 3))  # 3000 values: three go
    test = reference.copy()
    test[0, :4, 0] += [5.0, 4.0, 3.0, 2.0]
    errors = published_errors(reference, test)
    assert errors.relmse_trim == pytest.approx(4 / 1.01 / 2997, rel=ROUNDINGS)
    assert errors.relmse == pytest.approx((25 + 16 + 9 + 4) / 1.01 / 3000, rel=ROUNDINGS)


def test_dark_values_are_counted_and_judged_in_absolute_terms():
    # mean(r) = 1: below 0.001 lie the black value, wrong by 0.02, and the dim one, wrong by 0.01.
    reference = np.array([[0.0, 0.0005, 1.5, 2.4995]])
    errors = published_errors(reference, reference + np.array([[0.02, -0.01, 0.15, 0.0]]))
    assert (errors.values, errors.dark) == (4, 2)
    assert errors.dark_max == pytest.approx(0.02, rel=ROUNDINGS)
    assert errors.relative == pytest.approx(0.1 / 2, rel=ROUNDINGS)
    assert errors.relative_max == pytest.approx(0.1, rel=ROUNDINGS)


@pytest.mark.parametrize("factor", [1e-30, 1e30])
def test_with_the_mean_as_unit_nothing_has_a_unit(factor):
    rng = np.random.default_rng(3)
    reference = rng.gamma(0.5, 0.01, (12, 9, 3))
    test = reference * rng.normal(1, 0.1, reference.shape)
    plain, scaled = (published_errors(f * reference, f * test, unit=None) for f in (1.0, factor))
    assert scaled.unit == pytest.approx(factor * plain.unit, rel=1e-12)
    for field in fields(PublishedErrors)[1:]:
        # 1e-11: the rounding of the factor, squared and divided.
        assert getattr(scaled, field.name) == pytest.approx(
            getattr(plain, field.name), rel=1e-11
        ), field.name


# Sharma, Wu and Dalal 2005, table 1: L*, a*, b* of two colours and their CIEDE2000 to four digits.
# fmt: off
SHARMA = np.array([
    (50.0000, 2.6772, -79.7751, 50.0000, 0.0000, -82.7485, 2.0425),
    (50.0000, 3.1571, -77.2803, 50.0000, 0.0000, -82.7485, 2.8615),
    (50.0000, 2.8361, -74.0200, 50.0000, 0.0000, -82.7485, 3.4412),
    (50.0000, -1.3802, -84.2814, 50.0000, 0.0000, -82.7485, 1.0000),
    (50.0000, 0.0000, 0.0000, 50.0000, -1.0000, 2.0000, 2.3669),
    (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0009, 7.1792),
    (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0011, 7.2195),
    (50.0000, -0.0010, 2.4900, 50.0000, 0.0009, -2.4900, 4.8045),
    (50.0000, -0.0010, 2.4900, 50.0000, 0.0011, -2.4900, 4.7461),
    (50.0000, 2.5000, 0.0000, 50.0000, 0.0000, -2.5000, 4.3065),
    (50.0000, 2.5000, 0.0000, 73.0000, 25.0000, -18.0000, 27.1492),
    (50.0000, 2.5000, 0.0000, 61.0000, -5.0000, 29.0000, 22.8977),
    (50.0000, 2.5000, 0.0000, 56.0000, -27.0000, -3.0000, 31.9030),
    (50.0000, 2.5000, 0.0000, 58.0000, 24.0000, 15.0000, 19.4535),
    (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
    (63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630),
    (61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731),
    (22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373),
    (36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146),
    (90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441),
    (90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381),
    (6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377),
    (2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082),
])


def perceptual_quantiser(luminance):
    """Return the PQ value of a luminance [cd/m^2], SMPTE ST 2084 equation 5.1."""
    y = (luminance / 10000) ** (2610 / 16384)
    return ((3424 / 4096 + 2413 / 128 * y) / (1 + 2392 / 128 * y)) ** (2523 / 32)


def grey(value):
    return np.full((1, 1), value)


def test_published_pairs_of_ciede2000():
    difference = ciede2000(SHARMA[:, :3], SHARMA[:, 3:6])
    # half a unit of the last digit
    assert difference == pytest.approx(SHARMA[:, 6], abs=0.5e-4 + 1e-9)


def test_published_pair_of_delta_e_itp():
    # The example of colour-science, BT.2124's own formula: dI = 0.00137,
    # dT = 0.00172, dP = -0.00114.
    first = np.array([0.4885468072, -0.04739350675, 0.07475401302])
    second = np.array([0.4899203231, -0.04567508203, 0.07361341775])
    by_hand = 720 * np.sqrt(0.0013735159**2 + (0.00171842472 / 2) ** 2 + 0.00114059527**2)
    assert delta_e_itp(first, second) == pytest.approx(by_hand, rel=1e-8)
    assert by_hand == pytest.approx(1.42657228, rel=1e-8)


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.6), (0.01, 0.02), (1.0, 4.0)])
def test_grey_differs_in_lightness_alone(a, b, monkeypatch):
    monkeypatch.setattr("airlight.validation.metrics.colour.auto_exposure", lambda reference: 0.0)
    difference = colour_difference(grey(a), grey(b))
    expected = 720 * abs(perceptual_quantiser(203 * a) - perceptual_quantiser(203 * b))
    # The rounded matrices give white a luminance that is wrong by 1e-4.
    assert difference.itp_mean == pytest.approx(expected, rel=2e-3)
    light = [116 * np.cbrt(min(v, 1.0)) - 16 for v in (a, b)]
    if a > 0.01:
        middle = sum(light) / 2
        weight = 1 + 0.015 * (middle - 50) ** 2 / np.sqrt(20 + (middle - 50) ** 2)
        assert difference.ciede2000_mean == pytest.approx(abs(light[1] - light[0]) / weight, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("factor", [1e-30, 1e30])
def test_the_default_exposure_takes_the_unit_out(factor):
    rng = np.random.default_rng(2)
    reference = rng.gamma(0.7, 1.0, (16, 12, 3))
    test = reference * rng.normal(1, 0.05, reference.shape)
    here, there = colour_difference(reference, test), colour_difference(factor * reference, factor * test)
    assert there.exposure == pytest.approx(here.exposure - np.log2(factor), abs=1e-9)
    for name in ("ciede2000_mean", "ciede2000_max", "itp_mean", "itp_max", "clipped", (
        "clipped_itp"
    )):
        assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-9), name
    assert 0.9 / np.percentile(reference, 99) == pytest.approx(2.0**here.exposure, rel=1e-12)


@pytest.mark.parametrize("metric", [error_metrics, published_errors, colour_difference])
def test_images_of_two_sizes_are_refused(metric):
    with pytest.raises(InputError, match=r"reference is 4 x 3 pixels.*the test 3 x 4 pixels"):
        metric(np.ones((3, 4, 3)), np.ones((4, 3, 3)))
    with pytest.raises(InputError, match="with 3 channels, the test 4 x 3 pixels; render both"):
        metric(np.ones((3, 4, 3)), np.ones((3, 4)))


@pytest.mark.parametrize(
    ("metric", "shape", "options", "message"),
    [
        (error_metrics, (2, 2), {"mask": np.ones((2, 3), bool)}, r"a mask of bool \(2, 3\)"),
        (error_metrics, (2, 2), {"mask": np.zeros((2, 2), bool)}, "leaves no pixel"),
        (published_errors, (3, 4), {"unit": 0.0}, "unit: got 0.0, expected a radiance above 0"),
        (colour_difference, (3, 4, 2), {}, "2 channels has no colour; expected one"),
    ],
)
def test_refuses_what_does_not_fit(metric, shape, options, message):
    with pytest.raises(InputError, match=message):
        metric(np.ones(shape), np.ones(shape), **options)


real = pytest.mark.skipif(
    importlib.util.find_spec("flip_evaluator") is None, reason=(
        "flip-evaluator has no wheel for this machine"
    )
)
SHAPE = (24, 32, 3)


@pytest.fixture
def pair():
    """Return a reference and a test image that is brighter by a tenth."""
    reference = np.random.default_rng(1).gamma(2.0, 0.3, SHAPE)
    return reference, 1.1 * reference


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Return a function that puts a package with this body before the real one."""

    def install(body):
        (tmp_path / "flip_evaluator.py").write_text(body)
        monkeypatch.setenv("PYTHONPATH", (
            f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
        ))

    return install


def answer(expression):
    """Return the body of a package that answers with this expression of the
    reference r and the test t.
    """
    return (
        "import numpy as np\ndef evaluate(r, t, *args, parameters, **kw):\n    return "
        f"{expression}, -1, parameters\n"
    )


@real
def test_the_value_is_that_of_the_package(pair):
    import flip_evaluator

    flip, error_map = flip_hdr(*pair)
    parameters = {
        "ppd": flip.pixels_per_degree,
        "startExposure": flip.start_exposure,
        "stopExposure": flip.stop_exposure,
        "numExposures": flip.exposures,
        "tonemapper": "aces",
    }
    single = [image.astype(np.float32) for image in pair]
    _, mean, _ = flip_evaluator.evaluate(*single, "HDR", applyMagma=False, parameters=parameters)
    # Scaling by a power of two changes no digit of the image, but the exposure
    # is added to it in float32.
    assert flip.value == pytest.approx(mean, abs=1e-5)
    assert flip.note == ""
    assert error_map.shape == SHAPE[:2]


@real
def test_equal_images_have_none_and_larger_errors_more(pair):
    reference, test = pair
    assert flip_hdr(reference, reference)[0].value == 0
    assert 0.01 < flip_hdr(reference, test)[0].value < flip_hdr(reference, 2 * reference)[0].value < 1


@pytest.mark.parametrize("side", ["reference", "test image"])
@pytest.mark.parametrize(("bad", "what"), [(np.nan, "NaN or inf"), (np.inf, "NaN or inf"), (-1e-9, (
    "negative"
))])
def test_bad_pixels_are_a_note(pair, side, bad, what):
    images = dict(zip(("reference", "test image"), (image.copy() for image in pair)))
    images[side][3, 4:6, 1] = bad
    flip, _ = flip_hdr(images["reference"], images["test image"])
    assert flip.value is None
    assert f"2 pixels of the {side} are {what}" in flip.note


@pytest.mark.parametrize(
    ("body", "note"),
    [
        ("raise ImportError('wrong libgomp')", r"not installed (wrong libgomp)"),
        ("print('Exiting.')\nraise SystemExit(1)", "died with exit status 1: Exiting."),
        (answer("np.zeros((2, 2))"), "no map of errors between 0 and 1"),
        (answer("np.full(r.shape[:2], 7.0)"), "no map of errors between 0 and 1"),
    ],
)
def test_a_package_that_fails_is_a_note(pair, fake, body, note):
    fake(body)
    flip, _ = flip_hdr(*pair)
    assert flip.value is None
    assert note in flip.note
    assert "\n" not in flip.note
