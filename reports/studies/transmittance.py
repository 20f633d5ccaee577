# SPDX-License-Identifier: BSD-3-Clause
"""A study of estimators of the transmittance of rays through a density grid."""

from functools import partial
from typing import TYPE_CHECKING, Any

from reports.api.inputs import Progress, SceneLike, telling, with_kernels
from reports.studies.result import FRACTION, Study, with_environment
from reports.tables.table import table_of

if TYPE_CHECKING:
    from validation.estimates.transmittance import TransmittanceError

_STEPS = (2, 4, 8, 16, 32)  # of the marches
_STYLES = {
    "naive": ("vermillion", "o"),
    "jackknife": ("green", "^"),
    "unbiased-ray-marching": ("blue", "s"),
    "ratio-tracking": ("purple", "D"),
}


@with_kernels
def transmittance(scene: SceneLike = "smoke", *, progress: Progress = None) -> Study:
    """Measure estimators of the transmittance of rays through a density grid.

    Naive exponentials of a marched sum are too bright, by Jensen's inequality: the row says by how much, and how much
    follows from the variance of the sum. Beside them stand ratio tracking, unbiased ray marching and the jackknife, all
    against the exact optical depth, over 48 rays between random places of the grid.

    Parameters
    ----------
    scene
        A scene with a density grid around its camera.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reference.scene.read import read_reference
    from reports.api.scenes import opened
    from validation.columns import shown_values
    from validation.estimates.transmittance import TransmittanceError, transmittance_errors

    with telling(progress, "rays") as tell:
        read = read_reference(opened(scene, (8, 6)).scene)
        rows = transmittance_errors(read, _STEPS, progress=tell)
    title = f"{scene}: transmittance of 48 rays, relative to its mean"
    data = with_environment(scene=str(scene), rows=rows)
    how = dict.fromkeys(("bias", "bias_error", "jensen", "spread"), FRACTION)
    drawn = table_of(title, TransmittanceError, rows, how=how)
    return Study(
        name="transmittance",
        data=data,
        tables=(drawn,),
        rows=tuple(map(shown_values, rows)),
        draw=partial(_draw, rows),
    )


def _draw(rows: "list[TransmittanceError]", column: str) -> Any:
    """Return bias and spread over the look-ups; dotted, the brightening that Jensen's inequality predicts."""
    from reports.plotting.figure import name_sizes, new_figure
    from reports.plotting.style import COLOURS, WIDTHS

    width, double = WIDTHS[column], column == "double"
    figure = new_figure(width, (0.42 if double else 1.4) * width)
    panels = figure.subplots(1, 2) if double else figure.subplots(2, 1)
    for name, (colour, marker) in _STYLES.items():
        own = [row for row in rows if row.estimator == name]
        look_ups = [row.look_ups for row in own]
        style: dict[str, Any] = {"color": COLOURS[colour], "marker": marker, "label": name}
        panels[0].errorbar(look_ups, [abs(row.bias) for row in own], [2 * row.bias_error for row in own], **style)
        panels[1].plot(look_ups, [row.spread for row in own], **style)
    march = [row for row in rows if row.jensen is not None]
    jensen = [row.look_ups for row in march], [row.jensen for row in march]
    panels[0].plot(*jensen, color=COLOURS["vermillion"], linestyle=":", label="naive, by Jensen")
    panels[0].set(ylabel="bias, absolute, relative to T [1]")
    panels[1].set(ylabel="standard deviation, relative to T [1]")
    for panel in panels:
        panel.set(xlabel="look-ups a ray [1]", xscale="log", yscale="log")
        name_sizes(panel, sorted({row.steps for row in march}))
    panels[0].legend(loc="best")
    return figure
