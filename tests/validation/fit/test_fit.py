# SPDX-License-Identifier: BSD-3-Clause
"""`airlight compare --fit`: what explains an image, how sure that is,
and what no image can tell.
"""

import importlib
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.exr import Image
from airlight.validation.columns import plain
from airlight.validation.engine.fault import Number
from airlight.validation.engine.observation import Observation
from airlight.validation.engine.prediction import Guess, Predictor, SceneLight
from airlight.validation.fit.fit import fit_image
from airlight.validation.fit.solve import Model, interval_ends, robust_fit, weighted_fit
from airlight.validation.fit.unknowns import Unknown, read_unknowns
from airlight.validation.fog_model.radiance import scene_fog
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.models import model_of
from tests.helpers.scenes import scene_xml

SIZE = (48, 36)
TOOLS = Path(__file__).resolve().parents[3] / "docs/tools"


def scene_file(
    tmp_path, *, sigma_t="0.31", albedo="0.83", g="0.4", lights=1, position="0.7, 0.3, 1.9"
):
    lamps = [("lamp", position), ("side", "-1.1, 0.6, 0.4")][:lights]
    light = '<emitter type="point" id="{}"><point name="position" value="{}"/></emitter>'
    fog = f'<float name="sigma_t" value="{sigma_t}"/><float name="albedo" value="{albedo}"/>'
    fog += f'<phase type="hg"><float name="g" value="{g}"/></phase>'
    path = tmp_path / "own.xml"
    path.write_text(scene_xml(*(light.format(*lamp) for lamp in lamps), fog=fog, size=SIZE))
    return str(path)


def image_of(path):
    reference = reference_image(load_scene(path).scene)
    return Image(
        {
            "airlight": reference.airlight,
            "surface": reference.surface,
            "total": reference.airlight + reference.surface,
        }
    )


def predictor_of(reference, values):
    return Predictor(
        Observation(reference, values, "airlight", np.ones(len(values), bool)),
        SceneLight(reference),
    )


def fitted(image, scene, names, **how):
    return fit_image(image, load_scene(scene, SIZE), names, pixel="centre", **how)


@pytest.mark.claim("fit-exact")
@pytest.mark.parametrize(
    "start", [4.0, *(pytest.param(start, marks=pytest.mark.slow) for start in (0.02, 0.31))]
)
def test_another_fog_is_found_from_any_start(variant, tmp_path, start):
    foggier = image_of(scene_file(tmp_path, sigma_t="0.57", albedo="0.71", g="-0.2"))
    scene = scene_file(tmp_path)
    starts = {"sigma_t": start, "phase.g": 0.7}
    fit = fitted(foggier, scene, ["sigma_t", "albedo", "phase.g"], layer="airlight", starts=starts)
    wanted = (0.57, 0.71, -0.2)
    for parameter, value, known in zip(fit.parameters, wanted, (0.31, 0.83, 0.4), strict=True):
        assert parameter.value == pytest.approx(value, rel=1e-4)
        assert parameter.low < value < parameter.high
        assert parameter.scene == pytest.approx(known)
    assert fit.confounded == ()
    assert fit.residual < 1e-5
    assert fit.explained > 0.999999


@pytest.mark.slow
@pytest.mark.claim("fit-height-fog")
def test_heights_of_a_layer_are_found_in_an_image_by_other_code(variant, tmp_path):
    """NumPy makes the image: no code of it is the fog model's."""
    sys.path.insert(0, str(TOOLS))
    numpy_faults = importlib.import_module("numpy_faults")
    sys.path.remove(str(TOOLS))
    scene, wanted = (
        tmp_path / "scene.xml",
        replace(numpy_faults.LAYERED, layer=(0.2, 0.83), sigma_t=0.47),
    )
    scene.write_text(numpy_faults.scene_xml(numpy_faults.LAYERED))
    image = Image({"total": numpy_faults.rendered(wanted, area=False, noise=0.003, seed=3)})
    fit = fit_image(
        image, load_scene(str(scene), (64, 48)), ["sigma_1", "H_1", "albedo"], pixel="centre"
    )
    values = {each.name: each for each in fit.parameters}
    # 96 steps a ray and 16 parts of a path err by some 1e-3; the noise is
    # 3e-3 in each of 3072 pixels.
    assert values["sigma_1"].value == pytest.approx(0.47, rel=5e-3)
    assert values["H_1"].value == pytest.approx(0.83, rel=5e-3)
    assert fit.explained > 0.999
    # A layer has three numbers and is two: what its base does, its extinction does too.
    both = fit_image(image, load_scene(str(scene), (64, 48)), ["sigma_1", "z_1"], pixel="centre")
    assert both.confounded[0].parameters == ("sigma_1", "z_1")
    with pytest.raises(InputError, match="expected some of sigma_1, z_1, H_1, sigma_0, albedo"):
        fit_image(image, load_scene(str(scene), (64, 48)), ["sigma_t"], pixel="centre")


