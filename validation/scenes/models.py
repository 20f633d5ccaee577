# SPDX-License-Identifier: BSD-3-Clause
"""The equations of engines by name, and the words that name an equation.

    playcanvas                                 a preset of `models.toml`
    playcanvas:extinction=0.5,range=8          with its parameters, by the engine's own names
    playcanvas:range=8,law=power:2             with terms that replace its own
    light-path=off,law=softened:1:16           terms alone
    physical                                   the physical equation

Terms and their words are those of `reference.scene.model`. A piece without '=' belongs to the value
before it: `ambient=1,2,3`. Where a parameter has the name of a term, a number is the parameter, and
words are the term.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

from airlight.errors import InputError, nearest
from airlight.reference.scene.model import Model
from airlight.reference.scene.model_words import word_of

#: the name of the physical equation, and that of the default in a scene file which names a model
PHYSICAL_NAME, DEFAULT = "physical", "airlight-model"
_NEEDED = "needed"
_SWITCHES = {"true": "1", "false": "0", "on": "1", "off": "0"}
#: of terms, in the order in which they are told
TERMS = tuple(word_of(each.name) for each in fields(Model) if each.name != "name")

Value = tuple[float, ...] | None  # a number, three of a colour, or none


@dataclass(frozen=True)
class Parameter:
    """A parameter of an engine's equation."""

    name: str  #: in the engine, where it has one
    default: str  #: in words; empty for one that must be given
    what: str  #: what it is
    off_at: float | None = None  #: numbers up to this stand for none

    @property
    def words(self) -> str:
        """The name with its default, or that it must be given."""
        return f"{self.name}={self.default or _NEEDED}"

    def value(self, words: str) -> Value:
        """Return the value of words; raises InputError where they are none."""
        cells = _SWITCHES.get(words.lower(), words).split(",")
        if cells == ["none"]:
            return None
        try:
            numbers = tuple(float(cell) for cell in cells)
        except ValueError:
            numbers = (math.nan,)
        if self.off_at is not None and len(numbers) == 1 and numbers[0] <= self.off_at:
            return None
        if len(numbers) not in (1, 3) or not all(number >= 0 for number in numbers):
            raise InputError(
                f"model: {self.name} is '{words}'; expected a number from 0 on, R,G,B, or none"
            )
        return numbers


@dataclass(frozen=True)
class Preset:
    """The equation of an engine, as it was read in its source."""

    key: str  #: what a user types
    title: str
    version: str
    read: str  #: the files, with their commits
    unchecked: str  #: what was not checked, or is left to its algorithm
    parameters: tuple[Parameter, ...]
    #: words by term, with products of numbers, parameters and pi in braces
    words: Mapping[str, str]
    fog_engines: tuple[str, ...] = ()  #: of `heightfog`, whose equation it is

    @property
    def name(self) -> str:
        """The name of its model."""
        return f"{self.key} {self.version}"

    @property
    def usage(self) -> str:
        """The words that a user types, with the parameters that must be given."""
        needed = ",".join(f"{each.name}=NUMBER" for each in self.parameters if not each.default)
        return f"{self.key}:{needed}" if needed else self.key

    @property
    def terms(self) -> str:
        """Its terms in words, with parameters in braces."""
        return ", ".join(f"{term}={words}" for term, words in self.words.items()) or PHYSICAL_NAME

    def terms_with(self, given: Mapping[str, str]) -> dict[str, str]:
        """Return the words by term, with parameters of the user.

        Raises InputError for a parameter without a value, and words that are none.
        """
        values = dict[str, Value]()
        for each in self.parameters:
            words = given.get(each.name, each.default)
            if not words:
                raise InputError(
                    f"model: {self.key} needs {each.name}, {each.what}; expected "
                    f"{self.key}:{each.name}=NUMBER"
                )
            values[each.name] = each.value(words)
        filled = {term: _filled(words, values) for term, words in self.words.items()}
        # A term whose parameter is none is left out, and so is a range without an end.
        none = ("", "quartic:inf")
        return {term: words for term, words in filled.items() if words not in none}


_BRACES = re.compile(r"\{([^{}]*)\}")
_BETWEEN = re.compile(r",(?=[a-z.-]+=)")  # two terms, and not the channels of a colour


def _filled(words: str, values: Mapping[str, Value]) -> str:
    """Return words with the values of what stands in braces; nothing where one is none."""
    products = [_product(inside, values) for inside in _BRACES.findall(words)]
    cells = iter([",".join(map(repr, product)) for product in products if product is not None])
    return "" if None in products else _BRACES.sub(lambda match: next(cells), words)


def _product(words: str, values: Mapping[str, Value]) -> Value:
    """Return a product of numbers, parameters and pi, by channel where one is a colour."""
    factors = [
        values[word] if word in values else (math.pi if word == "pi" else float(word),)
        for word in words.split("*")
    ]
    given = [factor for factor in factors if factor is not None]
    if len(given) < len(factors):
        return None
    channels = max(map(len, given))
    wide = [factor * (channels if len(factor) == 1 else 1) for factor in given]
    if len(wide) == 1:
        return wide[0]
    # 15 digits: 0.4 * 0.4 is 0.16.
    return tuple(float(f"{math.prod(column):.15g}") for column in zip(*wide, strict=True))


