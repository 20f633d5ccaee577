# SPDX-License-Identifier: BSD-3-Clause
"""Diagnoses name the fault that is injected, alone, with another, or none; also
one in a renderer in NumPy.
"""

import importlib
import itertools
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.exr import NOTE, Image
from airlight.validation.engine.curves import to_srgb
from airlight.validation.engine.decide import Blocks
from airlight.validation.engine.diagnose import (
    Ranked,
    _right_rest,
    diagnose_file,
    diagnose_image,
)
from airlight.validation.engine.error_place import _is_ringed
from airlight.validation.engine.fault import Fault, Number
from airlight.validation.engine.faults import FAULTS
from airlight.validation.engine.observation import judged_layer, observation_of
from airlight.validation.engine.prediction import Guess, Predictor, SceneLight
from airlight.validation.engine.search import Explanation, _between, _Search, explain
from airlight.validation.fog_model.radiance import FogModel, scene_fog
from airlight.validation.fog_model.view import Scenery, scattering_paths, view_of
from airlight.validation.scenes.loading import load_scene
from tests.helpers.diagnoses import diagnosis
from tests.helpers.injected_faults import INJECTED
from tests.helpers.scenes import FOG, scene_xml

SIZE = (32, 24)


def diagnosed(values, scene="sphere-spot", size=SIZE, **how):
    how = {"pixel": "centre", **how}
    return diagnose_image(Image({"total": values}), load_scene(scene, size), layer="total", **how)


def total(reference, **how):
    image = quadrature_image(reference, checks=8, **how)
    return image.airlight + image.surface


@pytest.fixture(scope="module")
def reference(variant):
    return read_reference(load_scene("sphere-spot", SIZE).scene)


# A diagnosis takes some seconds: the fast tests have one fault of each kind.
FAST = ("extinction", "transfer")


def marked(injected):
    name = f"{injected.name}: {injected.words}"
    return pytest.param(injected, id=name, marks=() if injected.name in FAST else pytest.mark.slow)


@pytest.mark.claim("diagnosis-injected")
@pytest.mark.parametrize("injected", [marked(injected) for injected in INJECTED])
def test_an_injected_fault_comes_first(reference, injected):
    diagnosis = diagnosed(injected.image(reference))
    assert diagnosis.first == injected.name, [row.words for row in diagnosis.ranked]
    assert diagnosis.ranked[0].name == injected.name
    assert diagnosis.explained


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", ["the extinction 1.4 times", "upside down", "filmic", "half a pixel", "sRGB"]
)
def test_an_injected_fault_comes_first_in_noise_and_pixels_of_a_kind_that_nobody_tells(
    reference, words
):
    """The images of the test above have no noise, and it says that their pixels are
    centres: an engine says neither.
    """
    (injected,) = (each for each in INJECTED if each.words == words)
    noise = 1 + 0.01 * np.random.default_rng(6).standard_normal((SIZE[1], SIZE[0], 1))
    assert diagnosed(injected.image(reference) * noise, pixel=None).first == injected.name


@pytest.mark.slow
def test_a_light_that_is_off_is_named_among_many_triangles(reference, monkeypatch):
    """There less is tried, since paths cost much."""
    monkeypatch.setattr("airlight.validation.engine.prediction._MANY_TRIANGLES", 0)
    (injected,) = (each for each in INJECTED if each.name == "light-position")
    diagnosis = diagnosed(injected.image(reference))
    assert diagnosis.first == "light-position"
    assert diagnosis.explained


@pytest.mark.slow
def test_a_light_with_a_radius_is_named(variant, tmp_path):
    path = tmp_path / "fog.xml"
    path.write_text(scene_xml(fog=FOG + '<phase type="hg"><float name="g" value="0.47"/></phase>'))
    own = read_reference(load_scene(str(path), SIZE).scene)
    view = view_of(own)
    model = FogModel(view, scattering_paths(view, Scenery(radius=0.25), samples=64))
    image = model.layers(scene_fog(own)).sum(axis=0).reshape(SIZE[1], SIZE[0], 3)
    assert diagnosed(image, str(path)).first == "light-radius"


