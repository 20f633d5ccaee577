# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the medium, and of the laws of scattering and attenuation."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from airlight.analytic.height_fog import HeightFog, Layer
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.arrays import Array
from airlight.validation.engine.curves import from_srgb, to_srgb
from airlight.validation.engine.fault import (
    Change,
    Fault,
    Number,
    Values,
    changed_fog,
    changed_layers,
    short,
    with_law,
)
from airlight.validation.engine.prediction import Guess, Layers, Predictor
from airlight.validation.fog_model.radiance import Colour, Fog, PhaseLaw, colour

_FACTOR = (0.5, 0.7, 1.4, 2.0)  # factors to begin with
_SHIFT = Number(-100.0, 100.0, (-10.0, -2.0, -0.5, 0.5, 2.0, 10.0))  # of heights [m]
# of cameras in engines and modelling programs [m]
_USUAL_NEAR = (0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def _optics(change: Callable[..., tuple[float, float]]) -> Change:
    """Return a function that sets extinction and albedo of every channel of every medium."""
    return changed_fog(lambda fog, *p: changed_optics(fog, lambda s, a: change(s, a, *p)))


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


def _absorption(sigma_t: float, albedo: float, factor: float = 0.0) -> tuple[float, float]:
    """Return optics whose absorption has a factor; the scattering stays."""
    # The albedo is the same scattering over the new extinction.
    scattering = sigma_t * albedo
    extinction = scattering + factor * (sigma_t - scattering)
    return extinction, scattering / extinction if extinction > 0 else albedo


def _lobes(choose: Callable[[float], float | PhaseLaw]) -> Change:
    """Return a function that changes every Henyey-Greenstein phase function by its g."""
    return changed_fog(
        lambda fog: replace(
            fog, phase=tuple(choose(g) if isinstance(g, float) else g for g in fog.phase)
        )
    )


def _schlick(k: float) -> PhaseLaw:
    return lambda cosine: (1 - k * k) / (1 - k * cosine) ** 2


def _cornette_shanks(g: float) -> PhaseLaw:
    return lambda cosine: (
        1.5 * (1 - g * g) / (2 + g * g) * (1 + cosine**2) / (1 + g * g - 2 * g * cosine) ** 1.5
    )


def _rayleigh(cosine: Array) -> Array:
    return 0.75 * (1 + cosine**2)


def _cosine(cosine: Array) -> Array:
    return 4 * np.maximum(cosine, 0.0)


def _every_phase(law: float | PhaseLaw) -> Change:
    return changed_fog(lambda fog: replace(fog, phase=(law,) * len(fog.phase)))


def _unit(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return the guess with all lengths times a factor: paths grow with it, and light from
    points falls as its square.

    Irradiance and radiance, of lights that are far or have extent, are what they were.
    """
    # Lengths times p: depths are sigma_t p times the old lengths, and 1/r^2 of point and spot
    # lights, which come first, is p^-2 times what it was.
    near = len(predictor.reference.lights)
    intensity = tuple(
        value / p[0] ** 2 if light < near else value
        for light, value in enumerate(guess.fog.intensity)
    )
    fog = changed_optics(guess.fog, lambda sigma_t, albedo: (sigma_t * p[0], albedo))
    return replace(guess, fog=replace(fog, intensity=intensity))


def _between(spherical: bool, end: str, at: float | None = None) -> Change:
    """Return a function that begins or ends the medium at a distance, a given one or
    a parameter of the fault.
    """
    return changed_fog(
        lambda fog, *p: replace(
            fog, **{end: short(p[0]) if at is None else at, "spherical": spherical}
        )
    )


def _depths(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    """Return distances at which a fog may end: parts of those that the image shows."""
    # Parts of the distance of the farther surfaces, or of twice the farthest light where no surface
    # is in the image.
    view = predictor.view
    distances = view.distance[np.isfinite(view.distance)]
    lights = [
        float(np.linalg.norm(light.position - view.reference.origin))
        for light in view.reference.lights
    ]
    far = float(np.quantile(distances, 0.9)) if distances.size else 2 * max(lights, default=5.0)
    return [(far * part,) for part in (0.9, 0.6, 0.35)]


def _falling(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return homogeneous fog with a density that falls with height, from the camera's on."""
    # The layer has the density 1 at the camera: the extinction is a factor on it.
    up = _up(predictor.reference)
    height = HeightFog((Layer(1.0, float(predictor.reference.origin @ up), p[0]),))
    fog = changed_optics(guess.fog, lambda sigma_t, albedo: (sigma_t * p[1], albedo))
    return replace(guess, fog=replace(fog, height=height, up=up))


def _even(predictor: Predictor, guess: Guess, p: Values) -> Guess:
    """Return height fog with one extinction at all heights."""
    return replace(
        guess, fog=replace(guess.fog, sigma_t=((p[0],) * 3,), height=HeightFog(constant=1.0))
    )


def _densities(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    """Return extinctions that height fog has at the camera and at lights, and fractions of them."""
    fog, places = (
        guess.fog.height,
        [predictor.reference.origin, *(light.position for light in predictor.reference.lights)],
    )
    assert fog is not None
    mean = float(np.mean(fog.density([place @ guess.fog.up for place in places])))
    return [(max(mean, 1e-3) * part,) for part in (1.0, 0.3, 3.0)]


def _layers(change: Callable[..., Layer]) -> Change:
    """Return a function that changes every layer of height fog."""

    def changed(fog: Fog, *p: float) -> Fog:
        assert fog.height is not None
        layers = tuple(change(layer, *p) for layer in fog.height.layers)
        return replace(fog, height=replace(fog.height, layers=layers))

    return changed_fog(changed)


def _stretched(factor: Callable[..., float]) -> Change:
    """Return a function that gives every layer another scale height."""
    return _layers(lambda layer, *p: replace(layer, scale_height=factor(layer.scale_height, *p)))


def _up(reference: ReferenceScene) -> Colour:
    """Return the axis of the scene that is nearest to the camera's own way up."""
    up = camera_matrix(reference.scene.sensors()[0])[:3, 1]
    axis = int(np.argmax(np.abs(up)))
    return colour(np.sign(up[axis]) * np.eye(3)[axis])


def _heights(predictor: Predictor, guess: Guess) -> Sequence[Values]:
    """Return scale heights and factors to begin with: parts of the depth of the scene."""
    size = _depths(predictor, guess)[0][0]
    return [(size * part, factor) for part in (0.1, 0.3, 1.0) for factor in (1.0, 2.0)]


def _depth_for_distance(*what: str) -> Change:
    return changed_fog(lambda fog: replace(fog, planar=fog.planar | set(what)))


def _multiple(of_surfaces: bool) -> Change:
    def make(predictor: Predictor, guess: Guess, p: Values) -> Layers:
        # Too large an image has no light of higher orders: the fault then changes nothing.
        more = predictor.light.higher_orders
        if more is None:
            return lambda airlight, surface: (airlight, surface)
        orders = more[:, predictor.pixels]
        return lambda airlight, surface: (
            airlight + p[0] * orders[0],
            surface + p[0] * of_surfaces * orders[1],
        )

    return changed_layers(make)


MEDIUM = (
    Fault(
        "extinction",
        "the extinction is one over what it should be: a mean free path was asked for",
        _optics(lambda sigma_t, albedo: (1 / sigma_t, albedo)),
        needs=("even fog",),
    ),
    Fault(
        "extinction",
        "the extinction is {0:.4g} times what it should be",
        _optics(lambda sigma_t, albedo, factor: (sigma_t * factor, albedo)),
        (Number(1e-3, 1e3, (*_FACTOR, 0.1, 10.0), scale="log"),),
    ),
    Fault(
        "absorption",
        "the absorption is {0:.4g} times what it should be, at the same scattering",
        _optics(_absorption),
        (Number(0.0, 50.0, (0.0, 0.5, 2.0, 5.0)),),
        needs=("absorption",),
    ),
    Fault(
        "absorption",
        "the medium does not absorb: extinction is only what is scattered",
        _optics(_absorption),
        needs=("absorption",),
    ),
    Fault(
        "sigma-s",
        "the extinction was taken for the scattering coefficient, and absorption came on top",
        _optics(lambda sigma_t, albedo: (sigma_t / albedo if albedo > 0 else sigma_t, albedo)),
        needs=("absorption",),
    ),
    *(
        Fault("albedo", f"the albedo was {words}", _optics(change), needs=("absorption",))
        for words, change in (
            ("applied twice", lambda sigma_t, albedo: (sigma_t, albedo**2)),
            ("left out", lambda sigma_t, albedo: (sigma_t, 1.0)),
            (
                "decoded by the sRGB curve, as the value of a colour picker",
                lambda sigma_t, albedo: (sigma_t, float(from_srgb(np.array(albedo)))),
            ),
            (
                "encoded by the sRGB curve",
                lambda sigma_t, albedo: (sigma_t, float(to_srgb(np.array(albedo)))),
            ),
        )
    ),
    Fault(
        "g-sign",
        "g of the phase function has the other sign: light that should go on comes back",
        _lobes(lambda g: -g),
        needs=("g",),
    ),
    Fault(
        "g",
        "g of the phase function is {0:.4g}",
        lambda predictor, guess, p: _lobes(lambda g: float(p[0]))(predictor, guess, ()),
        (Number(-0.99, 0.99, (-0.5, 0.0, 0.4, 0.8)),),
        needs=("lobes",),
    ),
    Fault(
        "g",
        "the phase function is Henyey and Greenstein's with g {0:.4g}, not isotropic",
        lambda predictor, guess, p: _every_phase(float(p[0]))(predictor, guess, ()),
        (Number(-0.99, 0.99, (-0.5, 0.4, 0.8)),),
        needs=("fog", "isotropy"),
    ),
    *(
        Fault("phase", f"the phase function is {words}", change, needs=("lobes",))
        for words, change in (
            ("isotropic", _lobes(lambda g: 0.0)),
            (
                "Schlick's, with k = 1.55 g - 0.55 g^3",
                _lobes(lambda g: _schlick(1.55 * g - 0.55 * g**3)),
            ),
            ("Schlick's, with k = g", _lobes(_schlick)),
            ("Cornette and Shanks's, with the same g", _lobes(_cornette_shanks)),
        )
    ),
    Fault("phase", "the phase function is Rayleigh's", _every_phase(_rayleigh), needs=("fog",)),
    Fault(
        "phase", "a cosine was taken for the phase function", _every_phase(_cosine), needs=("fog",)
    ),
    *(
        Fault(
            name,
            f"the way {words} is not attenuated",
            with_law(**{name.replace("path", "segment").replace("-", "_"): (0.0, 0.0)}),
        )
        for name, words in (("light-path", "from the light"), ("camera-path", "to the camera"))
    ),
    Fault(
        "no-extinction",
        "nothing is attenuated, neither on the way from the light nor on the way to the camera: "
        "the extinction is "
        "missing, what is scattered is right",
        with_law(light_segment=(0.0, 0.0), camera_segment=(0.0, 0.0)),
    ),
    *(
        Fault(
            f"{of}-path",
            f"the way {words} is not attenuated for {which}",
            with_law(**{f"{of}_segment": segments}),
            needs=("both",),
        )
        for of, words in (("light", "from the light"), ("camera", "to the camera"))
        for which, segments in (
            ("the fog, for surfaces it is", (0.0, 1.0)),
            ("surfaces, for the fog it is", (1.0, 0.0)),
        )
    ),
    Fault(
        "unit-length",
        "lengths are {0:.4g} times what they should be: another unit of length",
        _unit,
        (Number(1e-4, 1e4, (0.01, 100.0, 0.1, 10.0, 0.3048, 3.2808, 0.001, 1000.0), scale="log"),),
        needs=("lamps",),
    ),
    # Where the fog before it is dark, a near plane is a factor with all digits
    # of one that engines have.
    *(
        Fault(
            "near-plane",
            f"the medium is missing up to {distance:g} m before the camera: a usual near plane",
            _between(False, "near", at=distance),
            needs=("no bounds",),
        )
        for distance in _USUAL_NEAR
    ),
    *(
        Fault(
            "near-plane",
            f"the medium is missing up to {{0:.4g}} m {words}",
            _between(spherical, "near"),
            (Number(0.0, np.inf, (0.05, 0.2, 0.5, 1.0)),),
            needs=("no bounds",),
        )
        for words, spherical in (
            ("before the camera: its near plane", False),
            ("away from the camera, along each ray: a start distance", True),
        )
    ),
    *(
        Fault(
            "fog-end",
            f"the fog ends {{0:.3g}} m {words}: beyond, nothing is scattered or attenuated",
            _between(spherical, "far"),
            (Number(1e-3, np.inf, scale="log"),),
            begin=_depths,
            costly=1,
            needs=("no bounds", "fog"),
        )
        for words, spherical in (
            ("before the camera, at a plane", False),
            ("away from the camera", True),
        )
    ),
    *(
        Fault(
            "depth-axis",
            "distances along the axis of the camera were taken for distances along the ray "
            f"{where}",
            change,
            needs=needs,
        )
        for where, change, needs in (
            (
                "in the attenuation and where rays end",
                _depth_for_distance("surfaces", "ends"),
                ("fog",),
            ),
            ("in the attenuation", _depth_for_distance("nodes", "surfaces"), ("shapes",)),
            (
                "in the attenuation and the steps of the march",
                _depth_for_distance("nodes", "surfaces", "steps"),
                ("fog",),
            ),
            ("in the attenuation of surfaces", _depth_for_distance("surfaces"), ("both",)),
        )
    ),
    Fault(
        "height-fog",
        "the density falls with height, to 1/e in {0:.3g} m, and is {1:.3g} times what it should "
        "be at the camera",
        _falling,
        (Number(1e-2, 1e4, scale="log"), Number(1e-2, 1e2, scale="log")),
        begin=_heights,
        single=True,
        needs=("no bounds", "even fog"),
    ),
    Fault(
        "homogeneous",
        "the fog is homogeneous, of the extinction {0:.4g} 1/m: its density does not fall with "
        "height",
        _even,
        (Number(1e-5, 1e3, scale="log"),),
        begin=_densities,
        single=True,
        needs=("height fog",),
    ),
    *(
        Fault("scale-height", words, _stretched(factor), needs=("height fog",))
        for words, factor in (
            (
                "scale heights are one over what they should be: a falloff was asked for",
                lambda h: 1 / h,
            ),
            ("densities halve in what should be the scale height", lambda h: h / math.log(2)),
            (
                "scale heights are ln 2 times what they should be: heights were taken that halve "
                "densities",
                lambda h: h * math.log(2),
            ),
        )
    ),
    Fault(
        "scale-height",
        "scale heights are {0:.4g} times what they should be",
        _stretched(lambda h, factor: h * factor),
        (Number(1e-3, 1e3, _FACTOR, scale="log"),),
        needs=("height fog",),
    ),
    *(
        Fault(
            "base-height",
            f"layers {words}",
            changed_fog(
                lambda fog, clamped=clamped: replace(
                    fog, height=replace(fog.height, clamped=clamped)
                )
            ),
            needs=("height fog", need),
        )
        for words, clamped, need in (
            ("are clamped: their density is constant below their base", True, "rising layers"),
            (
                "are not clamped: their density goes on rising below their base",
                False,
                "clamped layers",
            ),
        )
    ),
    Fault(
        "base-height",
        "bases of layers are {0:+.4g} m higher than they should be",
        _layers(lambda layer, shift: replace(layer, base=layer.base + shift)),
        (_SHIFT,),
        needs=("height fog",),
    ),
    Fault(
        "height-fog",
        "scale heights are {0:.4g} times what they should be, and bases {1:+.4g} m higher",
        _layers(
            lambda layer, factor, shift: Layer(
                layer.sigma_t, layer.base + shift, layer.scale_height * factor
            )
        ),
        (Number(1e-3, 1e3, scale="log"), _SHIFT),
        begin=lambda predictor, guess: [
            (factor, shift) for factor in (0.5, 1.0, 2.0) for shift in (-1.0, 0.0, 1.0)
        ],
        single=True,
        needs=("height fog",),
    ),
    Fault(
        "multiple",
        "{0:.3g} times the light of multiple scattering is included",
        _multiple(of_surfaces=False),
        (Number(0.0, 3.0),),
        costly=1,
        needs=("fog", "more light"),
    ),
    Fault(
        "multiple",
        "{0:.3g} times the light of higher orders is included, between surfaces and of the medium",
        _multiple(of_surfaces=True),
        (Number(0.0, 3.0),),
        costly=1,
        needs=("all light", "more light"),
    ),
)
