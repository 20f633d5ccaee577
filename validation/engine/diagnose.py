# SPDX-License-Identifier: BSD-3-Clause
"""The diagnosis of an image of a scene: every fault predicts the image that it would
make, and the data choose.

1. An image that is right by `validation.engine.verdict` is right: no fault is looked for.
   One that is black is black. One of a cloud that holds light of all orders is none of single
   scattering.
2. The stages of `stages.py` try faults, until one leaves nothing to explain. Whether pixels are
   centres or means is decided once, by the errors that the first stage leaves.
3. `decide.py` chooses an explanation, and says whether it is named.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from airlight.errors import InputError
from airlight.reference.scene.area_light import is_area
from airlight.reference.scene.model import Model
from airlight.reference.storage.exr import NOTE, Image, read_exr
from airlight.validation.arrays import Progress
from airlight.validation.engine.decide import LITTLE, Candidates
from airlight.validation.engine.equations import asked_words, engine_title
from airlight.validation.engine.error_place import place_words
from airlight.validation.engine.hints import find_hints
from airlight.validation.engine.judge import (
    EngineComparison,
    ReferenceOf,
    judge_image,
    references,
)
from airlight.validation.engine.observation import (
    PIXEL_WORDS,
    decide_pixel,
    judged_layer,
    layers_of,
    observation_of,
    pixel_kinds,
    scene_of_size,
    with_rest,
)
from airlight.validation.engine.other_orders import other_orders
from airlight.validation.engine.prediction import Predictor, SceneLight
from airlight.validation.engine.search import Explanation
from airlight.validation.engine.stages import QUICK, Attempt
from airlight.validation.engine.verdict import RIGHT as RIGHT_ERROR
from airlight.validation.engine.verdict import all_but_few, judge
from airlight.validation.scenes.changes import UNCHANGED, Changes
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.scenes.models import model_of

RIGHT, BLACK, ORDERS, UNEXPLAINED = "right", "black", "orders", "unexplained"


@dataclass(frozen=True)
class Ranked:
    """A fault in the order of evidence."""

    name: str
    parameters: tuple[float, ...]
    words: str
    residual: float  #: mean relative error that it leaves, together with the others of `together`
    evidence: float  #: score against the unchanged scene, see `validation.engine.decide`
    #: names of all that explain the image together, where it takes more than one
    together: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """The faults of a layer of an image."""

    scene: str
    path: str
    layer: str
    pixel: str  #: 'centre' or 'area'
    #: name of the first explanation: a fault, or 'right', 'black', 'orders' or 'unexplained'
    first: str
    ranked: tuple[Ranked, ...]  #: one where no fault was looked for
    residual: float  #: mean relative error of the image as it is
    left: float  #: mean relative error that the first explanation leaves
    rest: str  #: whether this error is like noise, or little; empty where it is neither
    explained: bool  #: whether the first explanation leaves nothing to explain
    place: str  #: where the remaining error lies; empty where it is like noise, or little
    #: which pixels are wrong where these are few and all others are right; empty otherwise
    few: str
    verdict: str  #: of the comparison with the reference, in words
    #: what is wrong with the file, such as pixels that are not finite
    failures: tuple[str, ...] = ()
    note: str = ""  #: what the reader of the file changed or left out, such as other primaries
    model: str = ""  #: the equation that the image should solve; empty for the physical one
    #: the equation of an engine that it solves instead, as a user types it; empty for none
    solves: str = ""
    #: other equations of engines that make the same image within noise, as a user types them
    alike: tuple[str, ...] = ()

    @property
    def lines(self) -> list[str]:
        """The first explanation and the error that it leaves, in sentences."""
        off = f"values are {_percent(self.residual)} off in the mean"
        scene = self.scene + (f" in the equation of {self.model}" if self.model else "")
        lines = [f"{self.path}, {self.layer}, against {scene}, {PIXEL_WORDS[self.pixel]}: {off}."]
        lines += self._said()
        lines += [f"Failed: {reason}." for reason in self.failures]
        return [*lines, *([f"The file: {self.note}."] if self.note else [])]

    def _said(self) -> list[str]:
        """Return what is wrong, in sentences; the comparison's verdict stands
        where no fault is named.
        """
        place = f": {self.few or f'the error lies {self.place}'}" if self.few or self.place else ""
        if self.first == RIGHT and len(self.ranked) < 2:
            return [f"Nothing is wrong with it: {self.verdict}."]
        if self.first == RIGHT:
            return [f"No fault is found, and the difference is {self.rest} ({self.verdict})."]
        if self.first == BLACK:
            return [f"The image is black: {self.verdict}."]
        if self.first == ORDERS:
            return [f"No fault is looked for: {self.ranked[0].words}."]
        if self.first == UNEXPLAINED:
            return [f"Nothing here explains it{place} ({self.verdict}).", *self._nearest()]
        # A pair of faults is two rows, each of which names both.
        together = [row for row in self.ranked if row.together]
        pair = (
            f"Two faults explain it: {'; and '.join(row.words for row in together)}."
            if together
            else ""
        )
        more = f"more than noise: something else is wrong too{place}"
        lines = [
            pair or f"{self.first}: {self.ranked[0].words}.",
            f"Without that, values are {_percent(self.left)} off in the mean, which is "
            f"{self.rest or more}.",
        ]
        if self.alike:
            titles = " and ".join(
                f"{engine_title(words)} (--model {words})" for words in self.alike
            )
            lines.append(f"The same image within noise is that of {titles}.")
        if self.solves:
            lines.append(f"To look for faults on top of this equation: --model {self.solves}")
        return lines

    def _nearest(self) -> list[str]:
        """Return what an image without an explanation may be: the fault that comes nearest, and
        what no fault here is.
        """
        if self.few:
            return []
        best = [row for row in self.ranked if row.together] or list(self.ranked[:1])
        lines = ["It may be the algorithm: few steps, froxels, a shadow map or a low resolution."]
        if best[0].name != RIGHT and self.left < (1 - LITTLE) * self.residual:
            lines.append(
                f"The nearest to it, {' and '.join(row.name for row in best)}, leaves "
                f"{_percent(self.left)} of {_percent(self.residual)}: "
                f"{'; and '.join(row.words for row in best)}."
            )
        return lines


def diagnose_file(
    path: str | os.PathLike[str],
    scene: str,
    *,
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    light: SceneLight | None = None,
    changes: Changes = UNCHANGED,
    model: Model | None = None,
    progress: Progress | None = None,
) -> tuple[Diagnosis, ...]:
    """Diagnose an EXR file of a scene: each of airlight and surfaces where it has both, or where it
    has airlight and all light, and no light is seen itself.

    A layer that is black, as it should be, says nothing beside another one.

    Parameters
    ----------
    path
        The EXR file.
    scene
        A built-in scene or a Mitsuba XML or pbrt file.
    layer, holds
        Which layer, and what it holds, see `validation.engine.observation.judged_layer`.
    pixel, light, progress
        See `diagnose_image`.
    changes, model
        See `validation.engine.judge.compare_scene`.
    """
    image = read_exr(path)
    several = layers_of(image, str(path), layer, holds)
    loaded = scene_of_size(scene, several[0].size, path, changes, model)
    if not any(is_area(each) or each.is_environment() for each in loaded.scene.emitters()):
        image = with_rest(image)
        several = layers_of(image, str(path), layer, holds)
    reference_of = references(loaded)
    diagnoses: list[Diagnosis] = []
    for each in several:
        diagnosis = diagnose_image(
            image,
            loaded,
            path=str(path),
            layer=each.name,
            holds=each.holds,
            pixel=pixel,
            light=light,
            reference_of=reference_of,
            at_size=partial(scene_of_size, scene, path=path, changes=changes, model=model),
            progress=progress,
        )
        diagnoses.append(diagnosis)
        # Surfaces have the equation that the fog tells: alone they do not tell whose it is.
        if diagnosis.solves:
            loaded = replace(loaded, model=model_of(diagnosis.solves))
            reference_of = references(loaded)
    # A black layer without an error is right: it is left out, unless there is no other layer.
    telling = tuple(each for each in diagnoses if each.first != BLACK or each.residual > 0)
    return telling or tuple(diagnoses)


def diagnose_image(
    image: Image,
    loaded: LoadedScene,
    *,
    path: str = "the image",
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    light: SceneLight | None = None,
    reference_of: ReferenceOf | None = None,
    at_size: Callable[[tuple[int, int]], LoadedScene] | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Say what is wrong with an image of a scene.

    Parameters
    ----------
    image, loaded
        The layers, and the scene at their size. The image should solve its equation: the faults
        are looked for on top of it.
    layer, holds
        Which layer, and what it holds: 'airlight', 'surface' or 'total'.
    pixel
        'centre' or 'area'; by default what the image says of itself, or what fits better.
    light
        The paths of light of this scene, which several images of it share.
    reference_of
        A function that computes the scene's reference for 'centre' or 'area'.
    at_size
        A function that loads the scene at another size; without it nobody asks whether an image
        of clouds holds light of further orders.
    progress
        Called with (fraction done, what).

    Raises
    ------
    InputError
        If fewer than 16 pixels say something, or fits and diagnoses do not predict the scene.
    """
    judged = judged_layer(image, path, name=layer, holds=holds)
    observation, failures = observation_of(image, judged, loaded.scene, model=loaded.model)
    fewest = 16  # pixels
    if (count := int(observation.used.sum())) < fewest:
        raise InputError(
            f"{path}: {count} pixels of the layer '{judged.name}' say something; expected at least "
            f"{fewest}, finite "
            "and not of a light itself: fewer do not tell a fault from noise"
        )
    # The comparison decides whether anything is wrong; the diagnosis says what,
    # and never contradicts it.
    reference_of = reference_of or references(loaded)
    compared = judge_image(
        image, judged, loaded, reference_of, path=path, pixel=pixel, mask=image.with_data()
    )
    # Light of further orders hides every fault of single scattering where it is most of the light.
    orders = None
    if at_size is not None and not compared.verdict.right:
        bias = compared.comparison.metrics.relative_bias
        orders = other_orders(loaded, at_size, judged.holds, bias)
    is_hidden = orders is not None and orders.dominate
    # The comparison has decided what the pixels of a right image are. Elsewhere the first stage is
    # tried with every kind of pixels, and the smaller error decides. An image that is wrong as a
    # whole, such as a black one, needs no search.
    light = light or SceneLight(observation.reference)
    is_plain = compared.verdict.right or is_hidden
    pixels = (compared.pixel,) if is_plain else pixel_kinds(image, pixel)
    is_searched = not is_plain and not compared.hints.reason

    def begun(kind: str) -> Attempt:
        attempt = Attempt.begun(Predictor(replace(observation, area=kind == "area"), light), kind)
        return attempt.after(QUICK, progress) if is_searched else attempt

    kind, attempt = decide_pixel(
        pixels, begun, lambda attempts: [each.candidates.chosen.error for each in attempts]
    )
    right = attempt.candidates.right
    # The diagnosis of a right image, from which the others differ by what a search finds.
    diagnosis = Diagnosis(
        scene=loaded.name,
        path=path,
        layer=judged.name,
        pixel=kind.pixel,
        first=RIGHT,
        ranked=tuple(_rows(right, 0.0)),
        residual=right.error,
        left=right.error,
        rest="little",
        explained=True,
        place="",
        few="",
        verdict=compared.verdict.words,
        failures=failures,
        note=str(image.attributes.get(NOTE, "")),
        model="" if loaded.model.is_physical else loaded.model.title,
    )
    if compared.verdict.right:
        return diagnosis
    if orders is not None and is_hidden:
        row = Ranked(ORDERS, (orders.more,), orders.words, diagnosis.residual, 0.0, ())
        found = replace(diagnosis, first=ORDERS, ranked=(row,), rest="", explained=False)
        return replace(found, verdict=f"not right: {orders.words}")
    if compared.hints.reason:
        # A reference is black where nothing should be seen: the image is black only if it is right.
        reason = compared.hints.reason
        black = reason.startswith("the image is black") or diagnosis.residual == 0
        first = BLACK if black else UNEXPLAINED
        row = Ranked(first, (), compared.hints.reason, diagnosis.residual, 0.0, ())
        return replace(diagnosis, first=first, ranked=(row,), rest="", explained=False)
    # Where a few pixels are wrong and all others right, such as a mark on the image, no path of
    # light explains it: the later stages are left out.
    is_right_so_far = not attempt.candidates.chosen.faults
    few = ""
    if is_right_so_far:
        correct, shown = (each.astype(np.float64) for each in (compared.reference, compared.image))
        few = all_but_few(correct, shown, image.with_data())
    if not few:
        attempt = attempt.finished(progress)
    return _concluded(diagnosis, attempt, compared, few)


