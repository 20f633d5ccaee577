# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a word names an equation: of an engine with its parameters, or by terms, or in a file."""

import math
import re
from dataclasses import fields, replace
from itertools import combinations

import mitsuba as mi
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.reference import ReferenceInputs
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.storage.scene_digest import scene_digest
from airlight.reference.storage.store import Content
from airlight.validation.scenes.engine_fog import ENGINES
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.models import (
    PRESETS,
    TERMS,
    Preset,
    model_line,
    model_of,
    model_parts,
    model_words,
    preset_of_fog,
)

pytestmark = pytest.mark.claim("model-words")

#: the parameters that must be given
GIVEN = {
    "bevy": "bounding_radius=7",
    "unreal": "froxel=0.3",
    "flax": "cell=0.4",
    "filament": "color=1,2,3",
}
BESIDE = {"phase": "none", "fade": "2:5", "lit": "1", "lamps": "2", "suns": "0"}
BESIDE["light-path"] = "length:3"
SCENE = """<scene version="3.0.0">{}
<sensor type="perspective"><float name="fov" value="41.7"/><ref id="fog" name="medium"/>
<film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/></film></sensor>
<medium type="{}" id="fog">{}<float name="albedo" value="0.83"/></medium>
<emitter type="point"><point name="position" value="0.7, 0.3, 1.9"/></emitter></scene>"""
FOG = ("homogeneous", '<float name="sigma_t" value="0.23"/>')
NAMED = '<default name="airlight-model" value="{}"/>'


def of(name: str, *more: str) -> Model:
    words = ",".join(filter(None, (GIVEN.get(name), *more)))
    return model_of(f"{name}:{words}" if words else name)


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_every_preset_is_a_model_and_says_what_was_read(preset: Preset):
    model = of(preset.key)
    assert model.name == f"{preset.key} {preset.version}"
    assert model.is_physical == (preset.key == "diligent")
    assert all((preset.title, preset.read, preset.unchecked))
    # A parameter decides something, and what stands in braces is one.
    inside = re.findall(r"\{([^{}]*)\}", " ".join(preset.words.values()))
    used = {word for words in inside for word in words.split("*")}
    names = {each.name for each in preset.parameters}
    assert names == {
        word for word in used if word != "pi" and not word.replace(".", "").isdecimal()
    }
    assert all(each.what for each in preset.parameters)
    needed = [each.name for each in preset.parameters if not each.default]
    assert needed == ([GIVEN[preset.key].partition("=")[0]] if preset.key in GIVEN else [])
    for name in needed:
        with pytest.raises(InputError, match=rf"needs {name}, .*; expected {preset.key}:{name}="):
            model_of(preset.key)


def test_presets_differ_and_mean_the_height_fog_of_engines():
    models = [replace(of(key), name="") for key in PRESETS]
    assert all(one != other for one, other in combinations(models, 2))
    named = {engine for each in PRESETS.values() for engine in each.fog_engines}
    assert named == {"playcanvas", "hdrp", "unreal-volumetric", "flax-volumetric"} < set(ENGINES)
    assert preset_of_fog("hdrp") is PRESETS["hdrp"]
    assert preset_of_fog("unreal") is preset_of_fog("") is None


@pytest.mark.parametrize(
    ("words", "terms"),
    [
        ("physical", {}),
        ("physical:law=sphere:0.2", {"law": "sphere:0.2"}),
        ("light-path=off,law=softened:1:16", {"light_path": "off", "law": "softened:1:16"}),
        # A piece without '=' belongs to the value before it.
        ("ambient=1,2,3,light-path=0.5", {"ambient": "1,2,3", "light_path": "0.5"}),
    ],
)
def test_terms_alone_have_no_name(words, terms):
    assert model_of(words) == Model(**terms)


