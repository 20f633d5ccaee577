# SPDX-License-Identifier: BSD-3-Clause
"""Values at which the search for the numbers of a fault begins, by what the image shows.

A fault of `faults.toml` names one of `STARTS`. Each is a function of the predictor of the image,
the guess that the fault changes, and its change.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.engine.fault import Change, Values
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.fog_model.view import SCENERY

Start = Callable[[Predictor, Guess, Change], Sequence[Values]]


def _corners(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return the best of no shift and half a pixel each way: at sharp edges slopes of
    one do not lead to others.
    """

    def error(shift: Values) -> float:
        return float(np.abs(predictor.errors(change(predictor, guess, shift))).mean())

    # Without a shift, or half a pixel in both directions.
    return [min(((0.0, 0.0), *product((-0.5, 0.5), repeat=2)), key=error)]


def _ratio(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return the usual ratio of image and guess, and up to four stops more or less: a curve
    after the exposure may hide it.
    """
    # Dark values have no ratio of use. Few pixels do not decide a median.
    predicted, image = predictor.predicted(guess), predictor.shown(guess)
    lit = (predicted > 0.01 * predicted.mean()) & (image > 0)
    usual = float(np.median(image[lit] / predicted[lit])) if lit.any() else 1.0
    return [(usual * 2.0**stops,) for stops in (0, 1, -1, 2, -2, 3, -3, 4, -4)]


def _part(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return the factor on a part of the light with which the part explains most of what the
    image has beyond the rest of the light.
    """
    # The image is the rest plus the factor times the part, both of which are guesses with the
    # factors 1 and 0. Bright pixels of the part say most of its factor: they are its weights.
    whole = predictor.predicted(change(predictor, guess, (1.0,)))
    rest = predictor.predicted(change(predictor, guess, (0.0,)))
    part, residual = whole - rest, predictor.shown(guess) - rest
    lit = part > 0.01 * max(float(part.mean()), 1e-300)
    if not lit.any():
        return [(1.0,)]
    return [(max(_weighted_median(residual[lit] / part[lit], part[lit]), 1e-9),)]


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][min(int(np.searchsorted(total, 0.5 * total[-1])), len(order) - 1)])


def _ambient_light(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return the colour of the ambient light that most of the fog has too much."""
    # In each channel the excess of the image over the guess is the ambient light times the opacity:
    # the median of their ratios, with the opacity as weights, is the solution already.
    opacity = np.maximum(1 - predictor.transmittance(guess), 1e-6)
    excess = predictor.shown(guess) - predictor.predicted(guess)
    channels = zip(excess.T, opacity.T, strict=True)
    return [tuple(max(_weighted_median(e / o, o), 0.0) for e, o in channels)]


def _fog_colour(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return the colour of fog that sends what most of the image has beyond surfaces."""
    # By channel the image is surfaces plus the colour times the opacity: the median of the ratios,
    # with the opacity as weights.
    rest = predictor.predicted(change(predictor, guess, (0.0, 0.0, 0.0)))
    part = predictor.predicted(change(predictor, guess, (1.0, 1.0, 1.0))) - rest
    excess, part = predictor.shown(guess) - rest, np.maximum(part, 1e-6)
    channels = zip(excess.T, part.T, strict=True)
    return [tuple(max(_weighted_median(e / o, o), 0.0) for e, o in channels)]


def _dark_excess(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return the excess of the darker half of the image over the guess."""
    # A level above 0, since it is looked for by its logarithm.
    predicted, image = predictor.predicted(guess), predictor.shown(guess)
    excess = (image - predicted)[predicted <= np.median(predicted)]
    return [(max(float(np.median(excess)), 1e-6 * float(np.abs(image).mean()), 1e-30),)]


def _ranges(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return ranges of lights: multiples of the usual distance from a light."""
    usual = _usual_distance(predictor)
    return [(usual * part,) for part in (0.5, 1.0, 2.0, 4.0)]


def _many_ranges(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return ranges of lights near one another, of which none is far from any range."""
    usual = _usual_distance(predictor)
    return [(usual * 2.0 ** (0.5 * step),) for step in range(-2, 7)]


def _usual_distance(predictor: Predictor) -> float:
    """Return the usual distance from a light of what it lights [m]."""
    # By ray, the mean distance of its nodes, which count as 1/r^2: unbounded rays have nodes far
    # from all light. Lit surface points do where no ray has fog.
    observation, means = predictor.observation, [np.empty(0)]
    for each in predictor.light.model(observation, SCENERY, 0).lights:
        nodes, weight = each.nodes, each.nodes.value[:, 0]
        if not nodes.towards.any():  # a sun has no distance
            continue
        total = np.bincount(nodes.ray, weight / nodes.r**2)
        summed = np.bincount(nodes.ray, weight / nodes.r)
        means.append(summed[total > 0] / total[total > 0])
    r = np.concatenate(means)
    if not len(r):
        lights = predictor.light.model(observation, SCENERY, 1).lights
        r = np.concatenate([np.empty(0), *(each.surface.r for each in lights)])
    return float(np.median(r)) if len(r) else 1.0


def _sizes_and_ranges(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return sizes of a light with its ranges."""
    return [(size, *end) for size in (0.1, 1.0) for end in _ranges(predictor, guess, change)]


def _depths(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return distances at which a fog may end: parts of the distance that the image shows."""
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


def _heights(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return scale heights and factors on the density: parts of the depth of the scene."""
    size = _depths(predictor, guess, change)[0][0]
    return [(size * part, factor) for part in (0.1, 0.3, 1.0) for factor in (1.0, 2.0)]


def _densities(predictor: Predictor, guess: Guess, change: Change) -> Sequence[Values]:
    """Return extinctions that height fog has at the camera and at lights, and fractions of them."""
    lights = [light.position for light in predictor.reference.lights]
    fog, places = guess.fog.height, [predictor.reference.origin, *lights]
    assert fog is not None
    mean = float(np.mean(fog.density([place @ guess.fog.up for place in places])))
    return [(max(mean, 1e-3) * part,) for part in (1.0, 0.3, 3.0)]


STARTS: Mapping[str, Start] = {
    "corners": _corners,
    "ratio": _ratio,
    "part": _part,
    "ambient light": _ambient_light,
    "colour of the fog": _fog_colour,
    "excess of the dark half": _dark_excess,
    "ranges": _ranges,
    "many ranges": _many_ranges,
    "sizes and ranges": _sizes_and_ranges,
    "depths": _depths,
    "scale heights and factors": _heights,
    "densities": _densities,
}
