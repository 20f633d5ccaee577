# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 5.8 of Ali 2016 again, in `fence`: R1 to R4, the shared points, the truth, each with its error and time.

`compute` writes an EXR file for each picture, `draw` only reads them.
"""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import Row, read_data, value, write_data
from reports.figures.picture_grid import LAYER, picture_grid, stored_image
from reports.machine.progress import Progress

NAME = "shafts-strip"
SUMMARY = "Fig. 5.8 of Ali 2016 again: 150 or 32 samples, Gaussian, bilateral, shared points, the truth"

_HEADER = ("file", "label", "error", "ms", "exposure")
_SHOWN = ("R1", "R2", "R3", "R4", "shared points")
_WORDS = {
    "R1": "R1: 150 samples",
    "R2": "R2: 32",
    "R3": "R3: 32, Gaussian",
    "R4": "R4: 32, bilateral",
    "shared points": "shared points",
}


def compute(folder: Path | str, *, quick: bool = False, progress: Progress | None = None) -> None:
    """Write `shafts-strip.csv` and an EXR file for each picture into a folder.

    Parameters
    ----------
    folder
        Where the data go.
    quick
        Smaller images, and fewer light points of the truth.
    progress
        Callback with the share done and what comes next, or None.
    """
    from reference.storage.exr import Image, write_exr
    from reports.plotting.pictures import exposure
    from validation.papers.ali import shafts_study

    target = ensure_folder(folder)
    size = (80, 60) if quick else (400, 300)
    study = shafts_study(size, seconds=0.05 if quick else 0.6, points=16 if quick else 64, progress=progress)
    rows = [study.row(name) for name in _SHOWN]
    pictures: list[Any] = [
        (_WORDS[row.name], row.image, row.error, row.timing and row.timing.median_ms) for row in rows
    ]
    pictures.append(("truth", study.truth.image, None, None))
    factor, lines = exposure(study.truth.image), []
    for number, (label, image, error, milliseconds) in enumerate(pictures):
        assert image is not None
        write_exr(target / f"{NAME}-{number}.exr", Image({LAYER: image}))
        lines.append((f"{NAME}-{number}.exr", label, error, milliseconds, factor))
    write_data(target, NAME, _HEADER, lines, size=list(size))


def draw(folder: Path, column: str):
    """Return the figure of the data in a folder."""
    from reports.plotting.pictures import tone_mapped

    def title(row: Row) -> str:
        error = value(row, "error")
        return row["label"] + (f"\nerror {error:.3f}, {value(row, 'ms'):.0f} ms" if error else "")

    def picture(row: Row):
        return tone_mapped(stored_image(folder / row["file"]), value(row, "exposure") or 1.0)

    return picture_grid(((title(row), picture(row)) for row in read_data(folder, NAME)), column)
