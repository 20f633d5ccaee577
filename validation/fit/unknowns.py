# SPDX-License-Identifier: BSD-3-Clause
"""The parameters that a fit may look for, by name, and the fog that they make.

| name | what it is |
|---|---|
| `sigma_t` | extinction of a medium [1/m]; `sigma_t.r`, `.g`, `.b` one channel of it |
| `albedo` | single-scattering albedo; `albedo.r`, `.g`, `.b` |
| `sigma_1`, `z_1`, `H_1` | extinction at its base [1/m], base height and scale height [m] of a layer of height fog |
| `sigma_2`, `z_2`, `H_2`, `sigma_0` | the second layer, and the constant part [1/m] |
| `phase.g` | g of Henyey and Greenstein's function |
| `intensity` | factor on a light |
| `light.x`, `light.y`, `light.z` | position of a light [m] |
| `exposure` | factor on the whole image; `exposure.r`, `.g`, `.b` |

Where a scene has several media or lights, the name of one follows after a colon, `sigma_t:fog` or `intensity:lamp`, or
its number, from 1 on; without it all of them are meant, one parameter for each. In a medium whose channels differ
`sigma_t` and `albedo` stand for three parameters.

Positive parameters are looked for by their logarithms, g by artanh g: all values are allowed that are possible, and a
step is a relative change.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analytic.errors import InputError, nearest
from analytic.height_fog import HeightFog
from reference.scene.read import ReferenceScene
from validation.arrays import Array
from validation.fog_model.radiance import Fog
from validation.fog_model.view import light_sources

CHANNELS = ("r", "g", "b")
AXES = ("x", "y", "z")
LAYERS = ("sigma_1", "z_1", "H_1", "sigma_2", "z_2", "H_2", "sigma_0")  #: of height fog, as scenes have them
_PARTS = {"sigma": "sigma_t", "z": "base", "H": "scale_height"}  # of a layer of height fog, by the letters of a scene

Path = tuple[str | int, ...]  #: of a number in a fog: fields, and numbers in tuples

# Farthest distance from the start of a search: a factor of 22 000, or an artanh g of 10. An image that needs more tells
# # nothing, and an unbounded step may overflow.
_FARTHEST = 10.0


# How parameters are looked for, as numbers on the whole line: to there, and back.
_SCALES: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "log": (math.log, lambda value: float(np.exp(value))),
    "tanh": (math.atanh, math.tanh),
    "plain": (float, float),
}
_BY_LETTERS = {"sigma": ("log", "1/m"), "z": ("plain", "m"), "H": ("log", "m")}
_KINDS = {
    "sigma_t": ("log", "1/m"),
    "albedo": ("log", "1"),
    "phase.g": ("tanh", "1"),
    "intensity": ("log", "1"),
    **{f"light.{axis}": ("plain", "m") for axis in AXES},
    "exposure": ("log", "1"),
    **{name: _BY_LETTERS[name[:-2]] for name in LAYERS},
}
NAMES = tuple(_KINDS)[: -len(LAYERS)]  #: of the parameters of homogeneous media


@dataclass(frozen=True)
class Unknown:
    """A parameter that is looked for."""

    name: str  #: as the user calls it
    kind: str  #: of `NAMES` or `LAYERS`
    paths: tuple[Path, ...]  #: the numbers of a fog that it stands for
    scene: float  #: value in the scene
    start: float = math.nan  #: value to begin with
    place: float = math.nan  #: of a position: where the paths begin [m]

    def put(self, fog: Fog, value: float) -> Fog:
        """Return the fog with a value of this parameter."""
        for path in self.paths:
            fog = _put(fog, path, value - self.place if self.moves else value)
        return fog

    @property
    def scale(self) -> str:
        """How it is looked for: of 'log' a step is a relative change, so that products make sense."""
        return _KINDS[self.kind][0]

    def inward(self, value: float) -> float:
        """Return the number on the whole line that a value is looked for as."""
        return _SCALES[self.scale][0](value)

    def outward(self, number: float) -> float:
        """Return the value that a number on the whole line stands for."""
        return _SCALES[self.scale][1](float(number))

    @property
    def unit(self) -> str:
        """The unit of its value."""
        return _KINDS[self.kind][1]

    @property
    def farthest(self) -> float:
        """How far from its start it is looked for, as a number on the whole line; see `_FARTHEST`."""
        return math.inf if self.scale == "plain" else _FARTHEST

    @property
    def moves(self) -> bool:
        """Whether it moves a light, and shadows with it."""
        return self.kind.startswith("light.")


def _put(whole: Any, path: Path, value: float) -> Any:
    if not path:
        return value
    first, rest = path[0], path[1:]
    if isinstance(first, str):
        return replace(whole, **{first: _put(getattr(whole, first), rest, value)})
    return (*whole[:first], _put(whole[first], rest, value), *whole[first + 1 :])


def _number(fog: Fog, path: Path) -> float:
    found: Any = fog
    for part in path:
        found = getattr(found, part) if isinstance(part, str) else found[part]
    return float(found)


def read_unknowns(
    names: Sequence[str], reference: ReferenceScene, fog: Fog, starts: Mapping[str, float]
) -> tuple[Unknown, ...]:
    """Return the parameters that names stand for.

    `reference`, `fog`: the scene, and what it says of the fog; `starts`: values to begin with, by name; the scene's own
    by default.
    """
    if not names:
        raise InputError(f"fit: got none, expected some of {', '.join(NAMES)}")
    unknowns = tuple(unknown for name in names for unknown in _read(name, reference, fog))
    seen: set[Path] = set()
    for unknown in unknowns:
        if seen & set(unknown.paths):
            raise InputError(f"fit: '{unknown.name}' is there twice; name each parameter once")
        seen |= set(unknown.paths)
    for name in starts:
        if name not in {unknown.name for unknown in unknowns}:
            known = [unknown.name for unknown in unknowns]
            raise InputError(
                f"start: '{name}' is not looked for; expected one of {', '.join(known)}" + nearest(name, known)
            )
    return tuple(_started(unknown, starts) for unknown in unknowns)


def with_values(unknowns: Sequence[Unknown], fog: Fog, inner: Sequence[float] | Array) -> Fog:
    """Return the fog with the values of parameters, given as numbers on the whole line."""
    for unknown, value in zip(unknowns, inner, strict=True):
        fog = unknown.put(fog, unknown.outward(value))
    return fog


def _read(name: str, reference: ReferenceScene, fog: Fog) -> list[Unknown]:
    word, _, place = name.partition(":")
    base, _, letter = word.rpartition(".")
    alone = base in ("sigma_t", "albedo", "exposure") and letter in CHANNELS
    kind, channels = (base, (CHANNELS.index(letter),)) if alone else (word, (0, 1, 2))
    if fog.height is None and kind in LAYERS:
        raise InputError(f"fit: got '{name}'; the scene has no height fog: write it as such, or look for 'sigma_t'")
    names = NAMES if fog.height is None else (*_layers_of(fog.height), *NAMES[1:])
    if kind not in names:
        raise InputError(f"fit: got '{name}', expected some of {', '.join(names)}" + nearest(word, names))
    if kind in LAYERS:
        part, number = kind.split("_")
        path: Path = ("height", "layers", int(number) - 1, _PARTS[part]) if number != "0" else ("height", "constant")
        return [Unknown(kind, kind, (path,), _number(fog, path))]
    if kind == "exposure":
        if place:
            raise InputError(f"fit: got '{name}'; the exposure is that of the whole image: write '{word}'")
        return [Unknown(name, kind, tuple((kind, channel) for channel in channels), 1.0)]
    if kind in ("sigma_t", "albedo", "phase.g"):
        numbers = _media(name, place, reference, fog)
        return [each for number in numbers for each in _of_medium(kind, channels, number, reference, fog)]
    return [_of_light(kind, number, reference) for number in _lights(name, place, kind, reference)]


def _of_medium(kind: str, channels: tuple[int, ...], number: int, reference: ReferenceScene, fog: Fog) -> list[Unknown]:
    ending = f":{_medium_name(number, reference)}" if len(_scattering(fog)) > 1 else ""
    if kind == "phase.g":
        phase = (reference.medium, *reference.media)[number].phase
        if not phase.is_constant and phase.name != "hg":
            raise InputError(
                f"fit: 'phase.g' is for the phase functions 'hg' and 'isotropic'; this medium has '{phase.name}'"
            )
        own = fog.phase[number]
        return [Unknown(kind + ending, kind, (("phase", number),), own if isinstance(own, float) else 0.0)]
    values = getattr(fog, kind)[number]
    groups = [channels] if len({values[c] for c in channels}) == 1 else [(channel,) for channel in channels]
    return [
        Unknown(
            kind + (f".{CHANNELS[group[0]]}" if len(group) == 1 else "") + ending,
            kind,
            tuple((kind, number, channel) for channel in group),
            values[group[0]],
        )
        for group in groups
    ]


def _of_light(kind: str, number: int, reference: ReferenceScene) -> Unknown:
    names = light_names(reference)
    name = kind + (f":{names[number]}" if len(names) > 1 else "")
    if kind == "intensity":
        return Unknown(name, kind, ((kind, number),), 1.0)
    if number >= len(reference.lights):
        raise InputError(f"fit: got '{name}', expected the position of a point or spot light")
    axis = AXES.index(kind[-1])
    return Unknown(name, kind, (("moved", number, axis),), float(reference.lights[number].position[axis]))


def _layers_of(height: HeightFog) -> tuple[str, ...]:
    """Return the names of the numbers that height fog has."""
    return tuple(name for name in LAYERS if 0 < int(name[-1]) <= len(height.layers) or name == "sigma_0")


def _scattering(fog: Fog) -> list[int]:
    """Return the numbers of the media that are there."""
    return [number for number, sigma_t in enumerate(fog.sigma_t) if max(sigma_t) > 0]


def _medium_name(number: int, reference: ReferenceScene) -> str:
    return "medium" if number == 0 else reference.media[number - 1].name


def light_names(reference: ReferenceScene) -> list[str]:
    """Return the ids of the lights, in the order of their paths."""
    return [source.name for source in light_sources(reference)]


def _media(name: str, place: str, reference: ReferenceScene, fog: Fog) -> list[int]:
    there = _scattering(fog)
    return _chosen(name, place, there, [_medium_name(number, reference) for number in there], "medium")


def _lights(name: str, place: str, kind: str, reference: ReferenceScene) -> list[int]:
    names = light_names(reference)
    numbers = list(range(len(names)))
    if kind != "intensity" and not place:
        numbers, names = numbers[: len(reference.lights)], names[: len(reference.lights)]
    return _chosen(name, place, numbers, names, "light")


def _chosen(name: str, place: str, numbers: list[int], names: list[str], what: str) -> list[int]:
    if not place:
        if not numbers:
            raise InputError(f"fit: got '{name}'; the scene has no {what} of this kind")
        return numbers
    if place in names:
        return [numbers[names.index(place)]]
    if place.isdigit() and 1 <= int(place) <= len(numbers):
        return [numbers[int(place) - 1]]
    raise InputError(
        f"fit: got '{name}', expected a {what} of the scene, {', '.join(names)}, or its number" + nearest(place, names)
    )


def _started(unknown: Unknown, starts: Mapping[str, float]) -> Unknown:
    value = starts.get(unknown.name, unknown.scene)
    fits = math.isfinite(value)
    wanted = "a finite number"
    if unknown.scale == "log":
        fits, wanted = fits and value > 0, "a number above 0"
        if unknown.name not in starts and value <= 0:
            raise InputError(
                f"fit: '{unknown.name}' is {value:g} in the scene, where nothing can begin; give start "
                f"{unknown.name}=VALUE"
            )
    if unknown.scale == "tanh":
        fits, wanted = -1 < value < 1, "a number between -1 and 1"
    if not fits:
        raise InputError(f"start: {unknown.name}={value:g}, expected {wanted}")
    return replace(unknown, start=float(value), place=unknown.scene)