def _concluded(
    diagnosis: Diagnosis, attempt: Attempt, compared: EngineComparison, few: str
) -> Diagnosis:
    """Return a diagnosis with what a search has found."""
    candidates, chosen = attempt.candidates, attempt.candidates.chosen
    # Values that stop at one number are a fact, in however few pixels.
    is_cut = chosen.names == ("clamp",) and compared.hints.stops
    if chosen.faults and (is_cut or candidates.is_named(chosen)):
        first = chosen.names[0]
    elif candidates.blocks.is_noise(candidates.right) and compared.verdict.noise_alone:
        # Noise alone makes blocks differ: that is no fault, and the comparison says so too.
        first, chosen = RIGHT, candidates.right
    else:
        first = UNEXPLAINED
    solved = next((i for i, fault in enumerate(chosen.faults) if fault.equation), None)
    solves = ""
    alike: tuple[str, ...] = ()
    if solved is not None and first != UNEXPLAINED:
        solves = asked_words(chosen.faults[solved].equation, chosen.values[solved])
        alike = _alike(candidates, chosen)
    # The record has eight rows. Where the error lies is said only if it is not explained.
    rest = candidates.remainder(chosen) or _right_rest(attempt.predictor, chosen)
    explained = bool(rest) and first != UNEXPLAINED
    return replace(
        diagnosis,
        first=first,
        ranked=tuple(_ranked(candidates, chosen)[:8]),
        left=chosen.error,
        rest=rest,
        explained=explained,
        place="" if explained else place_words(attempt.predictor, chosen),
        few="" if explained else few,
        solves=solves,
        alike=alike,
    )


