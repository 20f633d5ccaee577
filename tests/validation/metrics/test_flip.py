# SPDX-License-Identifier: BSD-3-Clause
"""Tests of HDR-FLIP: with the real package where it is installed, and with fakes that die, hang or are missing."""

import importlib.util
import os

import numpy as np
import pytest

from analytic.errors import InputError
from validation.metrics.flip import flip_hdr

real = pytest.mark.skipif(
    importlib.util.find_spec("flip_evaluator") is None, reason="flip-evaluator has no wheel for this machine"
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
        monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")

    return install


def answer(expression):
    """Return the body of a package that answers with this expression of the reference r and the test t."""
    return (
        f"import numpy as np\ndef evaluate(r, t, *args, parameters, **kw):\n    return {expression}, -1, parameters\n"
    )


# --- with the real package -------------------------------------------------------------------------------------------


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
    # Scaling by a power of two changes no digit of the image, but the exposure is added to it in float32.
    assert flip.value == pytest.approx(mean, abs=1e-5)
    assert flip.note == ""
    assert error_map.shape == SHAPE[:2]


@real
def test_equal_images_have_none_and_larger_errors_more(pair):
    reference, test = pair
    assert flip_hdr(reference, reference)[0].value == 0
    assert 0.01 < flip_hdr(reference, test)[0].value < flip_hdr(reference, 2 * reference)[0].value < 1


# --- what it has no answer for ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", ["reference", "test image"])
@pytest.mark.parametrize(("bad", "what"), [(np.nan, "NaN or inf"), (np.inf, "NaN or inf"), (-1e-9, "negative")])
def test_bad_pixels_are_a_note(pair, side, bad, what):
    images = dict(zip(("reference", "test image"), (image.copy() for image in pair)))
    images[side][3, 4:6, 1] = bad
    flip, _ = flip_hdr(images["reference"], images["test image"])
    assert flip.value is None
    assert f"2 pixels of the {side} are {what}" in flip.note


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((np.ones((3, 4, 3)), np.ones((3, 4))), {}, "two sizes: the reference is 4 x 3 pixels with 3 channels"),
        ((np.ones((3, 4)), np.ones((3, 4))), {"mask": np.zeros((3, 4), bool)}, "the mask leaves no pixel"),
    ],
)
def test_refuses_what_does_not_fit(arguments, options, message):
    with pytest.raises(InputError, match=message):
        flip_hdr(*arguments, **options)


# --- a package that fails --------------------------------------------------------------------------------------------


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
