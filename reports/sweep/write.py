# SPDX-License-Identifier: BSD-3-Clause
"""The files that say what a sweep says: its page, its figures, its claims and its digest."""

import json
from pathlib import Path

from reference.storage.files import ensure_folder, write_bytes, write_text
from reports.page.chart import svg_text
from reports.sweep.digest import digest
from reports.sweep.figures import drawn, pdf_bytes
from reports.sweep.page import render_sweep
from reports.sweep.read import read_sweep
from reports.sweep.summary import Summary, summary_of, to_json

PAGE, CLAIMS, DIGEST, FIGURES = "sweep.html", "sweep.json", "sweep.md", "figures"  #: in the folder of a sweep


def write_sweep(source: Path, target: Path | None = None) -> tuple[Summary, Path]:
    """Write what a sweep says, from its Parquet alone.

    Parameters
    ----------
    source
        The folder of a sweep, or its Parquet.
    target
        Folder of the files; the one with the Parquet by default.

    Returns
    -------
    tuple
        What the sweep says, and the path of its page.

    Raises
    ------
    InputError
        If there is no such Parquet, it cannot be used, or the folder cannot be written.
    """
    said = summary_of(read_sweep(source))
    folder = ensure_folder(said.sweep.path.parent if target is None else target)
    charts = {}
    for name, figure in drawn(said):
        charts[name] = svg_text(figure, name)
        write_text(folder / FIGURES / f"{name}.svg", charts[name])
        write_bytes(folder / FIGURES / f"{name}.pdf", pdf_bytes(figure))
    write_text(folder / CLAIMS, json.dumps(to_json(said), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(folder / DIGEST, digest(said))
    write_text(folder / PAGE, render_sweep(said, charts))
    return said, folder / PAGE
