# SPDX-License-Identifier: BSD-3-Clause
"""The diagnosis of an image of a scene: every hypothesis, then pairs of them, by evidence."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.read import read_truth
from reference.storage.exr import Image, read_exr
from validation.comparison.engine_compare import scene_of_size
from validation.comparison.engine_layers import judged_layer
from validation.comparison.engine_pixels import PIXELS
from validation.diagnosis.camera import CAMERA
from validation.diagnosis.encoding import ENCODING
from validation.diagnosis.hypothesis import Hypothesis
from validation.diagnosis.lights import LIGHTS
from validation.diagnosis.medium import MEDIUM
from validation.diagnosis.prediction import Predictor, SceneLight
from validation.diagnosis.search import EVALUATIONS, Explanation, begin, explain
from validation.diagnosis.verdict import (
    LEAST_EFFECT,
    LEAST_EVIDENCE,
    effect,
    evidence,
    gains,
    is_explained,
    is_noise,
    leaves_nothing,
    no_fault,
    scale_of,
    usual_error,
)
from validation.fit.fit import said_pixel, three_channels
from validation.fit.image_model import Task, without_lights
from validation.metrics.errors import plain
from validation.scenes.loading import LoadedScene

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

HYPOTHESES: tuple[Hypothesis, ...] = (*LIGHTS, *MEDIUM, *CAMERA, *ENCODING)
RIGHT, UNEXPLAINED = "right", "unexplained"

_REFINED = 5  # hypotheses whose numbers are found to all digits: those that leave least after a coarse search
_MOVED = 0.02  # share by which the error changes where a search left the unchanged scene
_FAR, _FAR_OF_PATHS = 10.0, 3.0  # errors over the least one that more digits do not bring down to it
_PAIRS = 1500  # evaluations for pairs, after those where they begin
_OTHER_PATHS = 20  # evaluations for which one with other paths counts
_BETTER = 0.7  # what a pair must leave of the error of one alone: with more numbers anything fits a little better
_MUCH = 0.2  # what an explanation must leave of the error to be named although more is wrong
_ALIKE = 5.0  # evidence by which explanations may differ and still be as good as one another
_SHOWN = 8
_SHARES = (0.0, 0.3), (0.3, 0.6), (0.8, 1.0), (0.6, 0.8)  # of the time: hypotheses by what they cost, and pairs


@dataclass(frozen=True)
class Ranked:
    """A hypothesis in the order of evidence."""

    name: str
    parameter: float | None  #: its only number
    parameters: tuple[float, ...]
    words: str
    residual: float  #: mean relative error that it leaves, with what stands beside it
    evidence: float  #: natural logarithm of the odds against the unchanged scene
    together: tuple[str, ...]  #: names of all that explain the image together, where it takes more than one


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with an image."""

    scene: str
    path: str
    pixel: str  #: 'centre' or 'area'
    first: str  #: name of what comes first; 'right' or 'unexplained' where no hypothesis does
    ranked: tuple[Ranked, ...]
    residual: float  #: mean relative error of the image as it is
    left: float  #: what the first explanation leaves of it
    explained: bool  #: whether that is noise, or little

    def to_json(self) -> dict[str, Any]:
        """Return every number by name."""
        return {
            "diagnosis": {
                "first": self.first,
                "ranked": [plain(row) for row in self.ranked],
                "residual": plain(self.residual),
                "left": plain(self.left),
                "explained": self.explained,
                "pixel": self.pixel,
            }
        }


def diagnose_file(path: str | os.PathLike[str], scene: str, *, layer: str | None = None, **how: Any) -> Diagnosis:
    """Diagnose an EXR file of a scene; see `diagnose_image` for what else can be given.

    Parameters
    ----------
    path, scene
        The EXR file; a built-in scene or a Mitsuba XML file.
    layer
        Which layer, see `validation.comparison.engine_layers.judged_layer`.

    Raises
    ------
    InputError
        For files and scenes that cannot be read.
    """
    image = read_exr(path)
    judged = judged_layer(image, path, name=layer, holds=how.get("holds"))
    return diagnose_image(image, scene_of_size(scene, judged.size, path), path=str(path), layer=layer, **how)


