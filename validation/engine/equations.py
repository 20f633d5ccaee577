# SPDX-License-Identifier: BSD-3-Clause
"""The equations of engines as hypotheses: what a preset of `validation.scenes.models` makes of an
image, and its terms in words.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace

import numpy as np

from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.model_words import word_of
from airlight.validation.engine.fault import Change, Fault, Values
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.fog_model.equation import fog_of_model, scenery_of_model
from airlight.validation.scenes.models import PRESETS, model_of


def equation(words: str) -> Change:
    """Return the change to the equation that words name, with {0}, {1}, .. for the numbers of the
    fault; see `validation.scenes.models`.
    """

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        return in_equation(predictor, guess, _model(words, p))

    return changed


def in_equation(predictor: Predictor, guess: Guess, model: Model) -> Guess:
    """Return a guess in the equation of a model."""
    # Nodes are not parted at corners of the light: all values of a range share their nodes.
    fog = replace(fog_of_model(predictor.reference, model), corners=())
    return replace(guess, fog=fog, scenery=scenery_of_model(model))


def equation_sentence(words: str) -> Callable[[Values], str]:
    """Return what a fault by such words says of an image, by its numbers."""

    def sentence(values: Values) -> str:
        return f"{equation_title(words)}: {model_sentence(model_of(asked_words(words, values)))}"

    return sentence


def asked_words(words: str, values: Values) -> str:
    """Return what a user types for an equation with these numbers."""
    return words.format(*(f"{value:.4g}" for value in values))


def equation_title(words: str) -> str:
    """Return whose equation words name, in words on an image."""
    return f"this is the equation of {engine_title(words)}"


def engine_title(words: str) -> str:
    """Return the engine whose equation words name, with its version."""
    preset = PRESETS[words.partition(":")[0]]
    return f"{preset.title} {preset.version}"


def _model(words: str, values: Values) -> Model:
    return model_of(words.format(*(f"{value:.12g}" for value in values)))


def faults_of_terms(model: Model) -> list[Fault]:
    """Return what may be otherwise than the equation that is asked for: each of its terms, or all
    of them, are physical in the image.
    """

    def physical(other: Model) -> Change:
        return lambda predictor, guess, p: in_equation(predictor, guess, other)

    title = "the image solves the physical equation, not that of the model"
    faults = [Fault("physical", title, physical(PHYSICAL), kind="model")]
    for word, _ in model.alone():
        field = word.replace(".", "_").replace("-", "_")
        neutral = {field: getattr(PHYSICAL, field)}
        # A cap and a lobe have no place without the source that they change.
        neutral |= {"cap": "none", "lobe": "none"} if word == "source" else {}
        words = f"the image is without a term of the equation, {word}={getattr(model, field)}"
        change = physical(replace(model, **neutral))
        faults.append(Fault(word, words, change, kind="model"))
    return faults if len(faults) > 2 else faults[:1]


def terms_that_matter(
    predictor: Predictor, words: str, values: Values, least: float
) -> tuple[str, ...]:
    """Return the terms of an equation that change the image of the scene, each alone, by more than
    a relative error.
    """
    predictor = predictor.quick
    plain = predictor.predicted(in_equation(predictor, predictor.unchanged, PHYSICAL))
    floor = 0.01 * float(np.mean(plain)) + 1e-300

    def change(model: Model) -> float:
        other = predictor.predicted(in_equation(predictor, predictor.unchanged, model))
        apart = np.abs(other - plain) / np.maximum(np.maximum(other, plain), floor)
        return float(np.mean(apart))

    return tuple(term for term, single in _model(words, values).alone() if change(single) > least)


# Terms in words, by the word of the term; functions of its value where it has several kinds.

_LAWS = {
    "power": "light falls as 1/r^{0:.3g}",
    "softened": "light falls as {1:.4g}/(r^2 + e) with e = {0:.3g} m^2",
    "clamped": "light falls as 1/r^{1:.3g}, and no more within {0:.3g} m",
    "sphere": "light falls as that of a disk of the radius {0:.3g} m that faces every point",
}
_RANGES = {
    "quartic": "lamps fall off by (1 - (r/R)^4)^2 with R = {0:.4g} m",
    "fourth": "lamps fall off by 1 - (r/R)^4 with R = {0:.4g} m",
    "square": "lamps fall off by (1 - (r/R)^2)^2 with R = {0:.4g} m",
    "linear": "lamps fall off by 1 - r/R with R = {0:.4g} m",
    "cut": "lamps end at {0:.4g} m",
}
_PATHS = {
    "off": "{way} is not attenuated",
    "on": "{way} is attenuated",
    "length": "the fog counts {0:.4g} m for {way}",
    "part": "{way} counts {0:.3g} times",
}
_WORDS: Mapping[str, Mapping[str, str] | str] = {
    "law": _LAWS,
    "range": _RANGES,
    "spot": {
        "cosine-squared": "spots fall off squared in the cosine",
        "cosine-smooth": "spots fall off smoothly in the cosine",
        "rim": "spots fall off by a power {0:.3g} of 1 - cosine",
    },
    "phase": {
        "none": "lamps have no phase function",
        "cornette-shanks": "the phase function is Cornette and Shanks's",
    },
    "depth": {
        "axis": "depth along the axis of the camera stands for distance",
        "axis-ends": "rays end at the depth of the surface, taken for a distance",
        "axis-lookup": "rays end where their depth is the distance of the surface",
    },
    "ends": {
        "planes": "the fog is {0:.4g} to {1:.4g} m before the camera",
        "spheres": "the fog is {0:.4g} to {1:.4g} m away from the camera",
    },
    "fade": "the fog fades to nothing between {0:.4g} and {1:.4g} m, and is more before",
    "source": "the fog has the colour ({0:.3g}, {1:.3g}, {2:.3g}) W/(m^2 sr), whatever the lights",
    "cap": "it covers {0:.3g} at most",
    "lobe": "suns add a lobe of the power {0:.3g}",
    "ambient": "the fog scatters ambient light of ({0:.3g}, {1:.3g}, {2:.3g}) W/(m^2 sr)",
    "lit": "the density is lit: {0:.3g} times the light is what is dense",
    "lamps": "the fog of lamps counts {0:.4g} times",
    "suns": "the fog of suns counts {0:.4g} times",
    "surface.law": {kind: f"on surfaces {words}" for kind, words in _LAWS.items()},
    "surface.factor": "surfaces count {0:.4g} times",
}
_WAYS = {
    "light-path": "the way from the light",
    "camera-path": "the way to the camera",
    "surface.light-path": "the way from the light to surfaces",
    "surface.camera-path": "the way from surfaces to the camera",
}


def model_sentence(model: Model) -> str:
    """Return the terms of a model in words."""
    names = [each.name for each in fields(model) if each.name != "name"]
    terms = {word_of(name): getattr(model, name) for name in names}
    plain = {word_of(name): getattr(PHYSICAL, name) for name in names}
    # A source that may cover all has no cap.
    plain = plain if model.most < 1 else plain | {"cap": model.cap}
    said = [_term_words(word, value) for word, value in terms.items() if value != plain[word]]
    return ", ".join(said) or "it is the physical one"


def _term_words(word: str, value: str) -> str:
    kind, *cells = value.replace(",", ":").split(":")
    if word in _WAYS:
        numbers = [float(cell) for cell in cells] or ([] if kind in _PATHS else [float(kind)])
        return _PATHS.get(kind, _PATHS["part"]).format(*numbers, way=_WAYS[word])
    words = _WORDS[word]
    if isinstance(words, str):
        # Sources begin with their kind, other terms with their first number.
        return words.format(*map(float, cells if kind == "constant" else [kind, *cells]))
    return words.get(kind, f"{word} is {value}").format(*map(float, cells))
