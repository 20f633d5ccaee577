# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 8 of Bouthors 2008 again: the light that leaves a point of a slab by its direction, in four ways."""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, value, write_data
from reports.machine.progress import Progress
from reports.plotting.style import COLOURS, WIDTHS, truth_style

NAME = "cloud-transport"
SUMMARY = "Fig. 8 of Bouthors 2008: light by direction in slabs, computed, by photons, from tables and by 22 functions"

_ORDERS = ("2", "5-6", "13-18", "31-inf")  #: that are drawn
_WAYS = ("exact", "table", "fit", "photons", "photons_se")
_HEADER = ("thickness", "depth", "orders", "angle", *_WAYS)
_QUICK = 40_000  #: photons


def compute(folder: Path | str, *, quick: bool = False, progress: Progress | None = None) -> None:
    """Write `cloud-transport.csv` into a folder: T of all sets of orders by angle.

    Parameters
    ----------
    folder
        Where the data go.
    quick
        A tenth of the photons.
    progress
        Called with (share done, what).
    """
    from validation.papers.bouthors_transport import transport_study

    target = ensure_folder(folder)
    few = {"photons": _QUICK} if quick else {}
    study = transport_study(progress=progress, **few)["transport"]
    rows = [
        (*(curve[name] for name in _HEADER[:3]), angle, *numbers)
        for curve in study["curves"]
        for angle, *numbers in zip(study["angles"], *(curve[way] for way in _WAYS), strict=True)
    ]
    write_data(target, NAME, _HEADER, rows, sun=study["sun"])


def draw(folder: Path | str, column: str = "double"):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = [row for row in read_data(folder, NAME) if row["orders"] in _ORDERS]
    places = list(dict.fromkeys((row["thickness"], row["depth"]) for row in rows))
    width, across = WIDTHS[column], 2 if column == "double" else 1
    down = -(-len(places) // across)
    figure = new_figure(width, 0.6 * down * width / across)
    panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
    dots = truth_style() | {"linestyle": "none", "marker": "o", "markersize": 1.5}
    for panel, place in zip(panels, places):
        for number, orders in enumerate(_ORDERS):
            own = [row for row in rows if (row["thickness"], row["depth"], row["orders"]) == (*place, orders)]
            angles = [value(row, "angle") for row in own]
            ways = {way: np.array([value(row, way) for row in own], dtype=float) for way in _WAYS}
            lit = ways["exact"] > 0
            for way, style, colour in (("exact", "-", "blue"), ("table", ":", "green"), ("fit", "--", "vermillion")):
                curve = np.where(lit & (ways[way] > 0), ways[way], np.nan)
                panel.plot(angles, curve, style, color=COLOURS[colour], label=None if number else _LABELS[way])
            seen = lit & (ways["photons"] > 2 * ways["photons_se"])
            label = None if number else _LABELS["photons"]
            panel.plot(np.array(angles)[seen], ways["photons"][seen], label=label, **dots)
        panel.set_yscale("log")
        panel.set_title(
            f"{float(place[0]):g} m thick, {float(place[1]):g} m deep, orders {', '.join(_ORDERS)}", fontsize=6
        )
        panel.set_xlabel("zenith angle of the view [degrees]")
        panel.set_ylabel("T [1/sr]")
    panels[0].legend()
    for panel in panels[len(places) :]:
        panel.set_axis_off()
    return figure


_LABELS = {"exact": "computed", "table": "tables", "fit": "22 functions", "photons": "photons"}