@pytest.mark.slow
def test_each_of_several_lights_has_a_factor(variant, tmp_path):
    scene = scene_file(tmp_path, lights=2)
    reference = read_reference(load_scene(scene).scene)
    pixels = SIZE[0] * SIZE[1]
    predictor = predictor_of(reference, np.ones((pixels, 3)))
    bright = predictor.predicted(Guess(replace(predictor.fog, intensity=(1.4, 0.3))))
    image = Image({"airlight": bright.reshape(SIZE[1], SIZE[0], 3)})
    fit = fitted(image, scene, ["intensity", "sigma_t"])
    values = {each.name: each.value for each in fit.parameters}
    assert values == pytest.approx(
        {"intensity:lamp": 1.4, "intensity:side": 0.3, "sigma_t": 0.31}, rel=1e-5
    )
    only = fitted(image, scene, ["intensity:side", "intensity:1"])
    assert [each.name for each in only.parameters] == ["intensity:side", "intensity:lamp"]


@pytest.mark.slow
def test_a_light_is_found_where_it_is_with_its_shadows(variant, tmp_path):
    image = image_of(scene_file(tmp_path, position="0.82, 0.17, 1.7"))
    fit = fitted(
        image, scene_file(tmp_path), ["light.x", "light.y", "light.z", "sigma_t"], layer="airlight"
    )
    values = [each.value for each in fit.parameters]
    assert values == pytest.approx([0.82, 0.17, 1.7, 0.31], rel=1e-3)


@pytest.mark.slow
@pytest.mark.claim("fit-confounded")
def test_albedo_and_intensity_are_not_told_apart_in_the_airlight_but_with_surfaces(
    variant, tmp_path
):
    scene = scene_file(tmp_path)
    image = image_of(scene)
    fit = fitted(image, scene, ["sigma_t", "albedo", "intensity", "exposure"], layer="airlight")
    (group,) = fit.confounded
    assert group.parameters == ("albedo", "intensity", "exposure")
    assert group.held == ("intensity", "exposure")
    ((name, (_, low, high)),) = group.products.items()
    assert name == "albedo * intensity * exposure"
    assert low < 0.83 < high
    assert "layer" in group.way_out
    by_name = {each.name: each for each in fit.parameters}
    assert by_name["albedo"].low is None
    assert by_name["sigma_t"].low is not None
    whole = fitted(image, scene, ["sigma_t", "albedo", "intensity"], layer="total")
    assert whole.confounded == ()
    assert [each.value for each in whole.parameters] == pytest.approx([0.31, 0.83, 1.0], rel=1e-3)


@pytest.mark.claim("fit-exact")
def test_an_albedo_that_no_medium_has_is_named(variant, tmp_path):
    """An image by another equation gave an albedo of 1.2 without a word, in text and JSON."""
    scene = scene_file(tmp_path, albedo="0.8")
    right = reference_image(load_scene(scene, (16, 12)).scene).airlight
    for factor, noise, doubted in ((1.5, 0.0, True), (1.24, 0.0, False), (1.27, 0.3, False)):
        image = right * (1 + noise * np.random.default_rng(1).normal(size=right.shape))
        image = Image({"airlight": factor * image})
        fit = fit_image(image, load_scene(scene, (16, 12)), ["albedo"], pixel="centre")
        assert bool(fit.doubts) is doubted, fit
        assert plain(fit)["doubts"] == list(fit.doubts)
        assert (
            any("albedo is above 1" in line and "--model" in line for line in fit.lines) is doubted
        )


