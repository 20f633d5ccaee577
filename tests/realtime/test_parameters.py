# SPDX-License-Identifier: BSD-3-Clause
"""Parameters say once what they are: conversion, checks and messages follow from their fields."""

import re
from dataclasses import dataclass

import pytest

from airlight.errors import InputError
from airlight.realtime.parameters import Parameters, defaults, parameter, read_parameters, values


@dataclass(frozen=True)
class Fog(Parameters):
    """One parameter of each kind."""

    steps: int = parameter(16, "steps of every ray", least=1, most=64, also=(0,))
    fraction: float = parameter(0.5, "fraction of the light", above=0, below=1, unit="1/m")
    word: str = parameter("even", "spacing", choices=("even", "uneven"))
    on: bool = parameter(True, "whether at all")
    free: float = parameter(2.0, "anything")

    def _check_together(self):
        if self.on and self.free < 0:
            raise InputError("free: expected on=false with a value below 0")


def refused(words):
    return pytest.raises(InputError, match=re.escape(words))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"steps": -1}, "steps: got -1, expected a whole number from 1 to 64"),
        (
            {"fraction": 0.0},
            "fraction: got 0.0, expected a finite number above 0 up to, but not, 1 [1/m]",
        ),
        ({"fraction": float("nan")}, "fraction: got nan, expected"),
        (
            {"word": "unevn"},
            "word: got 'unevn', expected one of even, uneven; did you mean 'uneven'?",
        ),
        ({"free": -1.0}, "free: expected on=false with a value below 0"),
        (
            {"step": 3},
            "method fog: got a parameter 'step', expected one of: steps, fraction, word, on, free; "
            "did you mean",
        ),
        ({"steps": "1.5"}, "method fog: steps got '1.5', expected a whole number"),
        ({"on": "maybe"}, "method fog: on got 'maybe', expected true or false"),
    ],
)
def test_what_cannot_be_used_is_refused_with_what_is_wanted(given, words):
    with refused(words):
        read_parameters("fog", Fog, given)


def test_words_become_values():
    parameters = read_parameters(
        "fog", Fog, {"steps": " 0 ", "fraction": "0.25", "word": "uneven", "on": "no", "free": -1}
    )
    assert values(parameters) == {
        "steps": 0,
        "fraction": 0.25,
        "word": "uneven",
        "on": False,
        "free": -1.0,
    }
    assert values(read_parameters("fog", Fog, {})) == defaults(Fog)
