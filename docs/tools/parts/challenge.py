# SPDX-License-Identifier: BSD-3-Clause
"""The first rows of the challenge, of the record that `challenge_rows.py` writes."""

import json
import math
from collections.abc import Sequence
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
    """Return the methods and engines that were scored, and which scenes they cannot have."""
    rows = _record()["rows"]
    scores = [record_of(each["score"], Score) for each in rows]
    (board,) = board_of(scores)
    shown = board_table(board).only(
        "place", "method", "number", "interval", "tied", "had", "random", "certified", "engine"
    )
    # Rows may be of several days and commits: the page says which are in it.
    made = {f"{each['made']}, `python docs/tools/{each['command']}`" for each in rows}
    commits = sorted({each.digests.commit[:12] for each in scores})
    versions = sorted({each.digests.airlight for each in scores})
    own = [
        f"{each.entry.method} with {each.entry.settings}"
        for each in scores
        if not each.entry.settings.startswith("default")
    ]
    said = (
        "The built-in methods with their default settings, and engines with the defaults of [their "
        f"adapters](adapters/README.md){', '.join(['', *own])}. Seed `{board.seed}`, scenes "
        f"`{board.digest[:12]}`; {'; '.join(sorted(made))}; airlight {', '.join(versions)}, commit "
        f"{', '.join(commits)}. The seed is public: the rows say what the numbers of known methods "
        "are."
    )
    cannot = [
        f"- {each.entry.method}, {_listed(names)}: {reason}"
        for each in scores
        for reason, names in each.cannot.items()
    ]
    # An engine without any scene has no entry.
    for name, reasons in _record()["none"].items():
        for reason in dict.fromkeys(reasons.values()):
            names = [scene for scene, each in reasons.items() if each == reason]
            cannot.append(f"- `{name}`, which has no entry, {_listed(names)}: {reason}")
    parts = [said, markdown(replace(shown, title="", explanation="")).strip()]
    if cannot:
        parts += ["Scenes that they cannot have, in their words:", "\n".join(cannot)]
    return "\n\n".join(parts)


def _listed(names: Sequence[str]) -> str:
    """Return names of scenes, those of a kind together: `engine-1, -2, -5`."""
    kinds: dict[str, list[str]] = {}
    for name in names:
        kind, _, number = name.rpartition("-")
        kinds.setdefault(kind, []).append(f"-{number}")
    return ", ".join(f"{kind}{', '.join(numbers)}" for kind, numbers in kinds.items())


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
