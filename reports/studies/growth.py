# SPDX-License-Identifier: BSD-3-Clause
"""Studies of growth: times and memory with the work, errors with the size of the shadow map."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

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
    pixels_of,
    several,
    telling,
    with_kernels,
)
from reports.machine.progress import counted, part_of
from reports.studies.methods import cells_of, check_study, loaded_scenes, scene_by_scene
from reports.studies.registry import FRACTION, Study, with_environment
from reports.tables.table import Table, numbers, table
from validation.timing import Scaling, StepCost

if TYPE_CHECKING:
    from validation.metrics.errors import Metrics


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

    The result has times, memory and exponents by pixels, triangles, lights or texels of the map. The
    exit status is 1 if a time jumps.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files; colonnade by default.
    kinds
        The kinds of growing work: some of size,triangles,lights,map; all by default.
    method
        A method, as in `airlight study methods`; by default one configuration of each method with shadows.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reports.api.render import asked_configurations
    from reports.tables.costs import cliffs, scaling_tables
    from validation.study.growth import study_growth
    from validation.study.ladders import ladder
    from validation.study.study import GROWTH, standard_study

    usual = standard_study("scaling")
    wanted = usual.growth if kinds is None else listed("kinds", kinds)
    for kind in wanted:
        if kind not in GROWTH:
            raise InputError(f"kinds: got {kind!r}, wanted some of {','.join(GROWTH)}")
    chosen, _ = asked_configurations(method, (), (), usual=usual.configurations)
    study = replace(usual.at(pixels_of(size)), configurations=tuple(chosen))
    names = [str(name) for name in several(scenes)] or usual.scenes
    # Scenes that have nothing of a kind are refused before an hour of work, not after.
    ladders = [(name, kind, ladder(kind, name, study.sizes[0])) for name in names for kind in wanted]
    records: list[Scaling] = []
    with telling(progress, "scaling") as tell:
        for at, (name, kind, steps) in enumerate(ladders):
            part = part_of(tell, at / len(ladders), (at + 1) / len(ladders))
            found = study_growth(replace(study, scenes=(name,)), kind, steps, progress=counted(part))
            records += found
    return Study(
        name="scaling",
        data=with_environment(scaling=records),
        tables=tuple(scaling_tables(records)),
        faults=tuple(cliffs(records)),
        draw=partial(_draw_scaling, records),
    )


def _draw_scaling(records: list[Scaling], column: str) -> Any:
    """Return the time of a frame over its work, by kind of work, with the fitted exponents and the camera rays."""
    from reports.plotting.figure import new_figure
    from reports.plotting.style import WIDTHS, method_style
    from reports.tables.costs import WORK

    kinds = list(dict.fromkeys(record.kind for record in records))
    width, double = WIDTHS[column], column == "double"
    across = min(len(kinds), 2 if double else 1)
    down = -(-len(kinds) // across)
    figure = new_figure(width, (0.42 if double else 0.9) * width * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, kind in zip(panels, kinds):
        costs: tuple[StepCost, ...] = ()
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
    figure.suptitle(", ".join(dict.fromkeys(record.scene for record in records)))
    return figure


# The size of the shadow map

_FEW = "has too few values above 0"
_FRACTIONS = numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", p50="", p99="", max="", how=FRACTION)


@with_kernels
def map_size(
    scenes: Scenes = (),
    *,
    method: MethodLike | None = None,
    settings: Values = (),
    sizes: Words | None = None,
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
        A method with a shadow map, light-volumes by default.
    settings
        NAME=VALUE, a parameter of the method; may be given several times. Choose them so that errors of other causes
        are well below the error of the largest map.
    sizes
        Sizes of the shadow map [texels], with commas; 32 to 4096 by default.
    size
        Width and height of the image [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.shadow_map import check_size
    from reports.api.render import checked_configuration
    from validation.study.configuration import parse_settings, prepared
    from validation.study.growth import fitted_exponent
    from validation.study.study import standard_study

    usual = standard_study("map-size")
    try:
        asked = [each.parameters[0][1] for each in usual.configurations] if sizes is None else listed("sizes", sizes)
        texels = sorted({int(word) for word in asked})
    except ValueError:
        raise InputError(f"sizes: got {sizes!r}, wanted sizes in texels, for example 128,256,512") from None
    for each in texels:
        check_size(each)
    parameters = dict(settings) if isinstance(settings, Mapping) else parse_settings(several(settings))
    if "map" in parameters:
        raise InputError(f"set: got map={parameters['map']}, wanted it in sizes: the map's size is what varies")
    named = usual.configurations[0].method if method is None else method
    checked = [checked_configuration(named, None, parameters | {"map": side}) for side in texels]
    by_size, apart = [chosen for chosen, _ in checked], checked[-1][1]
    loaded = loaded_scenes(several(scenes) or usual.scenes, size)
    check_study("map-size", loaded, by_size, frames=1)
    for each in loaded:  # refuse unusable scenes, and maps that exceed the memory, before any work
        prepared(read_scene(each.scene), by_size[-1])
    label = replace(by_size[0], parameters=tuple(each for each in by_size[0].parameters if each[0] != "map")).label
    found: list[MapErrors] = []
    for scene, tell in scene_by_scene(loaded, "map-size", progress):
        *_, cell = cells_of(scene, usual.measure, apart=apart)
        errors: list[Metrics] = []
        for number, chosen in enumerate(by_size):
            tell(number / len(by_size), chosen.label)
            row = cell(chosen)[0]
            if row.error is None:
                raise InputError(f"{scene.name}, {chosen.label}: {row.reason}")
            errors.append(row.error)
        exponent, scatter = fitted_exponent(texels, [each.relative_rmse or 0.0 for each in errors])
        found.append(MapErrors(scene.name, scene.size, label, tuple(texels), tuple(errors), -exponent, scatter))
    rows = [{"scene": each.scene, "label": label, **row} for each in found for row in each.rows]
    return Study(
        name="map-size",
        data=with_environment(scenes=found),
        tables=tuple(each.table for each in found),
        lines=tuple(each.words for each in found),
        rows=tuple(rows),
        draw=partial(_draw_maps, found),
    )


@dataclass(frozen=True)
class MapErrors:
    """The errors of a method in a scene by the size of its map."""

    scene: str
    size: tuple[int, int]  #: of the image [pixels]
    label: str  #: of the method, without the size of the map
    maps: tuple[int, ...]  #: side of the map [texels]
    errors: "tuple[Metrics, ...]"
    order: float  #: the relative RMSE falls as size^-order; not finite where too few errors are above 0
    order_error: float  #: its standard error

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The errors by name, a row for each size."""
        return [{"map": side, **vars(error)} for side, error in zip(self.maps, self.errors)]

    @property
    def table(self) -> Table:
        """The errors of each size."""
        title = "{}, {} x {}, {}: error".format(self.scene, *self.size, self.label)
        return table(title, (*numbers("map"), *_FRACTIONS), self.rows)

    @property
    def words(self) -> str:
        """How the error falls with the size."""
        power = f"falls as size^-({self.order:.2f} +- {self.order_error:.1g})"
        return f"{self.scene}: the relative RMSE {power if math.isfinite(self.order) else _FEW}."


def _draw_maps(found: list[MapErrors], column: str) -> Any:
    """Return the error over the size of the map, a line for each scene, with the fitted slope."""
    import numpy as np

    from reports.plotting.figure import name_sizes, new_figure
    from reports.plotting.style import WIDTHS, scene_styles

    width = WIDTHS[column]
    figure = new_figure(width, 0.45 * width if column == "double" else 1.05 * width)
    panel = figure.subplots()
    sizes = np.array(found[0].maps)
    for each, style in zip(found, scene_styles()):
        values = np.array([error.relative_rmse for error in each.errors], dtype=float)
        label = f"{each.scene}: order {each.order:.2f} ± {each.order_error:.2f}"
        panel.plot(sizes, values, linestyle="none", label=label, **style)
        if np.isfinite(each.order):
            level = np.exp(np.mean(np.log(values[values > 0]) + each.order * np.log(sizes[values > 0])))
            panel.plot(sizes, level * sizes**-each.order, color=style["color"])
    panel.set(xscale="log", yscale="log", title=found[0].label)
    panel.set(xlabel="side of the shadow map [texels]", ylabel="relative RMSE of the airlight [1]")
    name_sizes(panel, found[0].maps)
    panel.legend(loc="best")
    return figure
