# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 2 of Bouthors 2008 again: phase functions over the angle, Mie's of droplets beside what stands in for it."""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, values, write_data
from reports.plotting.style import WIDTHS

NAME = "phase-functions"
SUMMARY = "phase functions of droplets and those that stand in for them: Fig. 2 of Bouthors 2008"
#: Curves by their words, with how they are drawn; '=' is the mean cosine of Mie's function.
CURVES: dict[str, dict[str, Any]] = {
    "mie": {"color": "0.0", "linestyle": "-"},
    "mie-modified": {"color": "0.55", "linestyle": "--"},
    "hg-draine": {"color": "#0072b2", "linestyle": "-"},
    "hg:=": {"color": "#009e73", "linestyle": "-"},
    "hg:0.99": {"color": "#009e73", "linestyle": ":"},
    "rayleigh": {"color": "#d55e00", "linestyle": "-."},
}


def compute(folder: Path | str) -> None:
    """Write `phase-functions.csv`, a row for each angle [degrees], into a folder."""
    import numpy as np

    from analytic.droplets import optics
    from analytic.phase import phase_from_words

    angle = np.concatenate([np.linspace(0, 10, 201), np.linspace(10, 180, 681)[1:]])
    g = optics().g
    down, up = np.sin(np.deg2rad(0.5 * angle)) ** 2, np.cos(np.deg2rad(0.5 * angle)) ** 2
    columns = [phase_from_words(words.replace("=", f"{g!r}")).from_half(down, up) for words in CURVES]
    rows = list(zip(angle.tolist(), *(column.tolist() for column in columns)))
    write_data(ensure_folder(folder), NAME, ("angle", *CURVES), rows, g=g)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    rows = read_data(folder, NAME)
    angle = values(rows, "angle")
    figure = new_figure(WIDTHS[column], 0.62 * WIDTHS[column])
    panel = figure.subplots()
    for words, style in CURVES.items():
        shown = [(a, p) for a, p in zip(angle, values(rows, words)) if p > 0]
        label = "hg, g of mie" if words == "hg:=" else words.replace(":", ", g = ")
        panel.plot(*zip(*shown), label=label, **style)
    panel.set_yscale("log")
    panel.set_xlim(0, 180)
    panel.set_xlabel("scattering angle [degrees]")
    panel.set_ylabel("phase function, mean 1 [1]")
    panel.legend()
    return figure
