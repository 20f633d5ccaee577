# SPDX-License-Identifier: BSD-3-Clause
"""Claim: an image of an engine's own equation is called that, and what is wrong beside it is named
on top of it; no image of a fault alone is called an engine's equation.

The images are marched in NumPy (`tests.helpers.model_march`), which shares neither the lit intervals
nor the sums of the hypotheses.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.exr import Image, write_exr
from airlight.validation.engine import stages
from airlight.validation.engine.decide import LEAST_EVIDENCE, Candidates
from airlight.validation.engine.diagnose import (
    _alike,
    _concluded,
    diagnose_file,
    diagnose_image,
)
from airlight.validation.engine.equations import (
    asked_words,
    equation_sentence,
    faults_of_terms,
    model_sentence,
    terms_that_matter,
)
from airlight.validation.engine.fault import Fault, Number
from airlight.validation.engine.faults import FAULTS
from airlight.validation.engine.observation import judged_layer, observation_of
from airlight.validation.engine.prediction import Guess, Predictor, SceneLight
from airlight.validation.engine.search import Explanation
from airlight.validation.fog_model.equation import fog_of_model
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.models import PRESETS, model_of
from tests.helpers.diagnoses import diagnosis
from tests.helpers.model_images import model_image

EQUATIONS = [fault for fault in FAULTS if fault.equation]


def of_medium(reference, **changed):
    return replace(reference, medium=replace(reference.medium, **changed))


#: Images with one thing wrong, by its name; functions of a scene and of steps.
WRONG = {
    "right": lambda own, steps: model_image(own, steps).sum(axis=0),
    "factor": lambda own, steps: 1.7 * model_image(own, steps).sum(axis=0),
    "extinction": lambda own, steps: model_image(
        of_medium(own, sigma_t=1.4 * own.medium.sigma_t), steps
    ).sum(axis=0),
    "no-shadow": lambda own, steps: model_image(own, steps, shadows=False).sum(axis=0),
}


class Setting:
    """A scene at a size, and what all diagnoses of its images share."""

    def __init__(self, scene, size):
        self.loaded = load_scene(scene, size)
        self.size = size
        self.light = SceneLight(read_reference(self.loaded.scene))
        self.physical = quadrature_image(self.light.reference, checks=1)

    def diagnosed(self, words, wrong="right", *, given=False, steps=256, noise=0.01):
        """Return the diagnosis of an image of an equation, with something wrong beside it; `given`:
        whether the equation is asked for.
        """
        model = model_of(words)
        own = read_reference(self.loaded.scene, model)
        values = WRONG[wrong](own, steps)
        scatter = np.random.default_rng(7).standard_normal((*values.shape[:2], 1))
        reference = quadrature_image(own, checks=1) if given else self.physical
        return diagnose_image(
            Image({"total": values * (1 + noise * scatter)}),
            replace(self.loaded, model=model) if given else self.loaded,
            layer="total",
            pixel="centre",
            light=SceneLight(own) if given else self.light,
            reference_of=lambda pixel: reference,
        )


@pytest.fixture(scope="module")
def settings(variant):
    known = {}

    def setting(scene):
        if scene not in known:
            # Height fog costs more.
            small = scene in ("street", "meadow", "valley")
            known[scene] = Setting(scene, (32, 24) if small else (48, 36))
        return known[scene]

    return setting


@pytest.mark.parametrize(
    ("words", "numbers"),
    [
        ("playcanvas:range=8,extinction=0.6", (8.0, 0.6)),
        pytest.param("o3de", (0.45, 0.45, 0.6), marks=pytest.mark.slow),
    ],
)
def test_an_equation_is_named_with_its_numbers(variant, words, numbers):
    diagnosis = Setting("sphere-spot", (32, 24)).diagnosed(words)
    assert diagnosis.first == words.partition(":")[0], [row.words for row in diagnosis.ranked]
    assert diagnosis.ranked[0].parameters == pytest.approx(numbers, rel=0.02)
    assert diagnosis.explained
    assert not diagnosis.model


def test_a_fault_is_named_on_top_of_an_equation(variant):
    setting = Setting("sphere-spot", (32, 24))
    said = setting.diagnosed("playcanvas:range=8", "factor", given=True)
    assert said.first == "factor"
    assert said.ranked[0].parameters == pytest.approx((1.7,), rel=0.01)
    assert "in the equation of playcanvas" in said.lines[0]
    right = setting.diagnosed("playcanvas:range=8", given=True, steps=1024, noise=0.002)
    assert right.first == "right"


def test_a_file_is_diagnosed_in_the_equation_that_is_asked_for(variant, tmp_path):
    model, scene = model_of("unreal:froxel=0.4"), load_scene("sphere-spot", (24, 18)).scene
    image = quadrature_image(read_reference(scene, model), checks=1)
    path = tmp_path / "image.exr"
    write_exr(path, Image({"airlight": image.airlight}, attributes={"airlight:pixel": "centre"}))
    (said,) = diagnose_file(path, "sphere-spot", model=model)
    assert (said.first, said.model) == ("right", model.name)


def test_surfaces_have_the_equation_that_the_fog_tells(variant, tmp_path):
    """Alone they do not tell whose equation it is: many engines have the same on surfaces."""
    model, scene = model_of("playcanvas:range=7"), load_scene("sphere-spot", (24, 18)).scene
    image = quadrature_image(read_reference(scene, model), checks=1)
    layers = {"airlight": image.airlight, "surface": image.surface}
    path = tmp_path / "image.exr"
    write_exr(path, Image(layers, attributes={"airlight:pixel": "centre"}))
    fog, surface = diagnose_file(path, "sphere-spot")
    assert (fog.first, fog.solves) == ("playcanvas", "playcanvas:range=7,extinction=1")
    assert "--model playcanvas:range=7,extinction=1" in "\n".join(fog.lines)
    assert (surface.first, surface.model) == ("right", model.name)


#: Scenes with lamps and suns, and the equations that differ from physics in them. On open-fog no ray
#: ends, and all fogs of one colour are alike.
LAMPS = (
    "playcanvas:range=13,extinction=0.6",
    "three:distance=40",
    "godot:range=11",
    "bevy:range=30,bounding_radius=9",
    "eevee:cutoff_distance=11,shadow_soft_size=0.3",
    "hdrp",
    "unreal:froxel=0.4",
    "flax:cell=0.5",
)
COLOURS = ("filament:color=0.2,0.3,0.4", "o3de")
NAMED = [
    *(("open-fog", words) for words in LAMPS),
    *(("sphere-spot", words) for words in (*LAMPS, *COLOURS)),
    *(("street", words) for words in (*LAMPS, *COLOURS)),
    *(("meadow", words) for words in ("babylon", "playcanvas:extinction=0.6", "godot", *COLOURS)),
    *(("meadow", words) for words in ("hdrp", "unreal:froxel=1", "flax:cell=1")),
    ("valley", "babylon"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "words"), NAMED)
def test_each_equation_is_named_first(settings, scene, words):
    diagnosis = settings(scene).diagnosed(words, noise=0.005)
    assert diagnosis.first == words.partition(":")[0], [row.words for row in diagnosis.ranked]
    assert not diagnosis.ranked[0].together
    # Noise, and the steps of the march at the edges of shadows, which neighbours share.
    assert diagnosis.left < 0.1 * diagnosis.residual


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["open-fog", "sphere-spot", "meadow"])
def test_an_equation_that_is_physics_is_right(settings, scene):
    assert settings(scene).diagnosed("diligent").first == "right"


@pytest.mark.slow
def test_an_equation_of_one_term_is_that_fault(settings):
    """Babylon with its extinction differs from physics by the light path alone."""
    assert settings("meadow").diagnosed("babylon:enableExtinction=1").first == "light-path"


#: In three.js, where nothing is attenuated, another extinction is another brightness of the fog.
ALIKE = {("three:distance=40", "extinction"): "fog-factor"}


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["factor", "extinction", "no-shadow"])
@pytest.mark.parametrize("words", [*LAMPS, *COLOURS])
def test_one_fault_beside_an_equation_that_is_asked_for_is_named(settings, words, wrong):
    diagnosis = settings("sphere-spot").diagnosed(words, wrong, given=True)
    assert diagnosis.first == ALIKE.get((words, wrong), wrong)
    assert diagnosis.explained


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["factor", "extinction", "no-shadow"])
def test_one_fault_beside_an_equation_is_named_with_it(settings, wrong):
    diagnosis = settings("sphere-spot").diagnosed("playcanvas:range=8,extinction=0.6", wrong)
    assert set(diagnosis.ranked[0].together) == {"playcanvas", wrong}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("light-path=off,law=clamped:1.9", {"light-path", "distance-law"}),
        ("light-path=off,law=power:1", {"light-path", "distance-law"}),
        ("light-path=off,range=cut:2.9", {"light-path", "light-range"}),
    ],
)
def test_law_and_light_path_are_a_pair(settings, words, names):
    """Both are near the light; an equation of no engine has them alone."""
    diagnosis = settings("sphere-spot").diagnosed(words)
    assert set(diagnosis.ranked[0].together) == names


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("light-path=length:5", "light-path"),
        ("law=clamped:1.9", "distance-law"),
        ("source=constant:0.1,0.2,0.3", "filament"),
        ("lit=0.5", "lit-density"),
    ],
)
def test_single_terms_have_names_of_their_own(settings, words, name):
    assert settings("sphere-spot").diagnosed(words, steps=512).first == name


# The parts, by hand.


def test_every_engine_has_a_hypothesis_but_physics():
    assert {fault.name for fault in EQUATIONS} == set(PRESETS) - {"diligent"}
    assert all(fault.kind == "model" and fault.rank < 0 for fault in EQUATIONS)
    assert all("physics" in fault.needs for fault in EQUATIONS)


@pytest.mark.parametrize("fault", EQUATIONS, ids=lambda fault: fault.equation)
def test_each_hypothesis_says_its_terms(fault):
    values = tuple(1.5 + number for number in range(len(fault.parameters)))
    said = fault.sentence(values)
    preset = PRESETS[fault.name]
    assert said.startswith(f"this is the equation of {preset.title} {preset.version}: ")
    assert "{" not in said
    # The words that a user types to look for faults on top of it.
    asked = model_of(asked_words(fault.equation, values))
    # One with other terms of its own says so in its name.
    assert asked.name.partition(" with ")[0] == preset.name


def test_terms_in_words():
    model = Model(
        light_path="off",
        camera_path="0.5",
        law="clamped:0.1",
        range="cut:7",
        depth="axis",
        source="constant:0.1,0.2,0.3",
        cap="0.5",
        surface_light_path="on",
        surface_law="power:1",
    )
    assert model_sentence(model) == (
        "the way from the light is not attenuated, the way to the camera counts 0.5 times, "
        "light falls as 1/r^2, and no more within 0.1 m, lamps end at 7 m, depth along the axis of "
        "the camera stands for distance, the fog has the colour (0.1, 0.2, 0.3) W/(m^2 sr), "
        "whatever the lights, it covers 0.5 at most, the way from the light to surfaces is "
        "attenuated, on surfaces light falls as 1/r^1"
    )
    assert model_sentence(replace(model, cap="1")).count("covers") == 0
    length = Model(light_path="length:4")
    assert model_sentence(length) == "the fog counts 4 m for the way from the light"
    assert model_sentence(PHYSICAL) == "it is the physical one"
    words, values = "playcanvas:range={0},extinction={1}", (7.99996, 1.00001)
    assert asked_words(words, values) == "playcanvas:range=8,extinction=1"
    # Found numbers are told to four digits, and what is 1 to these is no term.
    assert "R = 8 m" in equation_sentence(words)(values)
    assert "camera counts" not in equation_sentence(words)(values)


@pytest.fixture(scope="module")
def predictor(variant):
    loaded = load_scene("sphere-spot", (24, 18))
    image = Image({"total": np.ones((18, 24, 3))})
    observation, _ = observation_of(image, judged_layer(image, "", holds="total"), loaded.scene)
    return Predictor(observation, SceneLight(observation.reference))


def test_a_term_matters_if_it_changes_the_image_alone(predictor):
    def terms(words, *values):
        return terms_that_matter(predictor, words, values, 0.01)

    # The scene has a hard spot, a lamp five metres from the surfaces, and no sun.
    assert terms("unreal:froxel={0},AttenuationRadius={1}", 1e-3, 1e6) == ("light-path",)
    assert terms("unreal:froxel={0},AttenuationRadius={1}", 1.0, 9.0) == (
        "light-path",
        "law",
        "range",
    )
    assert terms("flax:cell=0.001,Radius=1e6,suns=1,surface.law=power:2") == ("light-path", "fade")


def test_an_equation_whose_terms_do_not_matter_is_not_tried(predictor, monkeypatch):
    fault = Fault("unreal", "words", None, equation="unreal:froxel=0.001,AttenuationRadius=1e6")
    plain = replace(fault, name="plain", equation="")
    guess, errors = predictor.unchanged, np.full((1, 3), 0.1)
    found = [Explanation((each,), ((),), guess, errors, errors > 0, 0.1) for each in (fault, plain)]
    by_name = {each.names[0]: each for each in found}
    monkeypatch.setattr(stages, "explain", lambda predictor, faults, fine: by_name[faults[0].name])
    monkeypatch.setattr(stages, "_refined", lambda attempt, explanations: explanations)
    right = replace(found[0], faults=(), values=(), error=1.0)
    attempt = stages.Attempt(predictor, (fault, plain), Candidates("centre", None, right))
    assert [each.names for each in attempt.after("quick", None).candidates.tried] == [("plain",)]
    # One that leaves most of the error is never named: its terms cost nothing.
    by_name["unreal"] = replace(found[0], error=0.9)
    assert len(attempt.after("quick", None).candidates.tried) == 2


def test_of_what_leaves_the_same_an_equation_is_named_before_and_lit_density_after_a_fault():
    blocks = SimpleNamespace(is_noise=lambda explanation: True, area=lambda errors, lit: 1.0)
    errors, lit = np.full((64, 3), 1e-3), np.ones((64, 3), bool)

    def explained(rank, error=1e-3):
        fault = Fault(f"rank {rank}", "words", None, rank=rank)
        return Explanation((fault,), ((),), Guess(None), errors, lit, error)

    right = Explanation((), (), Guess(None), 100 * errors, lit, 0.1)
    tried = tuple(explained(rank) for rank in (1, 0, -1))
    for count, first in ((1, "rank 1"), (2, "rank 0"), (3, "rank -1")):
        assert Candidates("centre", blocks, right, tried[:count]).chosen.names == (first,)


def explained(error, numbers=(), *, equation="", faults=1, name="fault"):
    """Return an explanation that leaves an error, with as many numbers to each fault."""
    errors = np.full((1024, 3), error)
    each = tuple(
        Fault(
            f"{name} {count}", "words", None, (Number(0.0, 1.0),) * len(numbers), equation=equation
        )
        for count in range(faults)
    )
    lit = np.ones((1024, 3), bool)
    return Explanation(each, (tuple(numbers),) * faults, Guess(None), errors, lit, error)


def candidates_of(right, tried, *, noise=False):
    """Return candidates whose rest is noise or not."""
    blocks = SimpleNamespace(is_noise=lambda explanation: noise, area=lambda errors, lit: 1.0)
    return Candidates("centre", blocks, replace(right, faults=(), values=()), tuple(tried))


def test_numbers_that_take_away_a_little_of_an_unknown_rest_are_not_worth_it():
    """EEVEE's colonnade: a fault without a number leaves 4.2 of 15 %, one of two numbers 3.8 %."""
    right, plain = explained(0.15), explained(0.042, name="plain")
    two = explained(0.037, (0.5, 0.5), name="two")
    assert candidates_of(right, (two, plain)).chosen is plain
    # More than a tenth of the rest for each number is worth it, and so is any of noise alone.
    much = explained(0.03, (0.5, 0.5), name="much")
    assert candidates_of(right, (much, plain)).chosen is much
    assert candidates_of(right, (two, plain), noise=True).chosen is two
    # A fault that takes little away is none, however few its numbers.
    little, best = explained(0.108, name="little"), explained(0.1, (0.5,), name="best")
    assert candidates_of(right, (best, little)).chosen is best