@pytest.mark.slow
@pytest.mark.claim("fit-robust")
def test_pixels_that_disagree_are_left_out(variant, tmp_path):
    scene = scene_file(tmp_path, albedo="0.83")
    image = image_of(scene)
    spoiled = np.array(image.layers["airlight"])
    spoiled[:14, :20] = 7.0  # an object that the scene does not have: a sixth of the image
    spoiled[20, :10] = np.nan
    fit = fitted(
        Image({"airlight": spoiled}), scene, ["sigma_t", "albedo"], starts={"sigma_t": 1.0}
    )
    assert [each.value for each in fit.parameters] == pytest.approx([0.31, 0.83], rel=1e-4)
    # 7.0 is the largest value there is: those pixels count as cut off, and take no part at all.
    assert fit.left_out < 20
    spoiled[:14, :20] = 7.0 + np.random.default_rng(1).random((14, 20, 3))
    fit = fitted(Image({"airlight": spoiled}), scene, ["sigma_t", "albedo"])
    assert [each.value for each in fit.parameters] == pytest.approx([0.31, 0.83], rel=1e-4)
    assert fit.left_out >= 280
    mask = np.ones((SIZE[1], SIZE[0]))
    mask[:14, :20] = 0
    assert fitted(Image({"airlight": spoiled}), scene, ["sigma_t"], mask=mask).left_out < 20


@pytest.mark.statistical
@pytest.mark.claim("fit-coverage")
@pytest.mark.parametrize("noise", ["relative", "absolute", "skewed"])
def test_intervals_cover_the_reference_as_often_as_they_say(variant, tmp_path, noise):
    reference = read_reference(load_scene(scene_file(tmp_path), (32, 24)).scene)
    count, trials = 32 * 24, 200
    unknowns = read_unknowns(["sigma_t", "phase.g", "intensity"], reference, {})
    predictor = predictor_of(reference, np.zeros((count, 3)))
    clean = predictor.predicted(Guess(predictor.fog))
    generator = np.random.default_rng(5)
    wanted = Model.of(predictor, unknowns).at
    covered = np.zeros(len(unknowns))
    for _ in range(trials):
        noisy = {
            "relative": lambda: clean * (1 + 0.01 * generator.standard_normal((count, 1))),
            "absolute": lambda: (
                clean + 0.01 * clean.mean() * generator.standard_normal(clean.shape)
            ),
            "skewed": lambda: clean * generator.gamma(25.0, 0.04, (count, 1)),
        }[noise]()
        model = Model.of(
            Predictor(replace(predictor.observation, values=noisy), predictor.light), unknowns
        )
        solution = weighted_fit(model, robust_fit(model, wanted))
        low, high = interval_ends(model, solution).T
        covered += (low < wanted) & (wanted < high)
    # Of 200 trials 190 should cover; the binomial distribution with 0.95 gives fewer than 177 once
    # in 16 000, of which nine are looked at.
    assert (covered >= 177).all(), covered / trials


class _Known:
    """An image of white noise, and a model that is a function of the numbers that are looked for."""

    def __init__(self, noise, function):
        # Noise of the mean 0: the numbers to begin with explain the image best.
        self.function, noise = function, noise - noise.mean()
        self.image = function(1.0) + noise

    def shown(self, guess):
        return self.image

    def predicted(self, guess):
        return self.function(*guess.values)


@pytest.mark.parametrize("times", [0.5, 5.0, 20.0, 1e3, 1e6])
def test_an_end_that_noise_hides_is_found_far_away(times):
    """The end of 1 + p/1000 is where p - 1 is so many noises of the mean: a factor, not an ellipse.

    From twenty on, where the ellipse ends at e^20, it was 1.00004, and from 700 on no number.
    """
    generator = np.random.default_rng(3)
    noise = 1e-3 * times / 1.96 * np.sqrt(300) * generator.standard_normal((100, 3))
    number = Number(1e-300, 1e300, scale="log")
    unknown = Unknown("p", "p", lambda predictor, guess, p: replace(guess, values=p), (number,))
    predictor = _Known(noise, lambda p=1.0: np.full((100, 3), 1 + 1e-3 * p))
    model = Model(predictor, (unknown,), np.zeros(1), Guess(None))
    ((low, high),) = interval_ends(model, weighted_fit(model, model.at))
    # Noise of 300 values has another size by 12 % at most, and an end is found to 2 % of its errors.
    assert high == pytest.approx(np.log1p(times), abs=0.3)
    assert low < -0.3


