# SPDX-License-Identifier: BSD-3-Clause
"""The diagnosis of an image of a scene: every fault predicts the image that it would
make, and the data choose.

1. An image that is right by `validation.engine.judge` is right: no fault is looked for.
   One that is black is black.
2. Faults without paths of their own are tried alone. Where none of them leaves noise alone, pairs
   of faults of different kinds follow, and then the faults that need paths of their own. Whether
   pixels are centres or means is decided once, by the errors that the faults without paths of their
   own leave.
3. The explanation with the most evidence is chosen, or the simplest one of all that are as good
   (`evidence.py`).
4. It is named if its evidence and the fraction of the error that it leaves are within the limits of
   the calibration (`calibration.json`). The limits are chosen so that the diagnosis names a fault
   in at most 5 % of the right images with errors of engines.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from airlight.errors import InputError
from airlight.reference.storage.exr import NOTE, Image, read_exr
from airlight.validation.arrays import Progress
from airlight.validation.engine.error_place import place_words
from airlight.validation.engine.evidence import EVIDENCE, KNOWN, LEFT, Blocks, evidence, scale_of
from airlight.validation.engine.fault import Fault
from airlight.validation.engine.faults import KINDS, faults_of
from airlight.validation.engine.judge import (
    EngineComparison,
    ReferenceOf,
    all_but_few,
    judge_image,
    references,
)
from airlight.validation.engine.prediction import Predictor, SceneLight
from airlight.validation.engine.search import Explanation, begin, explain
from airlight.validation.engine.seen import (
    PIXEL_WORDS,
    decide_pixel,
    judged_layer,
    layers_of,
    pixel_kinds,
    scene_of_size,
    seen_image,
)
from airlight.validation.scenes.loading import LoadedScene

RIGHT, BLACK, UNEXPLAINED = "right", "black", "unexplained"

_LITTLE = 0.05  # fraction of the error: less is no second fault, nor another image
# Fractions of the progress: faults of the costs 0, 1 and 2, and pairs, which follow the cost 0.
_PARTS = (0.0, 0.3), (0.5, 0.8), (0.8, 1.0), (0.3, 0.5)


@dataclass(frozen=True)
class Ranked:
    """A fault in the order of evidence."""

    name: str
    parameters: tuple[float, ...]
    words: str
    residual: float  #: mean relative error that it leaves, together with the others of `together`
    evidence: float  #: score against the unchanged scene, see `validation.engine.evidence`
    #: names of all that explain the image together, where it takes more than one
    together: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """The faults of a layer of an image."""

    scene: str
    path: str
    layer: str
    pixel: str  #: 'centre' or 'area'
    #: name of the first explanation: a fault, or 'right', 'black' or 'unexplained'
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

    @property
    def lines(self) -> list[str]:
        """The first explanation, the error that it leaves, and the others that were tried."""
        off = f"values are {_percent(self.residual)} off in the mean"
        lines = [
            f"{self.path}, {self.layer}, against {self.scene}, {PIXEL_WORDS[self.pixel]}: {off}."
        ]
        lines += self._said()
        lines += [f"Failed: {reason}." for reason in self.failures]
        lines += [f"The file: {self.note}."] if self.note else []
        if len(self.ranked) < 2:  # no fault was looked for
            return lines
        # Five rows are printed. Evidence beyond 10 000 says no more by its digits.
        lines += ["", f"{'fault':<16} {'left':>9} {'evidence':>9}  what it says"]
        for row in self.ranked[:5]:
            weight = f"{row.evidence:.0f}" if abs(row.evidence) < 1e4 else f"{row.evidence:.1e}"
            lines.append(f"{row.name:<16} {_percent(row.residual):>9} {weight:>9}  {row.words}")
        return [
            *lines,
            "",
            "left: mean relative error without the fault; evidence: a score against `right`.",
        ]

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
        if self.first == UNEXPLAINED:
            return [f"Nothing here explains it{place} ({self.verdict})."]
        # A pair of faults is two rows, each of which names both.
        together = [row for row in self.ranked if row.together]
        pair = (
            f"Two faults explain it: {'; and '.join(row.words for row in together)}."
            if together
            else ""
        )
        more = f"more than noise: something else is wrong too{place}"
        return [
            pair or f"{self.first}: {self.ranked[0].words}.",
            f"Without that, values are {_percent(self.left)} off in the mean, which is "
            f"{self.rest or more}.",
        ]


def diagnose_file(
    path: str | os.PathLike[str],
    scene: str,
    *,
    layer: str | None = None,
    holds: str | None = None,
    **how: Any,
) -> tuple[Diagnosis, ...]:
    """Diagnose an EXR file of a scene: each of airlight and surfaces where it has
    both; see `diagnose_image`.

    `path`, `scene`: the EXR file; a built-in scene or a Mitsuba XML file; `layer`, `holds`: which
    layer, see `validation.engine.seen.judged_layer`. A layer that is black, as it should be, says
    nothing beside another one.
    """
    image = read_exr(path)
    several = layers_of(image, str(path), layer, holds)
    loaded = scene_of_size(scene, several[0].size, path)
    how["reference_of"] = references(loaded)
    diagnoses = [
        diagnose_image(image, loaded, path=str(path), layer=each.name, holds=each.holds, **how)
        for each in several
    ]
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
        The paths of light of this scene, which several images of it share.
    reference_of
        A function that computes the scene's reference for 'centre' or 'area'.
    progress
        Called with (fraction done, what).

    Raises
    ------
    InputError
        If fewer than 16 pixels say something, or fits and diagnoses do not predict the scene.
    """
    judged = judged_layer(image, path, name=layer, holds=holds)
    seen, failures = seen_image(image, judged, loaded.scene)
    fewest = 16  # pixels
    if (count := int(seen.used.sum())) < fewest:
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
    # The comparison has decided what the pixels of a right image are. Elsewhere every kind of pixel
    # has an attempt with the faults that cost nothing, and the smaller error decides. An image that
    # is wrong as a whole, such as a black one, needs no search.
    light = light or SceneLight(seen.reference)
    pixels = (compared.pixel,) if compared.verdict.right else pixel_kinds(image, pixel)

    def begun(kind: str) -> _Attempt:
        attempt = _Attempt(Predictor(replace(seen, area=kind == "area"), light), kind, progress)
        if not compared.verdict.right and not compared.hints.reason:
            attempt.try_faults(0)
        return attempt

    kind, attempt = decide_pixel(pixels, begun, lambda each: [one.chosen.error for one in each])
    # The diagnosis of a right image, from which the others differ by what a search finds.
    diagnosis = Diagnosis(
        scene=loaded.name,
        path=path,
        layer=judged.name,
        pixel=kind.pixel,
        first=RIGHT,
        ranked=tuple(_rows(attempt.right, 0.0)),
        residual=attempt.right.error,
        left=attempt.right.error,
        rest="little",
        explained=True,
        place="",
        few="",
        verdict=compared.verdict.words,
        failures=failures,
        note=str(image.attributes.get(NOTE, "")),
    )
    if compared.verdict.right:
        return diagnosis
    if compared.hints.reason:
        # A reference is black where nothing should be seen: the image is black only if it is right.
        reason = compared.hints.reason
        black = reason.startswith("the image is black") or diagnosis.residual == 0
        first = BLACK if black else UNEXPLAINED
        row = Ranked(first, (), compared.hints.reason, diagnosis.residual, 0.0, ())
        return replace(diagnosis, first=first, ranked=(row,), rest="", explained=False)
    # Where a few pixels are wrong and all others right, such as a mark on the image, no path of
    # light explains it: the costly faults are not tried.
    few = "" if attempt.chosen.faults else all_but_few(compared, image.with_data())
    if not few:
        attempt.go_on()
    return _concluded(diagnosis, attempt, compared, few)


