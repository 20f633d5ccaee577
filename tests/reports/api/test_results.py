# SPDX-License-Identifier: BSD-3-Clause
"""Results of the Python API: frozen, arrays for NumPy, HTML and PNG for a notebook; from
made-up numbers, no scene.
"""

import base64
import dataclasses
import io
import re

import numpy as np
import pytest
from PIL import Image as Picture

from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reference.storage.exr import Image, read_exr
from airlight.reports.api.compare import compare
from airlight.reports.api.results import Reference, RenderedFrames, Rendering, sealed, write_image
from airlight.reports.plotting.pictures import signed_colours, tone_curve
from airlight.reports.studies.methods import MethodsStudy
from airlight.validation.estimates.images import MonteCarloReference, RelativeErrors
from airlight.validation.study.row import Row


def layered(scale=1.0, dtype=np.float32, **more):
    ramp = scale * np.linspace(0.1, 1.0, 4 * 6 * 3, dtype=dtype).reshape(4, 6, 3)
    layers = {"airlight": ramp, "surface": np.full((4, 6, 3), 0.25, dtype)} | more
    return Image(layers, np.full((4, 6), 2.0, dtype), {"airlight:scene": "made-up"})


def rendering(scale=1.0, dtype=np.float32, **fields):
    made = {
        "kernel": None,
        "parameters": {"steps": 3},
        "precision": "single",
        "plan": {},
        "label": "slow (steps=3)",
    }
    image = sealed(layered(scale, dtype))
    return Rendering(scene="<made & up>", image=image, method="slow", **(made | fields))


def reference(**more):
    image = sealed(layered(dtype=np.float64, **more))
    return Reference(scene="<made & up>", image=image, estimator="quadrature", relative_error=1e-9)


RESULTS = {
    "rendering": rendering,
    "reference": reference,
    "comparison": lambda: compare(reference(), rendering(1.01)),
}


@pytest.mark.claim("results-are-frozen")
@pytest.mark.parametrize("name", RESULTS)
def test_results_are_frozen_and_so_are_their_arrays(name):
    result = RESULTS[name]()
    for field in dataclasses.fields(result):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, field.name, None)
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(result)[0] = 0
    own = np.array(result)
    own[0] = 0  # one's own


@pytest.mark.parametrize(
    "show", [Reference.text, Reference._repr_html_], ids=["terminal", "notebook"]
)
def test_a_quadrature_of_an_area_light_says_where_its_standard_errors_come_from(show):
    """Its header has a number of batches, but no samples a pixel and no
    seeds: it traced nothing. Means over pixels need no light sample.
    """
    for pixel, drawn in (("centre", "light samples"), ("area", "positions in each pixel")):
        image = layered(dtype=np.float64, airlight_se=np.full((4, 6, 3), 1e-3))
        image.attributes.update({"airlight:batches": 8, "airlight:pixel": pixel})
        made = Reference(
            scene="panel", image=sealed(image), estimator="quadrature", relative_error=3e-3
        )
        shown = show(made)
        assert f"standard errors from 8 independent sets of {drawn}" in shown
        assert "seeds" not in shown


def traced(*, batches=64, reached=None, masked=0, cached=0, damaged=0, errors=None):
    """A reference by samples, as its run ended."""
    image = layered(
        dtype=np.float64, airlight_se=np.full((4, 6, 3), 1e-3), surface_se=np.full((4, 6, 3), 2e-3)
    )
    image.attributes.update(
        {"airlight:batches": batches, "airlight:spp": 2 * batches, "airlight:seeds": "3-66"}
    )
    errors = errors or RelativeErrors(0.0123, 0.456)
    how = MonteCarloReference(image, errors, reached, masked, cached, damaged)
    return Reference(
        scene="fog", image=sealed(image), estimator="volpath", relative_error=0.0123, how=how
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "  standard error 1.23 % of the image, 45.6 % of the worst pixel"),
        (
            {"masked": 7},
            "  standard error 1.23 % of the image, 45.6 % of the worst pixel; 7 pixels beside a "
            "light left",
        ),
        ({"cached": 40}, "  40 of 64 batches from the cache"),
        ({"damaged": 1}, "  1 damaged file of the cache traced again"),
        ({"damaged": 2}, "  2 damaged files of the cache traced again"),
        ({"batches": 9}, "  a standard error from 9 batches is known to 25 % only"),
        (
            {"errors": RelativeErrors(None, None, "all pixels are beside a light")},
            "unknown: all pixels are beside",
        ),
        ({"reached": False}, "  the target error was not reached"),
    ],
)
def test_a_reference_by_samples_says_how_well_it_is_known_and_how_it_came_about(changes, words):
    text = traced(**changes).text()
    assert words in text
    assert (words in traced().text()) is (changes == {})
    assert (
        f"{2 * changes.get('batches', 64)} samples a pixel in {changes.get('batches', 64)} "
        "batches, seeds 3-66" in text
    )


