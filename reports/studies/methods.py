# SPDX-License-Identifier: BSD-3-Clause
"""Studies of methods: times and errors, and errors by cause."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    Kernels,
    Methods,
    Progress,
    Scenes,
    Size,
    Values,
    note,
    several,
    telling,
    with_kernels,
)
from airlight.reports.machine.progress import part_of
from airlight.reports.studies.registry import FRACTION, Study, with_environment
from airlight.reports.tables.table import Row, Table, table, table_of, words
from airlight.validation.columns import shown_values

if TYPE_CHECKING:
    from airlight.validation.study.causes import ErrorPart
    from airlight.validation.study.configuration import Configuration
    from airlight.validation.study.row import Row as CellRow


def loaded_scenes(scenes: Any, size: Any) -> list[Any]:
    """Return the scenes, loaded; those for fog by default. Unusable scenes are
    refused before the work.
    """
    from airlight.reports.api.scenes import opened
    from airlight.validation.scenes.registry import FOG_SCENES

    return [opened(each, size) for each in several(scenes) or FOG_SCENES]


def scene_by_scene(loaded: list[Any], title: str, progress: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each scene, and what tells how much of it is done."""
    with telling(progress, title) as tell:
        for at, scene in enumerate(loaded):
            # Each scene is an equal part of the bar, as their times are not known.
            part = part_of(tell, at / len(loaded), (at + 1) / len(loaded), before=f"{scene.name}: ")
            part(0.0, "the reference")
            yield scene, part


def cells_of(
    loaded: Any, measure: Any, *, apart: bool
) -> tuple[Any, Any, Callable[[Any], tuple[Any, Any]]]:
    """Return a scene as methods see it, its reference, and what gives row and frame of a
    configuration beside it.

    Methods of users run in separate processes if they can be found there, `apart`.
    """
    from airlight.realtime.scene.read_scene import read_scene
    from airlight.reference.quadrature.reference import reference_result
    from airlight.reports.machine.own_process import in_own_process
    from airlight.validation.study.reference import of_image
    from airlight.validation.study.run import run
    from airlight.validation.study.study import Cell

    # The reference is computed once for all configurations of the scene.
    scene, result = read_scene(loaded.scene), reference_result(loaded.scene)
    reference = of_image(result.value, result.spent)
    path, elsewhere = str(loaded.path or loaded.name), in_own_process if apart else None

    def cell(chosen: Any) -> tuple[Any, Any]:
        return run(Cell(path, loaded.size, (), chosen, measure), scene, reference, apart=elsewhere)

    return scene, reference, cell


def check_study(
    what: str,
    loaded: list[Any],
    chosen: list[Any],
    *,
    frames: float | None = None,
    progress: Any = None,
) -> None:
    """Refuse what would take more than an hour; `frames` are those of a configuration,
    as many as timing takes.
    """
    from airlight.realtime.scene.read_scene import read_scene
    from airlight.validation.study.configuration import configuration_work
    from airlight.validation.study.cost import TIMED, check_work, reference_work

    # The sum over scenes and configurations decides, before the first reference.
    works = []
    for each in loaded:
        scene = read_scene(each.scene)
        note(progress, scene.features.notes)
        works.append(
            reference_work(each.size, lights=len(scene.lights), area_lights=len(scene.area_lights))
        )
        works += [configuration_work(scene, one, frames or TIMED) for one in chosen]
    check_work(what, works)


class MethodsStudy(Study):
    """Speed against error: a row for each configuration in each scene, a record as
    those of `airlight sweep`.

    A row has `scene`, `label`, `method`, `kernel`, `times` (such as `times.frame.median_ms`),
    `error` (such as `error.relative_rmse`), and `reason`, why the method cannot render the scene.
    Missing values are None.
    """

    def fastest(self, error: float, scene: str | None = None) -> "CellRow | None":
        """Return the row of the fastest frame whose relative RMSE is at most `error`;
        None where there is none.

        Parameters
        ----------
        error
            Relative RMSE of the airlight, such as 0.01.
        scene
            Its name; all scenes by default.
        """
        from airlight.reports.tables.methods import within

        return next(
            iter(within(error, [row for row in self.rows if scene in (None, row.scene)])), None
        )


