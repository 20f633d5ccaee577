# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.challenge_new`, `challenge_score`, `challenge_board`: a number to cite."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.api.inputs import File, Files, Progress, one_error, output_files, telling
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Interval, Row, Table, numbers, table, words

if TYPE_CHECKING:
    from airlight.reports.challenge.board import BoardTable
    from airlight.reports.challenge.folder import Challenge
    from airlight.reports.challenge.record import Score

FOLDER, PAGE = "airlight-challenge", "board.html"  #: where `new` and `board` write by default


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ChallengeWritten(Result):
    """A challenge whose scenes were written."""

    folder: Path
    challenge: "Challenge"  #: the content of challenge.json

    @property
    def title(self) -> str:
        """The seed and the folder."""
        return f"Challenge {self.challenge.seed} in {self.folder}"

    @property
    def tables(self) -> Sequence[Table]:
        """The scenes."""
        columns = (*words("name", "kind"), *words(purpose="what was drawn", how={"long": True}))
        rows = [(each.name, each.kind, each.purpose) for each in self.challenge.scenes]
        return [table(f"Scenes of the seed {self.challenge.seed}", columns, rows)]

    @property
    def lines(self) -> Sequence[str]:
        """The files to write, and the command that scores them."""
        width, height = self.challenge.size
        return [
            f"{self.folder}: {len(self.challenge.scenes)} scenes of {width} x {height} pixels in "
            f"scenes/, each as NAME.xml, NAME.json and NAME.glb; digest "
            f"{self.challenge.digest[:12]}",
            f"to write: {self.challenge.write}",
            'and entry.toml, with a line method = "NAME, commit ..."; authors, machine and '
            'settings are optional; under [cannot] a line NAME = "REASON" for a scene that the '
            "method cannot have",
            f"to score: {shlex.join(['airlight', 'challenge', 'score', str(self.folder)])} -o "
            "score.json",
        ]


@one_error
def challenge_new(
    seed: str | None = None, *, entry: str | None = None, output: File | None = None
) -> ChallengeWritten:
    """Draw the scenes of a challenge from a seed, and write them without answers.

    There are 24 scenes of 160x120 pixels: eight random ones, eight that vary certified scenes, and
    eight in the height fog of engines. Each is a Mitsuba file, a description as of `airlight
    describe` and a glTF file; challenge.json has their digest and says what to render.

    Scenes cannot be chosen where their seed follows from the name of the entry: `--entry` takes the
    name, commit included. See docs/challenge.md.

    Parameters
    ----------
    seed
        A whole number or a word; none beside `--entry`.
    entry
        Make the seed of these words, such as 'My method, commit 1f2e3d'.
    output
        Folder for the scenes; airlight-challenge by default.

    Raises
    ------
    InputError
        For a seed that is no word, for both or none of seed and entry, and for a folder that holds
        another challenge.
    """
    from airlight.reference.storage.files import ensure_folder
    from airlight.reports.challenge.seed import seed_of_entry, seed_words
    from airlight.reports.machine.environment import activate

    if (seed is None) == (entry is None):
        raise InputError(
            "challenge: expected a seed, such as 7, or --entry with the words that it is made of, "
            "one of both"
        )
    said = "" if entry is None else " ".join(entry.split())
    word = seed_words(seed) if entry is None else seed_of_entry(said)
    folder = ensure_folder(FOLDER if output is None else output)
    activate()
    from airlight.reports.challenge.folder import FILE, read_challenge, write_challenge

    # The scenes of two challenges have the same names.
    if (folder / FILE).is_file() and read_challenge(folder / FILE).seed != word:
        raise InputError(
            f"output: {folder} holds the challenge {read_challenge(folder / FILE).seed}; expected "
            "another folder"
        )
    return ChallengeWritten(folder=folder, challenge=write_challenge(folder, word, said))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ChallengeScore(Result):
    """An entry that was scored."""

    score: "Score"  #: the content of score.json
    files: tuple[str, ...] = ()  #: that were written

    @property
    def number(self) -> float:
        """The geometric mean of the errors of its scenes."""
        return self.score.number

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the number."""
        return self.score.interval

    @property
    def title(self) -> str:
        """The method and its number."""
        return f"{self.score.entry.method}: {self.number:.3g}"

    @property
    def tables(self) -> Sequence[Table]:
        """The scenes: their errors, with the intervals that the reference leaves, and times."""
        from airlight.reports.challenge.record import CANNOT

        columns = (
            *words("scene", "kind"),
            *numbers(error="error", interval="between", how={"digits": 4}),
            *numbers(bias="bias", how={"digits": 2, "sign": True}),
            *numbers(seconds="frame s", how={"digits": 3}),
        )
        # A scene without an image has the reason in place of numbers.
        rows = [
            Row({"scene": each.name, "kind": each.kind, "error": CANNOT}, reason=each.cannot)
            if each.cannot
            else Row(
                {
                    "scene": each.name,
                    "kind": each.kind,
                    "error": each.error,
                    "interval": Interval(*each.interval),
                    "bias": each.bias,
                    "seconds": each.seconds,
                }
            )
            for each in self.score.scenes
        ]
        whole = table(
            f"{self.score.entry.method}, challenge {self.score.entry.seed}", columns, rows
        )
        timed = any(scene.seconds is not None for scene in self.score.scenes)
        return [whole if timed else whole.only(*(each.key for each in columns[:-1]))]

    @property
    def lines(self) -> Sequence[str]:
        """The number, the same by kind, and what to cite."""
        low, high = self.interval
        kinds = ", ".join(
            f"{kind} {of if isinstance(of, str) else f'{of:.3g}'}"
            for kind, of in self.score.kinds_shown.items()
        )
        black = f"{self.score.had} scenes have an image; the others count as black, error 1"
        return [
            f"number: {self.number:.4g}, 95 % interval {low:.4g} to {high:.4g} ({kinds}; smaller "
            f"is better, errors below {self.score.floor:g} count as that)",
            *([black] if self.score.cannot else []),
            f"to cite: {self.score.cite}",
            *(f"wrote {path}" for path in self.files),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of score.json."""
        from airlight.validation.columns import plain

        content: dict[str, Any] = plain(self.score)
        return content


