# SPDX-License-Identifier: BSD-3-Clause
"""Claim: faults of single lights and classes of lights are said of those; faults that a
scene cannot have are not.
"""

from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.height_fog import HeightFog
from airlight.analytic.phase import HenyeyGreenstein, Isotropic, Rayleigh
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import read_reference
from airlight.validation.engine import faults, stages
from airlight.validation.engine.decide import Candidates
from airlight.validation.engine.fault import Fault, Number
from airlight.validation.engine.faults import FAULTS, faults_of
from airlight.validation.engine.stages import PAIRS, STAGES, Attempt, differ, in_order
from airlight.validation.engine.starts import STARTS
from airlight.validation.engine.targets import GUESSES
from airlight.validation.engine.traits import traits
from airlight.validation.engine.transforms import (
    LAWS,
    LAYERS,
    LOBES,
    MIXES,
    OPTICS,
    PHASES,
    TURNS,
    VALUES,
    WINDOWS,
)
from airlight.validation.fog_model.radiance import Fog
from tests.helpers.scenes import bounded_medium, spot, tiny_scene


def of_physics(scene):
    return SimpleNamespace(reference=scene, observation=SimpleNamespace(equation=PHYSICAL))


def test_faults_of_lights_have_their_names_and_numbers(variant, monkeypatch):
    monkeypatch.setattr(faults, "traits", lambda predictor: defaultdict(lambda: True))
    sun = {"type": "directional", "direction": [0.3, 0.2, -1.0], "irradiance": 2.0}
    camera = {name: value for name, value in tiny_scene()["sensor"].items() if name != "medium"}
    body = bounded_medium({"type": "cube"}, 0.3, (0.9, 0.9, 0.9))
    bounded = tiny_scene(lamp2=spot(beam=11.0), sun=sun, fog=None, sensor=camera, body=body)
    scene = read_reference(mi.load_dict(bounded))

    def words_of(reference):
        return [
            fault.words.format(1.5) for fault in faults_of(of_physics(reference))[len(FAULTS) :]
        ]

    words = words_of(scene)
    assert "point and spot lights are 1.5 times as bright as they should be" in words
    for name in ("lamp", "lamp2", "sun"):
        assert f"the light '{name}' is 1.5 times as bright as it should be" in words
        assert f"the fog of the light '{name}' is 1.5 times as bright as it should be" in words
        assert f"nothing casts a shadow in the light of the light '{name}'" in words
        assert (
            f"nothing casts a shadow in the light of the light '{name}' in the fog, on surfaces it "
            "does" in words
        )
    # the sun is the only directional light: it has its name and is looked at once
    assert len(words) == 4 * 4
    # one light: the brightness of the whole
    assert words_of(read_reference(mi.load_dict(tiny_scene()))) == []
    monkeypatch.setattr(faults, "_MANY_LIGHTS", 2)
    among_many = words_of(scene)
    assert len(among_many) == 4 * 2
    assert {words for words in among_many if "'" in words} == {
        words for words in words if "'sun'" in words
    }


def test_faults_that_a_scene_cannot_have_are_left_out(variant, monkeypatch):
    monkeypatch.setattr(faults, "traits", lambda predictor: defaultdict(lambda: False))
    scene = read_reference(mi.load_dict(tiny_scene()))
    found = faults_of(of_physics(scene))
    assert found == tuple(fault for fault in FAULTS if not fault.needs)
    assert 0 < len(found) < len(FAULTS)


def test_every_formula_has_a_fault_and_a_key_that_nothing_reads_is_an_error():
    """A misspelt key of the table would leave a fault without its needs in silence."""
    text = Path(faults.__file__).with_name("faults.toml").read_text(encoding="utf-8")
    for table in (
        OPTICS,
        LOBES,
        PHASES,
        LAYERS,
        LAWS,
        WINDOWS,
        MIXES,
        VALUES,
        TURNS,
        GUESSES,
        STARTS,
    ):
        assert [name for name in table if f'"{name}"' not in text] == []
    row = {"name": "albedo", "words": "the albedo was applied twice", "optics": "albedo twice"}
    assert faults._fault("medium", row).kind == "medium"
    with pytest.raises(TypeError, match="need"):
        faults._fault("medium", row | {"need": ["absorption"]})
    with pytest.raises(KeyError, match="albedo thrice"):
        faults._fault("medium", row | {"optics": "albedo thrice"})


