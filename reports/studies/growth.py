# SPDX-License-Identifier: BSD-3-Clause
"""The study of growth: times and memory with the work."""

import math
from dataclasses import replace
from functools import partial
from typing import Any

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    Methods,
    Progress,
    Scenes,
    Size,
    Words,
    listed,
    pixels_of,
    several,
    telling,
    with_kernels,
)
from airlight.reports.machine.progress import counted, part_of
from airlight.reports.studies.registry import Study, with_environment
from airlight.validation.timing import Scaling, StepCost


@with_kernels
def scaling(
    scenes: Scenes = (),
    *,
    kinds: Words | None = None,
    method: Methods = (),
    size: Size = (800, 600),
    progress: Progress = None,
) -> Study:
    """Time methods as their work grows.

    The result has times, memory and exponents by pixels, triangles, lights or texels of the map.
    The exit status is 1 if a time jumps.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML or pbrt files; colonnade by default.
    kinds
        The kinds of growing work: some of size,triangles,lights,map; all by default.
    method
        A method, as in `airlight study methods`; by default one configuration of
        each method with shadows.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.reports.api.configurations import asked_configurations
    from airlight.reports.tables.costs import cliffs, scaling_tables
    from airlight.validation.study.growth import ladder, study_growth
    from airlight.validation.study.study import GROWTH, standard_study

    usual = standard_study("scaling")
    wanted = usual.growth if kinds is None else listed("kinds", kinds)
    # A mistake in words costs no work.
    for kind in wanted:
        if kind not in GROWTH:
            raise InputError(f"kinds: got {kind!r}, expected some of {','.join(GROWTH)}")
    # Every scene and kind is a ladder of works, on which all methods are timed.
    chosen, _ = asked_configurations(method, (), (), usual=usual.configurations)
    study = replace(usual.at(pixels_of(size)), configurations=tuple(chosen))
    names = [str(name) for name in several(scenes)] or usual.scenes
    # Scenes that have nothing of a kind are refused before an hour of work, not after.
    ladders = [
        (name, kind, ladder(kind, name, study.sizes[0])) for name in names for kind in wanted
    ]
    records: list[Scaling] = []
    with telling(progress, "scaling") as tell:
        for at, (name, kind, steps) in enumerate(ladders):
            part = part_of(tell, at / len(ladders), (at + 1) / len(ladders))
            found = study_growth(
                replace(study, scenes=(name,)), kind, steps, progress=counted(part)
            )
            records += found
    return Study(
        name="scaling",
        data=with_environment(scaling=records),
        tables=tuple(scaling_tables(records)),
        faults=tuple(cliffs(records)),
        draw=partial(_draw_scaling, records),
    )


def _draw_scaling(records: list[Scaling], column: str) -> Any:
    """Return the time of a frame over its work, by scene and kind of work, with the fitted
    exponents and the camera rays.
    """
    from airlight.reports.plotting.figure import new_figure
    from airlight.reports.plotting.style import WIDTHS, report_styles
    from airlight.reports.tables.costs import WORK

    # A panel for each kind of work in each scene, in it a line for each method; the camera rays are
    # the floor below all of them.
    kinds = list(dict.fromkeys((record.scene, record.kind) for record in records))
    width, double = WIDTHS[column], column == "double"
    across = min(len(kinds), 2 if double else 1)
    down = -(-len(kinds) // across)
    figure = new_figure(width, (0.42 if double else 0.9) * width * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    styles = report_styles((record.label.split()[0], record.label) for record in records)
    for panel, (scene, kind) in zip(panels, kinds):
        most: tuple[StepCost, ...] = ()
        for record in (each for each in records if (each.scene, each.kind) == (scene, kind)):
            costs = record.costs
            most = max(most, costs, key=len)
            label = f"{record.label}: power {record.growth['frame'].exponent or math.nan:.2f}"
            times = [cost.frame.median_ms for cost in costs]
            panel.plot([cost.work for cost in costs], times, label=label, **styles[record.label])
        # The camera rays are the same for all methods: the times beside the method with the most
        # steps stand for all.
        rays = [cost.rays.median_ms for cost in most]
        panel.plot(
            [cost.work for cost in most], rays, color="0.6", linestyle=":", label="camera rays"
        )
        panel.set(
            xscale="log", yscale="log", xlabel=f"{WORK[kind]} [1]", ylabel="time of a frame [ms]"
        )
        panel.set_title(scene, parse_math=False)  # a dollar in a name must not begin a formula
        panel.legend(loc="best")
    for panel in panels[len(kinds) :]:
        panel.remove()
    return figure
