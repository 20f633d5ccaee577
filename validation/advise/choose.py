# SPDX-License-Identifier: BSD-3-Clause
"""What every configuration will cost and err by in a scene, and the one to take.

A method that refuses the scene is asked, not predicted. The choice is the one of least predicted cost among those whose
error stays below what is asked for in a stated share of scenes. If there is none, it is the one of least predicted cost
over its chance to hold the error (what is paid, on average, until one holds it) among those that are at least half as
likely to hold it as the likeliest.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from realtime.errors import InputError
from realtime.scene.read_scene import Scene
from validation.advise.features import FEATURES, features
from validation.advise.model import AdviceModel, ConfigurationModel
from validation.configurations.methods import Configuration, prepared
from validation.properties.properties import scene_properties

SHARE = 0.99  #: of scenes in which a choice shall hold its error
_MEGAPIXEL = 1e6
_LIKELY = 0.5  # of the best chance
LEAST = 1e-8  #: errors below are rounding, and count as this


@dataclass(frozen=True)
class Candidate:
    """A configuration and what is predicted of it in a scene."""

    chosen: Configuration
    error: float  #: relative RMSE, as likely too high as too low
    error_bound: float  #: which it stays below in a share of scenes
    covered: float  #: that share: the one asked for, or less where it was fitted to few scenes
    chance: float  #: share of scenes in which it holds the error asked for
    cost_ms: float  #: of a frame
    cost_low: float  #: which nine of ten scenes are above
    cost_high: float  #: which nine of ten scenes are below
    refused: str = ""  #: why the method refuses the scene


@dataclass(frozen=True)
class Advice:
    """What to take, and all that was looked at."""

    error: float  #: that was asked for
    share: float  #: of scenes in which it shall hold
    best: Candidate | None  #: None where every method refuses the scene
    holds: bool  #: whether it is predicted to hold the error
    candidates: tuple[Candidate, ...]  #: the fastest that holds first, then the others, then those that refuse
    beyond: tuple[str, ...]  #: properties that no swept scene comes near


def predicted(
    each: ConfigurationModel, properties: Mapping[str, float], asked: float, *, share: float, margin: float = 0.0
) -> Candidate:
    """Return what is predicted of a configuration.

    Parameters
    ----------
    each
        Of the configuration.
    properties
        Of the scene, its `pixels` among them: the cost is in proportion to these.
    asked
        The error that it shall hold.
    share
        Of scenes in which `error_bound` shall hold.
    margin
        Decades that are added to it.
    """
    numbers = features(properties)
    error, cost = each.error.predict(numbers), each.cost.predict(numbers)
    pixels = properties["pixels"] / _MEGAPIXEL
    low, middle, high = (pixels * 10 ** cost.below(at) for at in (0.1, 0.5, 0.9))
    return Candidate(
        each.chosen,
        10 ** error.below(0.5),
        10 ** (error.below(share) + margin),
        error.covered(share),
        error.chance(math.log10(asked) - margin),
        middle,
        low,
        high,
    )


def choose(candidates: Sequence[Candidate], error: float) -> tuple[Candidate | None, bool]:
    """Return the candidate to take of those that do not refuse, and whether it is predicted to hold the error."""
    able = [each for each in candidates if not each.refused]
    holding = [each for each in able if each.error_bound <= error]
    if holding:
        return min(holding, key=lambda each: each.cost_ms), True
    best = max((each.chance for each in able), default=0.0)
    likely = [each for each in able if each.chance >= _LIKELY * best]
    return min(likely, key=lambda each: each.cost_ms / each.chance if best else each.cost_ms, default=None), False


def advise(
    model: AdviceModel,
    scene: Scene,
    error: float,
    *,
    share: float = SHARE,
    refusal: Callable[[Scene, Configuration], str] | None = None,
) -> Advice:
    """Return what to take in a scene.

    Parameters
    ----------
    model
        From `read_model`.
    scene
        As methods read it, at the size of its image.
    error
        Relative RMSE of the airlight that it shall hold.
    share
        Of scenes in which it shall.
    refusal
        Says why a configuration refuses a scene, '' where it does not; it is asked by default.
    """
    properties = scene_properties(scene)
    margin = float(model.about.get("margin", 0.0))
    reasons = {each.chosen: (refusal or why_refused)(scene, each.chosen) for each in model.configurations}
    found = [
        _with_reason(predicted(each, properties, error, share=share, margin=margin), reasons[each.chosen])
        for each in model.configurations
    ]
    best, holds = choose(found, error)

    def order(each: Candidate) -> tuple[bool, bool, bool, float]:
        out = each.error_bound > error
        return each is not best, bool(each.refused), out, each.error_bound if out else each.cost_ms

    return Advice(error, share, best, holds, tuple(sorted(found, key=order)), _beyond(model, properties))


def why_refused(scene: Scene, chosen: Configuration) -> str:
    """Return why a configuration refuses a scene, '' where it does not."""
    try:
        prepared(scene, chosen)
    except InputError as reason:
        return str(reason)
    return ""


def _with_reason(candidate: Candidate, reason: str) -> Candidate:
    return Candidate(**(vars(candidate) | {"refused": reason}))


def _beyond(model: AdviceModel, properties: Mapping[str, float]) -> tuple[str, ...]:
    """Return the properties that lie beyond those of all configurations' scenes."""
    if not model.configurations:
        return ()
    numbers = features(properties)
    outside = np.all([each.error.beyond(numbers) for each in model.configurations], axis=0)
    return tuple(name for name, out in zip(FEATURES, outside, strict=True) if out)
