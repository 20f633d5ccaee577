# SPDX-License-Identifier: BSD-3-Clause
"""`import airlight`: the functions do what the parts they are made of do, and refuse in
one line what they cannot.
"""

import doctest
import importlib

import mitsuba as mi
import numpy as np
import pytest

import airlight
from airlight.reference.quadrature.reference import reference_image
from airlight.reports.studies.registry import STUDIES
from airlight.validation.scenes.registry import SCENES
from tests.helpers.api import TINY, brighter, third


def gone(view):
    raise ZeroDivisionError("nothing there")


MODULES = [
    "airlight",
    "airlight.reports.api.render",
    "airlight.reports.api.compare",
    "airlight.reports.api.reference",
    "airlight.reports.studies.registry",
]
MODULES += [f"airlight.reports.studies.{module}" for module in sorted({*STUDIES.values()})]


@pytest.mark.parametrize("module", MODULES)
def test_examples_of_the_docstrings(module, variant):
    outcome = doctest.testmod(importlib.import_module(module))
    assert not outcome.failed
    assert outcome.attempted or "studies" in module


# Scenes


def test_a_scene_by_name_dictionary_mitsuba_scene_and_again(variant):
    scene = airlight.load_scene("open-fog", "16x12")
    assert scene.size == TINY
    assert scene.name == "open-fog"
    assert airlight.load_scene(scene) is scene
    assert airlight.load_scene(scene, TINY) is scene
    named = airlight.load_scene(SCENES["open-fog"].build(), TINY)
    assert named.size == TINY
    assert airlight.load_scene(mi.load_dict(SCENES["open-fog"].build())).size == (800, 600)
    by_name, by_dictionary = (
        airlight.render(described, "unshadowed") for described in (scene, named)
    )
    np.testing.assert_array_equal(by_name.airlight, by_dictionary.airlight)
    assert "1 point" in scene._repr_html_()


# Frames


def test_a_frame_is_that_of_the_parts_it_is_made_of(variant):
    from airlight.validation.study.configuration import configuration, prepared

    frame = airlight.render(
        "sphere-spot", "shadow-planes-2006", "quadrature-32", size=TINY, order="none"
    )
    scene = airlight.read_scene(airlight.load_scene("sphere-spot", TINY).scene)
    chosen = configuration("shadow-planes-2006", "quadrature-32", {"order": "none"})
    direct = airlight.render_frame(prepared(scene, chosen))
    np.testing.assert_array_equal(frame.airlight, direct.airlight)
    np.testing.assert_array_equal(frame.surface, direct.surface)
    np.testing.assert_array_equal(frame.depth, direct.distance)
    assert (frame.method, frame.kernel, dict(frame.parameters)) == (
        "shadow-planes-2006",
        "quadrature-32",
        {"order": "none"},
    )
    assert frame.plan["lights"] == "1 spot"
    assert frame.image.attributes["airlight:order"] == "none"
    assert frame.times is None


def test_a_function_of_ones_own_is_a_method(variant):
    usual = airlight.render("open-fog", "unshadowed", size=TINY)
    own = airlight.render("open-fog", brighter, size=TINY, times=3.0)
    np.testing.assert_allclose(own.airlight, 3 * usual.airlight, rtol=1e-6)
    assert own.label.endswith(":brighter (exact, times=3.0)")
    assert airlight.render("open-fog", own.method, size=TINY).kernel == "exact"
    thirds = airlight.render("open-fog", brighter, third, size=TINY)
    np.testing.assert_allclose(thirds.airlight, 2 / 3 * usual.airlight, rtol=1e-6)
    with pytest.raises(
        airlight.InputError, match=r"test_images\.py, line \d+: ZeroDivisionError: nothing there"
    ):
        airlight.render("open-fog", gone, size=TINY)


# The reference


def test_the_reference_with_its_bound(variant, own_cache):
    told = []
    scene = airlight.load_scene("sphere-spot", TINY)
    reference = airlight.reference(
        scene, progress=lambda fraction, what: told.append((fraction, what))
    )
    np.testing.assert_array_equal(reference.airlight, reference_image(scene.scene).airlight)
    assert reference.bound.shape == reference.airlight.shape == (12, 16, 3)
    assert reference.airlight.dtype == np.float64
    assert reference.standard_error is reference.surface_standard_error is None
    assert reference.relative_error == pytest.approx(
        float(reference.bound.mean() / reference.airlight.mean())
    )
    assert reference.how.left == 0
    assert told[-1] == (1.0, "quadrature")
    assert np.isfinite(reference.depth).any()


