# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the error of an engine's equation is told apart from that of its algorithm."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.storage.exr import Image, write_exr
from airlight.validation.engine import judge
from airlight.validation.engine.images import EngineImage, captured_model
from airlight.validation.engine.judge import compare_scene
from airlight.validation.engine.model_errors import model_errors
from airlight.validation.scenes.loading import load_scene
from airlight.validation.study.scene import open_scene
from airlight.validation.study.scene_images import image_row
from airlight.validation.study.study import standard_study

MODEL = Model(light_path="off", law="softened:1:16", range="quartic:8", name="an engine")


@pytest.fixture
def images(rng):
    """A physical image, that of a model, and one of an algorithm."""
    physical = rng.uniform(1, 2, (24, 32, 3))
    own = physical * rng.uniform(1.2, 1.4, physical.shape)
    return physical, own, own * 0.9


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def scene_errors(variant, tmp_path):
    """Compare an image of sphere-spot, made from references, with the scene under a model."""

    def compared(image, model=MODEL, **options):
        write_exr(tmp_path / "engine.exr", Image({"airlight": image.astype(np.float32)}))
        return compare_scene(
            "sphere-spot", tmp_path / "engine.exr", model=model, pixel="centre", **options
        )

    return compared


def airlight(model=PHYSICAL):
    return reference_image(load_scene("sphere-spot", (32, 24)).scene, model=model).airlight


def blocks(correct, other):
    return 0.5


def test_means_add_and_squares_do_with_the_correlation(images):
    physical, own, image = images
    found = model_errors(image, MODEL, lambda m: own if m == MODEL else physical, blocks)
    mean = physical.mean()
    algorithm, equation = image - own, own - physical
    both = found.total
    assert both.mean == pytest.approx((algorithm.mean() + equation.mean()) / mean, rel=1e-12)
    squares = [np.mean(part**2) for part in (algorithm, equation)]
    mixed = 2 * found.correlation * np.sqrt(squares[0] * squares[1])
    assert both.rmse == pytest.approx(np.sqrt(sum(squares) + mixed) / mean, rel=1e-12)
    # The error of the algorithm is told of the model's own brightness.
    assert found.image.mean == pytest.approx(-0.1, rel=1e-12)
    assert found.image.blocks == 0.5


def test_an_algorithm_that_hides_its_equation_is_said_to(images):
    physical, own, image = images
    found = model_errors(image, MODEL, lambda m: own if m == MODEL else physical, blocks)
    assert found.correlation < -0.9
    hidden = 100 * (1 - found.total.rmse / found.against_physics.rmse)
    assert f"the algorithm hides {hidden:.2g} % of the error of its equation" in found.words
    brighter = model_errors(own * 1.1, MODEL, lambda m: own if m == MODEL else physical, blocks)
    assert "adds" in brighter.words
    alike = model_errors(own, MODEL, lambda m: own if m == MODEL else physical, blocks)
    assert (alike.words, alike.image.rmse) == ("", 0)


def test_a_pixel_that_does_not_count_counts_nowhere(images):
    physical, own, image = images
    spoiled = image.copy()
    spoiled[3, 4] = np.nan
    found = model_errors(spoiled, MODEL, lambda m: own if m == MODEL else physical, blocks)
    kept = np.isfinite(spoiled)
    expected = (own - physical)[kept].mean() / physical[kept].mean()
    assert found.against_physics.mean == pytest.approx(expected, rel=1e-12)


def test_terms_alone_are_told_each(scene_errors):
    physical = airlight()
    found = scene_errors(airlight(MODEL)).model
    expected = {
        "light-path": Model(light_path="off"),
        "law": Model(law="softened:1:16"),
        "range": Model(range="quartic:8"),
    }
    told = {each.term: each.mean for each in found.terms_alone}
    assert told == {
        name: pytest.approx(airlight(model).mean() / physical.mean() - 1, rel=1e-9)
        for name, model in expected.items()
    }


def test_the_verdict_is_by_the_model(scene_errors):
    """An image of the equation is right, and the physical image is not."""
    right, wrong = scene_errors(airlight(MODEL)), scene_errors(airlight())
    assert [right.verdict.right, wrong.verdict.right] == [True, False]
    assert right.comparison.failures == ()
    said = right.summary()
    assert "reference of the model" in said
    assert "; reference:" not in said
    assert f"model            an engine: {MODEL.terms.replace(',', ', ')}" in said
    assert "judged by the equation of the model, which is not the physical one" in said
    assert "of the model" not in scene_errors(airlight(), PHYSICAL).summary()


def test_the_margin_of_both_is_against_physics(scene_errors):
    image = airlight(MODEL)
    bias = scene_errors(image).model.total.mean
    assert bias > 1
    assert scene_errors(image, margin_total=bias * 1.01).comparison.failures == ()
    (words,) = scene_errors(image, margin_total=bias * 0.99).comparison.failures
    assert words.startswith(f"the relative bias against physics is {bias:+.3g}, not within")
    with pytest.raises(InputError, match="expected a model beside it"):
        scene_errors(image, PHYSICAL, margin_total=0.1)