def test_a_fault_that_is_nearly_the_image_is_chosen_by_evidence_where_errors_are_noise():
    """Cycles at 1.05 times the exposure in fog of 0.25/m: without its first 0.2 m the fog makes
    nearly that image with no number to find, and leaves 3 % more of the noise.
    """
    noise = np.random.default_rng(1).normal(0, 0.0075, (1024, 1)).repeat(3, axis=1)
    nearly = noise + 0.001 * np.linspace(-1, 3, 1024)[:, None]
    right = replace(explained(0.026), errors=noise + 0.026)
    factor, plane = (
        replace(explained(float(np.abs(errors).mean()), numbers, name=name), errors=errors)
        for errors, numbers, name in ((noise, (1.05,), "factor"), (nearly, (), "near-plane"))
    )
    assert candidates_of(right, (plane, factor), noise=True).chosen is factor
    # Errors that are none hide such a difference: the simpler fault is chosen.
    assert candidates_of(right, (plane, factor)).chosen is plane


@pytest.mark.parametrize("stops", [True, False])
def test_values_that_stop_are_named_in_however_few_pixels(monkeypatch, stops):
    """Cycles' open-fog, cut off at 1 beside the lamp, in 469 of 19 200 pixels."""
    cut = replace(explained(0.0), faults=(Fault("clamp", "the values are cut off", None),))
    tried = candidates_of(explained(5e-5), (cut,), noise=True)
    assert 0 < tried.evidence(cut) < LEAST_EVIDENCE
    attempt = SimpleNamespace(candidates=tried, predictor=None)
    verdict = SimpleNamespace(noise_alone=False)
    hints = SimpleNamespace(stops=stops)
    compared = SimpleNamespace(hints=hints, verdict=verdict)
    monkeypatch.setattr("airlight.validation.engine.diagnose.place_words", lambda *_: "")
    begun = diagnosis(first="right", pixel="area", residual=5e-5, left=5e-5)
    said = _concluded(begun, attempt, compared, "")
    assert (said.first, said.explained) == (("clamp", True) if stops else ("unexplained", False))


