# SPDX-License-Identifier: BSD-3-Clause
"""Faults of lights and shadows."""

from dataclasses import replace
from typing import Any

import numpy as np

from validation.diagnosis.hypothesis import Hypothesis, Parameter
from validation.diagnosis.prediction import Guess, Predictor


def _scenery(**given: Any) -> Any:
    return lambda predictor, guess, p: replace(guess, scenery=replace(guess.scenery, **given))


def _factor(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    red, green, blue = guess.fog.exposure
    return replace(guess, fog=replace(guess.fog, exposure=(red * p[0], green * p[0], blue * p[0])))


def _ratio(predictor: Predictor, guess: Guess) -> tuple[float, ...]:
    """Return the usual ratio of image and guess."""
    predicted, seen = predictor.predicted(guess), predictor.seen(guess)
    lit = (predicted > 0.01 * predicted.mean()) & (seen > 0)
    return (float(np.median(seen[lit] / predicted[lit])) if lit.any() else 1.0,)


def _distance_law(power: float) -> Any:
    return lambda predictor, guess, p: replace(guess, fog=replace(guess.fog, distance_power=power))


def _radius(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, scenery=replace(guess.scenery, radius=_rounded(p[0])))


def _position(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    x, y, z = (_rounded(value) for value in p)
    return replace(guess, scenery=replace(guess.scenery, moved=(x, y, z)))


def _cone(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, scenery=replace(guess.scenery, cone=_rounded(p[0])))


def _blend(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    return replace(guess, scenery=replace(guess.scenery, blend=_rounded(p[0])))


def _rounded(value: float) -> float:
    """Return a value with few digits: sceneries that differ by less share their paths."""
    return float(f"{value:.4g}")


def _occluders(predictor: Predictor) -> bool:
    return bool(predictor.task.truth.occluders.shapes())


def _near_lights(predictor: Predictor) -> bool:
    return bool(predictor.task.truth.lights)


def _point_lights(predictor: Predictor) -> bool:
    return any(light.axis is None for light in predictor.task.truth.lights)


def _spots(predictor: Predictor) -> bool:
    return any(light.axis is not None for light in predictor.task.truth.lights)


def _soft(predictor: Predictor) -> bool:
    return any(light.axis is not None and 0 < light.beam < light.cutoff for light in predictor.task.truth.lights)


LIGHTS = (
    Hypothesis(
        "factor",
        "brightness",
        "the image is {0:.4g} times as bright as it should be",
        _factor,
        (Parameter("factor", 1e-9, 1e9, (1.0,), logarithmic=True),),
        begin=_ratio,
    ),
    Hypothesis("no-shadow", "light", "nothing casts a shadow", _scenery(shadows=False), applies=_occluders),
    Hypothesis(
        "distance-law",
        "light",
        "the light falls as one over the distance, not over its square",
        _distance_law(1.0),
        applies=_near_lights,
    ),
    Hypothesis(
        "distance-law", "light", "the light does not fall with the distance", _distance_law(0.0), applies=_near_lights
    ),
    Hypothesis(
        "spot-angle",
        "light",
        "the angles of spots are twice what they should be: a half angle was taken for a whole one",
        _scenery(cone=2.0),
        applies=_spots,
    ),
    Hypothesis(
        "spot-angle",
        "light",
        "the angles of spots are half of what they should be: a whole angle was taken for a half one",
        _scenery(cone=0.5),
        applies=_spots,
    ),
    Hypothesis(
        "spot-angle",
        "light",
        "the angles of spots are {0:.4g} times what they should be",
        _cone,
        (Parameter("factor", 0.2, 4.0, (0.8, 1.25), logarithmic=True, step=0.02),),
        costly=1,
        applies=_spots,
    ),
    Hypothesis(
        "spot-falloff", "light", "spots have a hard edge, without falloff", _scenery(edge="hard"), applies=_soft
    ),
    Hypothesis(
        "spot-falloff",
        "light",
        "spots fall off from their axis on, not from the beam's edge",
        _scenery(edge="smooth"),
        applies=_spots,
    ),
    Hypothesis(
        "spot-falloff",
        "light",
        "spots fall off as Blender's with a blend of {0:.3g}, which its own is 0.15: smoothly by the cosine",
        _blend,
        (Parameter("blend", 0.01, 1.0, (0.15, 0.5, 1.0), step=0.01),),
        costly=1,
        applies=_spots,
    ),
    Hypothesis(
        "light-radius",
        "light",
        "point lights are spheres of the radius {0:.3g} m",
        _radius,
        (Parameter("radius", 0.0, 10.0, (0.05, 0.2, 0.5), step=0.01, unit="m"),),
        costly=2,
        applies=_point_lights,
    ),
    Hypothesis(
        "light-position",
        "light",
        "the first light is off by ({0:.3g}, {1:.3g}, {2:.3g}) m",
        _position,
        tuple(Parameter(axis, -1e3, 1e3, (0.0,), step=0.003, unit="m") for axis in "xyz"),
        costly=1,
        applies=_near_lights,
    ),
)