def _presets(tables: Mapping[str, Mapping[str, Any]]) -> Mapping[str, Preset]:
    presets = {}
    for key, table in tables.items():
        parameters = tuple(
            Parameter(
                name,
                "" if each["default"] == _NEEDED else _text(each["default"]),
                each["what"],
                each.get("off_at"),
            )
            for name, each in table.get("parameters", {}).items()
        )
        facts = {name: table[name] for name in ("title", "version", "read", "unchecked")}
        presets[key] = Preset(
            key,
            **facts,
            parameters=parameters,
            words=MappingProxyType(table["terms"]),
            fog_engines=tuple(table.get("fog_engines", ())),
        )
    return MappingProxyType(presets)


def _text(default: float | str) -> str:
    return default if isinstance(default, str) else f"{default:g}"


#: see `models.toml`
PRESETS = _presets(
    tomllib.loads(Path(__file__).with_name("models.toml").read_text(encoding="utf-8"))
)


def model_of(words: str) -> Model:
    """Return the model that words name: an engine's with its parameters, or one by its terms.

    Raises InputError for words that name none.
    """
    text = words.strip()
    if not text or any(map(str.isspace, text)):
        raise InputError(
            f"model: got '{words}', expected one word without spaces, such as playcanvas:range=8 "
            "or light-path=off,law=softened:1:16"
        )
    # A name stands first, before a colon, a comma or the end: terms begin with NAME=.
    name, after, rest = re.findall(r"^([^=:,]*)([=:,]?)(.*)$", text, re.DOTALL)[0]
    if after == "=":
        return Model.of(_pairs(text))
    known = (PHYSICAL_NAME, *PRESETS)
    if name in TERMS:
        raise InputError(f"model: {name} is a term, and has no value; expected {name}=VALUE")
    if name not in known:
        raise InputError(
            f"model: no model is called '{name}'{nearest(name, known) or '.'} Use one of "
            f"{', '.join(known)}, or terms such as light-path=off"
        )
    if after and not rest:
        raise InputError(f"model: got '{text}', expected {name}, or {name}:NAME=VALUE")
    pairs = _pairs(rest) if rest else {}
    return Model.of(pairs) if name == PHYSICAL_NAME else _engine(PRESETS[name], pairs)


def _engine(preset: Preset, pairs: Mapping[str, str]) -> Model:
    """Return the model of an engine with a user's parameters and terms, by name."""
    parameters = [each.name for each in preset.parameters]
    known = dict.fromkeys((*parameters, *TERMS))
    given, terms = dict[str, str](), dict[str, str]()
    for word, value in pairs.items():
        if word not in known:
            raise InputError(
                f"model: {preset.key} has no '{word}'{nearest(word, known) or '.'} Use one of "
                + ", ".join(known)
            )
        is_parameter = word in parameters and (word not in TERMS or _is_number(value))
        (given if is_parameter else terms)[word] = value
    # A model with other terms is not the engine's: its name says so.
    changed = ",".join(f"{word}={value}" for word, value in terms.items())
    name = f"{preset.name} with {changed}" if changed else preset.name
    return Model.of(preset.terms_with(given) | terms, name=name)


def _is_number(value: str) -> bool:
    try:
        return bool([float(cell) for cell in value.split(",")])
    except ValueError:
        return value == "none" or value.lower() in _SWITCHES


def _pairs(text: str) -> dict[str, str]:
    """Return values by name, from text such as 'a=1,b=1,2,3'."""
    pairs, word = dict[str, str](), ""
    for piece in text.split(","):
        start, equals, value = piece.partition("=")
        if not equals and word:
            pairs[word] += f",{piece}"
            continue
        word = start
        if not (word and value):
            raise InputError(f"model: got '{piece}', expected NAME=VALUE")
        if word in pairs:
            raise InputError(f"model: {word} is given twice; leave one out")
        pairs[word] = value
    return pairs


def model_words(model: Model) -> str:
    """Return what a result says of its model: its name, and its terms."""
    terms = model.terms or PHYSICAL_NAME
    return f"{model.name}: {terms}" if model.name else terms


def model_parts(words: str) -> dict[str, str]:
    """Return name and terms from what `model_words` said; a model by its terms has no name."""
    name, between, terms = words.rpartition(": ")
    return {"name": name if between else "", "terms": terms}


def model_line(name: str, terms: str) -> str:
    """Return a line that tells a model."""
    return "model  " + (f"{name}: " if name else "") + _BETWEEN.sub(", ", terms)


def preset_of_fog(engine: str) -> Preset | None:
    """Return the equation that an engine of `heightfog` solves; None where none was read."""
    return next((each for each in PRESETS.values() if engine in each.fog_engines), None)
