# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of Biri 2006 and Billeter 2010 again, in our scenes: a triptych, two lamps, two tessellations.

`compute` writes an EXR file for each picture, `draw` only reads them. Tessellations are drawn by the side of the quads.
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import Row, read_data, value, write_data
from reports.figures.picture_grid import LAYER, picture_grid, stored_image

NAME = "paper-images"
SUMMARY = "the pictures of both papers in our scenes: three ways to light a hall, two lamps, tessellations"

_HEADER = ("file", "paper", "label", "kind", "exposure")


def compute(folder: Path | str, *, quick: bool = False) -> None:
    """Write `paper-images.csv` and an EXR file for each picture into a folder.

    Parameters
    ----------
    folder
        Where the data go.
    quick
        Smaller images and maps.
    """
    import numpy as np

    from reference.storage.exr import Image, write_exr
    from reports.plotting.pictures import exposure
    from validation.papers.pictures import tessellations, triptych, two_lights_image

    target = ensure_folder(folder)
    size = (80, 60) if quick else (400, 300)
    panels = [("Biri 2006, Fig. 1", label, "light", image) for label, image in triptych(size).items()]
    panels.append(("Billeter 2010, Fig. 1", "two lamps", "light", two_lights_image(size)))
    for name, side in tessellations(64 if quick else 256).items():
        label = "quads by our filter" if name == "ours" else "by the plain Laplacian"
        panels.append(("Billeter 2010, Fig. 8b", label, "side", np.repeat(side[:, :, None], 3, axis=2)))
    rows = []
    for number, (paper, label, kind, image) in enumerate(panels):
        write_exr(target / f"{NAME}-{number}.exr", Image({LAYER: image}))
        factor = exposure(panels[2][3] if number < 3 else image) if kind == "light" else 1.0
        rows.append((f"{NAME}-{number}.exr", paper, label, kind, factor))
    write_data(target, NAME, _HEADER, rows, size=list(size))


def draw(folder: Path, column: str):
    """Return the figure of the data in a folder."""
    import numpy as np

    from reports.plotting.pictures import tone_mapped

    def picture(row: Row):
        image = stored_image(folder / row["file"])
        if row["kind"] == "light":
            return tone_mapped(image, value(row, "exposure") or 1.0)
        return np.log2(image[::-1, :, 0])

    rows = read_data(folder, NAME)
    return picture_grid(((f"{row['paper']}\n{row['label']}", picture(row)) for row in rows), column)
