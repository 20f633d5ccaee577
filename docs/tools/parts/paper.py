# SPDX-License-Identifier: BSD-3-Clause
"""The figures of the paper, each with a digest of its inputs, and its record in numbers."""

import json
from typing import Any

from airlight.reports.engines.record import FILE, read_engines
from airlight.validation.certified.files import FILES, certified_data
from parts.measured import DATA, cycles

_CAPTIONS = {
    "speed": (
        "Time of a frame against error of the airlight, built-in methods in the scene `colonnade`. "
        "`airlight report colonnade --quick`"
    ),
    "engines": (
        "A scene by the reference and by engines: how far each is off physics, and its error "
        "against its own equation. `airlight report --engines all`, from kept captures"
    ),
}


def paper_figure(name: str) -> str:
    """Return a figure of the paper, with its caption and the digest of its inputs."""
    record = json.loads((DATA / "paper-figures.json").read_text("utf-8"))
    said = f"{_CAPTIONS[name]}; inputs `{record['inputs'][name]}`, airlight {record['airlight']}."
    return f"![{said} \\label{{fig:{name}}}]({name}.png)"


def paper_record() -> str:
    """Return the counts of what the program was checked by, and of what it found."""
    engines = read_engines(DATA / "captures" / FILE)
    judged = [cell for cell in engines.cells if cell.layers]
    right = sum(cell.layers[0].right for cell in judged)
    changes: dict[str, Any] = json.loads((DATA / "changed-shaders.json").read_text("utf-8"))
    faults = [row for row in changes["changes"] if row["injected"] not in ("right", "unexplained")]
    rows = sum(_rows(name) for name in FILES if name.endswith(".csv"))
    named = sum(row["right"] for row in faults)
    return (
        f"Certified rays: {rows}, in {len(FILES)} files with scenes and area lights. Engines of "
        f"others: {len(engines.engines)}, with {len(judged)} images; the airlight of {right} is "
        f"right by the engine's own equation. Changes of a real shader that the diagnosis named "
        f"first: {named} of {len(faults)}. Faults set in Blender's Cycles: {_cycles()}"
    )


def _cycles() -> str:
    """Return how many faults were named first, and how many right images were called right."""
    return cycles().partition(" (")[0].replace("; ", ", and ") + "."


def _rows(name: str) -> int:
    """Return the rows of a certified table: lines that are neither head nor comment."""
    lines = certified_data(name).read_text("utf-8").splitlines()
    return sum(bool(line) and not line.startswith("#") for line in lines) - 1
