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

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError, nearest
from analytic.height_fog import HeightFog
from reference.scene.read import ReferenceScene
from validation.fog_model.radiance import Fog
from validation.fog_model.view import light_sources

CHANNELS = ("r", "g", "b")
AXES = ("x", "y", "z")
NAMES = ("sigma_t", "albedo", "phase.g", "intensity", "light.x", "light.y", "light.z", "exposure")
LAYERS = ("sigma_1", "z_1", "H_1", "sigma_2", "z_2", "H_2", "sigma_0")  #: of height fog, as scenes have them
_PARTS = {"sigma": "sigma_t", "z": "base", "H": "scale_height"}  # of a layer of height fog, by the letters of a scene


# Of the start of a search: a factor of 22 000, or an artanh g of 10. An image that asks for more says nothing, and a
# step that is not bounded may ask for a factor that no number holds.
_FARTHEST = 10.0


@dataclass(frozen=True)
class Scale:
    """How a parameter is looked for: as a number on the whole line."""

    inward: Callable[[float], float]
    outward: Callable[[float], float]
    relative: bool  #: whether a step is a relative change, so that products of such parameters make sense


_LOG = Scale(math.log, lambda value: float(np.exp(value)), relative=True)
_TANH = Scale(math.atanh, math.tanh, relative=False)
_PLAIN = Scale(float, float, relative=False)


@dataclass(frozen=True)
class Unknown:
    """A parameter that is looked for."""

    name: str  #: as the user calls it
    kind: str  #: of `NAMES`
    number: int  #: of the medium or light
    channels: tuple[int, ...]  #: which it is about
    scene: float  #: value in the scene
    scale: Scale
    unit: str
    start: float = math.nan  #: value to begin with
    place: float = math.nan  #: of a position: where the paths begin [m]

    def put(self, fog: Fog, value: float) -> Fog:
        """Return the fog with a value of this parameter."""
        if self.kind in ("sigma_t", "albedo"):
            old = getattr(fog, self.kind)[self.number]
            new = tuple(value if channel in self.channels else old[channel] for channel in range(3))
            return fog.with_entry(self.kind, self.number, new)
        if self.kind == "phase.g":
            return fog.with_entry("phase", self.number, value)
        if self.kind == "intensity":
            return fog.with_entry("intensity", self.number, value)
        if self.kind == "exposure":
            red, green, blue = (value if c in self.channels else fog.exposure[c] for c in range(3))
            return replace(fog, exposure=(red, green, blue))
        if self.kind in LAYERS:
            return replace(fog, height=_with_layer(fog.height, self.kind, value))
        axis = AXES.index(self.kind[-1])
        place = fog.moved[self.number]
        new_place = tuple(value - self.place if each == axis else place[each] for each in range(3))
        return fog.with_entry("moved", self.number, new_place)

    @property
    def farthest(self) -> float:
        """How far from its start it is looked for, as a number on the whole line; see `_FARTHEST`."""
        return math.inf if self.scale is _PLAIN else _FARTHEST

    @property
    def moves(self) -> bool:
        """Whether it moves a light, and shadows with it."""
        return self.kind.startswith("light.")


def read_unknowns(
    names: Sequence[str], reference: ReferenceScene, fog: Fog, starts: Mapping[str, float]
) -> tuple[Unknown, ...]:
    """Return the parameters that names stand for.

    `reference`, `fog`: the scene, and what it says of the fog; `starts`: values to begin with, by name; the scene's own
    by default.
    """
    if not names:
        raise InputError(f"fit: got none, wanted some of {', '.join(NAMES)}")
    unknowns = tuple(unknown for name in names for unknown in _read(name, reference, fog))
    seen: set[tuple[str, int, int]] = set()
    for unknown in unknowns:
        places = {(unknown.kind, unknown.number, channel) for channel in unknown.channels}
        if places & seen:
            raise InputError(f"fit: '{unknown.name}' is there twice; name each parameter once")
        seen |= places
    for name in starts:
        if name not in {unknown.name for unknown in unknowns}:
            known = [unknown.name for unknown in unknowns]
            raise InputError(
                f"start: '{name}' is not looked for; wanted one of {', '.join(known)}" + nearest(name, known)
            )
    return tuple(_started(unknown, starts) for unknown in unknowns)


def with_values(unknowns: Sequence[Unknown], fog: Fog, inner: Sequence[float] | NDArray[np.float64]) -> Fog:
    """Return the fog with the values of parameters, given as numbers on the whole line."""
    for unknown, value in zip(unknowns, inner, strict=True):
        fog = unknown.put(fog, unknown.scale.outward(float(value)))
    return fog