def test_a_pair_of_as_few_numbers_needs_no_more_than_evidence():
    """A rest that no fault makes hides how much better two faults are than another one of two
    numbers.
    """
    right, single = explained(0.15), explained(0.005, (0.5, 0.5), name="single")
    pair = explained(0.0035, (0.5,), faults=2, name="pair")
    assert candidates_of(right, (single, pair)).chosen is pair
    more = explained(0.0035, (0.5, 0.5, 0.5), faults=2, name="more")
    assert candidates_of(right, (single, more)).chosen is single


def test_equations_that_make_the_same_image_are_all_told():
    right = explained(0.3)
    own = explained(0.002, (0.5,), equation="playcanvas:range={0}", name="playcanvas")
    other = explained(0.002, (8.0, 1.0), equation="unreal:AttenuationRadius={0},froxel={1}")
    far = explained(0.05, (0.5, 2.0), equation="eevee:cutoff_distance={0},shadow_soft_size={1}")
    told = _alike(candidates_of(right, (own, other, far)), own)
    assert told == ("unreal:AttenuationRadius=8,froxel=1",)


def test_the_same_image_of_another_engine_is_told_with_its_equation(variant):
    """With a sixteenth of the intensity the fog of PlayCanvas is that of Unreal with cells of a
    metre; surfaces are not.
    """
    loaded = load_scene("sphere-spot", (32, 24))
    own = read_reference(loaded.scene, model_of("playcanvas:range=9,law=softened:1"))
    scatter = 1 + 0.01 * np.random.default_rng(7).standard_normal((24, 32, 1))
    layers = {"airlight": model_image(own, 256)[0] * scatter}
    said = diagnose_image(Image(layers), loaded, layer="airlight", pixel="centre")
    assert said.first == "playcanvas", [row.words for row in said.ranked]
    assert said.ranked[0].parameters == pytest.approx((9.0,), rel=0.02)
    assert said.solves.startswith("playcanvas:range=")
    assert said.solves.endswith(",law=softened:1,surface.factor=1")
    (other,) = said.alike
    assert other.startswith("unreal:")
    assert f"Unreal, volumetric fog 5.4 (--model {other})" in "\n".join(said.lines)


