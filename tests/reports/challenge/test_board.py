# SPDX-License-Identifier: BSD-3-Clause
"""Boards: the best first, ties said, other challenges apart, and changed scores refused."""

import json
from dataclasses import replace

import pytest

from airlight.errors import InputError
from airlight.reports.challenge.board import board_of, board_table, read_board
from airlight.reports.challenge.number import FLOOR
from airlight.reports.challenge.record import (
    SCHEMA,
    Digests,
    Entry,
    SceneScore,
    Score,
    combined_score,
    score_text,
)
from airlight.reports.challenge.seed import KINDS
from airlight.reports.commands.main import run


def score(method, error, digest="ab" * 32, spread=1.3):
    """Return a score whose eight errors of each kind lie about an error."""
    scenes = tuple(
        SceneScore(
            name=f"{kind}-{at + 1}",
            kind=kind,
            error=float(f"{error * spread ** (at - 3.5):.4g}"),
            interval=(float(f"{error * spread ** (at - 3.5):.4g}"),) * 2,
            bias=0.0,
            pixels=100,
            seconds=0.5 + at,
        )
        for kind in KINDS
        for at in range(8)
    )
    whole, kinds = combined_score(scenes, digest)
    return Score(
        schema=SCHEMA,
        entry=Entry(method=method, seed="7"),
        number=whole.number,
        interval=(whole.low, whole.high),
        kinds=kinds,
        floor=FLOOR,
        scenes=scenes,
        digests=Digests(
            scenes=digest, images="cd" * 32, airlight="1.0", commit="ef" * 20, program="12" * 32
        ),
    )


def test_the_best_comes_first_and_overlapping_intervals_are_ties():
    (board,) = board_of([score("worst", 0.9), score("good", 0.1), score("close", 0.11)])
    assert [row.score.entry.method for row in board.rows] == ["good", "close", "worst"]
    assert [row.place for row in board.rows] == [1, 1, 3]
    assert [row.tied for row in board.rows] == [("close",), ("good",), ()]
    rows = board_table(board).rows
    assert rows[0].values["tied"] == "close"
    assert rows[0].values["seconds"] == 4.0


def test_entries_of_other_challenges_share_no_table():
    boards = board_of([score("a", 0.1), score("b", 0.2, digest="99" * 32), score("c", 0.3)])
    assert [[row.score.entry.method for row in board.rows] for board in boards] == [
        ["a", "c"],
        ["b"],
    ]


@pytest.mark.parametrize("field", ["number", "interval", "error", "kinds"])
def test_a_score_whose_number_does_not_follow_is_refused(tmp_path, field):
    data = json.loads(score_text(score("a", 0.1)))
    if field == "error":
        data["scenes"][3]["error"] *= 0.5
    elif field == "kinds":
        data["kinds"]["engine"] *= 0.5
    else:
        data[field] = 0.05 if field == "number" else [0.01, 0.02]
    (tmp_path / "a.json").write_text(json.dumps(data, indent=1))
    with pytest.raises(InputError, match="a score as it was written"):
        read_board(tmp_path)


def test_a_page_has_every_entry_and_loads_nothing(tmp_path, capsys):
    for each in (score("one <b>", 0.1), score("two", 0.4), score("three", 0.2, digest="99" * 32)):
        (tmp_path / f"{each.entry.method[:3]}.json").write_text(score_text(each))
    (tmp_path / "other.json").write_text('{"schema": "another"}')
    page = tmp_path / "page" / "board.html"
    assert run(["challenge", "board", str(tmp_path), "-o", str(page)]) == 0
    text = page.read_text()
    assert "one &lt;b&gt;" in text
    assert "<b>" not in text
    assert text.count('<section aria-labelledby="c-') == 2
    assert "share no table" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    assert run(["challenge", "board", str(tmp_path), "-o", str(page), "--json"]) == 0
    boards = json.loads("{" + capsys.readouterr().out.partition("\n{")[2])["result"]["boards"]
    assert [len(board["rows"]) for board in boards] == [2, 1]


def test_what_is_no_board_is_said(tmp_path, capsys):
    assert run(["challenge", "board", str(tmp_path)]) == 2
    assert "holds no score" in capsys.readouterr().err
    assert run(["challenge", "board", str(tmp_path / "none")]) == 2
    assert run(["challenge", "board", str(tmp_path), "-o", str(tmp_path / "x.pdf")]) == 2
    broken = replace(score("a", 0.1), schema="airlight-challenge-score/0")
    (tmp_path / "a.json").write_text(score_text(broken))
    assert run(["challenge", "board", str(tmp_path)]) == 2
    assert "of this version" in capsys.readouterr().err