def _read(name: str, reference: ReferenceScene, fog: Fog) -> list[Unknown]:
    word, _, place = name.partition(":")
    kind, channels = word, tuple(range(3))
    for channel, letter in enumerate(CHANNELS):
        base = word.removesuffix(f".{letter}")
        if base in ("sigma_t", "albedo", "exposure") and base != word:
            kind, channels = base, (channel,)
    if fog.height is None and kind in LAYERS:
        raise InputError(f"fit: got '{name}'; the scene has no height fog: write it as such, or look for 'sigma_t'")
    names = NAMES if fog.height is None else (*_layers_of(fog.height), *NAMES[1:])
    if kind not in names:
        raise InputError(f"fit: got '{name}', wanted some of {', '.join(names)}" + nearest(word, names))
    if fog.height is not None and kind in LAYERS:
        return [_of_layer(kind, fog.height)]
    if kind == "exposure":
        if place:
            raise InputError(f"fit: got '{name}'; the exposure is that of the whole image: write '{word}'")
        return [Unknown(name, kind, 0, channels, 1.0, _LOG, "1")]
    if kind in ("sigma_t", "albedo", "phase.g"):
        return [
            each
            for number in _media(name, place, reference, fog)
            for each in _of_medium(kind, channels, number, reference, fog)
        ]
    return [_of_light(kind, number, reference) for number in _lights(name, place, kind, reference)]


def _of_medium(kind: str, channels: tuple[int, ...], number: int, reference: ReferenceScene, fog: Fog) -> list[Unknown]:
    several = len(_scattering(fog)) > 1
    ending = f":{_medium_name(number, reference)}" if several else ""
    if kind == "phase.g":
        phase = (reference.medium, *reference.media)[number].phase
        if not phase.is_constant and phase.name != "hg":
            raise InputError(
                f"fit: 'phase.g' is for the phase functions 'hg' and 'isotropic'; this medium has '{phase.name}'"
            )
        own = fog.phase[number]
        g = own if isinstance(own, float) else 0.0
        return [Unknown(kind + ending, kind, number, (0, 1, 2), g, _TANH, "1")]
    values = getattr(fog, kind)[number]
    unit = "1/m" if kind == "sigma_t" else "1"
    groups = [channels] if len({values[c] for c in channels}) == 1 else [(channel,) for channel in channels]
    return [
        Unknown(
            kind + (f".{CHANNELS[group[0]]}" if len(group) == 1 else "") + ending,
            kind,
            number,
            group,
            values[group[0]],
            _LOG,
            unit,
        )
        for group in groups
    ]


def _of_light(kind: str, number: int, reference: ReferenceScene) -> Unknown:
    names = light_names(reference)
    name = kind + (f":{names[number]}" if len(names) > 1 else "")
    if kind == "intensity":
        return Unknown(name, kind, number, (0, 1, 2), 1.0, _LOG, "1")
    if number >= len(reference.lights):
        raise InputError(f"fit: got '{name}', wanted the position of a point or spot light")
    return Unknown(
        name, kind, number, (0, 1, 2), float(reference.lights[number].position[AXES.index(kind[-1])]), _PLAIN, "m"
    )


def _of_layer(kind: str, height: HeightFog) -> Unknown:
    part, number = kind.split("_")
    value = height.constant if number == "0" else getattr(height.layers[int(number) - 1], _PARTS[part])
    return Unknown(kind, kind, 0, (0, 1, 2), value, _PLAIN if part == "z" else _LOG, "1/m" if part == "sigma" else "m")


def _layers_of(height: HeightFog) -> tuple[str, ...]:
    """Return the names of the numbers that height fog has."""
    return tuple(name for name in LAYERS if 0 < int(name[-1]) <= len(height.layers) or name == "sigma_0")


def _with_layer(height: HeightFog | None, kind: str, value: float) -> HeightFog:
    assert height is not None
    part, number = kind.split("_")
    if number == "0":
        return replace(height, constant=value)
    layers = list(height.layers)
    layers[int(number) - 1] = replace(layers[int(number) - 1], **{_PARTS[part]: value})
    return replace(height, layers=tuple(layers))


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
        f"fit: got '{name}', wanted a {what} of the scene, {', '.join(names)}, or its number" + nearest(place, names)
    )


def _started(unknown: Unknown, starts: Mapping[str, float]) -> Unknown:
    value = starts.get(unknown.name, unknown.scene)
    fits = math.isfinite(value)
    wanted = "a finite number"
    if unknown.scale is _LOG:
        fits, wanted = fits and value > 0, "a number above 0"
        if unknown.name not in starts and value <= 0:
            raise InputError(
                f"fit: '{unknown.name}' is {value:g} in the scene, where nothing can begin; give start "
                f"{unknown.name}=VALUE"
            )
    if unknown.scale is _TANH:
        fits, wanted = -1 < value < 1, "a number between -1 and 1"
    if not fits:
        raise InputError(f"start: {unknown.name}={value:g}, wanted {wanted}")
    return replace(unknown, start=float(value), place=unknown.scene)
