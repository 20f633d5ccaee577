# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the medium and of the laws of scattering."""

from dataclasses import replace
from typing import Any

import numpy as np

from validation.diagnosis.hypothesis import Hypothesis, Parameter
from validation.diagnosis.prediction import Guess, Predictor
from validation.fog_model.fog import Colour, Fog


def _each(fog: Fog, change: Any) -> Fog:
    """Return a fog in which a function gives extinction and albedo of every channel of every medium."""
    pairs = [
        [change(s, a) for s, a in zip(sigma_t, albedo, strict=True)]
        for sigma_t, albedo in zip(fog.sigma_t, fog.albedo, strict=True)
    ]
    sigma = tuple(_colour([pair[0] for pair in medium]) for medium in pairs)
    return replace(fog, sigma_t=sigma, albedo=tuple(_colour([pair[1] for pair in medium]) for medium in pairs))


def _colour(values: list[Any]) -> Colour:
    red, green, blue = values
    return red, green, blue


def _fog(change: Any) -> Any:
    return lambda predictor, guess, p: replace(guess, fog=change(guess.fog, *p))


def _extinction(fog: Fog, factor: float) -> Fog:
    return _each(fog, lambda sigma_t, albedo: (sigma_t * factor, albedo))


def _absorption(fog: Fog, factor: float) -> Fog:
    """Return a fog whose absorption has a factor; what it scatters stays."""

    def change(sigma_t: float, albedo: float) -> tuple[float, float]:
        scattering = sigma_t * albedo
        extinction = scattering + factor * (sigma_t - scattering)
        return extinction, scattering / extinction if extinction > 0 else albedo

    return _each(fog, change)


def _sigma_s(fog: Fog) -> Fog:
    """Return a fog that scatters what it should extinguish, with the albedo that it should have."""
    return _each(fog, lambda sigma_t, albedo: (sigma_t / albedo if albedo > 0 else sigma_t, albedo))


def _albedo_twice(fog: Fog) -> Fog:
    return _each(fog, lambda sigma_t, albedo: (sigma_t, albedo**2))


def _albedo_left_out(fog: Fog) -> Fog:
    return _each(fog, lambda sigma_t, albedo: (sigma_t, 1.0))


def _g(fog: Fog, g: float) -> Fog:
    return replace(fog, g=tuple(None if own is None else g for own in fog.g))


def _g_sign(fog: Fog) -> Fog:
    return replace(fog, g=tuple(None if own is None else -own for own in fog.g))


def _lobe(fog: Fog, g: float) -> Fog:
    return replace(fog, g=(g,) * len(fog.g))


