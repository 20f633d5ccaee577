# SPDX-License-Identifier: BSD-3-Clause
"""The targets of the faults of `faults.toml`: what of a guess of an image a transform changes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from airlight.analytic.height_fog import HeightFog, Layer
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.arrays import Array
from airlight.validation.engine.curves import PRIMARIES
from airlight.validation.engine.equations import equation
from airlight.validation.engine.fault import Change, Held, Values
from airlight.validation.engine.prediction import Guess, Layers, Predictor
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
    reordered,
)
from airlight.validation.fog_model.laws import Falloff
from airlight.validation.fog_model.radiance import Colour, Fog, Path, PhaseLaw, colour, put


def short(value: float, digits: int = 4) -> float:
    """Return a number with few digits."""
    return float(f"{value:.{digits}g}")


#: By target, the record in a guess whose fields have the values that `faults.toml` says.
RECORDS: Mapping[str, Path] = {
    "fog": ("fog",),
    "scenery": ("scenery",),
    "height": ("fog", "height"),
}


def with_fields(target: str, fields: Mapping[str, object], digits: int = 4) -> Change:
    """Return a change of fields of a record of the guess.

    `fields`: values by field, of which '{0}' stands for the number of the fault; `digits`: of
    this number: sceneries that differ by less share their paths.
    """

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        for field, value in fields.items():
            number = short(p[0], digits) if value == "{0}" else value
            guess = put(guess, (*RECORDS[target], field), number)
        return guess

    return changed


# The fog: its media, the laws of light, and its height.


def changed_fog(change: Callable[..., Fog]) -> Change:
    """Return a change of the fog, by a function of it and the numbers of the fault."""
    return lambda predictor, guess, p: replace(guess, fog=change(guess.fog, *p))


def changed_optics(fog: Fog, change: Callable[[float, float], tuple[float, float]]) -> Fog:
    """Return a fog with other extinction and albedo where any medium is."""
    pairs = [
        [change(s, a) if s > 0 else (s, a) for s, a in zip(sigma_t, albedo, strict=True)]
        for sigma_t, albedo in zip(fog.sigma_t, fog.albedo, strict=True)
    ]
    sigma_t, albedo = (
        tuple(colour([pair[which] for pair in medium]) for medium in pairs) for which in (0, 1)
    )
    return replace(fog, sigma_t=sigma_t, albedo=albedo)


def _optics(change: Callable[..., tuple[float, float]]) -> Change:
    return changed_fog(lambda fog, *p: changed_optics(fog, lambda s, a: change(s, a, *p)))


def _lobes(change: Callable[..., float | PhaseLaw]) -> Change:
    return changed_fog(
        lambda fog, *p: replace(
            fog, phase=tuple(change(g, *p) if isinstance(g, float) else g for g in fog.phase)
        )
    )


def _phase(law: Callable[..., float | PhaseLaw]) -> Change:
    return changed_fog(lambda fog, *p: replace(fog, phase=(law(*p),) * len(fog.phase)))


def _layers(change: Callable[..., Layer]) -> Change:
    """Return a change of every layer of height fog."""

    def changed(fog: Fog, *p: float) -> Fog:
        assert fog.height is not None
        layers = tuple(change(layer, *p) for layer in fog.height.layers)
        return replace(fog, height=replace(fog.height, layers=layers))

    return changed_fog(changed)


def planar(words: Sequence[str]) -> Change:
    """Return a change of where depth along the axis is taken for distance along the ray."""
    return changed_fog(lambda fog: replace(fog, planar=fog.planar | set(words)))


def _law(factor: Callable[..., Array]) -> Change:
    return changed_fog(lambda fog, *p: replace(fog, law=(lambda r: factor(r, *p),) * 2))


def _window(factor: Callable[..., Array]) -> Change:
    return changed_fog(lambda fog, *p: replace(fog, window=lambda r: factor(r, *p)))


def _lit(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return fog whose density is lit, times a factor, whatever its albedo."""
    white = ((1.0, 1.0, 1.0),) * len(guess.fog.albedo)
    return replace(guess, fog=replace(guess.fog, albedo=white, lit=p[0]))