@pytest.mark.claim("exit-status", "targets-of-a-run")
@pytest.mark.parametrize(("reached", "status"), [(None, 0), (True, 0), (False, 1)])
def test_a_run_fails_where_the_error_that_was_asked_for_was_not_reached(reached, status):
    assert traced(reached=reached).status == status


def test_a_reference_by_samples_has_its_standard_errors_and_no_bound():
    run = traced()
    assert run.bound is run.error is run.surface_error is None
    assert (float(run.standard_error[0, 0, 0]), float(run.surface_standard_error[0, 0, 0])) == (
        1e-3,
        2e-3,
    )
    values = np.full((4, 6, 3), 1e-9)
    proven, grid = reference(airlight_bound=values), reference(airlight_error=values)
    assert proven.error is proven.bound
    assert proven.bound.shape == grid.error.shape == (4, 6, 3)
    assert grid.bound is None
    means = reference(emitted=values, emitted_se=values)
    assert means.emitted_standard_error.max() == 1e-9
    assert proven.emitted_standard_error is None


def test_an_animation_says_what_a_frame_costs_and_which_files_there_are():
    frames = RenderedFrames(
        scene="hall",
        method="ray-march",
        moves=("light", "medium"),
        size=(16, 12),
        frames=2,
        move_ms=1.5,
        render_ms=18.5,
        frame_ms=20.0,
        recordings={},
        device="llvm_ad_rgb",
        files=("a-0001.exr", "a-0002.exr", "a-0001.png", "a-0002.png", "a.json"),
    )
    assert frames.text().splitlines() == [
        "hall, ray-march: 2 frames, light and medium moving",
        "  20 ms a frame (50 frames/s): 1.5 ms to move, 18.5 ms to render, reusing what stood "
        "still; llvm_ad_rgb",
        "wrote a-0001.exr to a-0002.exr: 2 files, 16 x 12 pixels",
        "wrote a-0001.png to a-0002.png: 2 files, 16 x 12 pixels",
        "wrote a.json: what changes",
    ]


# In a notebook ------------------------------------------------------------------------------------


def pixels(png):
    with Picture.open(io.BytesIO(png)) as shown:
        return np.asarray(shown.convert("RGB")).astype(int)


def figures(html):
    """The pictures of a result in a notebook, by their captions."""
    found = re.findall(r'base64,([^"]+)".*?<figcaption>(.*?)</figcaption>', html)
    return {caption: pixels(base64.b64decode(data)) for data, caption in found}


def test_a_notebook_shows_all_light_and_the_airlight_where_that_is_another_picture(monkeypatch):
    frame = rendering()
    shown = figures(frame._repr_html_())
    assert list(shown) == ["all light", "airlight"]
    np.testing.assert_array_equal(shown["all light"], pixels(frame._repr_png_()))
    np.testing.assert_array_equal(shown["airlight"], frame.picture("airlight"))
    assert (shown["airlight"] < shown["all light"]).all()  # in the exposure of the total
    monkeypatch.setattr("airlight.reports.tables.record._NARROW", 1)  # no picture is enlarged
    assert re.findall(r"inline-block;width:(\d+)px", frame._repr_html_()) == 2 * [
        str(frame.size[0])
    ]
    assert "nothing written" not in frame._repr_html_()  # the command's words
    assert "&lt;made &amp; up&gt; by slow (steps=3)" in frame._repr_html_()
    fog = dataclasses.replace(frame, image=sealed(layered(surface=np.zeros((4, 6, 3), np.float32))))
    assert list(figures(fog._repr_html_())) == ["all light"]


