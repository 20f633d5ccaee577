# SPDX-License-Identifier: BSD-3-Clause
"""The page of verdicts on the claims of papers, from a run of `airlight fidelity`.

`docs/data/fidelity.json` holds what `airlight fidelity --json` printed; `docs/fidelity.md` is made from it. Tests fail
where the page is not what `python -m reports.docs.fidelity` makes it, and where the rows of the run are not those of
`validation.fidelity.catalogue`.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reports.data.json_files import read_json

ROOT = Path(__file__).resolve().parents[2]
RECORD = "docs/data/fidelity.json"
_PAGE = "docs/fidelity.md"
_BEGIN, _END = "<!-- verdicts: begin -->\n", "<!-- verdicts: end -->"


def page(text: str, record: Mapping[str, Any]) -> str:
    """Return the page with its generated part made anew.

    Parameters
    ----------
    text
        The page as it stands; what lies outside the marked part is kept.
    record
        What `airlight fidelity --json` printed.
    """
    before, rest = text.split(_BEGIN)
    return f"{before}{_BEGIN}{_verdicts(record)}{_END}{rest.split(_END)[1]}"


def _verdicts(record: Mapping[str, Any]) -> str:
    from reports.machine.environment import machine_in_words
    from reports.papers.fidelity import count_words, fidelity_tables
    from reports.tables.drawing import markdown

    rows = record["fidelity"]
    parts = [f"*{record['measured'][:10]}, {machine_in_words(dict(record['environment']))}; {count_words(rows)}.*"]
    for table in fidelity_tables(rows):
        parts += [f"## {table.title}", table.explanation, _without_title(markdown(table))]
    return "\n\n".join(["", *parts, ""]).lstrip("\n")


def _without_title(text: str) -> str:
    """Return the lines of a table in Markdown from its head on."""
    return text[text.index("| ") :].rstrip()


def stale_rows(record: Mapping[str, Any]) -> list[str]:
    """Return in what the rows of a run differ from those that are measured now, a line each."""
    from validation.fidelity.catalogue import ROWS, published_figures

    figures = {(one["paper"], one["item"]): one["value"] for one in published_figures(ROWS)}
    now = {(row.paper, row.item): (row.claim, row.unit, figures.get((row.paper, row.item))) for row in ROWS}
    then = {(row["paper"], row["item"]): (row["claim"], row["unit"], row["published"]) for row in record["fidelity"]}
    stale = [f"{paper}, {item}: not in the run" for paper, item in now if (paper, item) not in then]
    stale += [f"{paper}, {item}: no such row any more" for paper, item in then if (paper, item) not in now]
    return stale + [f"{key[0]}, {key[1]}: is not what it was" for key in now if key in then and now[key] != then[key]]


def read_record(path: Path) -> dict[str, Any]:
    """Return what `airlight fidelity --json` printed.

    Raises
    ------
    InputError
        If the file is something else.
    """
    record = read_json(path, "what `airlight fidelity --json` prints")
    if not isinstance(record, dict) or not {"fidelity", "environment", "measured"} <= set(record):
        raise InputError(f"{path}: wanted what `airlight fidelity --json` prints")
    return record


def current_page(root: Path = ROOT) -> str:
    """Return what `docs/fidelity.md` should hold."""
    return page((root / _PAGE).read_text(encoding="utf-8"), read_record(root / RECORD))


def redraw(root: Path = ROOT, measured: Path | None = None) -> Path:
    """Write `docs/fidelity.md` anew, from a new run if one is given, and return its path."""
    from reference.storage.files import write_text

    if measured is not None:
        record: Sequence[Any] | dict[str, Any] = read_record(measured)
        write_text(root / RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    write_text(root / _PAGE, current_page(root))
    return root / _PAGE


if __name__ == "__main__":
    print(redraw(measured=Path(sys.argv[1]) if len(sys.argv) > 1 else None))