@pytest.mark.parametrize(
    ("words", "terms"),
    [
        ("playcanvas:extinction=0.5,range=8", {"camera_path": "0.5", "range": "quartic:8"}),
        ("playcanvas:range=none", {"range": "none"}),
        ("playcanvas:range=inf", {"range": "none"}),
        ("playcanvas:ambientIntensity=1,2,3", {"ambient": "1,2,3"}),
        ("three", {"range": "none"}),
        ("three:distance=7", {"range": "quartic:7"}),
        ("babylon:enableExtinction=true", {"camera_path": "on"}),
        ("godot:attenuation=2,ambient=0.1", {"law": "power:2", "ambient": "0.1"}),
        ("bevy:bounding_radius=3", {"light_path": "length:3"}),
        (
            "eevee:use_volumetric_shadows=1,shadow_soft_size=0",
            {"light_path": "on", "law": "power:2"},
        ),
        ("hdrp:height_fog=0", {"light_path": "off"}),
        (
            "unreal:froxel=0.3,InverseSquaredLightDistanceBiasScale=2",
            {"law": "softened:0.36", "surface_law": "softened:1e-4"},
        ),
        ("filament:color=2", {"source": "constant:2", "lobe": "none"}),
        ("filament:color=1,2,3,inScatteringSize=8,inScatteringStart=3", {"lobe": "8:3"}),
        ("flax:cell=0.4,VolumetricFogDistance=90", {"law": "softened:0.16", "fade": "72:88.59375"}),
        ("o3de:FogDensityClamp=0.7", {"cap": "0.7", "source": "constant:0.45,0.45,0.6"}),
    ],
)
def test_parameters_of_engines_decide_terms(words, terms):
    model, engine = model_of(words), of(words.partition(":")[0])
    assert model.name == engine.name
    assert model == replace(model, **terms)
    # and no others
    told = {*(word for word in terms), "name", "ends", "light_path"}
    rest = [each.name for each in fields(Model) if each.name not in told]
    assert all(getattr(model, name) == getattr(engine, name) for name in rest)


def test_the_fade_of_flax_has_the_weights_of_its_slices():
    """The engine weighs slice i of N, which begins half a slice before i D/N."""
    fade, slices = model_of("flax:cell=0.4,VolumetricFogDistance=90").fade_of, 64
    assert fade is not None
    full, none = fade
    for i in range(slices):
        depth = i * 90 / slices
        weight = (slices - 1 - i) / (0.2 * slices - 1)
        assert (none - depth) / (none - full) == pytest.approx(weight, rel=1e-12, abs=1e-12)


def test_terms_after_a_preset_override_it_and_change_its_name():
    model = model_of("playcanvas:extinction=0.5,law=power:2,range=linear:9")
    assert (model.law, model.range, model.camera_path) == ("power:2", "linear:9", "0.5")
    assert model.name == "playcanvas 2.23.3 with law=power:2,range=linear:9"
    assert model_of("playcanvas,range=quartic:8").range == "quartic:8"
    assert float(model_of("playcanvas").surface_factor) == math.pi


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("", "expected one word without spaces"),
        ("play canvas", "expected one word without spaces"),
        ("playcanva", "did you mean 'playcanvas'.*one of physical, playcanvas"),
        (":range=8", "no model is called ''"),
        ("law", "law is a term.*expected law=VALUE"),
        ("playcanvas:", "expected playcanvas, or playcanvas:NAME=VALUE"),
        ("playcanvas:0.5", "got '0.5', expected NAME=VALUE"),
        ("playcanvas:extincton=1", "did you mean 'extinction'.*extinction, range, maxDistance"),
        ("playcanvas:extinction=", "expected NAME=VALUE"),
        ("playcanvas:extinction=much", "extinction is 'much'; expected a number from 0 on"),
        ("playcanvas:extinction=nan", "extinction is 'nan'; expected a number from 0 on"),
        ("playcanvas:extinction=-1", "extinction is '-1'; expected a number from 0 on"),
        ("playcanvas:ambientIntensity=1,2", "expected a number from 0 on, R,G,B"),
        ("playcanvas:range=8,range=9", "range is given twice"),
        ("lawn=power:2", "did you mean 'law'"),
        ("law=powder:2", "law is 'powder:2'; expected power:d"),
        ("=3", "got '=3', expected NAME=VALUE"),
        ("three:decay=inf", "law is 'clamped:0.1:inf'"),
        # Terms of the light of lamps and suns in fog, which a constant source has not.
        *(
            (f"o3de:{term}={value}", f"{term} is '{value}'; expected .* beside a constant source")
            for term, value in BESIDE.items()
        ),
    ],
)
def test_other_words_are_refused_in_one_line(words, expected):
    with pytest.raises(InputError, match=f"^model: .*{expected}") as refused:
        model_of(words)
    assert "\n" not in str(refused.value)


