# SPDX-License-Identifier: BSD-3-Clause
"""The table of planted faults in `docs/diagnosis.md`, from runs of `airlight bench --diagnosis`.

`docs/data/diagnosis.json` holds what `airlight bench --diagnosis --json` printed, or several runs of it for some scenes
each: `python -m reports.docs.diagnosis RUN.json..` joins them and makes the page anew. Scenes that are not built in are
those kept aside (`tests/helpers/aside.py`), and counted apart.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from reports.data.json_files import read_json
from reports.docs.marked import with_part

ROOT = Path(__file__).resolve().parents[2]
RECORD = "docs/data/diagnosis.json"
_PAGE = "docs/diagnosis.md"


def page(text: str, record: Mapping[str, Any]) -> str:
    """Return the page with its table made anew; `record` is what the command printed."""
    return with_part(text, "answers", _answers(record))


def _answers(record: Mapping[str, Any]) -> str:
    from reports.machine.environment import machine_in_words
    from reports.tables.diagnosis import answers_sentence, answers_table
    from reports.tables.drawing import markdown
    from validation.scenes.registry import FOG_SCENES

    rows = record["diagnosis"]
    machine, size = machine_in_words(dict(record["environment"])), " x ".join(map(str, record["size"]))
    parts = [f"*{record['measured'][:10]}, {machine}; images of {size} pixels.*"]
    for title, aside in (("built in", False), ("kept aside", True)):
        own = [row for row in rows if (row["scene"] not in FOG_SCENES) == aside]
        if own:
            names = ", ".join(f"`{name}`" for name in dict.fromkeys(row["scene"] for row in own))
            drawn = markdown(answers_table(own))
            parts += [f"Scenes {title}: {names}. {answers_sentence(own)}", drawn[drawn.index("| ") :].rstrip()]
    missing = [f"`{name}`" for name in FOG_SCENES if all(row["scene"] != name for row in rows)]
    if missing:
        parts.append(f"Not run: {', '.join(missing)}.")
    return "\n\n".join([*parts, ""])


def current_page(root: Path = ROOT) -> str:
    """Return what `docs/diagnosis.md` should hold."""
    record = read_json(root / RECORD, "what `airlight bench --diagnosis --json` prints")
    return page((root / _PAGE).read_text(encoding="utf-8"), record)


def redraw(root: Path = ROOT, runs: Sequence[Path] = ()) -> Path:
    """Write `docs/diagnosis.md` anew, with the rows of new runs if some are given, and return its path."""
    from reference.storage.files import write_text

    if runs:
        records = [read_json(path, "what `airlight bench --diagnosis --json` prints") for path in runs]
        record = {**records[0], "diagnosis": [row for each in records for row in each["diagnosis"]]}
        write_text(root / RECORD, json.dumps(record, indent=1) + "\n")
    write_text(root / _PAGE, current_page(root))
    return root / _PAGE


if __name__ == "__main__":
    print(redraw(runs=[Path(name) for name in sys.argv[1:]]))
