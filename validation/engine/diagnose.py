# SPDX-License-Identifier: BSD-3-Clause
"""The diagnosis of an image of a scene: every fault predicts the image that it would make, and the data choose.

Faults are tried alone, those that need their own paths only where no other one explains the image, then pairs of
different kinds. Whether pixels are centres or means is decided once, by what the faults without paths of their own
leave of the image.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from analytic.errors import InputError
from reference.storage.exr import Image, read_exr
from validation.arrays import Progress
from validation.engine.error_place import place_words
from validation.engine.evidence import (
    LEAST_EFFECT,
    evidence,
    gains,
    is_enough,
    is_explained,
    is_noise,
    leaves_nothing,
    no_fault,
    scale_of,
    usual_error,
)
from validation.engine.fault import Fault
from validation.engine.faults import KINDS, faults_of
from validation.engine.prediction import Predictor, SceneLight
from validation.engine.search import Explanation, begin, explain
from validation.engine.seen import (
    PIXEL_WORDS,
    decide_pixel,
    judged_layer,
    layers_of,
    pixel_kinds,
    scene_of_size,
    seen_image,
)
from validation.scenes.loading import LoadedScene

RIGHT, UNEXPLAINED = "right", "unexplained"

_FEWEST = 16  # pixels
_REFINED = 5  # faults whose numbers are found to all digits: those that leave least after a coarse search
_MOVED = 0.02  # fraction by which the error changes where a search left the unchanged scene
_LESS = 0.9  # fraction of the error that a search leaves of which all digits are wanted where paths cost much
# Errors over the least one that more digits do not bring down to it; the last where that one leaves noise.
_FAR, _FAR_OF_PATHS, _FAR_FROM_NOISE = 10.0, 3.0, 1.5
_PARTNERS = 12  # faults, those that leave least, with which all others are tried as pairs
_PAIRS = 12  # pairs that are followed, those that leave least where they begin
_BETTER = 0.7  # what a pair must leave of the error of one alone: with more numbers anything fits a little better
_MUCH = 0.2  # what an explanation must leave of the error to be named although more is wrong
_ALIKE = 5.0  # evidence by which explanations may differ and still be as good as one another
_SHOWN, _PRINTED = 8, 5
_CERTAIN = 1e4  # evidence beyond which the number says no more
_PARTS = (0.0, 0.3), (0.3, 0.6), (0.8, 1.0), (0.6, 0.8)  # of the time: faults by what they cost, and pairs


@dataclass(frozen=True)
class Ranked:
    """A fault in the order of evidence."""

    name: str
    parameters: tuple[float, ...]
    words: str
    residual: float  #: mean relative error that it leaves, with what stands beside it
    evidence: float  #: natural logarithm of the odds against the unchanged scene
    together: tuple[str, ...]  #: names of all that explain the image together, where it takes more than one


@dataclass(frozen=True)
class Diagnosis:
    """The faults of a layer of an image."""

    scene: str
    path: str
    layer: str
    pixel: str  #: 'centre' or 'area'
    first: str  #: name of the first explanation; 'right' or 'unexplained' where it is no fault
    ranked: tuple[Ranked, ...]
    residual: float  #: mean relative error of the image as it is
    left: float  #: what the first explanation leaves of it
    rest: str  #: what that is: noise, little, or less than a tenth of what it was; empty where it is none of these
    explained: bool  #: whether that is nothing to explain
    place: str  #: where the remaining error lies; empty where it is noise, or little
    failures: tuple[str, ...] = ()  #: what is wrong with the file, such as pixels that are not finite

    @property
    def lines(self) -> list[str]:
        """The first explanation, the error that it leaves, and the others that were tried."""
        off = f"values are {_percent(self.residual)} off in the mean"
        lines = [f"{self.path}, {self.layer}, against {self.scene}, {PIXEL_WORDS[self.pixel]}: {off}."]
        together = [row for row in self.ranked if row.together]
        if self.first == RIGHT:
            lines.append(f"Nothing is wrong with it: the difference is {self.rest}.")
        elif self.first == UNEXPLAINED:
            lines.append(f"Nothing here explains it{': the error lies ' + self.place if self.place else ''}.")
        else:
            found = f"Two faults explain it: {'; and '.join(row.words for row in together)}." if together else ""
            lines.append(found or f"{self.first}: {self.ranked[0].words}.")
            more = f"no noise: something else is wrong too{', ' + self.place if self.place else ''}"
            lines.append(
                f"Without that, values are {_percent(self.left)} off in the mean, which is {self.rest or more}."
            )
        lines += [f"Failed: {reason}." for reason in self.failures]
        lines += ["", f"{'fault':<16} {'left':>9} {'evidence':>9}  what it says"]
        for row in self.ranked[:_PRINTED]:
            weight = f"{row.evidence:.0f}" if abs(row.evidence) < _CERTAIN else f"{row.evidence:.1e}"
            lines.append(f"{row.name:<16} {_percent(row.residual):>9} {weight:>9}  {row.words}")
        return [
            *lines,
            "",
            "left: mean relative error without the fault; evidence: natural logarithm of the odds against `right`.",
        ]


def diagnose_file(
    path: str | os.PathLike[str], scene: str, *, layer: str | None = None, holds: str | None = None, **how: Any
) -> tuple[Diagnosis, ...]:
    """Diagnose an EXR file of a scene: each of airlight and surfaces where it has both; see `diagnose_image`.

    `path`, `scene`: the EXR file; a built-in scene or a Mitsuba XML file; `layer`, `holds`: which layer, see
    `validation.engine.seen.judged_layer`.
    """
    image = read_exr(path)
    several = layers_of(image, str(path), layer, holds)
    loaded = scene_of_size(scene, several[0].size, path)
    return tuple(
        diagnose_image(image, loaded, path=str(path), layer=each.name, holds=each.holds, **how) for each in several
    )


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

    `image`, `loaded`: the layers, and the scene at their size; `layer`, `holds`: which layer, and what it holds:
    'airlight', 'surface' or 'total'; `pixel`: 'centre' or 'area'; by default what the image says of itself, or what
    fits better; `light`: of this scene, as other images of it have found it.
    """
    judged = judged_layer(image, path, name=layer, holds=holds)
    seen, wrong = seen_image(image, judged, loaded.scene)
    if (count := int(seen.used.sum())) < _FEWEST:
        raise InputError(
            f"{path}: {count} pixels of the layer '{judged.name}' say something; expected at least {_FEWEST}, finite "
            "and not of a light itself: fewer do not tell a fault from noise"
        )
    light = light or SceneLight(seen.reference)

    def begun(kind: str) -> _Attempt:
        attempt = _Attempt(Predictor(replace(seen, area=kind == "area"), light), kind, progress)
        attempt.try_faults(0)
        return attempt

    kind, attempt = decide_pixel(pixel_kinds(image, pixel), begun, lambda found: [each.chosen.error for each in found])
    attempt.go_on()
    chosen, rows = attempt.ranked()
    rest = attempt.rest(chosen)
    return Diagnosis(
        loaded.name,
        path,
        judged.name,
        kind.pixel,
        _first(attempt.right, chosen, bool(rest)),
        tuple(rows[:_SHOWN]),
        attempt.right.error,
        chosen.error,
        rest,
        bool(rest),
        "" if rest else place_words(attempt.predictor, chosen),
        wrong,
    )