def test_traits_of_a_scene_and_its_image_by_hand():
    """A lamp, a soft and a hard spot over a ball in fog of Henyey and Greenstein's
    function, seen in 4 x 3 pixels.
    """
    lights = (
        SimpleNamespace(axis=None),
        SimpleNamespace(axis=(0, 0, -1), beam=0.2, cutoff=0.3),
        SimpleNamespace(axis=(0, 0, -1), beam=0.3, cutoff=0.3),
    )
    values = np.random.default_rng(1).uniform(1, 2, (12, 3))

    def found(
        *,
        lights=lights,
        shapes=("ball",),
        media=(),
        suns=(),
        model=PHYSICAL,
        holds="total",
        values=values,
        shape=(3, 4),
        **fog,
    ):
        phase = Isotropic()
        reference = SimpleNamespace(
            lights=lights,
            directional=suns,
            media=media,
            medium=SimpleNamespace(phase=phase),
            occluders=SimpleNamespace(shapes=lambda: shapes),
        )
        plain = {"sigma_t": ((0.3,) * 3,), "albedo": ((0.9,) * 3,), "phase": (0.4,)}
        ones = {name: (1.0,) for name in ("intensity", "airlight", "surface")}
        looked_at = values[np.isfinite(values).all(axis=1)]
        predictor = SimpleNamespace(
            reference=reference,
            fog=Fog(**(plain | ones | {"moved": ((0.0,) * 3,)} | fog)),
            observation=SimpleNamespace(holds=holds, values=values, equation=model),
            shape=shape,
            unchanged=None,
            shown=lambda guess: looked_at,
            predicted=lambda guess: looked_at - 0.1,
        )
        return {name for name, there in traits(predictor).items() if there}

    usual = {
        "shapes",
        "lamps",
        "point lights",
        "spots",
        "soft spots",
        "no bounds",
        "even fog",
        "fog",
        "all light",
    }
    usual |= {"both", "absorption", "lobes", "g", "oblong", "colours", "more light"}
    usual |= {"physics", "known g"}
    assert found() == usual
    assert found(holds="airlight") == usual - {"all light", "both"}
    assert found(holds="surface") == usual - {"all light", "both", "fog", "lobes", "g"}
    assert found(shapes=()) == usual - {"shapes", "both"}
    assert found(phase=(0.0,)) == usual - {"g"}
    assert found(phase=(None,)) == usual - {"g", "lobes"} | {"isotropy"}
    assert found(albedo=((1.0,) * 3,)) == usual - {"absorption"}
    assert found(sigma_t=((0.0,) * 3,)) == usual - {"absorption"}
    assert found(lights=lights[:1]) == usual - {"spots", "soft spots"}
    assert found(lights=lights[1:]) == usual - {"point lights"}
    assert found(lights=lights[2:]) == usual - {"point lights", "soft spots"}
    assert found(media=(SimpleNamespace(phase=HenyeyGreenstein(0.3)),)) == usual - {"no bounds"}
    assert found(media=(SimpleNamespace(phase=Rayleigh()),)) == usual - {"no bounds", "known g"}
    assert found(suns=(None,)) == usual | {"suns"}
    assert found(model=Model(light_path="off")) == usual - {"physics", "more light"}
    assert found(shape=(6, 2)) == usual
    assert found(shape=(4, 4)) == usual - {"oblong"} | {"square"}
    assert found(values=values[:, :1] * np.ones(3)) == usual - {"colours"}
    assert found(values=np.minimum(values, 1.5)) == usual | {"stop"}
    # No fault of channels or primaries was looked for where one pixel was infinite.
    assert found(values=np.r_[values, [[np.inf] * 3]]) == usual
    for clamped, name in ((True, "clamped layers"), (False, "rising layers")):
        assert found(height=HeightFog(constant=1.0, clamped=clamped)) == usual - {"even fog"} | {
            "height fog",
            name,
        }


def test_pairs_have_faults_of_two_kinds_in_the_order_in_which_they_happen():
    def fault(kind, *steps):
        return Fault(
            "name", "words", None, tuple(Number(0.0, 1.0, step=step) for step in steps), kind=kind
        )

    extinction, curve = fault("medium", 0.0), fault("values")
    lamp, shift = fault("light", 0.0), fault("camera", 0.1, 0.1)
    assert differ(extinction, curve)
    assert not differ(curve, fault("values", 0.0))
    assert not differ(lamp, shift)  # each shift would need new paths of the changed light
    assert differ(shift, extinction)
    assert differ(lamp, extinction)
    assert in_order(curve, extinction) == in_order(extinction, curve) == (extinction, curve)
    assert in_order(shift, lamp) == (lamp, shift)


def test_a_diagnosis_tells_how_far_it_is_from_nothing_to_all(monkeypatch):
    """Each stage is an equal part; every fault of the catalogue is in one of them."""
    assert {fault.stage for fault in FAULTS} == {*STAGES} - {PAIRS}
    heard = []
    monkeypatch.setattr(stages, "explain", lambda predictor, faults, fine: None)
    monkeypatch.setattr(stages, "_refined", lambda attempt, explanations: explanations)
    faults_of_stages = tuple(
        Fault(f"{stage} {number}", "words", None, stage=stage)
        for stage in STAGES
        for number in (1, 2)
    )
    attempt = Attempt(None, faults_of_stages, Candidates("centre", None, None))
    for stage in ("quick", "extent"):
        attempt = attempt.after(stage, lambda *words: heard.append(words))
    assert heard == [(0.0, "quick 1"), (0.125, "quick 2"), (0.75, "extent 1"), (0.875, "extent 2")]
    assert len(attempt.candidates.tried) == 4


def test_a_search_ends_after_the_first_stage_that_leaves_nothing(monkeypatch):
    """Stages cost more and more: no later one is begun without need."""
    done = []

    def after(attempt, stage, progress):
        done.append(stage)
        return attempt

    monkeypatch.setattr(Attempt, "after", after)
    for enough_after, expected in ((0, []), (1, ["pairs"]), (9, ["pairs", "paths", "extent"])):
        done.clear()
        candidates = SimpleNamespace(
            chosen=None, is_enough=lambda chosen, most=enough_after: len(done) >= most
        )
        Attempt(None, (), candidates).finished(None)
        assert done == expected
