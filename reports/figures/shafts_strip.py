# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 5.8 of Ali 2016 again, in `fence`: R1 to R4, the shared points, the reference, each with its error and time.

`compute` writes an EXR file for each picture, `draw` only reads them.
"""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import Row, read_data, value, write_data
from reports.figures.picture_grid import LAYER, picture_grid, stored_image
from reports.machine.progress import Progress

NAME = "shafts-strip"
SUMMARY = "Fig. 5.8 of Ali 2016 again: 150 or 32 samples, Gaussian, bilateral, shared points, the reference"

_HEADER = ("file", "label", "error", "ms", "exposure")
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
        Smaller images.
    progress
        Callback with the share done and what comes next, or None.
    """
    from realtime.scene.read_scene import read_scene
    from reference.storage.exr import Image, write_exr
    from reports.plotting.pictures import exposure
    from validation.papers.soft_shafts import RENDERINGS, SCENE, VARIANTS, rendered, shafts_reference, timings
    from validation.scenes.loading import load_scene

    target = ensure_folder(folder)
    size = (80, 60) if quick else (200, 152)
    if progress is not None:
        progress(0.0, "the reference")
    reference = shafts_reference(size)
    scene = read_scene(load_scene(SCENE, size).scene)
    chosen = {name: {**RENDERINGS, **VARIANTS}[name] for name in _WORDS}
    times = timings(scene, chosen, 0.05 if quick else 0.6)
    images = {_WORDS[name]: rendered(scene, values) for name, values in chosen.items()}
    milliseconds = [timing.median_ms for timing in times.values()]
    errors = [reference.error(image) for image in images.values()]
    factor, lines = exposure(reference.image), []
    images["reference"] = reference.image
    for number, (label, image) in enumerate(images.items()):
        write_exr(target / f"{NAME}-{number}.exr", Image({LAYER: image}))
        numbers = (errors[number], milliseconds[number]) if number < len(errors) else (None, None)
        lines.append((f"{NAME}-{number}.exr", label, *numbers, factor))
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