def _unit(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    """Return what lengths times a factor make of it: paths grow with it, and light from points falls as its square.

    Irradiance and radiance, of lights that are far or have extent, are what they were.
    """
    near = len(predictor.task.truth.lights)
    intensity = (value / p[0] ** 2 if light < near else value for light, value in enumerate(guess.fog.intensity))
    return replace(guess, fog=replace(_extinction(guess.fog, p[0]), intensity=tuple(intensity)))


def _multiple(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, multiple=(p[0] if predictor.task.holds != "surface" else 0.0, 0.0))


def _all_orders(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, multiple=(p[0], p[0]))


def _near(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, fog=replace(guess.fog, near=p[0]))


def _exact_near(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    near = float(f"{p[0]:.4g}")
    return replace(guess, fog=replace(guess.fog, near=near), scenery=replace(guess.scenery, near=near))


def _usual_near(distance: float) -> Any:
    return lambda predictor, guess, p: replace(guess, fog=replace(guess.fog, near=distance))


def _has_g(predictor: Predictor) -> bool:
    return any(g is not None for g in predictor.fog.g)


def _has_signed_g(predictor: Predictor) -> bool:
    return any(g for g in predictor.fog.g)


def _has_no_g(predictor: Predictor) -> bool:
    media = predictor.task.truth.medium, *predictor.task.truth.media
    return not _has_g(predictor) and any(medium.phase.is_constant for medium in media)


def _surrounds(predictor: Predictor) -> bool:
    return not predictor.task.truth.media


def _absorbs(predictor: Predictor) -> bool:
    fog = predictor.fog
    return any(s > 0 and a < 1 - 1e-6 for ss, aa in zip(fog.sigma_t, fog.albedo) for s, a in zip(ss, aa))


def _shines(predictor: Predictor) -> bool:
    return predictor.task.holds != "surface"


_FACTOR = (0.5, 0.7, 1.4, 2.0)
_USUAL_NEAR = (0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)  # of cameras in engines and modelling programs [m]

MEDIUM = (
    Hypothesis(
        "extinction",
        "medium",
        "the extinction is {0:.4g} times what it should be",
        _fog(_extinction),
        (Parameter("factor", 1e-3, 1e3, (*_FACTOR, 0.1, 10.0), logarithmic=True),),
    ),
    Hypothesis(
        "absorption",
        "medium",
        "the absorption is {0:.4g} times what it should be, at the same scattering",
        _fog(_absorption),
        (Parameter("factor", 0.0, 50.0, (0.0, 0.5, 2.0, 5.0)),),
        applies=_absorbs,
    ),
    Hypothesis(
        "absorption",
        "medium",
        "the medium does not absorb: extinction is only what is scattered",
        _fog(lambda fog: _absorption(fog, 0.0)),
        applies=_absorbs,
    ),
    Hypothesis(
        "sigma-s",
        "medium",
        "the extinction was taken for the scattering coefficient, and absorption came on top",
        _fog(_sigma_s),
        applies=_absorbs,
    ),
    Hypothesis("albedo", "medium", "the albedo was applied twice", _fog(_albedo_twice), applies=_absorbs),
    Hypothesis("albedo", "medium", "the albedo was left out", _fog(_albedo_left_out), applies=_absorbs),
    Hypothesis(
        "g-sign",
        "medium",
        "g of the phase function has the other sign: light that should go on comes back",
        _fog(_g_sign),
        applies=lambda predictor: _has_signed_g(predictor) and _shines(predictor),
    ),
    Hypothesis(
        "g",
        "medium",
        "g of the phase function is {0:.4g}",
        _fog(_g),
        (Parameter("g", -0.99, 0.99, (-0.5, 0.0, 0.4, 0.8)),),
        applies=lambda predictor: _has_g(predictor) and _shines(predictor),
    ),
    Hypothesis(
        "g",
        "medium",
        "the phase function is Henyey and Greenstein's with g {0:.4g}, not isotropic",
        _fog(_lobe),
        (Parameter("g", -0.99, 0.99, (-0.5, 0.4, 0.8)),),
        applies=lambda predictor: _has_no_g(predictor) and _shines(predictor),
    ),
    Hypothesis(
        "light-leg",
        "medium",
        "the way from the light is not attenuated",
        _fog(lambda fog: replace(fog, light_leg=0.0)),
    ),
    Hypothesis(
        "camera-leg",
        "medium",
        "the way to the camera is not attenuated",
        _fog(lambda fog: replace(fog, camera_leg=0.0)),
    ),
    Hypothesis(
        "unit-length",
        "medium",
        "lengths are {0:.4g} times what they should be: another unit of length",
        _unit,
        (Parameter("factor", 1e-4, 1e4, (0.01, 100.0, 0.1, 10.0, 0.3048, 3.2808, 0.001, 1000.0), logarithmic=True),),
        applies=lambda predictor: bool(predictor.task.truth.lights),
    ),
    # Where the fog before it is dark, a near plane is a factor with all digits of one that engines have.
    *(
        Hypothesis(
            "near-plane",
            "medium",
            f"the medium is missing up to {distance:g} m before the camera: a usual near plane",
            _usual_near(distance),
            applies=_surrounds,
        )
        for distance in _USUAL_NEAR
    ),
    Hypothesis(
        "near-plane",
        "medium",
        "the medium is missing up to {0:.4g} m before the camera: its near plane",
        _near,
        (Parameter("distance", 0.0, np.inf, (0.05, 0.2, 0.5, 1.0), unit="m"),),
        applies=_surrounds,
    ),
    # The same without the steps that whole nodes make.
    Hypothesis(
        "near-plane",
        "medium",
        "the medium is missing up to {0:.4g} m before the camera: its near plane",
        _exact_near,
        (Parameter("distance", 0.0, np.inf, (0.1, 0.3, 1.0), step=0.02, unit="m"),),
        costly=1,
        applies=_surrounds,
    ),
    Hypothesis(
        "multiple",
        "medium",
        "{0:.3g} times the light of multiple scattering is included",
        _multiple,
        (Parameter("share", 0.0, 3.0, (1.0,)),),
        costly=1,
        applies=_shines,
    ),
    Hypothesis(
        "multiple",
        "medium",
        "{0:.3g} times the light of higher orders is included, between surfaces and of the medium",
        _all_orders,
        (Parameter("share", 0.0, 3.0, (1.0,)),),
        costly=1,
        applies=lambda predictor: predictor.task.holds == "total",
    ),
)