@pytest.mark.parametrize(
    ("scene", "name"), [("sphere-spot", "light.x"), ("mist", "z_1"), ("mist", "sigma_1")]
)
def test_a_place_is_looked_for_in_lengths_of_the_scene(variant, scene, name):
    """Least errors, and where an ellipse is right, were in metres, at any size of the scene."""
    reference = read_reference(load_scene(scene, (8, 6)).scene)
    (number,) = (each.number for each in read_unknowns([name], reference, {}))
    (start,) = number.starts
    moved = number.outward(number.inward(start) + 1e-3)
    unit = start  # of a logarithm
    if name == "light.x":
        unit = np.linalg.norm(reference.lights[0].position - reference.origin)
    if name == "z_1":
        unit = scene_fog(reference).height.layers[0].scale_height
    assert moved - start == pytest.approx(1e-3 * unit, rel=1e-3)


@pytest.mark.parametrize("place", ["fog", "medium", "1"])
def test_a_medium_without_bounds_has_the_name_of_the_file_too(variant, tmp_path, place):
    reference = read_reference(load_scene(scene_file(tmp_path), (8, 6)).scene)
    (unknown,) = read_unknowns([f"sigma_t:{place}"], reference, {})
    assert unknown.scene == pytest.approx(0.31, rel=1e-6)


@pytest.mark.parametrize(
    ("names", "how", "words"),
    [
        ([], {}, "expected some of sigma_t"),
        (["sigma"], {}, "did you mean 'sigma_t'"),
        (["sigma_t"], {"starts": {"albedo": 0.5}}, "is not looked for"),
        (["H_1"], {}, "the scene has no height fog"),
        (["sigma_t"], {"starts": {"sigma_t": -1.0}}, "a number above 0"),
        (["sigma_t"], {"mask": np.ones((3, 4))}, "the mask is 4 x 3 pixels"),
    ],
)
def test_mistakes_have_one_line(variant, tmp_path, names, how, words):
    scene = scene_file(tmp_path)
    image = Image({"airlight": np.random.default_rng(1).random((36, 48, 3))})
    with pytest.raises(InputError, match=re.escape(words)):
        fit_image(image, load_scene(scene), names, **how)


@pytest.mark.claim("fit-exact")
@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("hdrp:range=3", ["sigma_t", "albedo", "phase.g"]),  # g of Cornette and Shanks's function
        ("light-path=off,lit=0.5", ["sigma_t", "intensity", "phase.g"]),  # not linear in the light
    ],
)
def test_the_fog_of_an_engines_equation_is_found(variant, tmp_path, words, names):
    """A file that names its equation is fitted by it, and the fit says so."""
    model = model_of(words)
    foggier = load_scene(scene_file(tmp_path, sigma_t="0.57", albedo="0.71", g="-0.2"), (24, 18))
    image = Image({"airlight": reference_image(foggier.scene, model=model).airlight})
    named = f'<default name="airlight-model" value="{words}"/>'
    path = Path(scene_file(tmp_path))
    path.write_text(re.sub("(<scene[^>]*>)", rf"\1{named}", path.read_text(), count=1))
    fit = fit_image(image, load_scene(str(path), (24, 18)), names, pixel="centre")
    known = {"sigma_t": 0.57, "albedo": 0.71, "phase.g": -0.2, "intensity": 1.0}
    for parameter in fit.parameters:
        assert parameter.value == pytest.approx(known[parameter.name], rel=1e-4)
        assert parameter.low < known[parameter.name] < parameter.high
    assert fit.model == {"name": model.name, "terms": model.terms}
    assert fit.lines[0].startswith("model  ")


@pytest.mark.parametrize(
    ("terms", "name", "said"),
    [
        ("phase=hg:0.3", "phase.g", "the model has phase=hg:0.3; leave one of them out"),
        ("lit=0.01", "albedo", "'albedo' is no part of the model, which has a lit density"),
    ],
)
def test_numbers_that_an_equation_does_not_have_are_refused(variant, tmp_path, terms, name, said):
    loaded = load_scene(scene_file(tmp_path))
    with pytest.raises(InputError, match=re.escape(said)):
        read_unknowns([name], read_reference(loaded.scene), {}, model_of(terms))
