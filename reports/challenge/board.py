# SPDX-License-Identifier: BSD-3-Clause
"""Scored entries side by side: a table for each challenge, with ties, and the page.

Entries of other scenes are no rows of one table: their numbers differ by what was drawn too, which
only their intervals allow for.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reports.challenge.record import CANNOT, SCHEMA, Score, read_score
from airlight.reports.challenge.seed import KINDS
from airlight.reports.data.records import read_json
from airlight.reports.page.filters import drawn
from airlight.reports.page.render import page_environment, template_text
from airlight.reports.tables.table import Column, Interval, Row, Table, Value, numbers, words
from airlight.reports.tables.table import table as table_of_rows

EXPLANATION = (
    "The error of a scene is the root mean square of the error of its airlight over that of the "
    "reference. The number is the geometric mean over the scenes, each counted as 0.001 at least; "
    "smaller is better. A scene that a method cannot have counts as a black image, whose error is "
    "1. The interval is what other scenes drawn "
    "alike would give, with 95 % confidence. Entries whose intervals overlap are tied: their order "
    "says nothing."
)


@dataclass(frozen=True)
class BoardRow:
    """An entry in its table."""

    score: Score
    place: int  #: one more than the entries of the table that are certainly better
    tied: tuple[str, ...]  #: methods whose intervals overlap with its own


@dataclass(frozen=True)
class BoardTable:
    """The entries of one challenge."""

    seed: str
    entry: str  #: the words that the seed was made of; empty where it was given
    digest: str  #: of the scenes
    rows: tuple[BoardRow, ...]  #: by their numbers


def read_board(folder: Path) -> tuple[BoardTable, ...]:
    """Read all scores of a folder and of the folders in it, a table for each challenge.

    Raises InputError where there are none, and for a score that was changed, and for a JSON file
    that cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"board: there is no folder {folder}; expected one with files score.json")
    # Other files of a challenge may lie beside the scores.
    scores = [read_score(file) for file in sorted(folder.rglob("*.json")) if _is_score(file)]
    if not scores:
        raise InputError(
            f"board: {folder} holds no score; expected files that `airlight challenge score ENTRY "
            "-o NAME.json` wrote"
        )
    return board_of(scores)


def _is_score(file: Path) -> bool:
    """Return whether a file says that it is a score; `read_score` finds what is wrong with it."""
    found = read_json(file, "a score of `airlight challenge score -o`")
    schema = found.get("schema") if isinstance(found, dict) else None
    return str(schema).startswith(SCHEMA.partition("/")[0])


def board_of(scores: Sequence[Score]) -> tuple[BoardTable, ...]:
    """Return a table for each challenge, the one with most entries first."""
    groups: dict[str, list[Score]] = {}
    for score in scores:
        groups.setdefault(score.digests.scenes, []).append(score)
    ordered = sorted(groups.items(), key=lambda each: (-len(each[1]), each[0]))
    return tuple(_table(digest, group) for digest, group in ordered)


def _table(digest: str, scores: Sequence[Score]) -> BoardTable:
    ranked = sorted(scores, key=lambda each: (each.number, each.entry.method))
    rows = []
    for score in ranked:
        low, high = score.interval
        better = sum(each.interval[1] < low for each in ranked)
        tied = tuple(
            each.entry.method
            for each in ranked
            if each is not score and each.interval[0] <= high and low <= each.interval[1]
        )
        rows.append(BoardRow(score, better + 1, tied))
    first = ranked[0].entry
    return BoardTable(first.seed, first.entry, digest, tuple(rows))


def board_table(board: BoardTable) -> Table:
    """Return the entries of a challenge by their numbers."""
    columns = (
        *numbers(place="place"),
        *words(method="method"),
        *numbers(number="number", interval="95 % interval", how={"digits": 3}),
        *words(tied="tied with"),
        *words(had="scenes"),
        *numbers(*KINDS, how={"digits": 2}),
        Column("seconds", "frame", "s", digits=3),
        *words(machine="machine"),
    )

    def row(each: BoardRow) -> Row:
        score = each.score
        seconds = [scene.seconds for scene in score.scenes if scene.seconds is not None]
        values: dict[str, Value] = {
            "place": each.place,
            "method": score.entry.method,
            "number": score.number,
            "interval": Interval(*score.interval),
            "tied": ", ".join(each.tied) or None,
            "had": score.had,
            "seconds": median(seconds) if seconds else None,
            "machine": score.entry.machine or None,
        }
        return Row(values | score.kinds_shown)

    return table_of_rows(
        f"Challenge {board.seed}", columns, map(row, board.rows), explanation=EXPLANATION
    )


def scenes_table(board: BoardTable) -> Table:
    """Return the error of each entry in each scene."""
    columns = (
        *words("scene"),
        *(
            Column(f"entry-{at}", row.score.entry.method, percent=True)
            for at, row in enumerate(board.rows)
        ),
    )
    errors: list[dict[str, Value]] = [
        {each.name: CANNOT if each.cannot else each.error for each in row.score.scenes}
        for row in board.rows
    ]
    rows = [
        Row({"scene": name} | {f"entry-{at}": each.get(name) for at, each in enumerate(errors)})
        for name in errors[0]
    ]
    return table_of_rows(f"Errors in the scenes of {board.seed}", columns, rows)


def render_board(boards: Sequence[BoardTable], source: str) -> str:
    """Return the HTML page of tables; `source` names the folder of the scores."""
    environment = page_environment()
    environment.globals |= {"board_table": drawn(board_table), "scenes_table": drawn(scenes_table)}
    return environment.get_template("challenge.html.j2").render(
        boards=boards,
        source=source,
        version=build().words,
        css=template_text("report.css"),
    )