def test_few_pixels_tell_no_fault_from_noise(variant):
    with pytest.raises(InputError, match="12 pixels"):
        diagnosed(np.full((3, 4, 3), 0.02), size=(4, 3))


def all_blocks(height, width):
    """Return the blocks of an image all of whose pixels are looked at."""
    return Blocks.of(SimpleNamespace(shape=(height, width), pixels=np.arange(height * width)))


def test_pixels_that_share_their_errors_count_as_fewer(reference):
    """White noise has as many witnesses as pixels; errors of 4 x 4 pixels each have a sixteenth."""
    (height, width), generator = (192, 256), np.random.default_rng(2)
    blocks = all_blocks(height, width)
    lit = np.ones((height * width, 3), bool)

    def explanation(errors):
        errors = np.repeat(errors.reshape(-1, 1), 3, axis=1)
        return Explanation(
            (), (), Guess(scene_fog(reference)), errors, lit, float(np.abs(errors).mean())
        )

    white = explanation(0.02 * generator.standard_normal((height, width)))
    shared = explanation(
        np.kron(0.02 * generator.standard_normal((height // 4, width // 4)), np.ones((4, 4)))
    )
    assert blocks.is_noise(white)
    assert not blocks.is_noise(shared)
    assert blocks.area(white.errors, lit) == pytest.approx(1, abs=0.3)
    assert blocks.area(shared.errors, lit) == pytest.approx(16, rel=0.3)


@pytest.mark.claim("diagnosis-right")
@pytest.mark.parametrize("noise", [0.01, pytest.param(0.2, marks=pytest.mark.slow)])
def test_no_fault_is_named_for_a_right_image(reference, noise):
    generator = np.random.default_rng(3)
    diagnosis = diagnosed(
        total(reference) * (1 + noise * generator.standard_normal((SIZE[1], SIZE[0], 1)))
    )
    assert diagnosis.first == "right"
    assert diagnosis.explained


@pytest.mark.slow
@pytest.mark.claim("diagnosis-injected")
def test_an_explanation_that_ends_where_a_simpler_one_is_is_that_one(variant):
    """Height fog with a scale height of kilometres is an extinction, though its number
    fits errors of an engine.
    """
    loaded = load_scene("open-fog", SIZE)
    own = read_reference(loaded.scene)
    height = np.linspace(-1, 1, SIZE[1])[:, None, None]
    image = total(replace(own, medium=replace(own.medium, sigma_t=1.332 * own.medium.sigma_t))) * (
        1 + 0.003 * height
    )
    diagnosis = diagnose_image(Image({"total": image}), loaded, layer="total", pixel="centre")
    assert diagnosis.first == "extinction"
    assert diagnosis.ranked[0].parameters[0] == pytest.approx(1.332, rel=0.01)


def marked_image(image):
    """A frame counter in white."""
    image = image.copy()
    image[2:4, 3:8] = 1.0
    return image


def holed(image):
    image = image.copy()
    image[5:8, 20:24] = 0.0
    return image


@pytest.mark.claim("diagnosis-right")
@pytest.mark.parametrize(
    ("change", "words"),
    [(marked_image, "10 of 768 pixels"), (holed, "pixels, in columns 20 to 20 and rows 5 to 7")],
)
def test_few_wrong_pixels_are_said_and_never_nothing(reference, change, words):
    """The comparison calls the image wrong: the diagnosis may not say that nothing is."""
    diagnosis = diagnosed(change(total(reference)))
    assert diagnosis.first == "unexplained"
    assert not diagnosis.explained
    assert words in diagnosis.few
    assert "all is right but" in "\n".join(diagnosis.lines)
    assert diagnosis.verdict.startswith("not right")


def test_a_black_image_is_black(reference):
    diagnosis = diagnosed(np.zeros((SIZE[1], SIZE[0], 3)))
    assert diagnosis.first == "black"
    assert [row.name for row in diagnosis.ranked] == ["black"]
    assert "The image is black" in "\n".join(diagnosis.lines)


@pytest.mark.parametrize(("value", "first"), [(0.0, "black"), (1.0, "unexplained")])
def test_an_image_of_what_should_be_black_is_black_only_if_it_is(variant, value, first):
    """Light where the scene has no surface at all was called a black image."""
    layers = {"surface": np.full((SIZE[1], SIZE[0], 3), value)}
    scene = load_scene("open-fog", SIZE)
    diagnosis = diagnose_image(Image(layers), scene, layer="surface", pixel="centre")
    assert diagnosis.first == first
    assert ("The image is black" in "\n".join(diagnosis.lines)) == (first == "black")
    assert "the reference is black" in diagnosis.verdict
    assert "inf" not in diagnosis.verdict


def test_the_diagnosis_remembers_what_the_reader_of_the_file_said(reference):
    image = Image({"total": total(reference)}, attributes={NOTE: "colours of other primaries"})
    said = diagnose_image(image, load_scene("sphere-spot", SIZE), layer="total", pixel="centre")
    assert "colours of other primaries" in "\n".join(said.lines)


@pytest.mark.slow
@pytest.mark.claim("diagnosis-two")
@pytest.mark.parametrize(
    "curve", [to_srgb, lambda x: to_srgb(x / (1 + x))], ids=["sRGB", "x/(1+x), sRGB"]
)
def test_an_exposure_before_a_curve_is_named_with_it(reference, curve):
    diagnosis = diagnosed(curve(40 * total(reference)))
    assert diagnosis.ranked[0].together == (
        "factor",
        "transfer" if curve is to_srgb else "tone-map",
    )
    assert diagnosis.ranked[0].parameters[0] == pytest.approx(40, rel=0.01)
    assert diagnosis.explained


@pytest.mark.slow
@pytest.mark.claim("diagnosis-two")
def test_two_faults_of_different_kinds_are_both_named(reference):
    denser = replace(
        reference, medium=replace(reference.medium, sigma_t=1.6 * reference.medium.sigma_t)
    )
    both = diagnosed(0.7 * total(denser))
    assert {row.name for row in both.ranked[:2]} == {"extinction", "factor"}
    assert both.ranked[0].together == ("extinction", "factor")
    assert [row.parameters[0] for row in both.ranked[:2]] == pytest.approx([1.6, 0.7], rel=1e-2)
    flipped = diagnosed(total(denser)[::-1])
    assert {row.name for row in flipped.ranked[:2]} == {"extinction", "flip"}
    assert "Two faults" in "\n".join(flipped.lines)


TOOLS = Path(__file__).resolve().parents[3] / "docs/tools"
sys.path.insert(0, str(TOOLS))
numpy_faults = importlib.import_module("numpy_faults")
sys.path.remove(str(TOOLS))
LARGER = (64, 48)


@pytest.fixture(scope="module")
def scenes(variant, tmp_path_factory):
    """By what is right, the scene that the renderer shows, and its
    light, which all images share.
    """

    def scene(engine):
        path = tmp_path_factory.mktemp("engine") / "scene.xml"
        path.write_text(numpy_faults.scene_xml(engine))
        loaded = load_scene(str(path), LARGER)
        return loaded, SceneLight(read_reference(loaded.scene))

    return {engine: scene(engine) for engine in (numpy_faults.RIGHT, numpy_faults.LAYERED)}


def usual_seed(noise, number):
    """Return a seed whose noise the diagnosis takes for noise; of one draw in thirty
    it says that more is left.
    """
    for seed in itertools.count(number, len(numpy_faults.CASES)):
        errors = np.repeat(numpy_faults.relative_noise(noise, seed), 3, axis=2)
        alone = SimpleNamespace(
            errors=errors.reshape(-1, 3), lit=np.ones((errors[..., 0].size, 3), bool)
        )
        if all_blocks(*errors.shape[:2]).is_noise(alone):
            return seed


def named(scenes, number, noise=0.01):
    engine, injected, _, given = numpy_faults.CASES[number]
    loaded, light = scenes[engine]
    image = numpy_faults.rendered(
        replace(engine, **given), area=False, noise=noise, seed=usual_seed(noise, number)
    )
    return injected, diagnose_image(Image({"total": image}), loaded, light=light)


@pytest.mark.slow
@pytest.mark.claim("diagnosis-engines")
@pytest.mark.parametrize("number", range(len(numpy_faults.CASES)))
def test_what_is_set_wrong_in_an_engine_is_named_or_placed(scenes, number):
    injected, said = named(scenes, number)
    assert said.first == injected, [row.words for row in said.ranked]
    assert said.place == "" or injected == "unexplained"


@pytest.mark.slow
@pytest.mark.claim("diagnosis-engines")
def test_the_fog_alone_is_too_bright(scenes):
    injected, said = named(scenes, 2)
    assert said.first == injected == "fog-factor"
    assert said.ranked[0].parameters[0] == pytest.approx(8.3, rel=1e-2)
    assert said.rest.startswith("like noise")
    assert "which is like noise" in "\n".join(said.lines)


@pytest.mark.claim("diagnosis-injected")
def test_values_that_few_pixels_have_cut_off_are_looked_at(variant):
    """Of 19 200 pixels 240 are at the largest value; 352 are looked at, and chance had
    two of the 240 among them.
    """
    scene = load_scene("open-fog", (160, 120)).scene
    values = np.random.default_rng(3).random((120, 160, 3))
    whole, _ = observation_of(
        Image({"total": values}), judged_layer(Image({"total": values}), "", holds="total"), scene
    )
    assert not len(whole.cut_off)
    values[40:50, 70:94] = 1.0
    observation, _ = observation_of(
        Image({"total": values}), judged_layer(Image({"total": values}), "", holds="total"), scene
    )
    pixels, before = (replace(each, area=True).view().pixels for each in (observation, whole))
    added = np.setdiff1d(pixels, before)
    assert len(observation.cut_off) == 240
    assert np.isin(pixels, observation.cut_off).sum() >= 4
    assert np.isin(added, observation.cut_off).all()
    assert len(added) <= 5  # 355 of 19 200 pixels are looked at, 1.25 % of which are cut off


def test_a_place_is_found_where_pixels_are_lit_or_dark():
    """Each pixel is wrong by all of its light while the light is further from its place
    than the shadow is wide.
    """
    true, widths = np.array([0.05, -0.07, 0.05]), np.linspace(0.004, 0.3, 100)

    def errors(place):
        return np.repeat(
            (widths < np.linalg.norm(np.array(place) - true))[:, None], 3, axis=1
        ).astype(float)

    (position,) = (each for each in FAULTS if each.name == "light-position")
    place_of = Fault("place", "", lambda predictor, guess, p: p, position.parameters)
    search = _Search(SimpleNamespace(unchanged=None, errors=errors), (place_of,))
    begun = np.zeros(3)
    np.testing.assert_array_equal(search.by_steps(begun, 0.01, False), begun)
    np.testing.assert_allclose(search.along_axes(begun, 0.01), true, atol=0.01)


def test_what_nothing_explains_is_told_with_what_comes_nearest():
    nearest = diagnosis(
        ranked=(Ranked("light-path", (), "the way is not attenuated", 0.05, 50.0, ()),),
        place="beside the light",
    )
    told = "The nearest to it, light-path, leaves 5 % of 7 %: the way is not attenuated."
    assert nearest.lines[1:] == [
        "Nothing here explains it: the error lies beside the light (not right).",
        "It may be the algorithm: few steps, froxels, a shadow map or a low resolution.",
        told,
    ]
    assert replace(nearest, place="").lines[1] == "Nothing here explains it (not right)."
    # One that takes nothing away is not near, and of a mark on the image nobody asks.
    assert told not in replace(nearest, left=0.0699).lines
    assert replace(nearest, few="all is right but 3 pixels").lines[1:] == [
        "Nothing here explains it: all is right but 3 pixels (not right)."
    ]


def striped(reference, size):
    """Return the image of a factor in broad stripes, which are neither noise nor little."""
    stripes = 1 + size * np.sign(np.sin(np.arange(SIZE[0]) / 2.0))[None, :, None]
    return 1.5 * total(reference) * stripes


@pytest.mark.parametrize(("size", "right"), [(0.006, True), (0.04, False)])
def test_a_rest_that_a_comparison_calls_right_is_nothing_to_it(reference, size, right):
    image = Image({"total": striped(reference, size)})
    scene = load_scene("sphere-spot", SIZE).scene
    observation, _ = observation_of(image, judged_layer(image, "", holds="total"), scene)
    predictor = Predictor(observation, SceneLight(observation.reference))
    (factor,) = [each for each in FAULTS if each.name == "factor"]
    rest = _right_rest(predictor, explain(predictor, [factor]))
    said = "nothing to a comparison: means over 2 x 2 pixels are within 0."
    assert rest.startswith(said) if right else not rest


def test_rings_are_told_from_noise():
    generator = np.random.default_rng(3)
    angle = generator.uniform(0, 2, 4096)
    noise = 0.01 * generator.standard_normal(4096)
    assert not _is_ringed(noise, angle)
    assert not _is_ringed(noise + 0.5, angle)
    assert _is_ringed(noise + 0.02 * np.sign(np.sin(20 * angle)), angle)


def test_a_search_about_a_start_ends_at_the_starts_beside_it():
    number = Number(0.0, 10.0, (1.0, 2.0, 5.0))
    assert _between(number, 2.0, 0.0, 10.0) == (1.0, 5.0)
    assert _between(number, 5.0, 0.0, 10.0) == (2.0, 10.0)
    # Elsewhere there is 30 % of the value, within the range.
    assert _between(number, 3.0, 0.0, 10.0) == pytest.approx((2.1, 3.9))
    assert _between(number, 0.0, 0.0, 10.0) == pytest.approx((0.0, 0.1))


@pytest.mark.slow
def test_an_image_whose_rest_a_comparison_calls_right_is_explained(reference):
    said = diagnosed(striped(reference, 0.006))
    assert said.first == "factor"
    assert said.rest.startswith("nothing to a comparison")
    assert said.explained
    assert not said.place


@pytest.mark.parametrize(("scene", "layers"), [("sphere-spot", 2), ("penumbra-plane", 1)])
def test_surfaces_are_judged_where_a_file_has_airlight_and_all_light(
    variant, monkeypatch, scene, layers
):
    """A light with an extent is seen in all light, and is no surface."""
    small = (16, 12)  # pixels: the reference of an area light takes a while
    image = quadrature_image(read_reference(load_scene(scene, small).scene), checks=1)
    both = {"airlight": image.airlight, "total": image.airlight + 2 * image.surface}
    file = Image(both, attributes={"airlight:pixel": "centre"})
    monkeypatch.setattr("airlight.validation.engine.diagnose.read_exr", lambda path: file)
    found = diagnose_file("engine.exr", scene)
    assert [each.layer for each in found] == ["airlight", "total - airlight"][:layers]
    assert found[0].first == "right"
    assert found[1:] == () or (found[1].first, found[1].ranked[0].parameters) == (
        "factor",
        pytest.approx((2.0,), rel=1e-3),
    )