def _right_rest(predictor: Predictor, chosen: Explanation) -> str:
    """Return what an explanation leaves, in words, where a comparison would call an image right
    that is as far off; nothing where it would not, or where no fault is chosen.
    """
    if not chosen.faults:
        return ""
    # The pixels that are looked at; all others count in no block.
    height, width = predictor.shape
    predicted, shown = (np.full((height * width, 3), np.nan) for _ in range(2))
    predicted[predictor.pixels] = predictor.predicted(chosen.guess)
    shown[predictor.pixels] = predictor.shown(chosen.guess)
    correct, image = (values.reshape(height, width, 3) for values in (predicted, shown))
    hints = find_hints(correct, image)
    verdict = judge(correct, image, hints, ())
    error = verdict.block_error
    if error > RIGHT_ERROR:
        # Means over some pixels of a block have more scatter than those over all of it.
        part = len(predictor.pixels) / (height * width)
        error = math.sqrt(max(error**2 - (1 - part) * verdict.block_noise**2, 0.0))
    is_alike = not hints.words and abs(hints.factor - 1) <= RIGHT_ERROR
    if not (is_alike and error <= RIGHT_ERROR):
        return ""
    size = f"{verdict.block} x {verdict.block} pixels"
    return f"nothing to a comparison: means over {size} are within {100 * error:.2g} %"


