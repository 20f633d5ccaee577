# SPDX-License-Identifier: BSD-3-Clause
"""The stages of the search for what is wrong with an image. Each costs more than the one before,
and the search ends after the first one whose best explanation leaves nothing to explain.

quick   every fault alone whose paths of light are those of the scene, or few others
pairs   two faults of different kinds of the first stage
paths   every fault alone that finds paths of its own for each of its values
extent  every fault alone that changes the extent of lights, which need many paths
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from airlight.validation.arrays import Progress
from airlight.validation.engine.decide import MODEL_ERROR, MOST_LEFT, Blocks, Candidates
from airlight.validation.engine.equations import terms_that_matter
from airlight.validation.engine.fault import Fault
from airlight.validation.engine.faults import KINDS, faults_of
from airlight.validation.engine.prediction import Predictor
from airlight.validation.engine.search import (
    COARSE,
    Explanation,
    best_of_starts,
    best_shape,
    explain,
)
from airlight.validation.engine.verdict import RIGHT

QUICK, PAIRS = "quick", "pairs"
STAGES = (QUICK, PAIRS, "paths", "extent")


@dataclass(frozen=True)
class Attempt:
    """The search with pixels of one kind, after some of its stages."""

    predictor: Predictor
    faults: tuple[Fault, ...]  #: that the scene and its image may have
    candidates: Candidates

    @staticmethod
    def begun(predictor: Predictor, pixel: str) -> "Attempt":
        """Return the search before its first stage; `pixel`: 'centre' or 'area'."""
        # Among many triangles exact paths cost much: few pixels are looked at.
        predictor = predictor.few if predictor.many else predictor
        candidates = Candidates(pixel, Blocks.of(predictor), explain(predictor, ()))
        return Attempt(predictor, faults_of(predictor), candidates)

    def after(self, stage: str, progress: Progress | None) -> "Attempt":
        """Return the search after another stage."""
        tell = _part_of(progress, STAGES.index(stage))
        tried = _pairs(self, tell) if stage == PAIRS else _alone(self, stage, tell)
        return replace(self, candidates=self.candidates.with_more(tried))

    def finished(self, progress: Progress | None) -> "Attempt":
        """Return the search, begun with the quick stage, after all stages that are needed."""
        attempt = self
        for stage in STAGES[1:]:
            if attempt.candidates.is_enough(attempt.candidates.chosen):
                break
            attempt = attempt.after(stage, progress)
        return attempt


def _part_of(progress: Progress | None, number: int) -> Progress:
    """Return the progress of a stage: each is an equal part of the whole."""

    def tell(part: float, what: str) -> None:
        if progress is not None:
            progress((number + part) / len(STAGES), what)

    return tell


def _alone(attempt: Attempt, stage: str, tell: Progress) -> list[Explanation]:
    """Return the explanations by the faults of a stage, each alone."""
    faults = [fault for fault in attempt.faults if fault.stage == stage]
    explanations: list[Explanation] = []
    for number, fault in enumerate(faults):
        tell(number / len(faults), fault.name)
        found = explain(attempt.predictor, (fault,), fine=False)
        if not (fault.equation and _is_one_term(attempt, found)):
            explanations.append(found)
    return _refined(attempt, explanations)


def _is_one_term(attempt: Attempt, found: Explanation) -> bool:
    """Return whether one term at most makes the image of an engine's equation: a term is a fault
    with a name of its own.
    """
    # An explanation that leaves most of the error is not named anyway.
    if found.error > MOST_LEFT * attempt.candidates.right.error:
        return False
    words = found.faults[0].equation
    return len(terms_that_matter(attempt.predictor, words, found.values[0], RIGHT)) < 2


def _refined(attempt: Attempt, explanations: Sequence[Explanation]) -> list[Explanation]:
    """Return explanations; the few that leave least have their parameters to all digits."""
    candidates = attempt.candidates
    errors = [each.error for each in (*candidates.tried, *explanations)]
    # After a coarse search the best five faults are refined. More digits do not bring an error
    # down from three times the least error, unless the coarse search does not see it.
    worst = max(3.0 * max(min(errors, default=1.0), MODEL_ERROR[candidates.pixel]), COARSE)
    finer: dict[int, Explanation] = {}
    for each in sorted(explanations, key=lambda each: each.error)[:5]:
        if each.parameters and each.error < worst:
            finer[id(each)] = explain(attempt.predictor, each.faults, each.values)
    return [finer.get(id(each), each) for each in explanations]


def _pairs(attempt: Attempt, tell: Progress) -> list[Explanation]:
    """Return the explanations by two faults of different kinds.

    Each pair has one of the faults that leave least, and starts from the values found for its
    faults alone; the best pairs are followed until one leaves nothing to explain.
    """
    # The faults of the first stage, by what they leave; some are never half of a pair.
    ordered = sorted(attempt.candidates.tried, key=lambda each: each.error)
    few = attempt.predictor.few
    halves = [_half(few, each) for each in ordered if not each.faults[0].single]
    # An exposure is wrong beside anything else, and alone explains little
    # where a curve comes after it.
    halves.sort(key=lambda fault: fault.name != "factor")
    # The first six faults are tried with all that follow them; of two that make up for one another
    # neither need leave little alone.
    pairs = [
        in_order(first, second)
        for number, first in enumerate(halves)
        for second in halves[number + 1 :]
        if differ(first, second) and (number < 6 or _near_lamps(first, second))
    ]
    # First half of the time: the error of each pair at its best start, on few pixels. Where numbers
    # of one fault alone make up for some of the other they are looked for again.
    begun = []
    for number, pair in enumerate(pairs):
        tell(0.5 * number / len(pairs), _names(pair))
        least, near = best_of_starts(few, pair)
        if _near_lamps(*pair) or (pair[0].equation and not pair[1].moves):
            rough = explain(few, pair, near, fine=False)
            least, near = rough.error, rough.values
        begun.append((least, near, pair))
    begun.sort(key=lambda each: each[0])
    # Second half: the twelve pairs that leave least are followed, on few pixels first. All
    # pixels are looked at only if a pair leaves much less than the best single fault.
    most = 12
    explanations: list[Explanation] = []
    for number, (_, near, pair) in enumerate(begun[:most]):
        tell(0.5 + 0.5 * number / most, _names(pair))
        rough = explain(few, pair, near, fine=False)
        if rough.error < MOST_LEFT * ordered[0].error:
            explanations.append(explain(attempt.predictor, pair, rough.values))
            if attempt.candidates.is_enough(explanations[-1]):
                break
    return explanations


def _half(few: Predictor, alone: Explanation) -> Fault:
    """Return a fault as one of a pair. An equation, which has many starts, begins with what was
    found for it alone, or where it has the shape of the image.
    """
    (fault,) = alone.faults
    if not fault.equation:
        return fault
    starts = *alone.values, best_shape(few, fault)
    return replace(fault, begin=lambda predictor, guess: starts)


def _near_lamps(first: Fault, second: Fault) -> bool:
    """Return whether two faults are the law of lamps and the path of their light, which make up for
    one another.
    """
    names = {first.name, second.name}
    return "light-path" in names and bool(names & {"distance-law", "light-range"})


def _names(faults: Sequence[Fault]) -> str:
    return " and ".join(fault.name for fault in faults)


def differ(first: Fault, second: Fault) -> bool:
    """Return whether two faults are of different kinds, and do not both
    look for paths of their own.
    """
    moves = first.moves or second.moves
    is_of_light = "light" in (first.kind, second.kind)
    return first.kind != second.kind and not (moves and is_of_light)


def in_order(first: Fault, second: Fault) -> tuple[Fault, Fault]:
    """Return faults in the order in which they happen: the scene, its
    image, what is done to values.
    """
    if KINDS.index(first.kind) <= KINDS.index(second.kind):
        return first, second
    return second, first