def _first(right: Explanation, chosen: Explanation, explained: bool) -> str:
    if not chosen.faults:
        return RIGHT if explained else UNEXPLAINED
    if explained or chosen.error < _MUCH * right.error:
        return chosen.names[0]
    return UNEXPLAINED


class _Attempt:
    """The search among all faults, with pixels of one kind."""

    def __init__(self, predictor: Predictor, pixel: str, progress: Progress | None) -> None:
        self.many = predictor.many
        self.predictor = predictor.few if self.many else predictor
        self.pixel, self.progress = pixel, progress
        self.little = no_fault(predictor.reference)
        self.right = explain(self.predictor, ())
        self.faults = faults_of(self.predictor)
        self.singles: list[Explanation] = []
        self.pairs: list[Explanation] = []

    @property
    def chosen(self) -> Explanation:
        """The best explanation by one fault, or the unchanged scene."""
        return self._best(self.singles)

    def explained(self, explanation: Explanation) -> bool:
        """Return whether what an explanation leaves is noise, or little."""
        return is_explained(explanation, self.right, self.predictor.pairs, self.little)

    def rest(self, explanation: Explanation) -> str:
        """Return the residual of an explanation in words; nothing where something else is wrong too."""
        if is_explained(explanation, self.right, self.predictor.pairs, 0.0):
            return "noise: neighbouring pixels do not share it"
        if self.explained(explanation):
            return "little"
        return "less than a tenth of what it was" if gains(explanation, self.right) else ""

    def go_on(self) -> None:
        """Try what costs more where it is needed."""
        if self._settled(self.chosen):
            return
        self.try_faults(1)
        if not self.explained(self.chosen):
            self.pairs = self._try_pairs(self.chosen)
        if not self._settled(self._with_pairs()):
            self.try_faults(2)

    def ranked(self) -> tuple[Explanation, list[Ranked]]:
        """Return the explanation that is chosen, and all in the order of evidence."""
        chosen = self._with_pairs()
        scale = scale_of(chosen, self.pixel)
        rows: list[Ranked] = []
        if len(chosen.faults) > 1:
            rows += _rows(chosen, evidence(chosen, self.right, scale))
        named = {row.name for row in rows}
        for each in sorted(self.singles, key=lambda each: -evidence(each, self.right, scale)):
            if each.names[0] not in named:
                named.add(each.names[0])
                # Between explanations that leave the same, the one with fewer numbers comes first.
                shown = chosen if each.names == chosen.names else each
                rows += _rows(shown, evidence(shown, self.right, scale))
        if not chosen.faults:
            rows.insert(0, Ranked(RIGHT, (), "nothing is wrong", self.right.error, 0.0, ()))
        elif len(chosen.faults) == 1:
            rows.sort(key=lambda row: row.name != chosen.names[0])
        return chosen, rows

    def try_faults(self, costly: int) -> None:
        """Try all faults of a cost, each alone."""
        own, tried = [fault for fault in self.faults if fault.costly == costly], list[Explanation]()
        for number, fault in enumerate(own):
            moved = [each for each in [*self.singles, *tried] if each.faults[0].costly]
            if self.many and any(gains(each, self.right) for each in moved):
                break  # of two faults that move paths one leaves a tenth at most
            self._tell(_PARTS[costly], number / len(own), fault.name)
            tried.append(explain(self.predictor, (fault,), fine=False))
        least = min((each.error for each in self.singles), default=1.0)
        # A sphere in the place of a light costs as much as all others: to all digits only where it explains most.
        coarse = costly > 1 and (self.many or all(each.error > least for each in tried))
        self.singles += tried if coarse else self._refined(tried, least)

    def _settled(self, explanation: Explanation) -> bool:
        """Return whether nothing is left that another fault could explain."""
        pairs = self.predictor.pairs
        if len(explanation.faults) > 1:
            return leaves_nothing(explanation, self.pixel)
        if explanation.faults and not self.predictor.reference.area:
            # An error that is little for an image may be much beside what the fault itself does, if it is a wrong one:
            # a factor leaves 0.4 % of what a lamp of 0.25 m does, all of it in the shadows, and another g 0.2 % of a
            # near plane at 0.1 m, most of it in the middle.
            return leaves_nothing(explanation, "centre") or is_noise(explanation, pairs)
        return usual_error(explanation) <= self.little or is_noise(explanation, pairs)

    def _with_pairs(self) -> Explanation:
        """Return the best pair if it leaves far less than the best explanation alone, else that one."""
        chosen = self.chosen
        best = self._best([chosen, *self.pairs] if chosen.faults else self.pairs)
        if best is chosen or not best.faults:
            return chosen
        return best if best.error < _BETTER * chosen.error else chosen

    def _refined(self, explanations: list[Explanation], least: float = 1.0) -> list[Explanation]:
        """Return explanations, those that leave least with all digits; `least` is what others leave.

        Where a search stayed at the unchanged scene, or left far more than another, none are wanted.
        """
        least = max(LEAST_EFFECT, min([least, *(each.error for each in explanations)]))
        moved = [each for each in explanations if abs(each.error - self.right.error) > _MOVED * self.right.error]
        if self.many:
            moved = [each for each in moved if each.error < _LESS * self.right.error]
        finer: dict[int, Explanation] = {}
        for each in sorted(moved, key=lambda each: each.error):
            far = min(_far(each), _FAR_FROM_NOISE if any(map(self._settled, finer.values())) else _FAR)
            if len(finer) < _REFINED and each.parameters and each.error < far * least:
                finer[id(each)] = explain(self.predictor, each.faults, each.values)
                least = max(LEAST_EFFECT, min(least, finer[id(each)].error))
        return [finer.get(id(each), each) for each in explanations]

    def _best(self, explanations: Sequence[Explanation]) -> Explanation:
        """Return the explanation with the most evidence, or the unchanged scene where none has enough."""
        if not explanations:
            return self.right
        scale = min(scale_of(each, self.pixel) for each in [self.right, *explanations])
        most = max(evidence(each, self.right, scale) for each in explanations)
        # Among equals, such as a factor and a near plane before dark fog: the simplest, then the first.
        alike = [each for each in explanations if evidence(each, self.right, scale) >= most - _ALIKE]
        best = min(alike, key=lambda each: each.parameters)
        return best if is_enough(best, self.right, scale, self.predictor.pairs) else self.right

    def _try_pairs(self, chosen: Explanation) -> list[Explanation]:
        """Return explanations by two faults of different kinds.

        Each pair has one of the faults that leave least, and starts from the values found for its faults alone; the
        best pairs are followed until one leaves nothing visible.
        """
        ordered = sorted(self.singles, key=lambda each: each.error)
        cheap = [each.faults[0] for each in ordered if not each.faults[0].costly and not each.faults[0].single]
        both = [_in_order(a, b) for n, a in enumerate(cheap[:_PARTNERS]) for b in cheap[n + 1 :] if _differ(a, b)]
        begun = []
        for number, pair in enumerate(both):
            self._tell(_PARTS[-1], 0.5 * number / len(both), " and ".join(fault.name for fault in pair))
            begun.append((*begin(self.predictor, pair), pair))
        begun.sort(key=lambda each: each[0])
        explanations: list[Explanation] = []
        for number, (_, near, pair) in enumerate(begun[:_PAIRS]):
            self._tell(_PARTS[-1], 0.5 + 0.5 * number / _PAIRS, " and ".join(fault.name for fault in pair))
            explanations.append(explain(self.predictor, pair, near, fine=False))
            if explanations[-1].error < _MUCH * chosen.error:
                explanations[-1] = explain(self.predictor, pair, explanations[-1].values)
                if leaves_nothing(explanations[-1], self.pixel):
                    break
        return self._refined(explanations)

    def _tell(self, span: tuple[float, float], part: float, what: str) -> None:
        if self.progress is not None:
            self.progress(span[0] + (span[1] - span[0]) * part, what)


