# SPDX-License-Identifier: BSD-3-Clause
"""Studies of growth: times and memory with the work, errors with the size of the shadow map."""

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any

from analytic.errors import InputError
from reports.api.inputs import (
    MethodLike,
    Methods,
    Progress,
    Scenes,
    Size,
    Values,
    Words,
    listed,
    one_error,
    pixels_of,
    several,
    telling,
)
from reports.machine.progress import counted, part_of
from reports.studies.result import FRACTION, Study, with_environment
from reports.tables.table import numbers, table


@one_error
def scaling(
    scenes: Scenes = ("colonnade",),
    *,
    kinds: Words = "size,triangles,lights,map",
    method: Methods = (),
    size: Size = (800, 600),
    progress: Progress = None,
) -> Study:
    """Time methods as their work grows.

    The result has times, memory and exponents by pixels, triangles, lights, bounded media or texels of the map. The
    exit status is 1 if a time jumps.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files.
    kinds
        What grows: some of size,triangles,lights,media,map.
    method
        A method, as in `airlight study methods`; by default one configuration of each method with shadows.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from validation.study.ladders import KINDS, ladder

    wanted = listed("kinds", kinds)
    for kind in wanted:
        if kind not in KINDS:
            raise InputError(f"kinds: got {kind!r}, wanted some of {','.join(KINDS)}")
    names = [str(name) for name in several(scenes)]
    from reports.machine.environment import activate

    activate()
    from reports.api.render import asked_configurations
    from reports.report.others import scaling_records
    from reports.tables.scaling import cliffs, scaling_tables
    from validation.study.growth import METHODS, study_scaling

    chosen, _ = asked_configurations(method, (), (), usual=METHODS)
    pixels = pixels_of(size)
    assert pixels is not None
    # Scenes that have nothing of a kind are refused before an hour of work, not after.
    ladders = [(name, kind, ladder(kind, name, pixels)) for name in names for kind in wanted]
    records: list[Any] = []
    with telling(progress, "scaling") as tell:
        for at, (name, kind, steps) in enumerate(ladders):
            part = part_of(tell, at / len(ladders), (at + 1) / len(ladders))
            found = study_scaling(kind, steps, chosen, progress=counted(part))
            records += scaling_records(found, name, pixels)
    return Study(
        name="scaling",
        data=with_environment(scaling=[asdict(each) for each in records]),
        drawn=tuple(scaling_tables(records)),
        wrong=tuple(cliffs(records)),
        draw=partial(_draw_scaling, records),
    )


def _draw_scaling(records: list[Any], column: str) -> Any:
    """Return the time of a frame over its work, by kind of work, with the fitted exponents and the camera rays."""
    from reports.plotting.figure import new_figure
    from reports.plotting.style import WIDTHS, method_style
    from reports.tables.scaling import WORK

    kinds = list(dict.fromkeys(record.kind for record in records))
    width, double = WIDTHS[column], column == "double"
    across = min(len(kinds), 2 if double else 1)
    down = -(-len(kinds) // across)
    figure = new_figure(width, (0.42 if double else 0.9) * width * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, kind in zip(panels, kinds):
        costs: list[Any] = []
        for record in (each for each in records if each.kind == kind):
            costs = record.costs
            label = f"{record.label}: power {record.growth['frame'].exponent or math.nan:.2f}"
            times = [cost.frame.median_ms for cost in costs]
            panel.plot([cost.work for cost in costs], times, label=label, **method_style(record.label.split()[0]))
        rays = [cost.rays.median_ms for cost in costs]
        panel.plot([cost.work for cost in costs], rays, color="0.6", linestyle=":", label="camera rays")
        panel.set(xscale="log", yscale="log", xlabel=f"{WORK[kind]} [1]", ylabel="time of a frame [ms]")
        panel.legend(loc="best")
    for panel in panels[len(kinds) :]:
        panel.remove()
    figure.suptitle(", ".join(dict.fromkeys(record["scene"] for record in records)))
    return figure


# The size of the shadow map

_SHARES = numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", p50="", p99="", max="", how=FRACTION)


@one_error
def map_size(
    scenes: Scenes = (),
    *,
    method: MethodLike = "light-volumes",
    settings: Values = (),
    sizes: Words = "32,64,128,256,512,1024,2048,4096",
    size: Size = (160, 120),
    progress: Progress = None,
) -> Study:
    """Measure the error against the size of the shadow map.

    Also returns the slope of the relative RMSE, fitted to the logarithms.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files; all built-in scenes for fog by default.
    method
        A method with a shadow map.
    settings
        NAME=VALUE, a parameter of the method; may be given several times. Choose them so that errors of other causes
        are well below the error of the largest map.
    sizes
        Sizes of the shadow map [texels], with commas.
    size
        Width and height of the image [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from realtime.shadow_maps.shadow_map import check_size
    from reports.machine.environment import activate
    from validation.study.configuration import parse_settings

    try:
        texels = sorted({int(word) for word in listed("sizes", sizes)})
    except ValueError:
        raise InputError(f"sizes: got {sizes!r}, wanted sizes in texels, for example 128,256,512") from None
    for each in texels:
        check_size(each)
    parameters = dict(settings) if isinstance(settings, Mapping) else parse_settings(several(settings))
    if "map" in parameters:
        raise InputError(f"set: got map={parameters['map']}, wanted it in sizes: the map's size is what varies")
    pixels = pixels_of(size)
    from reports.api.render import checked_configuration

    largest, apart = checked_configuration(method, None, parameters | {"map": texels[-1]})
    activate()
    call: Any = _map_study
    if apart:
        from reports.machine.own_process import in_own_process

        call = partial(in_own_process, _map_study, name=largest.method)
        progress = progress is True
    from validation.scenes.registry import FOG_SCENES

    names = several(scenes) or list(FOG_SCENES)
    studied = call(names, pixels, texels, method, parameters, progress)
    shared = tuple(each for each in largest.parameters if each[0] != "map")
    return _map_result(studied, pixels, texels, replace(largest, parameters=shared).label)


def _map_study(
    names: list[Any],
    pixels: Any,
    texels: list[int],
    method: Any,
    parameters: dict[str, Any],
    progress: Progress,
) -> list[tuple[str, Any]]:
    """Return of every scene its name and the errors by size."""
    from realtime.scene.read_scene import read_scene
    from reports.api.scenes import opened
    from validation.estimates.quadrature import reference_image
    from validation.study.configuration import configuration, prepared
    from validation.study.cost import check_work, frame_work, reference_work
    from validation.study.reference import of_image
    from validation.study.run import run
    from validation.study.study import Cell, Measure

    loaded = [opened(name, pixels) for name in names]
    works = [reference_work(pixels, lights=len(each.scene.emitters())) for each in loaded]
    works += [frame_work(pixels, frames=len(texels)) for _ in loaded]
    check_work(f"map-size, {pixels[0]} x {pixels[1]}", works)
    by_size = [configuration(method, None, parameters | {"map": size}) for size in texels]
    for each in loaded:  # refuse unusable scenes, and maps that exceed the memory, before any work
        prepared(read_scene(each.scene), by_size[-1])
    studied = []
    with telling(progress, "map-size") as tell:
        for at, each in enumerate(loaded):
            part = counted(part_of(tell, at / len(loaded), (at + 1) / len(loaded), before=f"{each.name}, "))
            scene, reference = read_scene(each.scene), of_image(reference_image(each.scene))
            errors = []
            for number, chosen in enumerate(by_size):
                part(number, len(by_size), chosen.label)
                cell = Cell(each.name, pixels, (), chosen, Measure("none", every_metric=False))
                row, _ = run(cell, scene, reference)
                if row.error is None:
                    raise InputError(f"{each.name}, {chosen.label}: {row.reason}")
                errors.append(row.error)
            studied.append((each.name, errors))
    return studied


def _map_result(studied: list[tuple[str, Any]], pixels: Any, texels: list[int], label: str) -> Study:
    from validation.metrics.errors import plain
    from validation.study.maps import fitted_slope

    tables, said, rows, data, drawn = [], [], [], [], []
    for name, errors in studied:
        title = f"{name}, {pixels[0]} x {pixels[1]}, {label}"
        of_scene = [{"map": size, **vars(metrics)} for size, metrics in zip(texels, errors, strict=True)]
        rows += [{"scene": name, "label": label, **row} for row in of_scene]
        tables.append(table(f"{title}: error", (*numbers("map"), *_SHARES), of_scene))
        order = fitted_slope(texels, [row["relative_rmse"] for row in of_scene])
        power = f"falls as size^-({order[0]:.2f} +- {order[1]:.1g})"
        said.append(f"{name}: the relative RMSE {power if math.isfinite(order[0]) else 'has too few values above 0'}.")
        data.append({"name": name, "method": label, "errors": plain(of_scene), "order": plain(order)})
        drawn.append((name, [row["relative_rmse"] for row in of_scene], *order))
    return Study(
        name="map-size",
        data=with_environment(size=list(pixels), maps=texels, scenes=data),
        drawn=tuple(tables),
        said=tuple(said),
        rows=tuple(rows),
        draw=partial(_draw_maps, label, texels, drawn),
    )


def _draw_maps(label: str, texels: list[int], drawn: list[tuple[str, list[float], float, float]], column: str) -> Any:
    """Return the error over the size of the map, a line for each scene, with the fitted slope."""
    import numpy as np

    from reports.plotting.figure import name_sizes, new_figure
    from reports.plotting.style import WIDTHS, scene_styles

    width = WIDTHS[column]
    figure = new_figure(width, 0.45 * width if column == "double" else 1.05 * width)
    panel = figure.subplots()
    sizes = np.array(texels)
    for (name, errors, order, standard_error), style in zip(drawn, scene_styles()):
        values = np.array(errors)
        panel.plot(sizes, values, linestyle="none", label=f"{name}: order {order:.2f} ± {standard_error:.2f}", **style)
        if np.isfinite(order):
            level = np.exp(np.mean(np.log(values[values > 0]) + order * np.log(sizes[values > 0])))
            panel.plot(sizes, level * sizes**-order, color=style["color"])
    panel.set(xscale="log", yscale="log", title=label)
    panel.set(xlabel="side of the shadow map [texels]", ylabel="relative RMSE of the airlight [1]")
    name_sizes(panel, texels)
    panel.legend(loc="best")
    return figure