@with_kernels
def methods(
    scenes: Scenes = (),
    *,
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    size: Size | None = None,
    seconds: float = 0.6,
    progress: Progress = None,
) -> MethodsStudy:
    """Time methods and measure their errors.

    Every method is timed in every scene and compared with the reference. `airlight` is the airlight
    alone (the kernel with its ray set-up), `frame` a frame with static geometry and light, `light
    moved` a frame after the light moved.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML or pbrt files; by default the fourteen built-in
        ones of homogeneous fog with few lights.
    method
        A method of `airlight list methods`, a user's as MODULE:FUNCTION, FILE.py:FUNCTION or
        FILE.glsl, or 'all', the default; may be given several times. A name stands for its standard
        configurations.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter for each method that `--method` names, or kernel=NAME; may be given several times.
    size
        Width and height [pixels], or WxH; the scene's own by default.
    seconds
        Time to spend on each timing, of which every configuration has five [s].
    progress
        Called with (fraction done, what); True shows a bar.

    Examples
    --------
    >>> import airlight
    >>> found = airlight.study("methods", "open-fog", method="unshadowed", size=(32, 24), seconds=0.01)
    >>> [row.label for row in found]
    ['unshadowed (taylor)', 'unshadowed (quadrature)', 'unshadowed (exact)']
    >>> found.fastest(1e-3).error.relative_rmse < 1e-3
    True
    """
    from airlight.reports.api.configurations import asked_configurations
    from airlight.reports.machine.own_process import in_own_process
    from airlight.reports.report.claims import own_faults
    from airlight.reports.tables.methods import methods_table, times_words
    from airlight.validation.study.run import with_times
    from airlight.validation.study.scene import configurations_for
    from airlight.validation.study.study import Cell, Measure
    from airlight.validation.study.turns import time_cells

    # Everything is checked and loaded before the first reference, which may take minutes.
    chosen, apart = asked_configurations(method, kernel, settings)
    loaded = loaded_scenes(scenes, size)
    check_study("methods", loaded, chosen, progress=progress)
    tables, wrong, rows = [], [], []
    for scene, tell in scene_by_scene(loaded, "methods", progress):
        measure = Measure("stages", seconds, every_metric=False)
        # First the images and their errors, half of the bar. Configurations that do not differ in
        # this scene, such as variants of shadows where nothing casts one, are left out.
        read, _, cell = cells_of(scene, measure, apart=apart)
        useful, measured = configurations_for(read, chosen), list[tuple[Any, Any]]()
        for at, each in enumerate(useful):
            tell(0.5 * at / len(useful), each.label)
            measured.append(cell(each))
        # Methods that were rendered are timed, all in turns.
        path = str(scene.path or scene.name)
        asked = [
            Cell(path, scene.size, (), each, measure) if row.status == "done" else None
            for each, (row, _) in zip(useful, measured, strict=True)
        ]
        # Then the times, all methods in turns in one run, so that a change of the machine hits all
        # alike.
        tell(0.5, "times")
        timings = time_cells(asked, partial(_same, read), apart=in_own_process if apart else None)
        found = [
            replace(with_times(row, times), scene=scene.name)
            for (row, _), times in zip(measured, timings, strict=True)
        ]
        rows += found
        title = "{}, {} x {}".format(scene.name, *scene.size)
        tables.append(methods_table(title, found, explanation=times_words(found)))
        wrong += own_faults(found)
    return MethodsStudy(
        name="methods",
        data=with_environment(rows=rows),
        tables=tuple(tables),
        rows=tuple(rows),
        faults=tuple(dict.fromkeys(wrong)),
    )


def _same(scene: Any, cell: Any) -> Any:
    """Return the scene of every cell."""
    return scene


# Errors by cause


