# SPDX-License-Identifier: BSD-3-Clause
"""How good choices are in scenes that the model has not seen: cross-validation over scenes.

All rows of a scene are held out together. In a scene that is held out each error of a grid is asked for; the choice is
looked up in its rows: whether it held the error, and how much slower it was than the fastest that did.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from validation.advise.choose import SHARE, choose, predicted
from validation.advise.model import AdviceModel
from validation.advise.rows import SceneRow

ERRORS = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  #: that are asked for
_FOLDS = 8
CLOSE = 1.3  #: times the fastest that holds the error


@dataclass(frozen=True)
class Choice:
    """A choice in a scene that was held out."""

    image: tuple[str, str, int, int]
    asked: float  #: error that was asked for
    label: str  #: of the configuration
    promised: bool  #: whether it was predicted to hold the error
    held: bool  #: whether it did
    possible: bool  #: whether any configuration did
    slower: float  #: its cost over that of the fastest that held the error; infinite where it did not


@dataclass(frozen=True)
class Judgement:
    """Shares of choices in scenes that were held out."""

    scenes: int
    choices: int  #: scenes times errors that were asked for
    promised: float  #: share of the choices that were predicted to hold the error
    held: float  #: share of these that held it
    possible: float  #: share of the choices for which some configuration held the error
    held_of_possible: float  #: share of these for which the choice did, predicted or not
    close: float  #: share of these within `CLOSE` times the fastest that held it
    margin: float  #: decades added to predicted errors


def by_image(rows: Iterable[SceneRow]) -> dict[tuple[str, str, int, int], list[SceneRow]]:
    """Return rows by image."""
    images: dict[tuple[str, str, int, int], list[SceneRow]] = {}
    for row in rows:
        images.setdefault(row.image, []).append(row)
    return images


def held_out_choices(
    rows: Sequence[SceneRow], fitted: Callable[[Sequence[SceneRow]], AdviceModel], margin: float, folds: int = _FOLDS
) -> list[Choice]:
    """Return the choices in all scenes, each by a model that has not seen the scene.

    Parameters
    ----------
    rows
        Of a sweep.
    fitted
        Returns the model of some rows.
    margin
        Decades added to predicted errors.
    folds
        How often scenes are divided; scene number i is held out in fold i modulo this.
    """
    scenes = sorted({row.image[0] for row in rows})
    fold_of = {scene: number % folds for number, scene in enumerate(scenes)}
    choices = []
    for fold in range(min(folds, len(scenes))):
        model = fitted([row for row in rows if fold_of[row.image[0]] != fold])
        for image, own in by_image(row for row in rows if fold_of[row.image[0]] == fold).items():
            choices += [_choice(model, image, own, asked, margin) for asked in ERRORS]
    return [choice for choice in choices if choice is not None]


def _choice(
    model: AdviceModel, image: tuple[str, str, int, int], rows: list[SceneRow], asked: float, margin: float
) -> Choice | None:
    measured = {row.chosen: row for row in rows if np.isfinite(row.cost)}
    able = [each for each in model.configurations if each.chosen in measured]
    best, promised = choose(
        [predicted(each, rows[0].properties, asked, share=SHARE, margin=margin) for each in able], asked
    )
    if best is None:
        return None
    holding = [row.cost for row in measured.values() if row.error <= asked]
    taken = measured[best.chosen]
    held = taken.error <= asked
    slower = taken.cost / min(holding) if held else np.inf
    return Choice(image, asked, best.chosen.label, promised, held, bool(holding), float(slower))


def judged(choices: Sequence[Choice], margin: float) -> Judgement:
    """Return the shares of choices."""
    promised = [choice for choice in choices if choice.promised]
    possible = [choice for choice in choices if choice.possible]
    return Judgement(
        len({choice.image[0] for choice in choices}),
        len(choices),
        _share(len(promised), len(choices)),
        _share(sum(choice.held for choice in promised), len(promised)),
        _share(len(possible), len(choices)),
        _share(sum(choice.held for choice in possible), len(possible)),
        _share(sum(choice.slower <= CLOSE for choice in possible), len(possible)),
        margin,
    )


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