@one_error
def challenge_score(
    entry: File, *, output: Files = (), progress: Progress = None
) -> ChallengeScore:
    """Score an entry: the error of each of its images, and one number with its interval.

    The scenes are drawn again from the seed; changed ones are refused, and so is an entry that
    lacks an image. A scene that the method cannot have is named in entry.toml, under [cannot] as
    NAME = "reason", and counts as a black image, whose error is 1. References come from the cache,
    or take half a minute. The error of a scene is the root mean square of the error of its airlight
    over that of the reference, and the number is the geometric mean over scenes, each counted as
    0.001 at least.

    The same entry has the same score.json on any machine: `-o` writes it.

    Parameters
    ----------
    entry
        A folder with entry.toml, the images NAME.exr, challenge.json unless entry.toml has the
        seed, and perhaps times.json: seconds of a frame by the name of its scene.
    output
        Write the score to a .json file.
    progress
        Called with (fraction done, what); True shows a bar.

    Raises
    ------
    InputError
        For an entry that is not whole, and for scenes that were changed.
    """
    from airlight.reports.machine.environment import activate

    folder, files = Path(entry), output_files(output, ".json")
    if not folder.is_dir():
        raise InputError(
            f"entry: there is no folder {folder}; expected one with entry.toml and the images"
        )
    activate()
    from airlight.reference.storage.files import write_text
    from airlight.reports.challenge.record import score_text
    from airlight.reports.challenge.score import score_entry

    with telling(progress, "the references") as tell:
        score = score_entry(folder, tell)
    for path in files:
        write_text(path, score_text(score))
    return ChallengeScore(score=score, files=tuple(map(str, files)))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ChallengeBoard(Result):
    """Entries side by side."""

    page: Path
    boards: "tuple[BoardTable, ...]"  #: one for each challenge

    @property
    def title(self) -> str:
        """How many entries of how many challenges."""
        entries, count = sum(len(board.rows) for board in self.boards), len(self.boards)
        return f"{entries} entries of {count} challenge{'' if count == 1 else 's'}"

    @property
    def tables(self) -> Sequence[Table]:
        """The entries of each challenge by their numbers."""
        from airlight.reports.challenge.board import board_table

        return [board_table(board) for board in self.boards]

    @property
    def lines(self) -> Sequence[str]:
        """Where the page is."""
        return [f"{self.page}: {self.title}"]

    def to_dict(self) -> dict[str, Any]:
        """Return the entries of each challenge."""
        from airlight.validation.columns import plain

        return {"page": str(self.page), "boards": plain(self.boards)}


@one_error
def challenge_board(folder: File, *, output: File = PAGE) -> ChallengeBoard:
    """Write scored entries as one page: a table for each challenge, the best number first.

    Entries whose intervals overlap are tied. Entries of different challenges share no table. A
    score whose number does not follow from its errors is refused.

    Parameters
    ----------
    folder
        The folder of the scores that `airlight challenge score -o` wrote.
    output
        The page to write, an .html file; board.html by default.

    Raises
    ------
    InputError
        For a folder without scores, and for a score that was changed.
    """
    from airlight.reference.storage.files import write_text
    from airlight.reports.challenge.board import read_board, render_board

    (page,) = output_files([output], ".html")
    boards = read_board(Path(folder))
    write_text(page, render_board(boards, str(folder)))
    return ChallengeBoard(page=page, boards=boards)