def test_the_margin_of_both_holds_what_the_physical_reference_may_be_off(scene_errors, monkeypatch):
    """The error of the reference counted in `--margin` alone."""
    image = airlight(MODEL)
    bias = scene_errors(image).model.total.mean
    monkeypatch.setattr(judge, "off_by", lambda *args, **options: (0.02 * bias, 0.0))
    assert scene_errors(image, margin_total=bias * 1.03).comparison.failures == ()
    (words,) = scene_errors(image, margin_total=bias * 1.01).comparison.failures
    assert "not shown to be (it may be off by" in words


def test_a_sun_without_a_physical_reference_has_a_dash(variant, tmp_path, images):
    def layer(model):
        if model == PHYSICAL:
            raise InputError("nothing of it arrives")
        return images[1]

    found = model_errors(images[2], MODEL, layer, blocks)
    assert [found.against_physics, found.total, found.correlation] == [None] * 3
    rows = [line.split() for line in found.lines if "physics" in line]
    assert [row[3:6] for row in rows] == [["-", "-", "-"]] * 2
    assert all("nothing of it arrives" in " ".join(row) for row in rows)


def test_a_capture_is_judged_by_the_equation_that_it_names(tmp_path):
    layers = {"airlight": np.ones((2, 2, 3), np.float32)}
    named = {"airlight:model": "light-path=off,law=softened:1"}
    engine = {"airlight:engine": "PlayCanvas", "airlight:engine-version": "2.23.3"}
    write_exr(tmp_path / "capture.exr", Image(layers, attributes=named | engine))
    model = captured_model(tmp_path / "capture.exr")
    assert (model.name, model.terms) == ("PlayCanvas 2.23.3", "light-path=off,law=softened:1:1")
    # A reference of a model is no image of an engine, and an engine may not say its equation.
    for attributes in (named, engine):
        write_exr(tmp_path / "other.exr", Image(layers, attributes=attributes))
        assert captured_model(tmp_path / "other.exr") is None


@pytest.mark.parametrize("layers", [("airlight", "surface"), ("surface",), ("airlight",)])
def test_all_light_is_compared_where_an_image_has_it(variant, tmp_path, layers):
    """FLIP compared surfaces alone with the airlight and the surfaces."""
    reference = reference_image(load_scene("sphere-spot", (16, 12)).scene)
    file = tmp_path / "sphere-spot.engine.exr"
    shown = {name: getattr(reference, name) for name in layers}
    write_exr(file, Image(shown, attributes={"airlight:pixel": "centre"}))
    study = replace(standard_study("quick"), scenes=("sphere-spot",), configurations=(), flip="all")
    opened = open_scene("sphere-spot", study.of("sphere-spot").at((16, 12)), {})
    judged = image_row(opened, EngineImage("sphere-spot", "engine", file), None)
    assert reference.surface.max() > 0
    assert (judged.whole is not None) == (len(layers) == 2)
    if judged.whole is not None:
        np.testing.assert_allclose(judged.whole, judged.light, rtol=1e-5, atol=1e-6)


def test_pixels_that_a_file_does_not_hold_are_no_error_of_all_light(variant, tmp_path):
    """FLIP compared them, as black ones."""
    reference = reference_image(load_scene("sphere-spot", (16, 12)).scene)
    total = (reference.airlight + reference.surface).astype(np.float32)[:, :10]
    window = [np.array(corner, np.int32) for corner in ((0, 0), (9, 11), (0, 0), (15, 11))]
    header = {"dataWindow": tuple(window[:2]), "displayWindow": tuple(window[2:])}
    planes = {key: np.ascontiguousarray(total[..., n]) for n, key in enumerate("RGB")}
    OpenEXR.File(header, planes).write(str(tmp_path / "sphere-spot.engine.exr"))
    study = replace(standard_study("quick"), scenes=("sphere-spot",), configurations=(), flip="all")
    opened = open_scene("sphere-spot", study.of("sphere-spot").at((16, 12)), {})
    shown = EngineImage("sphere-spot", "engine", tmp_path / "sphere-spot.engine.exr")
    judged = image_row(opened, shown, None)
    assert judged.row.error.relative_rmse < 1e-4
    assert judged.whole is None


def test_the_row_of_an_image_has_both_errors(variant, tmp_path):
    """By blocks, as the verdict."""
    write_exr(
        tmp_path / "sphere-spot.engine.exr",
        Image(
            {"airlight": (1.02 * airlight(MODEL)).astype(np.float32)},
            attributes={"airlight:engine": "E", "airlight:model": MODEL.terms},
        ),
    )
    study = replace(standard_study("quick"), scenes=("sphere-spot",), configurations=())
    opened = open_scene("sphere-spot", study.of("sphere-spot").at((32, 24)), {})
    judged = image_row(
        opened, EngineImage("sphere-spot", "engine", tmp_path / "sphere-spot.engine.exr"), None
    )
    assert judged.row.model.algorithm == pytest.approx(0.02, rel=1e-3)
    assert judged.row.model.equation > 1
    assert "judged by the equation of the model E" in judged.row.note