def test_media_stay_those_of_the_scene_in_an_equation_with_another_phase_function(variant):
    """A model of the physical equation has the scene's own phase function and albedo."""
    loaded = load_scene("sphere-spot", (24, 18))
    image = Image({"total": np.ones((18, 24, 3))})
    physical = fog_of_model(read_reference(loaded.scene), PHYSICAL)
    for words in ("three", "hdrp"):
        model = model_of(words)
        observation, _ = observation_of(
            image, judged_layer(image, "", holds="total"), loaded.scene, model=model
        )
        asked = Predictor(observation, SceneLight(observation.reference))
        assert asked.fog == fog_of_model(read_reference(loaded.scene, model), model)
        (back,) = (each for each in faults_of_terms(model) if each.name == "physical")
        assert back.change(asked, asked.unchanged, ()).fog == physical


def test_terms_of_an_equation_that_is_asked_for_may_be_physical(predictor):
    model = Model(light_path="off", law="softened:1:16", source="constant:1,1,1", cap="0.5")
    faults = {fault.name: fault for fault in faults_of_terms(model)}
    assert list(faults) == ["physical", "light-path", "law", "source"]
    assert "law=softened:1:16" in faults["law"].words
    base = Guess(None)
    assert faults["physical"].change(predictor, base, ()).fog == predictor.unchanged.fog
    fog = faults["light-path"].change(predictor, base, ()).fog
    assert (fog.light_segment, fog.most) == ((1.0, 1.0), 0.5)
    assert faults["source"].change(predictor, base, ()).fog.constant is None
    # A single term is physical if all are.
    assert [fault.name for fault in faults_of_terms(Model(light_path="off"))] == ["physical"]