def test_equal_models_have_equal_keys():
    def key(words: str) -> str | None:
        return ReferenceInputs(Content("a"), model=model_of(words)).key

    same = ["three", "three:decay=2", "three,suns=0", model_of("three").terms]
    assert len({key(words) for words in same}) == 1
    assert key("diligent") == key("physical") == ReferenceInputs(Content("a")).key
    others = [
        *(f"{key}:{words}" for key, words in GIVEN.items()),
        "playcanvas",
        "physical",
        "three",
    ]
    assert len({key(words) for words in others}) == len(others)


@pytest.mark.parametrize("words", ["playcanvas:extinction=0.5", "law=sphere:1,ambient=1,2,3"])
def test_what_results_say_of_a_model_names_it_again(words):
    model = model_of(words)
    assert model_parts(model_words(model)) == {"name": model.name, "terms": model.terms}
    assert replace(model, name="") == model_of(model.terms)
    assert model_words(PHYSICAL) == "physical"
    said = model_line(model.name, model.terms)
    assert said.startswith(f"model  {model.name}: " if model.name else "model  law=sphere:1, amb")
    assert "1, 2" not in said


@pytest.fixture
def load(variant, tmp_path):
    """Write a file with these words before its parts, and load it."""

    def loaded(words: str = "", medium: tuple[str, str] = FOG):
        path = tmp_path / "own.xml"
        path.write_text(SCENE.format(words, *medium))
        mi.load_file(str(path))  # is valid for Mitsuba
        return load_scene(str(path))

    return loaded


def test_a_file_names_a_model_by_a_default(load):
    plain, named = load(), load(NAMED.format("playcanvas:extinction=0.5"))
    assert (plain.model, named.model) == (PHYSICAL, model_of("playcanvas:extinction=0.5"))
    # It is a fact about the renderer, and none about the scene.
    assert scene_digest(plain.scene) == scene_digest(named.scene)
    # Mitsuba keeps the first of two defaults.
    both = NAMED.format("godot") + NAMED.format("three")
    assert load(both).model == model_of("godot")
    assert load('<default name="spp" value="3"/>').model is PHYSICAL
    with pytest.raises(InputError, match=r"^scene .*own\.xml: model: .*did you mean 'godot'"):
        load(NAMED.format("godt"))


def test_a_file_says_whose_height_fog_it_has(load):
    numbers = {"density": 0.1, "heightFalloff": 0.6}
    given = "".join(f'<float name="{name}" value="{value}"/>' for name, value in numbers.items())
    box = '<transform name="to_world"><scale x="99" y="99" z="60"/></transform>'
    volume = f'<volume type="heightfog" name="sigma_t"><string name="engine" value="playcanvas"/>{given}{box}'
    fog = load(medium=("heterogeneous", f"{volume}</volume>"))
    assert (fog.fog_engine, load().fog_engine) == ("playcanvas", "")


def test_the_terms_are_those_of_models():
    assert len(TERMS) == len(fields(Model)) - 1
    assert model_of(",".join(f"{term}={_word(term)}" for term in TERMS)) == PHYSICAL


def _word(term: str) -> str:
    name = term.replace("surface.", "surface_").replace("-", "_")
    return str(getattr(PHYSICAL, name))