def test_a_reference_by_samples_with_its_standard_error(variant):
    traced = airlight.reference("open-fog", "single-scatter", size=TINY, samples=64, seed=7)
    reference = airlight.reference("open-fog", size=TINY)
    assert traced.bound is None
    assert traced.image.attributes["airlight:spp"] == 64
    assert traced.image.attributes["airlight:seeds"].startswith("7")
    assert 0 < traced.relative_error < 0.1
    compared = airlight.compare(traced, reference, margin=0.1)
    assert compared.statistics.equivalent
    assert compared.passed
    # Student's law for 32 batches: one of 576 values is beyond 8 standard errors
    # with a probability of 3e-6.
    assert np.max(np.abs(traced.airlight - reference.airlight) / traced.standard_error) < 8


# Comparisons


def test_images_files_and_arrays_compare_alike(variant, tmp_path):
    reference = airlight.reference("sphere-spot", size=TINY)
    frame = airlight.render("sphere-spot", "ray-march", size=TINY, steps=16)
    reference_file, frame_file = (
        reference.save(tmp_path / "reference.exr"),
        frame.save(tmp_path / "frame.exr"),
    )
    direct = airlight.compare(reference, frame)
    assert direct.metrics == airlight.error_metrics(reference.airlight, frame.airlight)
    assert airlight.compare(reference.airlight, frame.airlight).metrics == direct.metrics
    assert airlight.compare(reference, airlight.read_exr(frame_file)).metrics == direct.metrics
    # A file keeps float32.
    files = airlight.compare(reference_file, frame_file)
    assert files.metrics.relative_rmse == pytest.approx(direct.metrics.relative_rmse, rel=1e-5)
    assert files.names == ("reference.exr", "frame.exr")
    total = airlight.compare(reference, frame, "total")
    assert total.metrics == airlight.error_metrics(reference.total, frame.total)
    mask = np.zeros((12, 16), bool)
    mask[4:8] = True
    assert airlight.compare(reference, frame, mask=mask).masked == 192 - 64
    assert airlight.compare(reference, frame, all_metrics=True).colour.ciede2000_mean > 0


# Mistakes

ONES = np.ones((2, 2, 3))
SMALL = {"scene": "open-fog", "size": (8, 6)}


@pytest.mark.claim("input-errors")
@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("load_scene", {"scene": 3.5}, "got float, expected a name"),
        ("load_scene", {"scene": {"type": "scene"}}, "no sensor"),
        ("load_scene", {"scene": "open-fog", "size": (0, 4)}, "at least 1x1"),
        ("load_scene", {"scene": "open-fog", "size": 8}, "expected \\(width, height\\)"),
        ("render", SMALL | {"method": "ray-marhc"}, "did you mean 'ray-march'"),
        ("render", SMALL | {"method": "ray-march", "kernel": "exact"}, "calls no kernel"),
        ("render", SMALL | {"method": "ray-march", "steps": 2.5}, "expected a whole number"),
        (
            "render",
            SMALL | {"method": lambda view: 0},
            "expected a name or a function at the top of a module",
        ),
        ("render", SMALL | {"precision": "half"}, "precision"),
        ("reference", SMALL | {"pixel": "corner"}, "'centre' or 'area'"),
        ("compare", {"reference": ONES, "test": np.ones((2, 3, 3))}, "two sizes"),
        ("compare", {"reference": ONES, "test": ONES, "margin": 0.1}, "a margin needs errors"),
        ("compare", {"reference": [["a"]], "test": ONES}, "the reference: got list"),
        (
            "compare",
            {"reference": ONES, "test": ONES, "mask": np.ones((2, 2))},
            "expected truth values",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(variant, name, arguments, words):
    with pytest.raises(airlight.InputError, match=words) as raised:
        getattr(airlight, name)(**arguments)
    assert "\n" not in str(raised.value)
