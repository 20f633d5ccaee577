# SPDX-License-Identifier: BSD-3-Clause
"""The first rows of the challenge, of the record that `challenge_rows.py` writes."""

import json
import math
from dataclasses import replace
from functools import cache
from statistics import mean, stdev
from typing import Any

from airlight.reports.challenge.board import board_of, board_table
from airlight.reports.challenge.record import Score
from airlight.reports.tables.drawing import markdown
from airlight.validation.columns import record_of
from parts.listed import table
from parts.measured import DATA


@cache
def _record() -> Any:
    return json.loads((DATA / "challenge.json").read_text("utf-8"))


def challenge_rows() -> str:
    """Return the built-in methods that were scored, and those that have no entry."""
    record = _record()
    scores = [record_of(each, Score) for each in record["scores"]]
    (board,) = board_of(scores)
    shown = board_table(board).only(
        "place", "method", "number", "interval", "tied", "random", "certified", "engine"
    )
    built = scores[0].digests
    said = (
        f"The built-in methods with their default settings, seed `{board.seed}`, scenes "
        f"`{board.digest[:12]}`, {record['made']}, airlight {built.airlight}, commit "
        f"{built.commit[:12]}. The seed is public: the rows say what the numbers of known methods "
        "are."
    )
    refused = [
        f"`{each['method']}` has no entry, as it refuses `{each['scene']}`: {each['reason']}."
        for each in {each["method"]: each for each in record["refused"]}.values()
    ]
    return "\n\n".join([said, markdown(replace(shown, title="", explanation="")).strip(), *refused])


def challenge_spread() -> str:
    """Return how far the numbers of a method lie apart over seeds."""
    rows = []
    for method, numbers in _record()["spread"].items():
        logs = [math.log(number) for number in numbers.values()]
        if len(logs) < 2:
            continue
        row = [math.exp(mean(logs)), min(numbers.values()), max(numbers.values()), stdev(logs)]
        rows.append([f"`{method}`", str(len(logs)), *(f"{value:.2g}" for value in row)])
    rows.sort(key=lambda row: float(row[2]))
    if not rows:
        return "Not measured yet: `python docs/tools/challenge_rows.py` measures it."
    head = ("method", "seeds", "geometric mean", "least", "largest", "deviation of the logarithm")
    return table(head, rows)
