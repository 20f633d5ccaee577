# SPDX-License-Identifier: BSD-3-Clause
"""A study of methods under a light that moves: flicker, lag and ghosts."""

from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from reports.api.inputs import Kernels, Methods, Progress, SceneLike, Size, Values, pixels_of, telling, with_kernels
from reports.machine.progress import counted
from reports.studies.result import FRACTION, Study, with_environment
from reports.tables.table import numbers, table, words

if TYPE_CHECKING:
    from validation.study.motion import MethodMotion

_TURN = 120  # frames of a whole turn in a sweep
_RUNS = 4  # of a method that draws random numbers


@with_kernels
def motion(
    scene: SceneLike = "sphere-spot",
    *,
    stimulus: Literal["sweep", "step"] = "sweep",
    frames: int = 24,
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    size: Size = (160, 120),
    progress: Progress = None,
) -> Study:
    """Measure how methods flicker, lag and leave ghosts under a light that moves.

    Each frame is compared with its own reference. A method that keeps history gets it. See docs/your-engine.md for what
    the numbers are; `airlight compare --frames` has the same for frames of other renderers.

    Parameters
    ----------
    scene
        A scene whose lights have no extent.
    stimulus
        Lights that circle, 120 frames a turn (sweep), or that jump after eight frames (step).
    frames
        How many are rendered.
    method, kernel, settings
        As in `airlight study methods`; planes, froxels with and without history, a noisy march with it, by default.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reports.api.render import asked_configurations
    from reports.api.scenes import opened
    from validation.study.configuration import named_configurations
    from validation.study.motion import method_motion

    chosen, _ = asked_configurations(method, kernel, settings, usual=named_configurations("motion"))
    loaded = opened(scene, pixels_of(size))
    with telling(progress, "motion") as tell:
        found = method_motion(
            loaded.scene,
            loaded.animation,
            chosen,
            stimulus=stimulus,
            frames=frames,
            turn=_TURN,
            runs=_RUNS,
            progress=counted(tell),
        )
    columns = (
        *words(label="method"),
        *numbers(relative_rmse="rel. RMSE", bias="bias", flicker="flicker", how=FRACTION),
        *numbers(lag="lag", lag_se="its error", ghost="ghost", ghost_se="its error", pop="pop"),
        *words("verdict"),
    )
    rows = [each.to_json() for each in found]
    title = f"{loaded.name}, {frames} frames of a {stimulus}: errors relative to the mean of the references"
    data = with_environment(scene=loaded.name, stimulus=stimulus, frames=frames, turn=_TURN, runs=_RUNS, rows=rows)
    return Study(
        name="motion", data=data, tables=(table(title, columns, rows),), rows=tuple(rows), draw=partial(_draw, found)
    )


def _draw(found: "list[MethodMotion]", column: str) -> Any:
    """Return the error by frame of each method."""
    from reports.plotting.figure import new_figure
    from reports.plotting.style import WIDTHS

    width = WIDTHS[column]
    figure = new_figure(width, 0.62 * width)
    axes = figure.subplots()
    measured = [(each.label, each.measures) for each in found if each.measures]
    for label, measures in measured:
        axes.plot(measures.rmse_by_frame, label=label)
    change = measured[0][1].change_by_frame if measured else ()
    axes.plot(change, color="0.5", linestyle=":", label="change of the reference")
    axes.set(xlabel="frame", ylabel="relative RMSE [1]")
    axes.set_yscale("symlog", linthresh=1e-6)
    axes.legend(loc="best")
    return figure