def _far(explanation: Explanation) -> float:
    """Return the error over the least one that more digits do not bring down to it: those of other paths are few."""
    numbers = (parameter for fault in explanation.faults for parameter in fault.parameters)
    return _FAR_OF_PATHS if any(number.step for number in numbers) else _FAR


def _differ(first: Fault, second: Fault) -> bool:
    """Return whether two faults are of different kinds, and do not both look for paths of their own."""
    moves = [any(parameter.step for parameter in each.parameters) for each in (first, second)]
    lights = [each.kind == "light" for each in (first, second)]
    return first.kind != second.kind and not (any(moves) and any(lights))


def _in_order(first: Fault, second: Fault) -> tuple[Fault, Fault]:
    """Return faults in the order in which they happen: the scene, its image, what is done to values."""
    return (first, second) if KINDS.index(first.kind) <= KINDS.index(second.kind) else (second, first)


def _rows(explanation: Explanation, weight: float) -> list[Ranked]:
    names = explanation.names if len(explanation.faults) > 1 else ()
    return [
        Ranked(fault.name, values, fault.sentence(values), explanation.error, weight, names)
        for fault, values in zip(explanation.faults, explanation.values, strict=True)
    ]


def _percent(part: float) -> str:
    return f"{100 * part:.3g} %"