def _alike(candidates: Candidates, chosen: Explanation) -> tuple[str, ...]:
    """Return the equations of other engines that make the same image as a chosen one, as a user
    types them, the best of each engine.
    """
    if len(chosen.faults) > 1:
        return ()
    others: dict[str, str] = {}
    for each in sorted(candidates.tried, key=lambda each: -candidates.evidence(each)):
        fault = each.faults[0]
        is_other = len(each.faults) == 1 and fault.equation and fault.name != chosen.names[0]
        if is_other and candidates.is_same_image(each, chosen):
            others.setdefault(fault.name, asked_words(fault.equation, each.values[0]))
    return tuple(others.values())


def _ranked(candidates: Candidates, chosen: Explanation) -> list[Ranked]:
    """Return the chosen explanation and single faults in the order of evidence."""
    singles = [each for each in candidates.tried if len(each.faults) == 1]
    weighed = [(candidates.evidence(each), each) for each in singles]
    # Several faults have one name, such as the laws of distance: the best one is listed.
    rows = _rows(chosen, candidates.evidence(chosen))
    listed = {row.name for row in rows}
    for weight, each in sorted(weighed, key=lambda row: -row[0]):
        if each.names[0] not in listed:
            listed.add(each.names[0])
            rows += _rows(each, weight)
    return rows


def _rows(explanation: Explanation, weight: float) -> list[Ranked]:
    if not explanation.faults:
        return [Ranked(RIGHT, (), "nothing is wrong", explanation.error, 0.0, ())]
    names = explanation.names if len(explanation.faults) > 1 else ()
    return [
        Ranked(fault.name, values, fault.sentence(values), explanation.error, weight, names)
        for fault, values in zip(explanation.faults, explanation.values, strict=True)
    ]


def _percent(part: float) -> str:
    return f"{100 * part:.3g} %"