def _concluded(
    diagnosis: Diagnosis, attempt: "_Attempt", compared: EngineComparison, few: str
) -> Diagnosis:
    """Return a diagnosis with what a search has found."""
    chosen = attempt.chosen
    if chosen.faults and attempt.is_named(chosen):
        first = chosen.names[0]
    elif attempt.blocks.is_noise(attempt.right) and compared.verdict.noise_alone:
        # Noise alone makes blocks differ: that is no fault, and the comparison says so too.
        first, chosen = RIGHT, attempt.right
    else:
        first = UNEXPLAINED
    # The record has eight rows. Where the error lies is said only if it is not explained.
    rest = attempt.rest(chosen)
    explained = bool(rest) and first != UNEXPLAINED
    return replace(
        diagnosis,
        first=first,
        ranked=tuple(attempt.ranked(chosen)[:8]),
        left=chosen.error,
        rest=rest,
        explained=explained,
        place="" if explained else place_words(attempt.predictor, chosen),
        few="" if explained else few,
    )


class _Attempt:
    """The search among all faults, with pixels of one kind."""

    def __init__(self, predictor: Predictor, pixel: str, progress: Progress | None) -> None:
        self.many = predictor.many
        self.predictor = predictor.few if self.many else predictor
        self.pixel, self.progress = pixel, progress
        self.blocks = Blocks.of(self.predictor)
        self.right = explain(self.predictor, ())
        self.faults = faults_of(self.predictor)
        self.found: list[Explanation] = []

    def go_on(self) -> None:
        """Try what costs more where it is needed."""
        for step in (self.try_pairs, lambda: self.try_faults(1), lambda: self.try_faults(2)):
            if self.is_settled(self.chosen):
                return
            step()

    def try_faults(self, costly: int) -> None:
        """Try all faults of a cost, each alone."""
        faults, tried = (
            [fault for fault in self.faults if fault.costly == costly],
            list[Explanation](),
        )
        for number, fault in enumerate(faults):
            self._tell(_PARTS[costly], number / len(faults), fault.name)
            tried.append(explain(self.predictor, (fault,), fine=False))
        self.found += self._refined(tried)

    def try_pairs(self) -> None:
        """Try two faults of different kinds.

        Each pair has one of the faults that leave least, and starts from the values found for its
        faults alone; the best pairs are followed until one leaves nothing to explain.
        """
        # Single faults that cost nothing, by what they leave; some are never half of a pair.
        ordered = sorted(self.found, key=lambda each: each.error)
        cheap = [
            each.faults[0]
            for each in ordered
            if not each.faults[0].costly and not each.faults[0].single
        ]
        # An exposure is wrong beside anything else, and alone explains little
        # where a curve comes after it.
        cheap.sort(key=lambda fault: fault.name != "factor")
        # The first six faults are tried with all that follow them.
        pairs = [
            _in_order(a, b)
            for n, a in enumerate(cheap[:6])
            for b in cheap[n + 1 :]
            if _differ(a, b)
        ]
        # First half of the time: the error of each pair at its best start, on few pixels.
        few, begun = self.predictor.few, []
        for number, pair in enumerate(pairs):
            self._tell(
                _PARTS[-1], 0.5 * number / len(pairs), " and ".join(fault.name for fault in pair)
            )
            begun.append((*begin(few, pair), pair))
        begun.sort(key=lambda each: each[0])
        # Second half: the twelve pairs that leave least are followed, on few pixels first. All
        # pixels are looked at only if a pair leaves much less than the best single fault.
        most = 12
        explanations: list[Explanation] = []
        for number, (_, near, pair) in enumerate(begun[:most]):
            self._tell(
                _PARTS[-1], 0.5 + 0.5 * number / most, " and ".join(fault.name for fault in pair)
            )
            rough = explain(few, pair, near, fine=False)
            if rough.error < LEFT * ordered[0].error:
                explanations.append(explain(self.predictor, pair, rough.values))
                if self.is_settled(explanations[-1]):
                    break
        self.found += explanations

    def is_settled(self, explanation: Explanation) -> bool:
        """Return whether an explanation leaves noise, or little: nothing for another fault."""
        return self.blocks.is_noise(explanation) or self._is_little(explanation)

    def _is_little(self, explanation: Explanation) -> bool:
        """Return whether an explanation leaves no more than the error of the fog model itself, or
        little more.
        """
        # A twentieth of the error of the image is little too, up to the model's error of means.
        most = max(KNOWN[self.pixel], min(KNOWN["area"], _LITTLE * self.right.error))
        return explanation.error <= most

    def is_named(self, explanation: Explanation) -> bool:
        """Return whether an explanation is within the limits of the calibration."""
        weight = self._evidence([explanation])[0]
        return weight > EVIDENCE and (
            self.is_settled(explanation) or explanation.error < LEFT * self.right.error
        )

    def rest(self, explanation: Explanation) -> str:
        """Return what an explanation leaves in words; nothing where something else is wrong too."""
        if self.blocks.is_noise(explanation):
            return "like noise: neighbouring pixels do not share it"
        return "little" if self._is_little(explanation) else ""

    @property
    def chosen(self) -> Explanation:
        """The explanation with the most evidence, or the simplest of all that are as good; or the
        scene as it is.
        """
        singles = [each for each in self.found if len(each.faults) == 1]
        pairs = [each for each in self.found if len(each.faults) > 1]
        best = self._best([self.right, *singles])
        if pairs:
            # The second fault must be as sure as the first, in an image that has the first one.
            pair = self._best(pairs)
            one, two = self._evidence([best, pair])
            best = pair if two > one + EVIDENCE and pair.error < LEFT * best.error else best
        return best

    def _best(self, explanations: Sequence[Explanation]) -> Explanation:
        """Return the explanation with the most evidence, or the simplest of all that are as good.

        A further number is worth its error only where the simpler explanation leaves more than
        little: fog with a scale height of 10 km is an extinction, and so is fog with a scale height
        of 90 m that fits a rest of 0.1 %.
        """
        # Explanations whose evidence differs by five are as good as one another.
        weights = self._evidence(explanations)
        ordered = sorted(zip(weights, explanations, strict=True), key=lambda each: -each[0])
        most, best = ordered[0]
        alike = [
            each for weight, each in ordered if weight >= most - 5.0 or self._is_as_good(each, best)
        ]
        return min(alike, key=lambda each: (each.parameters, len(each.faults)))

    def _is_as_good(self, one: Explanation, best: Explanation) -> bool:
        """Return whether an explanation is nearly the image of the best one, and
        leaves little or hardly more.
        """
        apart = float(np.abs(one.errors - best.errors).mean())
        leaves_little = bool(one.faults) and self._is_little(one)
        # An explanation that leaves noise alone is better than one that
        # does not, by however little.
        noise_too = self.blocks.is_noise(one) or not self.blocks.is_noise(best)
        hardly_more = noise_too and one.error <= (1 + _LITTLE) * best.error
        return apart <= _LITTLE * self.right.error and (leaves_little or hardly_more)

    def _evidence(self, explanations: Iterable[Explanation]) -> list[float]:
        """Return the evidence of explanations."""
        # The explanation that leaves least says how large the errors are that no fault makes, and
        # how many pixels count as one: the same scale for all explanations.
        least = min([self.right, *self.found], key=lambda each: scale_of(each, self.pixel))
        scale, area = scale_of(least, self.pixel), self.blocks.area(least.errors, least.lit)
        return [evidence(each, self.right, scale, max(area, 1.0)) for each in explanations]

    def ranked(self, chosen: Explanation) -> list[Ranked]:
        """Return all explanations in the order of evidence, the chosen one first."""
        singles = [each for each in self.found if len(each.faults) == 1]
        weights = dict(
            zip(map(id, [chosen, *singles]), self._evidence([chosen, *singles]), strict=True)
        )
        # Several faults have one name, such as the laws of distance: the best one is listed.
        rows = _rows(chosen, weights[id(chosen)])
        named = {row.name for row in rows}
        for each in sorted(singles, key=lambda each: -weights[id(each)]):
            if each.names[0] not in named:
                named.add(each.names[0])
                rows += _rows(each, weights[id(each)])
        return rows

    def _refined(self, explanations: list[Explanation]) -> list[Explanation]:
        """Return explanations; the few that leave least have their parameters to all digits."""
        # After a coarse search the best five faults are refined. More digits do not bring an error
        # down from three times the least error, or three times the error of the model.
        least = min((each.error for each in [*self.found, *explanations]), default=1.0)
        finer: dict[int, Explanation] = {}
        for each in sorted(explanations, key=lambda each: each.error)[:5]:
            if each.parameters and each.error < 3.0 * max(least, KNOWN[self.pixel]):
                finer[id(each)] = explain(self.predictor, each.faults, each.values)
        return [finer.get(id(each), each) for each in explanations]

    def _tell(self, span: tuple[float, float], part: float, what: str) -> None:
        if self.progress is not None:
            self.progress(span[0] + (span[1] - span[0]) * part, what)


def _differ(first: Fault, second: Fault) -> bool:
    """Return whether two faults are of different kinds, and do not both
    look for paths of their own.
    """
    moves = [any(parameter.step for parameter in each.parameters) for each in (first, second)]
    lights = [each.kind == "light" for each in (first, second)]
    return first.kind != second.kind and not (any(moves) and any(lights))


def _in_order(first: Fault, second: Fault) -> tuple[Fault, Fault]:
    """Return faults in the order in which they happen: the scene, its
    image, what is done to values.
    """
    return (
        (first, second) if KINDS.index(first.kind) <= KINDS.index(second.kind) else (second, first)
    )


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
