# SPDX-License-Identifier: BSD-3-Clause
"""The catalogue of faults that an engine's image may have, read from `faults.toml`.

`airlight compare --diagnose` tries all of them. The hints of `airlight compare` are the faults with
an `undo`, which takes a fault back from a whole image, without any path of light.

The table is TOML: anybody who writes an engine can read it, and add a fault to a known target,
without Python. Formulas stay in `transforms.py`, where the table names them.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from airlight.validation.arrays import Array
from airlight.validation.engine.equations import (
    equation_sentence,
    equation_title,
    faults_of_terms,
)
from airlight.validation.engine.fault import Begin, Change, Fault, Number, Values
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.engine.starts import STARTS
from airlight.validation.engine.targets import (
    BY_NAME,
    HELD,
    PARTS,
    RECORDS,
    of_fog_alone,
    planar,
    scaled,
    with_fields,
)
from airlight.validation.engine.traits import traits
from airlight.validation.engine.transforms import TURNS, VALUES, reordered
from airlight.validation.fog_model.view import light_sources

#: The kinds of faults, in the order in which they happen.
KINDS = ("model", "medium", "light", "layers", "camera", "brightness", "values")
_MANY_LIGHTS = 6  # in a scene with more lights, no faults of single lights are looked for


def _change(row: dict[str, Any]) -> Change:
    """Take the target of a fault from its row of the table; return its change."""
    # A row has one target. Its digits belong to a number that is a field of a record.
    digits = row.pop("digits", 4)
    (target,) = row.keys() & {*BY_NAME, *RECORDS, "planar"}
    transform = row.pop(target)
    if target == "planar":
        return planar(transform)
    if target in BY_NAME:
        return BY_NAME[target](transform)
    # A list of numbers is a tuple in the record.
    fields = {
        field: tuple(value) if isinstance(value, list) else value
        for field, value in transform.items()
    }
    return with_fields(target, fields, digits)


def _numbers(tables: Sequence[dict[str, Any]]) -> tuple[Number, ...]:
    """Return the numbers that a fault looks for."""
    numbers: list[Number] = []
    for table in tables:
        # The table has the fields of `Number`, a range in the place of its ends, and a count of
        # equal numbers.
        others = dict(table)
        low, high = others.pop("range")
        count = others.pop("count", 1)
        starts = tuple(others.pop("starts", (1.0,)))
        numbers += [Number(low, high, starts, **others)] * count
    return tuple(numbers)


def _begin(starts: str, numbers: Sequence[Number], change: Change) -> Begin | None:
    """Return the function that finds the values to begin with; None for those of the numbers."""
    if not starts:
        return None
    if starts == "all":
        together = tuple(product(*(number.starts for number in numbers)))
        return lambda predictor, guess: together
    # The image shows the first numbers; each of them goes with all starts of the others.
    start = STARTS[starts]

    def begin(predictor: Predictor, guess: Guess) -> list[Values]:
        return [
            (*first, *more)
            for first in start(predictor, guess, change)
            for more in product(*(number.starts for number in numbers[len(first) :]))
        ]

    return begin


def _undo(name: str) -> Callable[[Array], Array]:
    """Return the turn, curve or order of channels that takes a fault back."""
    return TURNS.get(name) or VALUES.get(name) or reordered(name)


def _fault(kind: str, entry: Mapping[str, Any]) -> Fault:
    """Return the fault of a row of the table."""
    # Each key is taken from the row where it is read. The rest are fields of `Fault`: a key that
    # nothing reads is an error there.
    row = dict(entry)
    is_factor = "factor" in row
    if "equation" in row:
        words = row["equation"]
        # An equation is one fault in the place of the several terms that it is.
        row |= {"words": equation_title(words), "tell": equation_sentence(words), "rank": -1}
    equation = row.get("equation", "")
    change, part = _change(row), row.pop("part", "")
    if part:
        change = PARTS[part](change)
    numbers = _numbers(row.pop("numbers", ()))
    return Fault(
        change=change,
        parameters=numbers,
        begin=_begin(row.pop("starts", ""), numbers, change),
        held=HELD[row.pop("held"), part] if "held" in row else None,
        undo=_undo(row.pop("undo")) if "undo" in row else None,
        needs=tuple(row.pop("needs", ())),
        factor=is_factor,
        equation=equation,
        kind=kind,
        **row,
    )


def _table() -> tuple[Fault, ...]:
    """Return the faults of `faults.toml`; a block with `rows` is as many, which share its other
    keys.
    """
    text = Path(__file__).with_name("faults.toml").read_text(encoding="utf-8")
    return tuple(
        _fault(kind, {key: value for key, value in (block | row).items() if key != "rows"})
        for kind, blocks in tomllib.loads(text).items()
        for block in blocks
        for row in block.get("rows", [{}])
    )


FAULTS = _table()
#: The brightness of the whole image, of which a comparison tells the factor.
(BRIGHTNESS,) = (fault for fault in FAULTS if fault.kind == "brightness")


def faults_of(predictor: Predictor) -> tuple[Fault, ...]:
    """Return the faults that an image of a scene may have, and with them the faults of its single
    lights and classes of lights.
    """
    # Lights are numbered in the order of `light_sources`: point and spot lights, directional ones,
    # area lights. A class that is all lights, or one light, is no group of its own.
    sources = light_sources(predictor.reference)
    near = len(predictor.reference.lights)
    far = near + len(predictor.reference.directional)
    classes = {
        "point and spot lights": range(near),
        "directional lights": range(near, far),
        "area lights": range(far, len(sources)),
    }
    groups = {
        name: tuple(numbers) for name, numbers in classes.items() if 1 < len(numbers) < len(sources)
    }
    # A light that is the only one of its class is looked at even among many.
    singles = [(numbers[0],) for numbers in classes.values() if len(numbers) == 1 < len(sources)]
    if 1 < len(sources) <= _MANY_LIGHTS:
        singles = [(number,) for number in range(len(sources))]
    groups |= {f"the light '{sources[number].name}'": (number,) for (number,) in singles}
    faults = [*FAULTS]
    for which, lights in groups.items():
        faults += _of_lights(which, lights)
    model = predictor.observation.equation
    if not model.is_physical:
        faults += faults_of_terms(model)
    traits_of_scene = traits(predictor)
    return tuple(fault for fault in faults if all(traits_of_scene[need] for need in fault.needs))


def _of_lights(which: str, lights: tuple[int, ...]) -> list[Fault]:
    """Return the faults of some lights: their factor, their factor in the fog, and no shadows in
    all of their light or in the fog alone.
    """
    are, they = ("is", "it") if len(lights) == 1 else ("are", "they")
    unshadowed = with_fields("scenery", {"unshadowed": lights})
    shadow_words = f"nothing casts a shadow in the light of {which}"
    return [
        _factor_fault(
            "light-factor",
            f"{which} {are} {{0:.4g}} times as bright as {they} should be",
            scaled("intensity", lights),
        ),
        _factor_fault(
            "fog-factor",
            f"the fog of {which} is {{0:.4g}} times as bright as it should be",
            scaled("airlight", lights),
            needs=("both",),
        ),
        Fault("no-shadow", shadow_words, unshadowed, needs=("shapes",), kind="light"),
        Fault(
            "no-shadow",
            f"{shadow_words} in the fog, on surfaces it does",
            of_fog_alone(unshadowed),
            needs=("both",),
            kind="light",
        ),
    ]


def _factor_fault(name: str, words: str, change: Change, needs: tuple[str, ...] = ()) -> Fault:
    """Return a fault that multiplies the light of some lights."""
    numbers = (Number(1e-9, 1e9, scale="log"),)
    return Fault(
        name,
        words,
        change,
        numbers,
        begin=_begin("part", numbers, change),
        needs=needs,
        factor=True,
        kind="layers",
    )
