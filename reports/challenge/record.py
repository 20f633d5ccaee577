# SPDX-License-Identifier: BSD-3-Clause
"""The content of score.json: an entry, its errors, its number, and what was scored.

It has no date and nothing of the machine that scored, and results have `number.DIGITS` digits, so
that it has the same bytes wherever it is written.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from airlight.errors import InputError
from airlight.reports.challenge.number import (
    BLACK,
    Combined,
    SceneError,
    combined,
    rounded,
    rounded_out,
)
from airlight.reports.challenge.seed import check_seed
from airlight.reports.data.records import read_versioned
from airlight.validation.columns import plain

SCHEMA = "airlight-challenge-score/1"
#: the table of entry.toml with reasons by the names of scenes; tables say it in place of an error
CANNOT = "cannot"
_UNIT = 1e-3  # of a number of four digits, at most
_DIGEST = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Everything that the authors of an entry say of it."""

    method: str
    authors: str = ""
    machine: str = ""
    settings: str = ""
    seed: str
    entry: str = ""  #: the words that the seed was made of; empty where it was given


@dataclass(frozen=True, kw_only=True)
class SceneScore:
    """The result of a scene."""

    name: str
    kind: str
    error: float  #: RMS of the error over that of the reference [1]
    interval: tuple[float, float]  #: of the error, by the stated error of the reference
    bias: float  #: mean error over the mean of the reference [1]
    pixels: int  #: that were judged
    seconds: float | None  #: of a frame, as the entry says
    cannot: str = ""  #: why there is no image, which counts as a black one; empty where there is


@dataclass(frozen=True, kw_only=True)
class Digests:
    """The digests of scenes and images, and the program that scored."""

    scenes: str  #: of the Mitsuba files and meshes
    images: str
    airlight: str  #: version
    commit: str
    program: str  #: of all files of the program


@dataclass(frozen=True, kw_only=True)
class Score:
    """The content of score.json."""

    schema: str
    entry: Entry
    number: float  #: the geometric mean of errors, see `challenge.number`
    interval: tuple[float, float]  #: 95 % interval of the number, for scenes drawn alike
    kinds: Mapping[str, float]  #: the same number of each kind of scenes
    floor: float  #: least error that counts
    scenes: tuple[SceneScore, ...]
    digests: Digests

    @property
    def cannot(self) -> dict[str, tuple[str, ...]]:
        """The names of the scenes that the method cannot have, by the reason."""
        reasons: dict[str, tuple[str, ...]] = {}
        for scene in self.scenes:
            if scene.cannot:
                reasons[scene.cannot] = (*reasons.get(scene.cannot, ()), scene.name)
        return reasons

    @property
    def kinds_shown(self) -> dict[str, float | str]:
        """The number of each kind, and `cannot` in place of 1 where it has no image of a kind."""
        had = {scene.kind for scene in self.scenes if not scene.cannot}
        return {kind: number if kind in had else CANNOT for kind, number in self.kinds.items()}

    @property
    def had(self) -> str:
        """How many of the scenes have an image, such as 16 of 24."""
        return f"{sum(not scene.cannot for scene in self.scenes)} of {len(self.scenes)}"

    @property
    def cite(self) -> str:
        """The sentence that a paper cites."""
        low, high = self.interval
        digests = self.digests
        part = f" with {self.had} scenes, the others as black images," if self.cannot else ""
        return (
            f"{self.entry.method}: {self.number:.3g} (95 % interval {low:.3g} to {high:.3g}){part} "
            f"in the airlight challenge, seed {self.entry.seed}, scenes {digests.scenes[:12]}, images "
            f"{digests.images[:12]}, airlight {digests.airlight}, commit {digests.commit[:12]}"
        )


def combined_score(rows: Sequence[SceneScore], digest: str) -> tuple[Combined, dict[str, float]]:
    """Return the number of rounded errors, rounded with its interval, and the number of each kind.

    A reader of score.json finds the same number again.
    """
    errors: dict[str, list[SceneError]] = {}
    for row in rows:
        errors.setdefault(row.kind, []).append(SceneError(row.error, *row.interval))
    whole = combined(errors, digest)
    kinds = {kind: combined({kind: each}, digest).number for kind, each in errors.items()}
    return (
        Combined(rounded(whole.number), *rounded_out((whole.low, whole.high))),
        {kind: rounded(number) for kind, number in kinds.items()},
    )


def score_text(score: Score) -> str:
    """Return the content of score.json."""
    return json.dumps(plain(score), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def read_score(file: Path) -> Score:
    """Return the content of a file score.json; refuse one whose number does not follow from its
    errors.
    """
    wanted = "a score of `airlight challenge score -o`"
    score = read_versioned(file, Score, SCHEMA, wanted, "score again")
    if not (score.scenes and _DIGEST.fullmatch(score.digests.scenes)):
        raise InputError(f"{file} has no scenes, or no digest of them; score again")
    check_seed(score.entry.seed, score.entry.entry, str(file))
    black = (BLACK.error, BLACK.low, BLACK.high)
    for scene in score.scenes:
        if scene.cannot and (scene.error, *scene.interval) != black:
            raise InputError(
                f"{file}: {scene.name} has no image and the error {scene.error:g}; expected 1, that "
                "of a black image: score again"
            )
    # Another machine finds the same number again, but for the rounding of logarithms.
    again, kinds = combined_score(score.scenes, score.digests.scenes)
    made = (again.number, again.low, again.high, *kinds.values())
    said = (score.number, *score.interval, *(score.kinds.get(kind, 0.0) for kind in kinds))
    follow = all(abs(one - two) <= _UNIT * two for one, two in zip(said, made, strict=True))
    if not follow or len(score.kinds) != len(kinds):
        raise InputError(
            f"{file}: its errors make the number {made[0]:g}, interval {made[1]:g} to {made[2]:g}, "
            "and numbers of kinds, of which it says others; expected a score as it was written: "
            "score again"
        )
    return score
