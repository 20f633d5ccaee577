# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with titles, in two rows, from the EXR files of a figure."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reports.figures.files import new_figure
from reports.plotting.style import WIDTHS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LAYER = "total"  #: of the EXR files


def stored_image(path: Path):
    """Return the image of an EXR file of such a figure, (height, width, 3) [W/(m^2 sr)]."""
    import numpy as np

    from reference.storage.exr import layer, read_exr

    return np.asarray(layer(read_exr(path), LAYER, path), dtype=np.float64)


def picture_grid(pictures: Iterable[tuple[str, Any]], column: str, *, across: int = 3) -> "Figure":
    """Return a figure of pictures in two rows.

    Parameters
    ----------
    pictures
        Titles and pictures, (height, width, 3) in 8 bits, or (height, width) for shades of grey.
    column
        Of `reports.plotting.style.WIDTHS`.
    across
        Pictures in a row.
    """
    wide = WIDTHS[column]
    figure = new_figure(wide, 1.86 * wide / across)
    for panel, (title, picture) in zip(figure.subplots(2, across, squeeze=False).ravel(), pictures):
        show_picture(panel, picture)
        panel.set_title(title, fontsize=6 if column == "double" else 4.5)
    return figure


def show_picture(panel: "Axes", picture) -> None:
    """Show a picture pixel by pixel, without axes."""
    panel.imshow(picture, interpolation="nearest", cmap="gray")
    panel.set_xticks([])
    panel.set_yticks([])
    panel.grid(False)