def _softened_with_end(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return light that is softened near its source, and has a range."""
    softened = _law(LAWS["softened"])(predictor, guess, p[:1])
    return _window(WINDOWS["(1 - (r/R)^4)^2"])(predictor, softened, p[1:])


def scaled(field: str, lights: Sequence[int] | None = None) -> Change:
    """Return a change that gives a factor to all entries of a tuple of the fog, or to the entries
    of some lights.
    """

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        factors = tuple(
            value * p[0] if lights is None or light in lights else value
            for light, value in enumerate(getattr(guess.fog, field))
        )
        return with_fields("fog", {field: factors})(predictor, guess, p)

    return changed


def _unit(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return the guess with all lengths times a factor: paths grow with it, and light from
    points falls as its square.

    Irradiance and radiance, of lights that are far or have extent, are what they were. Lengths of an
    engine's equation stay, and are p times shorter in the metres of the scene.
    """
    # Lengths times p: depths are sigma_t p times the old lengths, and 1/r^2 of point and spot
    # lights, which come first, is p^-2 times what it was.
    near = len(predictor.reference.lights)
    intensity = tuple(
        value / p[0] ** 2 if light < near else value
        for light, value in enumerate(guess.fog.intensity)
    )
    fog = changed_optics(guess.fog, lambda sigma_t, albedo: (sigma_t * p[0], albedo))
    first, second = (_at_times(law, p[0]) for law in fog.law)
    fog = replace(
        fog,
        intensity=intensity,
        law=(first, second),
        window=_at_times(fog.window, p[0]),
        corners=tuple(each / p[0] for each in fog.corners),
        light_length=fog.light_length / p[0],
        near=fog.near / p[0],
        far=fog.far / p[0],
        fade=None if fog.fade is None else (fog.fade[0] / p[0], fog.fade[1] / p[0]),
        lobe=None if fog.lobe is None else (fog.lobe[0], fog.lobe[1] / p[0]),
    )
    return replace(guess, fog=fog)


def _at_times(law: Falloff | None, times: float) -> Falloff | None:
    """Return a law by the distance at so many times the distance; 1 is the law itself."""
    return law if law is None or times == 1 else lambda r: law(times * r)


def _falling(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return homogeneous fog with a density that falls with height, from the camera's on."""
    # The layer has the density 1 at the camera: the extinction is a factor on it.
    up = _up(predictor.reference)
    height = HeightFog((Layer(1.0, float(predictor.reference.origin @ up), p[0]),))
    fog = changed_optics(guess.fog, lambda sigma_t, albedo: (sigma_t * p[1], albedo))
    return replace(guess, fog=replace(fog, height=height, up=up))


def _up(reference: ReferenceScene) -> Colour:
    """Return the axis of the scene that is nearest to the camera's own way up."""
    up = camera_matrix(reference.scene.sensors()[0])[:3, 1]
    axis = int(np.argmax(np.abs(up)))
    return colour(np.sign(up[axis]) * np.eye(3)[axis])


def _even(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return height fog with one extinction at all heights."""
    return replace(
        guess, fog=replace(guess.fog, sigma_t=((p[0],) * 3,), height=HeightFog(constant=1.0))
    )


# The scenery: shadows, places of lights, the camera.


def of_fog_alone(change: Change) -> Change:
    """Return a change of the scenery that surfaces do not see."""

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        return replace(change(predictor, guess, p), surfaces=guess.surfaces or guess.scenery)

    return changed


def of_surfaces_alone(change: Change) -> Change:
    """Return a change of the scenery that the fog does not see."""

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        return replace(guess, surfaces=change(predictor, guess, p).scenery)

    return changed


#: By the `part` of a fault, what makes a change of the scenery one of this part alone.
PARTS: Mapping[str, Callable[[Change], Change]] = {
    "fog": of_fog_alone,
    "surfaces": of_surfaces_alone,
}


def _moved(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return a guess with the first light off by a vector."""
    x, y, z = (short(value) for value in p)
    return replace(guess, scenery=replace(guess.scenery, moved=((x, y, z),)))


def position_held(predictor: Predictor, guess: Guess, p: Values, at: Values) -> Guess:
    """Return a guess with the light at p, and shadows as they are where it is at another place.

    The edge of a spot's cone moves more of the fog than all else: there nothing is held.
    """
    if predictor.reference.lights[0].axis is not None:
        return _moved(predictor, guess, p)
    # The paths belong to the light at `at`; the fog moves the light from there to p.
    guess_at = _moved(predictor, guess, at)
    x, y, z = (value - before for value, before in zip(p, guess_at.scenery.moved[0], strict=True))
    return replace(guess_at, fog=guess_at.fog.put(("moved", 0), (x, y, z)))


def _held_in_fog(predictor: Predictor, guess: Guess, p: Values, at: Values) -> Guess:
    return replace(position_held(predictor, guess, p, at), surfaces=guess.surfaces or guess.scenery)


#: Changes with paths held where they are for other values, by the part of the light.
HELD: Mapping[tuple[str, str], Held] = {
    ("first light moved", ""): position_held,
    ("first light moved", "fog"): _held_in_fog,
}


def _camera_moved(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    x, y, z = (short(value) for value in p)
    return replace(guess, scenery=replace(guess.scenery, eye=(x, y, z)))


def _camera_turned(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    right, up, clockwise = (short(value) for value in p)
    return replace(guess, scenery=replace(guess.scenery, turned=(right, up, clockwise)))


def _shifted(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return an image that lies some pixels too far right, and down."""
    # A pixel that shows what lies to the right of it shows an image that moved to the left.
    offset = (-round(p[0], 3), -round(p[1], 3))
    return replace(guess, scenery=replace(guess.scenery, offset=offset))


def _other_axis(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return the guess with the angle of view along the other axis: pixels grow
    with the ratio of the sides.
    """
    height, width = predictor.shape
    return replace(guess, scenery=replace(guess.scenery, zoom=width / height))


# Airlight and surfaces before they are added, and the values of the image.


def _changed_layers(guess: Guess, change: Layers) -> Guess:
    return replace(guess, layers=(*guess.layers, change))


def _mixed(change: Callable[..., tuple[Array, Array]]) -> Change:
    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        transmittance = predictor.transmittance(guess)
        return _changed_layers(
            guess, lambda airlight, surface: change(airlight, surface, transmittance, *p)
        )

    return changed


def _higher_orders(of_surfaces: bool) -> Change:
    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        # Too large an image has no light of higher orders: the fault then changes nothing.
        more = predictor.light.higher_orders
        if more is None:
            return _changed_layers(guess, lambda airlight, surface: (airlight, surface))
        orders = more[:, predictor.pixels]
        return _changed_layers(
            guess,
            lambda airlight, surface: (
                airlight + p[0] * orders[0],
                surface + p[0] * of_surfaces * orders[1],
            ),
        )

    return changed


def _changed_values(change: Callable[..., Array]) -> Change:
    return lambda predictor, guess, p: replace(
        guess, values=(*guess.values, lambda radiance: change(radiance, *p))
    )


def _tinted(words: str) -> Change:
    """Return a change of colours: words are a layer, or 'image' for both, and its channels."""
    layer, channels = words.split()
    places = ["RGB".index(channel) for channel in channels]

    def changed(predictor: Predictor, guess: Guess, p: Values) -> Guess:
        factors = np.ones(3)
        factors[places] = p
        fog, surfaces = (
            factors if layer in ("image", each) else np.ones(3) for each in ("airlight", "surface")
        )
        return _changed_layers(
            guess, lambda airlight, surface: (airlight * fog, surface * surfaces)
        )

    return changed


def _with_primaries(name: str) -> Change:
    matrix = PRIMARIES[name]
    return _changed_values(lambda radiance: radiance @ matrix.T)


def _vignette(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    attenuated = predictor.cosines[:, None] ** p[0]
    return replace(guess, values=(*guess.values, lambda radiance: radiance * attenuated))


def _cut_off(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    values = predictor.observation.values
    most = float(values[np.isfinite(values)].max())
    return replace(guess, values=(*guess.values, lambda radiance: np.minimum(radiance, most)))


def _turned(turn: Callable[[Array], Array]) -> Change:
    """Return the change by a fault of the grid of pixels: the guess says how it is taken back."""
    return lambda predictor, guess, p: replace(guess, undo=turn)


#: Changes that need more of the guess than one quantity.
GUESSES: Mapping[str, Change] = {
    "unit of length": _unit,
    "softened, with an end": _softened_with_end,
    "lit density": _lit,
    "falling density": _falling,
    "even density": _even,
    "first light moved": _moved,
    "camera moved": _camera_moved,
    "camera turned": _camera_turned,
    "shifted": _shifted,
    "field of view of the other axis": _other_axis,
    "higher orders of the fog": _higher_orders(of_surfaces=False),
    "higher orders": _higher_orders(of_surfaces=True),
    "vignette": _vignette,
    "cut off": _cut_off,
}

#: The change that a transform of a target makes, by the name that the target has in `faults.toml`;
#: with the name of the transform.
BY_NAME: Mapping[str, Callable[[str], Change]] = {
    "optics": lambda name: _optics(OPTICS[name]),
    "lobes": lambda name: _lobes(LOBES[name]),
    "phase": lambda name: _phase(PHASES[name]),
    "layer": lambda name: _layers(LAYERS[name]),
    "equation": equation,
    "law": lambda name: _law(LAWS[name]),
    "window": lambda name: _window(WINDOWS[name]),
    "factor": scaled,
    "mix": lambda name: _mixed(MIXES[name]),
    "tint": _tinted,
    "values": lambda name: _changed_values(VALUES[name]),
    "primaries": _with_primaries,
    "channels": lambda order: _changed_values(reordered(order)),
    "grid": lambda name: _turned(TURNS[name]),
    "guess": GUESSES.__getitem__,
}