@with_kernels
def decomposition(
    scenes: Scenes = (),
    *,
    method: Methods = (),
    settings: Values = (),
    size: Size = (240, 180),
    progress: Progress = None,
) -> Study:
    """Split the error of methods by its causes.

    The parts add up to the error: they are differences of renders in which one cause after the
    other is gone. The figure shows image, error and parts of the first scene.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML or pbrt files; colonnade by default.
    method
        A method, as in `airlight study methods`; by default a ray march by a
        map, min-max and froxel-fog.
    settings
        NAME=VALUE, a parameter for each method that `--method` names, or kernel=NAME; may be given several times.
    size
        Width and height [pixels], or WxH.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.reports.api.configurations import asked_configurations
    from airlight.validation.study.study import standard_study

    # Scenes and methods of the standard study, unless others are named.
    usual = standard_study("decomposition")
    chosen, apart = asked_configurations(method, (), settings, usual=usual.configurations)
    loaded = loaded_scenes(several(scenes) or list(usual.scenes), size)
    check_study("decomposition", loaded, chosen, progress=progress)
    data, tables, rows, drawn = [], [], [], []
    for scene, tell in scene_by_scene(loaded, "decomposition", progress):
        split = _split(scene, chosen, usual.measure, apart=apart, progress=tell)
        title = "{}, {} x {}: error of the airlight by cause".format(scene.name, *scene.size)
        tables.append(_cause_table(title, split))
        entries = []
        # A refusal is an entry without parts.
        for each, _, found in split:
            entry: dict[str, Any] = {
                "label": each.label,
                "method": each.method,
                "kernel": each.kernel,
            }
            entry |= {"parameters": dict(each.parameters)}
            if isinstance(found, str):
                entries.append(entry | {"refused": found})
                continue
            parts = [shown_values(part) for part in found]
            entries.append(entry | {"refused": None, "whole": parts[0], "parts": parts[1:]})
            rows += [{"scene": scene.name, "label": each.label, **part} for part in parts]
        data.append({"name": scene.name, "size": list(scene.size), "methods": entries})
        drawn.append(
            [
                (each.label, image, found)
                for each, image, found in split
                if not isinstance(found, str)
            ]
        )
    return Study(
        name="decomposition",
        data=with_environment(scenes=data),
        tables=tuple(tables),
        rows=tuple(rows),
        draw=partial(_draw_parts, drawn[0]) if drawn and drawn[0] else None,
    )


#: Configurations with the reference, and their parts or the reason for which there are none.
Split = list[tuple["Configuration", Any, "list[ErrorPart] | str"]]


def _split(loaded: Any, chosen: list[Any], measure: Any, *, apart: bool, progress: Any) -> Split:
    """Return the errors of a scene by cause."""
    from airlight.validation.study.causes import decompose
    from airlight.validation.study.scene import configurations_for

    scene, reference, cell = cells_of(loaded, measure, apart=apart)

    @cache
    # Parts are differences of renders: some configurations occur in several, and are rendered once.
    def airlight(configuration: Any) -> Any:
        row, frame = cell(configuration)
        if frame is None or row.error is None or row.error.nonfinite:
            raise InputError(
                row.reason or f"{configuration.label}: its image has values that are not finite"
            )
        return frame.airlight

    split: Split = []
    # A method that the decomposition cannot split is a row with the reason.
    useful = configurations_for(scene, chosen)
    for at, each in enumerate(useful):
        progress((1 + at) / (1 + len(useful)), each.label)
        try:
            split.append(
                (each, reference.airlight, decompose(scene, each, reference.airlight, airlight))
            )
        except InputError as error:
            split.append((each, reference.airlight, str(error)))
    return split


def _cause_table(title: str, split: Split) -> Table:
    from airlight.validation.study.causes import ErrorPart

    rows: list[Row] = []
    for each, _, found in split:
        if isinstance(found, str):
            rows.append(Row({"label": each.label}, reason=found))
            continue
        rows += [
            Row({**shown_values(part), "label": "" if at else each.label})
            for at, part in enumerate(found)
        ]
    how: dict[str, dict[str, Any]] = {
        "relative_rmse": FRACTION,
        "relative_bias": FRACTION,
        "fraction": {"percent": True, "places": 1},
    }
    columns = table_of(title, ErrorPart, (), how=how).columns
    return table(title, (*words(label="method"), *columns), rows)


def _draw_parts(split: list[Any], column: str) -> Any:
    """Return the image of each method, its error, and the parts that add up to it,
    on the scale of the page.
    """
    import numpy as np

    from airlight.reports.plotting.figure import new_figure, show_picture
    from airlight.reports.plotting.pictures import error_map, exposure, tone_mapped
    from airlight.reports.plotting.style import WIDTHS

    # A row for each method: the reference, its image, the whole error, then the parts.
    across = 2 + max(len(parts) for _, _, parts in split)
    wide, size = WIDTHS[column], 6 if column == "double" else 4.5
    height, width = split[0][1].shape[:2]
    figure = new_figure(wide, len(split) * (wide / across * height / width + 0.36))
    panels = figure.subplots(len(split), across, squeeze=False)
    for (label, given, parts), line in zip(split, panels):
        for panel in line:
            panel.set_axis_off()
        reference = np.asarray(given, dtype=np.float64)
        factor = exposure(reference)
        show_picture(line[0], tone_mapped(reference, factor), "reference", size)
        show_picture(
            line[1],
            tone_mapped(reference + parts[0].image, factor),
            label.replace(" (", "\n("),
            size,
        )
        for panel, part in zip(line[2:], parts):
            shown = (
                ""
                if part.fraction is None or part.cause == "whole"
                else f", {100 * part.fraction:.0f} %"
            )
            error = "dark" if part.relative_rmse is None else f"{part.relative_rmse:.1e}"
            title = f"{part.cause}\n{error}{shown}"
            show_picture(panel, error_map(reference, reference + part.image), title, size)
    return figure