def test_a_comparison_in_a_notebook_has_both_images_in_one_exposure_and_where_they_differ():
    exact = reference()
    dark = np.array(exact.airlight)
    dark[2, 3] *= 0.8
    compared = compare(exact, dark)
    shown = figures(compared._repr_html_())
    first, second, scale = shown
    assert (first, second) == (
        "&lt;made &amp; up&gt;, the reference by quadrature",
        "the test image",
    )
    assert "blue too dark, red too bright" in scale
    same = np.ones((4, 6), bool)
    same[2, 3] = False
    np.testing.assert_array_equal(shown[first][same], shown[second][same])
    assert (shown[first][2, 3] > shown[second][2, 3]).all()
    assert (shown[scale][same] >= 247).all()  # white: no error
    red, _, blue = shown[scale][2, 3]
    assert blue > red
    np.testing.assert_array_equal(shown[scale], compared.picture())


def test_a_comparison_is_an_array_of_relative_errors_and_one_line():
    exact = reference()
    compared = compare(exact, 1.01 * exact.airlight)
    np.testing.assert_allclose(np.asarray(compared), 0.01, rtol=1e-9)
    assert repr(compared) == (
        "ImageComparison(airlight of the test image against <made & up>, the reference by "
        "quadrature: "
        f"relative RMSE {compared.metrics.relative_rmse:.3g}, relative bias 0.01, passed)"
    )
    assert "relative 1 %" in compared.text()
    negative = compare(exact, -exact.airlight)
    assert (negative.passed, negative.status) == (False, 1)
    assert "failed: " in repr(negative)
    assert "negative" in repr(negative)
    grey = compare(exact.airlight[..., 0], 1.01 * exact.airlight[..., 0])
    assert grey.picture().shape == (4, 6, 3)
    assert grey.error.shape == (4, 6)


def test_a_picture_of_a_difference_under_a_mask_has_the_errors_of_the_values(tmp_path):
    """A light that is left out must not lift the floor under dark pixels, nor be shown itself."""
    exact = np.full((4, 6, 3), 1e-4)
    exact[0, 0], exact[0, 1] = np.inf, 1e6
    test, kept = exact.copy(), np.isfinite(exact[..., 0]) & (exact[..., 0] < 1)
    test[2, 2] = 2e-4
    for name in ("values.exr", "picture.png"):
        compare(exact, test, mask=kept, output=tmp_path / name)
    relative = read_exr(tmp_path / "values.exr").layers["relative"]
    np.testing.assert_allclose(relative[2, 2], 1.0, rtol=1e-5)
    shown = pixels((tmp_path / "picture.png").read_bytes())
    np.testing.assert_array_equal(shown[2, 2], signed_colours()[-1])
    np.testing.assert_array_equal(shown[0, :2], [signed_colours()[127]] * 2)


@pytest.mark.parametrize("masked", [False, True])
def test_a_difference_of_images_of_one_value_a_pixel_is_grey(masked, tmp_path):
    kept = np.arange(24).reshape(4, 6) != 3 if masked else None
    for name in ("values.exr", "picture.png"):
        compare(np.ones((4, 6)), np.full((4, 6), 1.5), mask=kept, output=tmp_path / name)
    difference = read_exr(tmp_path / "values.exr").layers["total"]
    assert difference.shape == (4, 6, 3)
    assert np.count_nonzero(difference == 0.5) == 3 * (23 if masked else 24)


def test_a_layer_is_found_by_its_name_and_one_that_lacks_is_refused():
    several = reference(airlight_3_4=np.full((4, 6, 3), 0.5))
    assert several.layer("airlight_3_4").mean() == 0.5
    with pytest.raises(InputError, match="'opacity'"):
        several.layer("opacity")


