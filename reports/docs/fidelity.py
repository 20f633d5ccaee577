# SPDX-License-Identifier: BSD-3-Clause
"""The page of verdicts on the claims of papers, from a run of `airlight fidelity`.

`docs/data/fidelity.json` holds what `airlight fidelity --json` printed, or several runs of it for one paper each;
`docs/fidelity.md` is made from it. Tests fail
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
from reports.docs.marked import with_part

ROOT = Path(__file__).resolve().parents[2]
RECORD = "docs/data/fidelity.json"
_PAGE = "docs/fidelity.md"


def page(text: str, record: Mapping[str, Any]) -> str:
    """Return the page with its generated part made anew.

    Parameters
    ----------
    text
        The page as it stands; what lies outside the marked part is kept.
    record
        What `airlight fidelity --json` printed.
    """
    return with_part(text, "verdicts", _verdicts(record))


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


def joined(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return several runs as one: of each paper the rows of the last run that has it, in the order of the catalogue.

    Raises
    ------
    InputError
        If the runs were made on different machines.
    """
    from validation.fidelity.catalogue import PAPERS

    machines = {
        json.dumps([record["environment"].get(name) for name in ("processor", "threads", "variant")])
        for record in records
    }
    if len(machines) > 1:
        raise InputError("the runs were made on different machines; wanted runs of one")
    of_paper = {
        paper: [row for row in record["fidelity"] if row["paper"] == paper]
        for record in records
        for paper in _papers(record)
    }
    rows = [row for paper in PAPERS for row in of_paper.get(paper, ())]
    return {**records[-1], "measured": min(record["measured"] for record in records), "fidelity": rows}


def _papers(record: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(row["paper"] for row in record["fidelity"]))


def redraw(root: Path = ROOT, runs: Sequence[Path] = ()) -> Path:
    """Write `docs/fidelity.md` anew, with the rows of new runs if some are given, and return its path."""
    from reference.storage.files import write_text

    if runs:
        record = joined([read_record(path) for path in runs])
        write_text(root / RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    write_text(root / _PAGE, current_page(root))
    return root / _PAGE


if __name__ == "__main__":
    print(redraw(runs=[Path(name) for name in sys.argv[1:]]))
