# SPDX-License-Identifier: BSD-3-Clause
"""Images of engines are found and compared with the reference of their pixels;
hints say what looks wrong.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.storage.exr import Image, write_exr
from airlight.validation.engine.hints import find_hints
from airlight.validation.engine.images import (
    TIMES,
    EngineImage,
    find_images,
    image_times,
    images_size,
    measure_image,
    notes_of,
)
from airlight.validation.scenes.loading import load_scene
from airlight.validation.timing import Timing

SCENES = {
    "open-fog": "open-fog",
    "hall": "hall",
    "hall.small": "hall.small",
    "mine": "folder/mine.xml",
}
SHAPE = (4, 6, 3)
RANDOM = np.random.default_rng(5)
AIRLIGHT, SURFACE = RANDOM.uniform(0.5, 2, SHAPE), RANDOM.uniform(0, 3, SHAPE)


def reference_of(pixel):
    """The means over pixels are a tenth brighter here, where a pixel is bright."""
    brighter = 1 + 0.1 * (pixel == "area") * (AIRLIGHT > 1)
    layers = {"airlight": brighter * AIRLIGHT, "surface": brighter * SURFACE, "emitted": None}
    errors = {"airlight_error": 0 * AIRLIGHT, "airlight_se": None}
    errors |= {"surface_error": 0 * AIRLIGHT, "surface_se": None}
    return SimpleNamespace(
        **layers, **errors, light_angle=np.ones(SHAPE[:2]), airlight_kind="proven"
    )


def written(folder, name, **layers):
    path = folder / name
    write_exr(path, Image(layers or {"total": np.ones(SHAPE, dtype=np.float32)}))
    return path


def test_files_are_found_by_the_name_of_their_scene(tmp_path):
    for name in (
        "open-fog.exr",
        "hall.godot.exr",
        "hall.unreal 5.4.exr",
        "hall.small.exr",
        "mine.EXR",
    ):
        written(tmp_path, "x.exr").rename(tmp_path / name)
    (tmp_path / "notes.txt").write_text("not an image")
    images = find_images(tmp_path, SCENES)
    labels = {scene: [image.label for image in several] for scene, several in images.items()}
    assert labels == {
        "hall": ["godot", "unreal 5.4"],
        "hall.small": [tmp_path.name],
        "mine": [tmp_path.name],
        "open-fog": [tmp_path.name],
    }


def test_a_bright_pixel_that_a_mask_leaves_out_is_no_measure_of_the_others():
    """All others were called black beside a light of ten million, which was masked."""
    reference = np.ones((40, 40, 3))
    reference[20, 20] = 1e7
    image = np.ones((40, 40, 3))
    image[20, 20] = np.nan
    hints = find_hints(reference, image)
    assert (hints.factor, hints.words, hints.reason) == (1.0, (), "")
    hints = find_hints(reference, 3 * image)
    assert hints.factor == pytest.approx(1 / 3)
    assert "3 times as bright" in hints.words[0]


def test_images_of_a_scene_have_one_size(tmp_path):
    first, second = written(tmp_path, "hall.a.exr"), written(tmp_path, "hall.b.exr")
    images = tuple(find_images(tmp_path, SCENES)["hall"])
    assert images_size(images) == (6, 4)
    write_exr(second, Image({"total": np.ones((4, 8, 3), dtype=np.float32)}))
    with pytest.raises(InputError, match=r"hall\.b\.exr is 8 x 4 pixels and .*hall\.a\.exr 6 x 4"):
        images_size(images)
    assert first.is_file()


def measured(path, *, surfaces=True):
    return measure_image(
        EngineImage("hall", "godot", path),
        load_scene("hall", (6, 4)),
        reference_of,
        surfaces=surfaces,
    )


def test_a_layer_of_airlight_is_judged_as_such(variant, tmp_path):
    path = written(tmp_path, "hall.exr", airlight=1.1 * AIRLIGHT, surface=SURFACE)
    judged, layers, surface_error = measured(path)
    assert judged.expected == "airlight"
    # The file holds float32: 6e-8.
    assert judged.comparison.metrics.relative_bias == pytest.approx(0.1, abs=1e-7)
    assert not judged.verdict.right
    assert surface_error.relative_rmse == pytest.approx(0, abs=1e-7)
    np.testing.assert_allclose(
        layers["airlight"] + layers["surface"], 1.1 * AIRLIGHT + SURFACE, rtol=1e-6
    )
    assert measured(path, surfaces=False)[2] is None


def test_pixels_that_a_file_does_not_hold_are_no_error_of_its_surface(variant, monkeypatch):
    """They are 0 in the layers of a file with a data window, and counted as black surfaces."""
    part = np.arange(6)[None, :, None] < 4
    layers = {"airlight": part * AIRLIGHT, "surface": part * SURFACE}
    image = Image(layers, window=(0, 0, 4, 4))
    monkeypatch.setattr("airlight.validation.engine.images.read_exr", lambda path: image)
    judged, _, surface_error = measured("hall.exr")
    assert judged.comparison.metrics.pixels == surface_error.pixels == 16
    assert surface_error.rmse == 0


def test_a_file_without_any_light_is_refused(variant, tmp_path):
    path = written(tmp_path, "hall.exr", beauty=np.ones(SHAPE), matte=np.ones(SHAPE))
    for refused in (
        lambda: measured(path),
        lambda: images_size((EngineImage("hall", "godot", path),)),
    ):
        with pytest.raises(
            InputError,
            match="has no channels R, G, B and no layer 'airlight'; it has beauty, matte",
        ):
            refused()


def test_colours_in_integers_are_refused_by_name(tmp_path):
    """They once ended `report --images` with a StopIteration."""
    import OpenEXR

    path = tmp_path / "hall.exr"
    OpenEXR.File({}, {name: np.ones((4, 6), dtype=np.uint32) for name in "RGB"}).write(str(path))
    with pytest.raises(InputError, match="colours in unsigned integers left out: B, G, R"):
        images_size((EngineImage("hall", "godot", path),))


@pytest.mark.claim("engine-pixels")
def test_the_reference_that_fits_is_taken(variant, tmp_path):
    for pixel in ("centre", "area"):
        reference = reference_of(pixel)
        path = written(
            tmp_path, f"{pixel}.exr", total=0.999 * (reference.airlight + reference.surface)
        )
        judged, *_ = measured(path)
        assert (judged.pixel, "means over the areas" in notes_of(judged, None)) == (
            pixel,
            pixel == "area",
        )
        assert judged.comparison.metrics.relative_bias == pytest.approx(-0.001, abs=1e-6)
        np.testing.assert_array_equal(judged.layers.airlight, reference.airlight)


def test_an_engine_says_how_long_its_images_took(variant, tmp_path):
    path = written(tmp_path, "hall.godot.exr")
    assert image_times(path) is None
    (tmp_path / TIMES).write_text(
        '{"hall.godot.exr": {"ms": 3.1, "quartiles": [2.9, 3.4], "device": "a card"}}'
    )
    times = image_times(path)
    assert times == (Timing(3.1, 2.9, 3.4, 0), "a card")
    assert "timed on a card" in notes_of(measured(path)[0], times)
    assert image_times(tmp_path / "hall.other.exr") is None
    for wrong in ('{"hall.godot": {"ms": -1}}', '{"hall.godot": {"quartiles": [1, 2]}}', "no JSON"):
        (tmp_path / TIMES).write_text(wrong)
        with pytest.raises(InputError, match="milliseconds of a frame above 0"):
            image_times(path)


@pytest.fixture
def pattern():
    """An image without symmetry, its channels apart."""
    row, column = np.mgrid[:12, :16]
    light = np.exp(-0.1 * (row - 3.2) ** 2 - 0.05 * (column - 10.7) ** 2) + 0.02 * column
    return light[..., None] * np.array([0.9, 0.4, 0.2])


def srgb(image):
    return np.where(image <= 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)


@pytest.mark.claim("engine-suspects")
def test_the_right_image_raises_no_suspicion(pattern):
    noisy = pattern * (1 + 0.005 * np.random.default_rng(3).standard_normal(pattern.shape))
    for image in (pattern, noisy):
        hints = find_hints(pattern, image)
        assert hints.words == ()
        assert abs(hints.factor - 1) < 0.002
    assert find_hints(pattern, pattern).factor_rmse == 0


@pytest.mark.claim("engine-suspects")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda image: image[::-1], ["upside down"]),
        (lambda image: image[:, ::-1], ["mirrored left to right"]),
        (lambda image: image[..., ::-1], ["channel order B, G, R"]),
        (srgb, ["sRGB curve"]),
        (
            lambda image: math.pi * image,
            ["3.142 times as bright as it should be (pi), +1.65 stops"],
        ),
        (lambda image: image / (4 * math.pi), ["(1/(4 pi)), -3.65 stops"]),
        (lambda image: 683 * image, ["683, lumens a watt"]),
        (lambda image: 4 * math.pi * image[::-1], ["upside down", "(4 pi), +3.65 stops"]),
        (lambda image: -image, ["the image is negative"]),
    ],
)
def test_each_fault_is_named_and_nothing_else(pattern, change, words):
    hints = find_hints(pattern, change(pattern)).words
    assert len(hints) == len(words)
    for hint, word in zip(hints, words):
        assert word in hint
    assert hints[-1].endswith(f"instead of {relative_rmse(pattern, change(pattern)):.3g}")


def relative_rmse(pattern, image):
    return np.sqrt(np.mean((image - pattern) ** 2)) / pattern.mean()


@pytest.mark.claim("engine-suspects", tolerance="1e-12 relative")
def test_best_factor_is_the_median_of_the_ratios_of_lit_values(pattern):
    noisy = pattern * np.exp(0.1 * np.random.default_rng(4).standard_normal(pattern.shape))
    noisy[2:4] = 0
    hints = find_hints(pattern, noisy)
    lit = (noisy > 0) & (pattern > 1e-3 * pattern.mean())
    np.testing.assert_allclose(
        hints.factor, np.exp(np.median(np.log(pattern[lit] / noisy[lit]))), rtol=1e-12
    )
    np.testing.assert_allclose(
        hints.factor_rmse, relative_rmse(pattern, hints.factor * noisy), rtol=1e-12
    )


@pytest.mark.claim("engine-suspects")
@pytest.mark.parametrize("fault", [0, 50, np.inf])
def test_one_pixel_decides_nothing(pattern, fault):
    """The least squares were 0.001 times the image where one pixel beside a lamp was a
    thousand times too bright.
    """
    image = pattern.copy()
    image[5, 6] *= fault
    hints = find_hints(pattern, image)
    np.testing.assert_allclose(hints.factor, 1, rtol=1e-12)
    assert hints.words == ()
    for factor in (math.pi, 1e-3):
        (words,) = find_hints(pattern, factor * image).words
        assert f"the image is {factor:.4g} times as bright" in words