def test_frames_of_an_animation_share_the_curve_of_the_first(tmp_path):
    bright, dim = layered(dtype=np.float64), layered(0.25, dtype=np.float64)
    curve = tone_curve(bright.layers["airlight"] + bright.layers["surface"])
    for name, image in (("bright", bright), ("dim", dim)):
        write_image(tmp_path / f"{name}.png", image, curve)
    write_image(tmp_path / "alone.png", dim)
    shown = {path.stem: pixels(path.read_bytes()) for path in tmp_path.iterdir()}
    assert (shown["dim"] <= shown["bright"]).all()
    assert shown["dim"].mean() < shown["alone"].mean()


@pytest.mark.claim("results-are-frozen")
def test_numpy_takes_a_result_as_its_total():
    frame = rendering()
    np.testing.assert_array_equal(np.asarray(frame), frame.airlight + frame.surface)
    assert np.shares_memory(np.asarray(frame), frame.total)
    assert not np.shares_memory(np.array(frame), frame.total)
    assert np.asarray(frame, dtype=np.float64).dtype == np.float64
    # the mean of a ramp is its middle
    assert float(np.mean(frame)) == pytest.approx(0.55 + 0.25, rel=1e-6)
    with pytest.raises(ValueError, match="copy"):
        np.array(frame, dtype=np.float64, copy=False)


@pytest.mark.claim("image-files")
def test_save_writes_exr_and_png_and_refuses_others(tmp_path):
    frame = rendering()
    read = read_exr(frame.save(tmp_path / "frame.exr"))
    np.testing.assert_array_equal(read.layers["airlight"], frame.airlight)
    assert any(key.startswith("airlight:version:") for key in read.attributes)
    assert (read.attributes["airlight:commit"], read.attributes["airlight:digest"]) == (
        build().commit,
        build().digest,
    )
    with Picture.open(frame.save(tmp_path / "frame.png")) as shown:
        assert shown.size == (6, 4)
    with pytest.raises(InputError, match=r"\.exr .* or \.png"):
        frame.save(tmp_path / "frame.jpg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame.exr", "frame.png"]


@pytest.mark.claim("image-files")
def test_the_picture_that_users_look_at_first_has_all_light_the_right_way_up(tmp_path):
    """16 x 12 pixels against a picture by hand: Reinhard's curve on airlight and
    surface, encoded as sRGB.
    """
    random = np.random.default_rng(7)
    airlight, surface = (
        random.uniform(0.0, top, (12, 16, 3)).astype(np.float32) for top in (0.3, 1.0)
    )
    image = Image({"airlight": airlight, "surface": surface}, np.ones((12, 16), np.float32), {})
    fields = {
        "kernel": None,
        "parameters": {},
        "precision": "single",
        "plan": {},
        "label": "m",
        "method": "m",
    }
    frame = Rendering(scene="golden", image=sealed(image), **fields)
    with Picture.open(frame.save(tmp_path / "frame.png")) as shown:
        pixels = np.asarray(shown.convert("RGB")).astype(int)
    total = airlight.astype(np.float64) + surface
    exposure = 0.3 / total.mean()
    white = max(1.0, exposure * np.percentile(total, 99.9))
    x = exposure * total
    linear = np.clip(x * (1 + x / white**2) / (1 + x), 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(pixels - 255 * encoded).max() <= 0.6  # half a step of 8 bits, and float32


def test_rows_are_records_and_columns_by_their_paths():
    rows = [
        Row("fog", label, "m", None, "{}", 8, 6, "refused", reason="no <lights>") for label in "ab"
    ]
    benched = MethodsStudy(name="methods", data={}, rows=tuple(rows))
    assert benched.fastest(0.5) is None
    assert len(benched) == 2
    assert benched[1].label == "b"
    assert benched.columns()["label"] == ["a", "b"]
    assert benched.columns()["times.frame.median_ms"] == [None, None]
