# SPDX-License-Identifier: BSD-3-Clause
"""The parameters that a fit may look for, by name: faults of a guess that set a number.

| name | what it is |
|---|---|
| `sigma_t` | extinction of a medium [1/m]; `sigma_t.r`, `.g`, `.b` one channel of it |
| `albedo` | single-scattering albedo; `albedo.r`, `.g`, `.b` |
| `sigma_1`, `z_1`, `H_1` | of a layer: extinction at its base [1/m], base, scale height [m] |
| `sigma_2`, `z_2`, `H_2`, `sigma_0` | the second layer, and the constant part [1/m] |
| `phase.g` | g of Henyey and Greenstein's function |
| `intensity` | factor on a light |
| `light.x`, `light.y`, `light.z` | position of a light [m] |
| `exposure` | factor on the whole image; `exposure.r`, `.g`, `.b` |

Where a scene has several media or lights, the name of one follows after a colon, `sigma_t:fog` or
`intensity:lamp`, or its number, from 1 on; without it all of them are meant, one parameter for
each. In a medium whose channels differ `sigma_t` and `albedo` stand for three parameters.

Positive parameters are looked for by their logarithms, g by artanh g: all values are allowed that
are possible, and a step is a relative change. A coordinate of a light counts in distances from the
camera to the farthest lamp, a base in scale heights: a fit of a scene in other units is the same.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airlight.analytic.height_fog import HeightFog
from airlight.analytic.phase import CornetteShanks
from airlight.errors import InputError, nearest
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.engine.fault import Fault, Number, Values
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.fog_model.radiance import Fog, Path, PhaseLaw, colour, scene_fog
from airlight.validation.fog_model.view import light_sources

CHANNELS = ("r", "g", "b")
AXES = ("x", "y", "z")
#: of height fog, as scenes have them
LAYERS = ("sigma_1", "z_1", "H_1", "sigma_2", "z_2", "H_2", "sigma_0")
# of a layer of height fog, by the letters of a scene
_PARTS = {"sigma": "sigma_t", "z": "base", "H": "scale_height"}
_RANGES = {"log": (1e-300, 1e300), "tanh": (-1 + 1e-15, 1 - 1e-15), "plain": (-math.inf, math.inf)}
_BY_LETTERS = {"sigma": ("log", "1/m"), "z": ("plain", "m"), "H": ("log", "m")}
_KINDS = {  # how a parameter is looked for, and its unit
    "sigma_t": ("log", "1/m"),
    "albedo": ("log", "1"),
    "phase.g": ("tanh", "1"),
    "intensity": ("log", "1"),
    **{f"light.{axis}": ("plain", "m") for axis in AXES},
    "exposure": ("log", "1"),
    **{name: _BY_LETTERS[name[:-2]] for name in LAYERS},
}
NAMES = tuple(_KINDS)[: -len(LAYERS)]  #: of the parameters of homogeneous media
_OF_MEDIA = ("sigma_t", "albedo", "phase.g")


@dataclass(frozen=True)
class Unknown(Fault):
    """A parameter that is looked for: a fault that sets a number, whose kind is
    one of `NAMES` or `LAYERS`.
    """

    paths: tuple[Path, ...] = ()  #: the numbers of a fog that it stands for
    scene: float = math.nan  #: value in the scene

    @property
    def number(self) -> Number:
        """Its number; the value to begin with is its start."""
        return self.parameters[0]

    @property
    def unit(self) -> str:
        """The unit of its value."""
        return _KINDS[self.kind][1]


def _unknown(
    name: str,
    kind: str,
    paths: tuple[Path, ...],
    scene: float,
    meaning: Callable[[float], float | PhaseLaw] = float,
    unit: float = 1.0,
) -> Unknown:
    """Return a number of a fog; `meaning` is what the fog has for its value, `unit` that of a plain
    one.
    """
    number = Number(*_RANGES[_KINDS[kind][0]], starts=(scene,), scale=_KINDS[kind][0], unit=unit)

    def change(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        fog = guess.fog
        for path in paths:
            fog = fog.put(path, meaning(p[0]))
        return replace(guess, fog=fog)

    return Unknown(
        name, f"{name} is {{0:.6g}}", change, (number,), kind=kind, paths=paths, scene=scene
    )


def _coordinate(name: str, kind: str, light: int, reference: ReferenceScene) -> Unknown:
    """Return a coordinate of the position of a light: shadows move with it,
    except where paths are held.
    """
    axis, places = AXES.index(kind[-1]), [each.position for each in reference.lights]
    scene, path = float(places[light][axis]), ("moved", light, axis)

    def change(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        # Coordinates of a light are looked for one by one: those that an earlier one moved stay.
        moved = np.zeros((len(places), 3))
        moved[: len(guess.scenery.moved)] = guess.scenery.moved
        moved[light, axis] = p[0] - scene
        return replace(
            guess, scenery=replace(guess.scenery, moved=tuple(colour(each) for each in moved))
        )

    def held(predictor: Predictor, guess: Guess, p: Values, at: Values) -> Guess:
        # Paths belong to the light at `at`; the fog model moves it from there without new shadows.
        guess = change(predictor, guess, at)
        return replace(guess, fog=guess.fog.put(path, p[0] - at[0]))

    # The distance from the camera to the farthest lamp; one at the camera has none.
    away = max(float(np.linalg.norm(place - reference.origin)) for place in places)
    number = Number(*_RANGES["plain"], starts=(scene,), unit=away or 1.0)
    return Unknown(
        name,
        f"{name} is {{0:.6g}}",
        change,
        (number,),
        held=held,
        kind=kind,
        paths=(path,),
        scene=scene,
    )


def read_unknowns(
    names: Sequence[str],
    reference: ReferenceScene,
    starts: Mapping[str, float],
    model: Model = PHYSICAL,
) -> tuple[Unknown, ...]:
    """Return the parameters that names stand for.

    `starts`: values to begin with, by name; those of the scene by default. `model` is the equation
    that the image should solve.
    """
    fog = scene_fog(reference)
    if not names:
        raise InputError(f"fit: got none, expected some of {', '.join(NAMES)}")
    unknowns = tuple(unknown for name in names for unknown in _read(name, reference, fog, model))
    # Two names may stand for one number, such as sigma_t and sigma_t.r.
    paths: set[Path] = set()
    for unknown in unknowns:
        if paths & set(unknown.paths):
            raise InputError(f"fit: '{unknown.name}' is there twice; name each parameter once")
        paths |= set(unknown.paths)
    for name in starts:
        if name not in {unknown.name for unknown in unknowns}:
            expected = [unknown.name for unknown in unknowns]
            raise InputError(
                f"start: '{name}' is not looked for; expected one of {', '.join(expected)}"
                + nearest(name, expected)
            )
    return tuple(_started(unknown, starts) for unknown in unknowns)


def _read(name: str, reference: ReferenceScene, fog: Fog, model: Model) -> list[Unknown]:
    # A name has up to three parts, 'sigma_t.r:fog': the kind, a channel, and a medium or light.
    # phase.g has a dot that is no channel.
    word, _, place = name.partition(":")
    base, _, letter = word.rpartition(".")
    alone = base in ("sigma_t", "albedo", "exposure") and letter in CHANNELS
    kind, channels = (base, (CHANNELS.index(letter),)) if alone else (word, (0, 1, 2))
    if fog.height is None and kind in LAYERS:
        raise InputError(
            f"fit: got '{name}'; the scene has no height fog: write it as such, or look for "
            "'sigma_t'"
        )
    # In height fog the numbers of its layers take the place of sigma_t.
    names = NAMES if fog.height is None else (*_layers_of(fog.height), *NAMES[1:])
    if kind not in names:
        raise InputError(
            f"fit: got '{name}', expected some of {', '.join(names)}" + nearest(word, names)
        )
    if kind in LAYERS:
        assert fog.height is not None
        # sigma_0 is the constant part of the density, which is no layer.
        part, layer = _PARTS[kind[:-2]], int(kind[-1]) - 1
        if layer < 0:
            return [_unknown(kind, kind, (("height", "constant"),), fog.height.constant)]
        own = fog.height.layers[layer]
        unit = own.scale_height if part == "base" else 1.0
        path: Path = ("height", "layers", layer, part)
        return [_unknown(kind, kind, (path,), getattr(own, part), unit=unit)]
    # The exposure belongs to the image; all other kinds belong to a medium or a light, and without
    # a place there is an unknown for each.
    if kind == "exposure":
        if place:
            raise InputError(
                f"fit: got '{name}'; the exposure is that of the whole image: write '{word}'"
            )
        return [_unknown(name, kind, tuple((kind, channel) for channel in channels), 1.0)]
    unknowns = []
    for number, ending in _chosen(name, place, kind, reference, fog):
        if kind in _OF_MEDIA:
            unknowns += _of_medium(kind, channels, number, ending, reference, fog, model)
        elif kind == "intensity":
            unknowns.append(_unknown(kind + ending, kind, ((kind, number),), 1.0))
        else:
            unknowns.append(_coordinate(kind + ending, kind, number, reference))
    return unknowns


def _of_medium(
    kind: str,
    channels: tuple[int, ...],
    number: int,
    ending: str,
    reference: ReferenceScene,
    fog: Fog,
    model: Model,
) -> list[Unknown]:
    """Return the unknowns of a medium; `ending`: of their names, where there are several media."""
    if kind == "phase.g":
        # An isotropic medium has no lobe, and begins with g = 0.
        phase, g = (reference.medium, *reference.media)[number].phase, fog.phase[number]
        if not phase.is_constant and phase.name != "hg":
            raise InputError(
                "fit: 'phase.g' is for the phase functions 'hg' and 'isotropic'; this medium has "
                f"'{phase.name}'"
            )
        if model.phase not in ("scene", "none", "cornette-shanks"):
            raise InputError(
                f"fit: 'phase.g' is that of the scene, and the model has phase={model.phase}; leave "
                "one of them out"
            )
        begin, path = g if isinstance(g, float) else 0.0, ("phase", number)
        law = CornetteShanks if model.phase == "cornette-shanks" else float
        return [_unknown(kind + ending, kind, (path,), begin, law)]
    if kind == "albedo" and model.lit_scale is not None:
        raise InputError(
            "fit: 'albedo' is no part of the model, which has a lit density; leave one of them out"
        )
    # Channels that are all equal in the scene are one unknown; otherwise each of them is one.
    values = getattr(fog, kind)[number]
    groups = (
        [channels]
        if len({values[c] for c in channels}) == 1
        else [(channel,) for channel in channels]
    )
    return [
        _unknown(
            kind + (f".{CHANNELS[group[0]]}" if len(group) == 1 else "") + ending,
            kind,
            tuple((kind, number, channel) for channel in group),
            values[group[0]],
        )
        for group in groups
    ]


def _layers_of(height: HeightFog) -> tuple[str, ...]:
    """Return the names of the numbers that height fog has."""
    return tuple(
        name for name in LAYERS if 0 < int(name[-1]) <= len(height.layers) or name == "sigma_0"
    )


def _chosen(
    name: str, place: str, kind: str, reference: ReferenceScene, fog: Fog
) -> list[tuple[int, str]]:
    """Return the numbers of media or lights, and the endings that names have for them
    where there are several.
    """
    if kind in _OF_MEDIA:
        what, names = "medium", ["medium", *(medium.name for medium in reference.media)]
        # The medium without bounds is the camera's: its id in the file is another name of it.
        around = reference.scene.sensors()[0].get_medium()
        place = "medium" if around is not None and place and place == around.id() else place
        # A vacuum has no parameters.
        numbers = [number for number, sigma_t in enumerate(fog.sigma_t) if max(sigma_t) > 0]
        several = len(numbers) > 1
    else:
        # Every light has an intensity; only point and spot lights, which come first, have a place.
        what, names = "light", [source.name for source in light_sources(reference)]
        several = len(names) > 1
        numbers = list(range(len(names) if kind == "intensity" else len(reference.lights)))
    names = [names[number] for number in numbers]
    if not numbers:
        raise InputError(f"fit: got '{name}'; the scene has no {what} of this kind")
    choices = [
        (number, f":{each}" if several else "") for number, each in zip(numbers, names, strict=True)
    ]
    if not place:
        return choices
    # A name wins over a number: a light may be called '2'.
    if place in names:
        return [choices[names.index(place)]]
    if place.isdecimal() and 1 <= int(place) <= len(choices):
        return [choices[int(place) - 1]]
    raise InputError(
        f"fit: got '{name}', expected a {what} of the scene, {', '.join(names)}, or its number"
        + nearest(place, names)
    )


def _started(unknown: Unknown, starts: Mapping[str, float]) -> Unknown:
    # The logarithm of a parameter that is 0 in the scene has no place to begin.
    value = float(starts.get(unknown.name, unknown.scene))
    scale = unknown.number.scale
    if scale == "log" and unknown.name not in starts and value <= 0:
        raise InputError(
            f"fit: '{unknown.name}' is {value:g} in the scene, where nothing can begin; give start "
            f"{unknown.name}=VALUE"
        )
    expected = {
        "log": "a number above 0",
        "tanh": "a number between -1 and 1",
        "plain": "a finite number",
    }[scale]
    if not (math.isfinite(value) and unknown.number.low <= value <= unknown.number.high):
        raise InputError(f"start: {unknown.name}={value:g}, expected {expected}")
    return replace(unknown, parameters=(replace(unknown.number, starts=(value,)),))