def diagnose_image(
    image: Image,
    loaded: LoadedScene,
    *,
    path: str = "the image",
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    light: SceneLight | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Say what is wrong with an image of a scene.

    Parameters
    ----------
    image, loaded
        The layers, and the scene at their size.
    layer, holds
        Which layer, and what it holds: 'airlight', 'surface' or 'total'.
    pixel
        'centre' or 'area'; by default what the image says of itself, or what fits better.
    light
        Of this scene, as other images of it have found it.

    Raises
    ------
    InputError
        For a layer that is not there, a scene that has no truth, and an image without finite values.
    """
    if pixel is not None and pixel not in PIXELS:
        raise InputError(f"--pixel {pixel}; wanted 'centre' or 'area'")
    judged = judged_layer(image, path, name=layer, holds=holds)
    light = light or SceneLight(read_truth(loaded.scene))
    values = three_channels(judged)
    used = np.isfinite(values).all(axis=1) & without_lights(light.truth, judged)
    if not used.any() or not np.any(values[used] > 0):
        raise InputError(f"{path}: the layer '{judged.name}' has no finite value above 0; there is nothing to diagnose")
    said = pixel or said_pixel(image)
    task = Task(light.truth, values, judged.holds, used, area=False, points=light.points)
    kinds = [said] if said else list(PIXELS)
    results = []
    for number, kind in enumerate(kinds):
        shape = judged.size[1], judged.size[0]
        predictor = Predictor(replace(task, area=kind == "area"), shape, light)
        tell = None if progress is None else _stage(progress, number, len(kinds))
        results.append((kind, _ranked(predictor, kind, tell)))
    kind, (right, chosen, rows, explained) = min(results, key=lambda result: result[1][1].error)
    first = _first(right, chosen, explained)
    return Diagnosis(loaded.name, path, kind, first, tuple(rows[:_SHOWN]), right.error, chosen.error, explained)


def _stage(progress: Progress, number: int, count: int) -> Progress:
    return lambda share, what: progress((number + share) / count, what)


def _first(right: Explanation, chosen: Explanation, explained: bool) -> str:
    if not chosen.hypotheses:
        return RIGHT if explained else UNEXPLAINED
    if explained or chosen.error < _MUCH * right.error:
        return chosen.hypotheses[0].name
    return UNEXPLAINED


def _ranked(
    predictor: Predictor, pixel: str, progress: Progress | None
) -> tuple[Explanation, Explanation, list[Ranked], bool]:
    """Return the unchanged scene, the explanation that is chosen, all in order, and whether nothing is left."""
    right = explain(predictor, ())
    neighbours, little = predictor.pairs, no_fault(predictor.task.truth)
    explained = partial(is_explained, pairs=neighbours, little=little)
    there = [hypothesis for hypothesis in HYPOTHESES if hypothesis.applies(predictor)]

    singles: list[Explanation] = []

    def tried(costly: int) -> list[Explanation]:
        own = [hypothesis for hypothesis in there if hypothesis.costly == costly]
        tell = None if progress is None else partial(_within, progress, _SHARES[costly])
        return _explained(predictor, right, own, min((each.error for each in singles), default=1.0), tell)

    def settled(explanation: Explanation) -> bool:
        """Return whether nothing is left that another hypothesis could explain."""
        if len(explanation.hypotheses) > 1:
            return leaves_nothing(explanation, pixel)
        if explanation.hypotheses and not predictor.task.truth.area:
            # What is little for an image may be much beside what the fault itself does, if it is not the right one:
            # a factor leaves 0.4 % of what a lamp of 0.25 m does, all of it in the shadows, and another g 0.2 % of a
            # near plane at 0.1 m, most of it in the middle.
            return leaves_nothing(explanation, "centre") or is_noise(explanation, neighbours)
        return usual_error(explanation) <= little or is_noise(explanation, neighbours)

    singles += tried(0)
    chosen = _best(right, singles, pixel)
    pairs: list[Explanation] = []
    if not settled(chosen):
        singles += tried(1)
        chosen = _best(right, singles, pixel)
        if not explained(chosen):
            tell = None if progress is None else partial(_within, progress, _SHARES[-1])
            pairs = _pairs(predictor, right, chosen, singles, pixel, tell)
        if not settled(_with_pairs(right, chosen, pairs, pixel)):
            singles += tried(2)
            chosen = _best(right, singles, pixel)
        chosen = _with_pairs(right, chosen, pairs, pixel)
    scale = scale_of(chosen, pixel)
    rows: list[Ranked] = []
    if len(chosen.hypotheses) > 1:
        rows += _rows(chosen, evidence(chosen, right, scale))
    ordered = sorted(singles, key=lambda each: -evidence(each, right, scale))
    named = {row.name for row in rows}
    for each in ordered:
        name = each.hypotheses[0].name
        if name not in named:
            named.add(name)
            rows += _rows(each, evidence(each, right, scale))
    if not chosen.hypotheses:
        rows.insert(0, Ranked(RIGHT, None, (), "nothing is wrong", right.error, 0.0, ()))
    elif len(chosen.hypotheses) == 1:
        # Between explanations that leave the same, the one with fewer numbers comes first.
        rows.sort(key=lambda row: row.name != chosen.hypotheses[0].name)
    return right, chosen, rows, explained(chosen) or gains(chosen, right)


def _within(progress: Progress, span: tuple[float, float], share: float, what: str) -> None:
    progress(span[0] + (span[1] - span[0]) * share, what)


def _with_pairs(right: Explanation, chosen: Explanation, pairs: Sequence[Explanation], pixel: str) -> Explanation:
    """Return the best pair if it leaves far less than the best explanation alone, else that one."""
    best = _best(right, [chosen, *pairs] if chosen.hypotheses else pairs, pixel)
    return best if best.error < _BETTER * chosen.error else chosen


def _explained(
    predictor: Predictor,
    right: Explanation,
    hypotheses: Sequence[Hypothesis],
    least: float,
    progress: Progress | None,
) -> list[Explanation]:
    explanations = []
    for number, hypothesis in enumerate(hypotheses):
        if progress is not None:
            progress(number / len(hypotheses), hypothesis.name)
        explanations.append(explain(predictor, (hypothesis,), fine=False))
    return _refined(predictor, right, explanations, least)


def _refined(
    predictor: Predictor, right: Explanation, explanations: list[Explanation], least: float = 1.0
) -> list[Explanation]:
    """Return explanations, those that leave least with all digits; `least` is what others leave.

    Where a search stayed at the unchanged scene, or left far more than another, none are wanted.
    """
    least = max(LEAST_EFFECT, min([least, *(each.error for each in explanations)]))
    moved = [each for each in explanations if abs(each.error - right.error) > _MOVED * right.error]
    better = [each for each in moved if each.error < _far(each) * least]
    ordered = sorted(better, key=lambda each: each.error)
    best = [each for each in ordered[:_REFINED] if each.parameters]
    finer = {id(each): explain(predictor, each.hypotheses, each.values) for each in best}
    return [finer.get(id(each), each) for each in explanations]


def _far(explanation: Explanation) -> float:
    """Return the error over the least one that more digits do not bring down to it: those of other paths are few."""
    numbers = (parameter for hypothesis in explanation.hypotheses for parameter in hypothesis.parameters)
    return _FAR_OF_PATHS if any(number.step for number in numbers) else _FAR


def _best(right: Explanation, explanations: Sequence[Explanation], pixel: str) -> Explanation:
    """Return the explanation with the most evidence, or the unchanged scene where none has enough."""
    if not explanations:
        return right
    scale = min(scale_of(each, pixel) for each in [right, *explanations])
    most = max(evidence(each, right, scale) for each in explanations)
    # Of those that explain it alike, such as a factor and a near plane before dark fog, the simplest and the first.
    alike = [each for each in explanations if evidence(each, right, scale) >= most - _ALIKE]
    best = min(alike, key=lambda each: each.parameters)
    enough = evidence(best, right, scale) > LEAST_EVIDENCE and effect(best, right) > LEAST_EFFECT
    return best if enough else right


def _pairs(
    predictor: Predictor,
    right: Explanation,
    chosen: Explanation,
    singles: Sequence[Explanation],
    pixel: str,
    progress: Progress | None,
) -> list[Explanation]:
    """Return explanations by two hypotheses of different kinds.

    All begin where their hypotheses do; those that leave least there are followed until one leaves nothing that could
    be seen, or enough have been.
    """
    cheap = [each.hypotheses[0] for each in singles if not each.hypotheses[0].costly]
    both = [_in_order(a, b) for number, a in enumerate(cheap) for b in cheap[:number] if _differ(a, b)]
    begun = []
    for number, pair in enumerate(both):
        if progress is not None:
            progress(0.5 * number / len(both), " and ".join(each.name for each in pair))
        begun.append((*begin(predictor, pair), pair))
    begun.sort(key=lambda each: each[0])
    costs = np.cumsum([_cost(first) + _cost(second) for _, _, (first, second) in begun])
    wanted = begun[: int(np.searchsorted(costs, _PAIRS))]
    explanations: list[Explanation] = []
    for number, (_, near, pair) in enumerate(wanted):
        if progress is not None:
            progress(0.5 + 0.5 * number / len(wanted), " and ".join(each.name for each in pair))
        explanations.append(explain(predictor, pair, near, fine=False))
        if explanations[-1].error < _MUCH * chosen.error:
            explanations[-1] = explain(predictor, pair, explanations[-1].values)
            if leaves_nothing(explanations[-1], pixel):
                break
    return _refined(predictor, right, explanations)


def _differ(first: Hypothesis, second: Hypothesis) -> bool:
    """Return whether two hypotheses are of different kinds, and do not both look for paths of their own."""
    moves = [any(parameter.step for parameter in each.parameters) for each in (first, second)]
    lights = [each.kind == "light" for each in (first, second)]
    return first.kind != second.kind and not (any(moves) and any(lights))


def _cost(hypothesis: Hypothesis) -> int:
    """Return how many evaluations a hypothesis adds to a pair; those with other paths count as several."""
    return 1 + sum(EVALUATIONS * (_OTHER_PATHS if number.step else 1) for number in hypothesis.parameters)


_ORDER = ("medium", "light", "camera", "brightness", "values")


def _in_order(first: Hypothesis, second: Hypothesis) -> tuple[Hypothesis, Hypothesis]:
    """Return hypotheses in the order in which faults happen: the scene, its image, what is done to values."""
    return (first, second) if _ORDER.index(first.kind) <= _ORDER.index(second.kind) else (second, first)


def _rows(explanation: Explanation, weight: float) -> list[Ranked]:
    names = tuple(hypothesis.name for hypothesis in explanation.hypotheses)
    return [
        Ranked(
            hypothesis.name,
            values[0] if len(values) == 1 else None,
            values,
            hypothesis.words.format(*values),
            explanation.error,
            weight,
            names if len(names) > 1 else (),
        )
        for hypothesis, values in zip(explanation.hypotheses, explanation.values, strict=True)
    ]
