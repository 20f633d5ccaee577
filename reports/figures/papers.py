# SPDX-License-Identifier: BSD-3-Clause
"""The pictures and curves of the papers again, in our scenes: for `airlight
paper NAME --pictures DIR`.

Each figure is PDF and PNG, with its data as EXR files or CSV beside it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from airlight.reference.storage.exr import Image, write_exr
from airlight.reference.storage.files import ensure_folder, write_text
from airlight.reports.machine.environment import stamped
from airlight.reports.machine.progress import Progress, sharing
from airlight.reports.plotting.figure import ENDINGS, new_figure, picture_grid, save_figure
from airlight.reports.plotting.pictures import exposure, tone_mapped
from airlight.reports.plotting.style import COLOURS, WIDTHS
from airlight.reports.tables.drawing import csv
from airlight.reports.tables.table import Column, table


@dataclass(frozen=True)
class PaperFigure:
    """A figure and its data."""

    draw: Callable[[str], Any]  #: returns it for a column
    images: Mapping[str, Any] = field(default_factory=dict)  #: radiance by the name of its file
    rows: Sequence[Mapping[str, Any]] = ()


def write_figures(
    folder: Path, paper: str | None, *, quick: bool, progress: Progress
) -> tuple[str, ...]:
    """Draw the figures of a paper, or of all, into a folder, `quick` ones smaller;
    return the names of the files.
    """
    target = ensure_folder(folder)
    # A figure may belong to two papers.
    chosen = {name: make for name, (of, make) in _FIGURES.items() if paper is None or paper in of}
    written: list[Path] = []
    steps = sharing(progress, [(f"{name}, ", 1.0) for name in chosen])
    # Each figure is drawn once per file format; its images and curves lie beside it, so that a
    # reader can draw it differently.
    for (name, make), step in zip(chosen.items(), steps):
        figure = make(quick, step)
        written += [save_figure(target / f"{name}{ending}", figure.draw) for ending in ENDINGS]
        for file, radiance in figure.images.items():
            written.append(target / f"{name}-{file}.exr")
            write_exr(written[-1], stamped(Image({"total": radiance})))
        if figure.rows:
            written.append(target / f"{name}.csv")
            write_text(
                written[-1],
                csv(table("", [Column(key, key) for key in figure.rows[0]], figure.rows)),
            )
    return tuple(map(str, written))


def _grid(pictures: Sequence[tuple[str, Any]], across: int = 3) -> Callable[[str], Any]:
    return lambda column: picture_grid(pictures, column, across=across)


def _pictures(quick: bool, progress: Progress) -> PaperFigure:
    """Return the pictures of Biri 2006 and Billeter 2010: a triptych, two
    lights, two tessellations.
    """
    from airlight.validation.papers.pictures import tessellations, triptych, two_lights_image

    # Sizes of `quick` only show that the code runs.
    size = (80, 60) if quick else (400, 300)
    lit = triptych(size)
    # One exposure for the triptych, from its third image: brightness is to be compared across the
    # three.
    shared = exposure(list(lit.values())[2])
    shown = [
        (f"Biri 2006, Fig. 1\n{label}", tone_mapped(image, shared)) for label, image in lit.items()
    ]
    images = {f"triptych-{at}": image for at, image in enumerate(lit.values())}
    images["two-lights"] = two = two_lights_image(size)
    shown.append(("Billeter 2010, Fig. 1\ntwo lights", tone_mapped(two, exposure(two))))
    for name, side in tessellations(64 if quick else 256).items():
        label = "quads by our filter" if name == "ours" else "by the plain Laplacian"
        # The sides of the quads, as an EXR file of three equal channels; the picture has their
        # logarithm.
        images[f"side-{name}"] = np.repeat(side[:, :, None], 3, axis=2)
        # by the side of the quads
        shown.append((f"Billeter 2010, Fig. 8b\n{label}", np.log2(side[::-1])))
    return PaperFigure(_grid(shown), images)


_SHAFTS = {
    "R1": "R1: 150 samples",
    "R2": "R2: 32",
    "R3": "R3: 32, Gaussian",
    "R4": "R4: 32, bilateral",
    "shared points": "shared points",
}


def _shafts(quick: bool, progress: Progress) -> PaperFigure:
    """Return Fig. 5.8 of Ali 2016 in `fence`: R1 to R4, the shared points, the
    reference, with errors and times.
    """
    from airlight.validation.papers.soft_shafts import (
        RENDERINGS,
        VARIANTS,
        rendered,
        shafts_scene,
        timings,
    )

    size = (80, 60) if quick else (200, 152)
    progress(0.0, "the reference")
    # The five renderings of one scene in one exposure, timed one after the other.
    scene, reference = shafts_scene(size)
    chosen = {name: {**RENDERINGS, **VARIANTS}[name] for name in _SHAFTS}
    times = timings(scene, chosen, 0.05 if quick else 0.6)
    factor, shown, rows = exposure(reference.image), [], []
    images: dict[str, Any] = {}
    for (name, values), time in zip(chosen.items(), times.values()):
        image = rendered(scene, values)
        images[name.replace(" ", "-")] = image
        error = reference.error(image)
        rows.append({"label": _SHAFTS[name], "error": error, "ms": time.median_ms})
        title = f"{_SHAFTS[name]}\nerror {error:.3f}, {time.median_ms:.0f} ms"
        shown.append((title, tone_mapped(image, factor)))
    images["reference"] = reference.image
    shown.append(("reference", tone_mapped(reference.image, factor)))
    return PaperFigure(_grid(shown), images, rows)


def _cloud_images(quick: bool, progress: Progress) -> PaperFigure:
    """Return Figs 11 and 12 of Bouthors 2008: clouds by collectors above
    the same by light paths.
    """
    from airlight.validation.papers.clouds import GAP, LOBES, RESULTS, SAMPLES, SIZE, pair_of, shown

    # The sizes and samples of the verdicts, so that figure and claim are of the same images and the
    # cache serves both.
    size, samples = ((24, 18), 16) if quick else (SIZE, SAMPLES)
    scenes = {name: "Fig. 12" for name in RESULTS} | {GAP: "Fig. 11a", LOBES: "Fig. 11b"}
    above, below = [], []
    images: dict[str, Any] = {}
    steps = sharing(progress, [(f"{name}, ", 1.0) for name in scenes])
    for (name, figure), step in zip(scenes.items(), steps):
        collectors, paths, _ = pair_of(shown(name, size), samples, step)
        # The light paths are toned like the collectors above them.
        factor = exposure(collectors)
        images |= {f"{name}-collectors": collectors, f"{name}-light-paths": paths}
        above.append((f"{figure}, {name}\ncollectors", tone_mapped(collectors, factor)))
        below.append((f"{figure}, {name}\nlight paths", tone_mapped(paths, factor)))
    return PaperFigure(_grid([*above, *below], across=4), images)


_ORDERS = ("2", "5-6", "13-18", "31-inf")  # that are drawn
_WAYS = {
    "exact": ("-", "blue", "computed"),
    "grid": (":", "green", "grid of frames"),
    "fit": ("--", "vermillion", "fitted functions"),
}


def _cloud_transport(quick: bool, progress: Progress) -> PaperFigure:
    """Return Fig. 8 of Bouthors 2008: the light that leaves a point of a slab by its
    direction, in three ways.
    """
    from airlight.validation.papers.slab import transport_curves

    curves = transport_curves()

    def draw(column: str) -> Any:
        # A panel for each place in the slab, in it a curve for each order and each way.
        places = list(dict.fromkeys((curve.thickness, curve.depth) for curve in curves))
        width, across = WIDTHS[column], 2 if column == "double" else 1
        down = -(-len(places) // across)
        figure = new_figure(width, 0.6 * down * width / across)
        panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
        for panel, place in zip(panels, places):
            for at, orders in enumerate(_ORDERS):
                (curve,) = (
                    c for c in curves if (c.thickness, c.depth, c.orders) == (*place, orders)
                )
                for way, (style, colour, label) in _WAYS.items():
                    values = getattr(curve, way)
                    # A logarithmic axis has no zero: directions without light leave a gap.
                    shown = np.where((curve.exact > 0) & (values > 0), values, np.nan)
                    panel.plot(
                        curve.angle,
                        shown,
                        style,
                        color=COLOURS[colour],
                        label=None if at else label,
                    )
            title = f"{place[0]:g} m thick, {place[1]:g} m deep, orders {', '.join(_ORDERS)}"
            panel.set_title(title, fontsize=6)
            panel.set(yscale="log", xlabel="zenith angle of the view [degrees]", ylabel="T [1/sr]")
        panels[0].legend()
        # The last row may have empty panels.
        for panel in panels[len(places) :]:
            panel.set_axis_off()
        return figure

    names = ("thickness", "depth", "orders", "angle", *_WAYS)
    # The CSV file has a row for each angle, beyond the orders that are drawn.
    rows = [
        dict(zip(names, (curve.thickness, curve.depth, curve.orders, *numbers)))
        for curve in curves
        for numbers in zip(
            curve.angle.tolist(), *(getattr(curve, way).tolist() for way in _WAYS), strict=True
        )
    ]
    return PaperFigure(draw, rows=rows)


#: Figures by name: of which papers, and what makes them.
_FIGURES: Mapping[str, tuple[tuple[str, ...], Callable[[bool, Progress], PaperFigure]]] = {
    "paper-images": (("biri", "billeter"), _pictures),
    "shafts-strip": (("ali",), _shafts),
    "cloud-images": (("bouthors",), _cloud_images),
    "cloud-transport": (("bouthors",), _cloud_transport),
}
