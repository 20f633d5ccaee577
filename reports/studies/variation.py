# SPDX-License-Identifier: BSD-3-Clause
"""Studies of errors that vary: from run to run, and from frame to frame
under a light that moves.
"""

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from airlight.reports.api.inputs import (
    Kernels,
    Methods,
    Progress,
    SceneLike,
    Size,
    Values,
    pixels_of,
    telling,
    with_kernels,
)
from airlight.reports.machine.progress import counted
from airlight.reports.studies.registry import FRACTION, Study, with_environment
from airlight.reports.tables.table import Interval, numbers, table, words

if TYPE_CHECKING:
    from airlight.validation.study.variation import MethodMotion, MethodNoise


@with_kernels
def noise(
    scene: SceneLike = "sphere-spot",
    *,
    runs: int = 16,
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    size: Size = (160, 120),
    progress: Progress = None,
) -> Study:
    """Measure bias and noise of methods that draw random numbers, by independent runs of one frame.

    All runs are compared with one reference, and a bias is told where it is beyond the error of that.
    Methods that draw no random numbers stand in the same table: all of their error is bias.
    docs/your-engine.md explains the numbers; `airlight compare SCENE "runs/####.exr"` has the same
    for renders of others.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML or pbrt file.
    runs
        Number of runs of each method that draws random numbers.
    method
        As in `airlight study methods`; may be given several times.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter for each method that `--method` names, or kernel=NAME; may be given several times.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.reports.api.configurations import asked_configurations
    from airlight.reports.api.scenes import opened
    from airlight.validation.motion.noise import BLURS, time_words
    from airlight.validation.study.configuration import named_configurations
    from airlight.validation.study.variation import method_noise

    # The configurations of `studies/methods.toml` under this word, unless others are named.
    chosen, _ = asked_configurations(method, kernel, settings, usual=named_configurations("noise"))
    loaded = opened(scene, pixels_of(size))
    with telling(progress, "noise") as tell:
        found = method_noise(loaded.scene, chosen, runs=runs, progress=counted(tell))
    # The error after a blur, of the middle width.
    middle = len(BLURS) // 2
    goal = 0.01  # error, until which the time is given
    rows = [
        vars(each.noise)
        | {
            "label": each.label,
            "bias": each.noise.bias.value,
            "ms": None if each.noise.seconds is None else 1e3 * each.noise.seconds,
            "interval": Interval(*each.noise.bias_ci) if each.noise.runs > 1 else None,
            "noise": each.noise.deviation.value,
            "until": time_words(each.noise.time_to(goal)),
            "blurred": each.noise.blurred_rmse[middle],
        }
        for each in found
    ]
    columns = (
        *words(label="method"),
        *numbers("runs", ms="frame [ms]"),
        *numbers(bias="bias", interval="95 %", detectable_bias="detectable", how=FRACTION),
        *numbers(root_bias="bias by pixel", noise="noise", relative_rmse="rel. RMSE", how=FRACTION),
        *numbers(efficiency="efficiency [1/s]"),
        *words(until=f"to {100 * goal:g} %"),
        *numbers(low_fraction="low frequencies", how={"digits": 2}),
        *numbers(blurred=f"RMSE blurred, {BLURS[middle]:g} px", how=FRACTION),
    )
    title = f"{loaded.name}: errors of one frame, relative to the mean of the reference"
    data = with_environment(scene=loaded.name, runs=runs, rows=found)
    return Study(
        name="noise",
        data=data,
        tables=(table(title, columns, rows),),
        lines=tuple(f"{each.label}: {each.noise.verdict}" for each in found),
        rows=tuple(found),
        draw=partial(_draw_noise, found),
    )


def _draw_noise(found: "list[MethodNoise]", column: str) -> Any:
    """Return error against time, error spectra, and of each noisy method what is
    biased and how noisy it is.
    """
    from airlight.reports.plotting.figure import new_figure
    from airlight.reports.plotting.pictures import error_map
    from airlight.reports.plotting.style import WIDTHS

    # At the top the errors and their spectra for all methods, below a row of pictures for each
    # noisy one.
    width, noisy = WIDTHS[column], [each for each in found if each.noise.runs > 1]
    figure = new_figure(width, (0.42 + 0.38 * len(noisy)) * width)
    panels = figure.subplots(1 + len(noisy), 2, squeeze=False)
    errors, spectra = panels[0]
    for each in found:
        # Eight points for each factor of ten of averaged runs, up to 1e5; a method without noise is
        # a point.
        steps = [
            10 ** (k / 8)
            for k in range(1 + round(8 * math.log10(1e5)) if each.noise.runs > 1 else 1)
        ]
        style = {} if each.noise.runs > 1 else {"marker": "o", "linestyle": ""}
        # Without a time there is no place on the axis.
        seconds = math.nan if each.noise.seconds is None else each.noise.seconds
        errors.plot(
            [seconds * n for n in steps],
            [each.noise.after(n) for n in steps],
            label=each.label,
            **style,
        )
        # The middle of each ring of frequencies, up to half a cycle a pixel.
        rings = len(each.noise.spectrum)
        spectra.plot(
            [(k + 0.5) / (2 * rings) for k in range(rings)], each.noise.spectrum, label=each.label
        )
    errors.set(
        xlabel="time [s]", ylabel="relative RMSE of averaged runs [1]", xscale="log", yscale="log"
    )
    errors.legend(loc="best")
    spectra.axhline(1.0, color="0.5", linestyle=":")  # white noise
    spectra.set(xlabel="frequency [cycles/pixel]", ylabel="error spectrum [1]")
    for (bias, deviation), each in zip(panels[1:], noisy, strict=True):
        bias.imshow(error_map(each.reference, each.mean), interpolation="nearest")
        bias.set_title("mean of the runs, from two standard errors on", fontsize="small")
        shown = deviation.imshow(
            each.deviation.mean(axis=2) / each.reference.mean(), interpolation="nearest"
        )
        deviation.set_title("standard deviation of a run", fontsize="small")
        figure.colorbar(shown, ax=deviation)
        bias.set_ylabel(each.label, fontsize="small")
        for panel in (bias, deviation):
            panel.set(xticks=[], yticks=[])
    return figure


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

    Each frame is compared with its own reference. A method that keeps history gets it. See
    docs/your-engine.md for what the numbers are; `airlight compare --sequence` has the same for
    frames of other renderers.

    Parameters
    ----------
    scene
        A scene whose lights have no extent.
    stimulus
        Lights that circle, 120 frames a turn (sweep), or that jump after eight frames (step).
    frames
        How many are rendered.
    method
        As in `airlight study methods`; planes, froxels with and without history, a noisy
        march with it, by default.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter for each method that `--method` names, or kernel=NAME; may be given several times.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.reports.api.configurations import asked_configurations
    from airlight.reports.api.scenes import opened
    from airlight.validation.study.configuration import named_configurations
    from airlight.validation.study.variation import method_motion

    # The configurations of `studies/methods.toml` under this word, unless others are named.
    chosen, _ = asked_configurations(method, kernel, settings, usual=named_configurations("motion"))
    loaded = opened(scene, pixels_of(size))
    turn = 120  # frames of a whole turn in a sweep
    runs = 4  # of a method that draws random numbers
    with telling(progress, "motion") as tell:
        found = method_motion(
            loaded.scene,
            loaded.animation,
            chosen,
            stimulus=stimulus,
            frames=frames,
            turn=turn,
            runs=runs,
            progress=counted(tell),
        )
    columns = (
        *words(label="method"),
        *numbers(relative_rmse="rel. RMSE", bias="bias", flicker="flicker", how=FRACTION),
        *numbers(lag="lag", lag_se="its error", ghost="ghost", ghost_se="its error", pop="pop"),
        *words("verdict"),
    )
    rows = []
    for each in found:
        row: dict[str, Any] = {"label": each.label, "verdict": each.verdict}
        if each.measures:
            # Estimates have values and errors; the table shows errors of lag and ghost, which a
            # threshold is compared with.
            estimates = {
                name: getattr(each.measures, name)
                for name in ("relative_rmse", "bias", "flicker", "ghost")
            }
            estimates["lag"] = each.measures.lag.lag
            row |= {name: estimate.value for name, estimate in estimates.items()} | {
                "pop": each.measures.pop
            }
            row |= {f"{name}_se": estimates[name].error for name in ("lag", "ghost")}
        rows.append(row)
    title = f"{loaded.name}, {frames} frames of a {stimulus}: errors relative to the mean of the references"
    data = with_environment(
        scene=loaded.name, stimulus=stimulus, frames=frames, turn=turn, runs=runs, rows=found
    )
    return Study(
        name="motion",
        data=data,
        tables=(table(title, columns, rows),),
        rows=tuple(found),
        draw=partial(_draw_motion, found),
    )


def _draw_motion(found: "list[MethodMotion]", column: str) -> Any:
    """Return the error by frame of each method."""
    from airlight.reports.plotting.figure import new_figure
    from airlight.reports.plotting.style import WIDTHS

    width = WIDTHS[column]
    figure = new_figure(width, 0.62 * width)
    axes = figure.subplots()
    # The change of the reference from frame to frame stands beside the errors: a method that lags
    # by a frame errs by that much.
    measured = [(each.label, each.measures) for each in found if each.measures]
    for label, measures in measured:
        axes.plot(measures.rmse_by_frame, label=label)
    change = measured[0][1].change_by_frame if measured else ()
    axes.plot(change, color="0.5", linestyle=":", label="change of the reference")
    axes.set(xlabel="frame", ylabel="relative RMSE [1]")
    axes.set_yscale("symlog", linthresh=1e-6)
    axes.legend(loc="best")
    return figure
