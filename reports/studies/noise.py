# SPDX-License-Identifier: BSD-3-Clause
"""A study of methods that draw random numbers: bias apart from noise, and how long either takes to average away."""

import math
from functools import partial
from typing import TYPE_CHECKING, Any

from reports.api.inputs import Kernels, Methods, Progress, SceneLike, Size, Values, pixels_of, telling, with_kernels
from reports.machine.progress import counted
from reports.studies.result import FRACTION, Study, with_environment
from reports.tables.table import Interval, numbers, table, words

if TYPE_CHECKING:
    from validation.study.noise import MethodNoise

_GOAL = 0.01  # error, until which the time is given
_MOST = 1e5  # runs that are averaged in the figure


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

    The reference has no noise. Methods that draw no random numbers stand in the same table: all of their error is bias.
    See docs/your-engine.md for what the numbers are; `airlight compare SCENE "runs/####.exr"` has the same for renders
    of others.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML file.
    runs
        Of each method that draws random numbers.
    method, kernel, settings
        As in `airlight study methods`.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reports.api.render import asked_configurations
    from reports.api.scenes import opened
    from validation.columns import plain
    from validation.motion.noise import BLURS, time_words
    from validation.study.configuration import named_configurations
    from validation.study.noise import method_noise

    chosen, _ = asked_configurations(method, kernel, settings, usual=named_configurations("noise"))
    loaded = opened(scene, pixels_of(size))
    with telling(progress, "noise") as tell:
        found = method_noise(loaded.scene, chosen, runs=runs, progress=counted(tell))
    middle = len(BLURS) // 2
    rows = [{"label": each.label, **plain(each.noise.to_json())} for each in found]
    shown = [
        row
        | {
            "ms": 1e3 * (each.noise.seconds or 0.0),
            "interval": Interval(*each.noise.bias_ci) if each.noise.runs > 1 else None,
            "noise": math.sqrt(max(each.noise.variance.value or 0.0, 0.0)),
            "until": time_words(each.noise.seconds_to(_GOAL)),
            "blurred": each.noise.blurred_rmse[middle],
        }
        for row, each in zip(rows, found, strict=True)
    ]
    columns = (
        *words(label="method"),
        *numbers("runs", ms="frame [ms]"),
        *numbers(bias="bias", interval="95 %", detectable_bias="detectable", how=FRACTION),
        *numbers(root_bias="bias by pixel", noise="noise", relative_rmse="rel. RMSE", how=FRACTION),
        *numbers(efficiency="efficiency [1/s]"),
        *words(until=f"to {100 * _GOAL:g} %"),
        *numbers(low_fraction="low frequencies", how={"digits": 2}),
        *numbers(blurred=f"RMSE blurred, {BLURS[middle]:g} px", how=FRACTION),
    )
    title = f"{loaded.name}: errors of one frame, relative to the mean of the reference"
    data = with_environment(scene=loaded.name, runs=runs, rows=rows)
    return Study(
        name="noise",
        data=data,
        tables=(table(title, columns, shown),),
        lines=tuple(f"{each.label}: {each.noise.words}" for each in found),
        rows=tuple(rows),
        draw=partial(_draw, found),
    )


def _draw(found: "list[MethodNoise]", column: str) -> Any:
    """Return error against time, error spectra, and of each noisy method what is biased and how noisy it is."""
    from reports.plotting.figure import new_figure
    from reports.plotting.pictures import error_map
    from reports.plotting.style import WIDTHS

    width, noisy = WIDTHS[column], [each for each in found if each.noise.runs > 1]
    figure = new_figure(width, (0.42 + 0.38 * len(noisy)) * width)
    panels = figure.subplots(1 + len(noisy), 2, squeeze=False)
    errors, spectra = panels[0]
    for each in found:
        seconds = each.noise.seconds or 0.0
        steps = [10 ** (k / 8) for k in range(1 + round(8 * math.log10(_MOST)) if each.noise.runs > 1 else 1)]
        style = {} if each.noise.runs > 1 else {"marker": "o", "linestyle": ""}
        errors.plot([seconds * n for n in steps], [each.noise.after(n) for n in steps], label=each.label, **style)
        rings = len(each.noise.spectrum)
        spectra.plot([(k + 0.5) / (2 * rings) for k in range(rings)], each.noise.spectrum, label=each.label)
    errors.set(xlabel="time [s]", ylabel="relative RMSE of averaged runs [1]", xscale="log", yscale="log")
    errors.legend(loc="best")
    spectra.axhline(1.0, color="0.5", linestyle=":")  # white noise
    spectra.set(xlabel="frequency [cycles/pixel]", ylabel="error spectrum [1]")
    for (bias, deviation), each in zip(panels[1:], noisy, strict=True):
        bias.imshow(error_map(each.reference, each.mean), interpolation="nearest")
        bias.set_title("mean of the runs, from two standard errors on", fontsize="small")
        shown = deviation.imshow(each.deviation.mean(axis=2) / each.reference.mean(), interpolation="nearest")
        deviation.set_title("standard deviation of a run", fontsize="small")
        figure.colorbar(shown, ax=deviation)
        bias.set_ylabel(each.label, fontsize="small")
        for panel in (bias, deviation):
            panel.set(xticks=[], yticks=[])
    return figure
