# SPDX-License-Identifier: BSD-3-Clause
"""Figs 11 and 12 of Bouthors 2008 again: clouds by collectors above the same by light paths.

`compute` writes an EXR file for each picture, `draw` only reads them.
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import Row, read_data, value, write_data
from reports.figures.picture_grid import LAYER, picture_grid, stored_image
from reports.machine.progress import Progress, part_of

NAME = "cloud-images"
SUMMARY = "Figs 11 and 12 of Bouthors 2008 in our scenes: clouds by collectors above the truth"

_HEADER = ("file", "figure", "way", "exposure")


def compute(folder: Path | str, *, quick: bool = False, progress: Progress | None = None) -> None:
    """Write `cloud-images.csv` and an EXR file for each picture into a folder.

    Parameters
    ----------
    folder
        Where the data go.
    quick
        Small images of few light paths.
    progress
        Called with (share done, what).
    """
    from reference.storage.exr import Image, write_exr
    from reports.plotting.pictures import exposure
    from validation.papers.clouds import GAP, LOBES, RESULTS, SAMPLES, SIZE, pair_of, shown

    target = ensure_folder(folder)
    size, samples = ((24, 18), 16) if quick else (SIZE, SAMPLES)
    scenes = {name: "Fig. 12" for name in RESULTS} | {GAP: "Fig. 11a", LOBES: "Fig. 11b"}
    rows: list[tuple[str, str, str, float]] = []
    for number, (name, figure) in enumerate(scenes.items()):
        part = part_of(progress, number / len(scenes), (number + 1) / len(scenes), before=f"{name}, ")
        pair = pair_of(shown(name, size), samples, part)
        factor = exposure(pair.image)
        for way, image in (("collectors", pair.image), ("light paths", pair.reference)):
            file = f"{NAME}-{name}-{way.replace(' ', '-')}.exr"
            write_exr(target / file, Image({LAYER: image}))
            rows.append((file, f"{figure}, {name}", way, factor))
    # The first row of the grid has the method, the second the truth.
    write_data(target, NAME, _HEADER, rows[::2] + rows[1::2], size=list(size), samples=samples)


def draw(folder: Path, column: str):
    """Return the figure of the data in a folder."""
    from reports.plotting.pictures import tone_mapped

    def picture(row: Row):
        return tone_mapped(stored_image(folder / row["file"]), value(row, "exposure") or 1.0)

    rows = read_data(folder, NAME)
    return picture_grid(((f"{row['figure']}\n{row['way']}", picture(row)) for row in rows), column, across=4)
