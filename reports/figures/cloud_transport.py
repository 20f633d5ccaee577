# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 8 of Bouthors 2008 again: the light that leaves a point of a slab by its direction, in three ways."""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, value, write_data
from reports.plotting.style import COLOURS, WIDTHS

NAME = "cloud-transport"
SUMMARY = "Fig. 8 of Bouthors 2008: light by direction in slabs, computed, from tables and by 22 functions"

_ORDERS = ("2", "5-6", "13-18", "31-inf")  #: that are drawn
_WAYS = ("exact", "table", "fit")
_HEADER = ("thickness", "depth", "orders", "angle", *_WAYS)


def compute(folder: Path | str) -> None:
    """Write `cloud-transport.csv` into a folder: T of all sets of orders by angle.

    Parameters
    ----------
    folder
        Where the data go.
    """
    from validation.papers.slab import SUN, transport_curves

    target = ensure_folder(folder)
    rows = [
        (*(curve[name] for name in _HEADER[:3]), *numbers)
        for curve in transport_curves()
        for numbers in zip(curve["angle"], *(curve[way] for way in _WAYS), strict=True)
    ]
    write_data(target, NAME, _HEADER, rows, sun=SUN)


def draw(folder: Path | str, column: str = "double"):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = [row for row in read_data(folder, NAME) if row["orders"] in _ORDERS]
    places = list(dict.fromkeys((row["thickness"], row["depth"]) for row in rows))
    width, across = WIDTHS[column], 2 if column == "double" else 1
    down = -(-len(places) // across)
    figure = new_figure(width, 0.6 * down * width / across)
    panels = figure.subplots(down, across, sharex=True, squeeze=False).ravel()
    for panel, place in zip(panels, places):
        for number, orders in enumerate(_ORDERS):
            own = [row for row in rows if (row["thickness"], row["depth"], row["orders"]) == (*place, orders)]
            angles = [value(row, "angle") for row in own]
            ways = {way: np.array([value(row, way) for row in own], dtype=float) for way in _WAYS}
            lit = ways["exact"] > 0
            for way, style, colour in (("exact", "-", "blue"), ("table", ":", "green"), ("fit", "--", "vermillion")):
                curve = np.where(lit & (ways[way] > 0), ways[way], np.nan)
                panel.plot(angles, curve, style, color=COLOURS[colour], label=None if number else _LABELS[way])
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


_LABELS = {"exact": "computed", "table": "tables", "fit": "22 functions"}
