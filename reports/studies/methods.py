# SPDX-License-Identifier: BSD-3-Clause
"""Studies of methods: times and errors, errors by cause, growth with the work, the size of the shadow map."""

import math
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reports.api.inputs import (
    File,
    KernelLike,
    Kernels,
    MethodLike,
    Methods,
    Progress,
    Scenes,
    Size,
    Values,
    Words,
    kernel_name,
    listed,
    note,
    one_error,
    pixels_of,
    several,
    telling,
)
from reports.machine.own_process import LIMIT
from reports.machine.progress import counted, part_of
from reports.studies.result import Study, with_environment
from reports.tables.table import Row, Table, Value, number, numbers, table, words

_BATCHES = 4096  # at most: a comparison ends earlier if its interval is narrow enough
_SHARE = {"digits": 2, "share": True}


def _scenes(scenes: Any, size: Any) -> list[Any]:
    """Return the scenes, loaded; those for fog by default. What cannot be used is refused before the work."""
    from reports.api.scenes import opened
    from validation.scenes.registry import FOG_SCENES

    return [opened(each, size) for each in several(scenes) or FOG_SCENES]


class MethodsStudy(Study):
    """Speed against error: a row for each configuration in each scene.

    A row has `scene`, `width`, `height`, `label`, `method`, `kernel`; medians `frame_ms` with its quartiles
    `frame_low_ms` and `frame_high_ms`, `airlight_ms`, `surface_ms`, `light_moved_ms`, `objects_moved_ms`
    (after these moved), `light_moved_camera_kept_ms` (after the light moved, camera rays cached), `colours_changed_ms`
    (after only medium or colours changed) [ms]; of the airlight `relative_rmse`, `relative_bias`, `p50`, `p99`, `max`,
    `nonfinite` and `negative`; `flip`; `refused`, why the method cannot render the scene, and `note`. Missing values
    are None.
    """

    def fastest(self, error: float, scene: str | None = None) -> Mapping[str, Any] | None:
        """Return the row of the fastest frame whose relative RMSE is at most `error`; None where there is none.

        Parameters
        ----------
        error
            Relative RMSE of the airlight, such as 0.01.
        scene
            Its name; all scenes by default.
        """
        fit = [row for row in self.rows if scene in (None, row["scene"]) and _reaches(row, error)]
        return min(fit, key=lambda row: row["frame_ms"], default=None)


def _reaches(row: Mapping[str, Any], error: float) -> bool:
    known = row["frame_ms"] is not None and row["relative_rmse"] is not None
    return known and row["relative_rmse"] <= error and not row["nonfinite"]


@one_error
def methods(
    scenes: Scenes = (),
    *,
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    size: Size | None = None,
    seconds: float = 0.6,
    flip: bool = False,
    margin: float | None = None,
    method_limit: float = LIMIT,
    force: bool = False,
    progress: Progress = None,
) -> MethodsStudy:
    """Time methods and measure their errors.

    Every method is timed in every scene and compared with the reference. `airlight` is the airlight alone (the kernel
    with its ray set-up), `frame` a frame with static geometry and light, `light moved` a frame after the light moved.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files; all built-in scenes for fog by default.
    method
        A method of `airlight list methods`, a user method as MODULE:FUNCTION or FILE.py:FUNCTION, or 'all', the
        default; may be given several times. A name stands for its standard configurations.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter of each method that `--method` names; may be given several times.
    size
        Width and height [pixels], or WxH; the scene's own by default.
    seconds
        Time to spend on each timing, of which every configuration has five [s].
    flip
        Also compute HDR-FLIP of all light.
    margin
        Also compare the reference with single-scatter (within 0.05 %) and volpath, whose relative bias must be shown to
        be within this; the time grows like 1/margin^2. Exit status 1 if they do not confirm it.
    method_limit
        A user method that is named is stopped after so long in a scene [s].
    force
        Start also what will take more than an hour, or more memory than there is.
    progress
        Called with (fraction done, what); True shows a bar.

    Examples
    --------
    >>> import airlight
    >>> found = airlight.study("methods", "open-fog", method="unshadowed", size=(32, 24), seconds=0.01)
    >>> [row["label"] for row in found]
    ['unshadowed (taylor)', 'unshadowed (quadrature)', 'unshadowed (exact)']
    >>> found.fastest(1e-3)["relative_rmse"] < 1e-3
    True
    """
    from reports.machine.environment import activate

    if margin is not None and not 0 < margin < 1:
        raise InputError(f"margin: got {margin:g}, wanted a fraction between 0 and 1, such as 0.002 for 0.2 %")
    activate()
    from reports.api.render import asked_configurations
    from reports.data.own_faults import own_faults
    from reports.tables.agreement import agreement_table
    from reports.tables.methods import methods_table

    chosen, apart = asked_configurations(method, kernel, settings, limit=method_limit)
    loaded = _scenes(scenes, size)
    _check_work("methods", loaded, chosen, force=force, progress=progress)
    benched, rows = [], []
    with telling(progress, "methods") as tell:
        for at, scene in enumerate(loaded):
            step = part_of(tell, at / len(loaded), (at + 1) / len(loaded))
            how: dict[str, Any] = {
                "seconds": seconds,
                "flip": flip,
                "limit": method_limit if apart else None,
                "margin": margin,
            }
            data, of_scene = _methods_in(scene, chosen, progress=step, **how)
            benched.append(data)
            rows += of_scene
    tables = [methods_table("{}, {} x {}".format(each["name"], *each["size"]), each["methods"]) for each in benched]
    compared = [(f"{each['name']}, {one['layer']}", one) for each in benched for one in each["agreement"].values()]
    if compared:
        title = "Monte Carlo against the quadrature reference; volpath corrected for its shadow-ray epsilon"
        tables.append(agreement_table(title, compared))
    return MethodsStudy(
        name="methods",
        data=with_environment(scenes=benched),
        drawn=tuple(tables),
        rows=tuple(rows),
        wrong=tuple(own_faults({"scenes": benched})),
        good=all(one["statistics"]["equivalent"] for _, one in compared),
    )


def _check_work(what: str, loaded: list[Any], chosen: list[Any], *, force: bool, progress: Any) -> None:
    from realtime.scene.read_scene import read_scene
    from validation.study.configuration import rendered_lights
    from validation.study.cost import check_work, frame_work, steps_of, truth_work

    works = []
    for each in loaded:
        scene = read_scene(each.scene)
        note(progress, scene.features.notes)
        at = scene.camera.width, scene.camera.height
        works.append(truth_work(at, lights=len(scene.lights) + len(scene.area_lights)))
        for one in chosen:
            steps = steps_of(one.parameters) if one.method == "ray-march" else 0
            works.append(frame_work(at, lights=rendered_lights(scene, one), steps=steps))
    check_work(what, works, force=force)


def _methods_in(
    loaded: Any,
    chosen: list[Any],
    *,
    seconds: float,
    flip: bool,
    margin: float | None,
    limit: float | None,
    progress: Any,
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return what was measured in a scene, as in report.json, and as flat rows."""
    from realtime.scene.read_scene import read_scene
    from reports.machine.own_process import in_own_process
    from reports.report.scene import row_entry
    from validation.estimates.agreement import agreements
    from validation.estimates.quadrature import truth_image
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene
    from validation.study.reference import of_image
    from validation.study.run import run
    from validation.study.scene import configurations_for
    from validation.study.study import Cell, Measure, standard_study

    done = 1.0 if margin is None else 0.6
    progress(0.0, f"{loaded.name}: the reference")
    scene, reference = read_scene(loaded.scene), of_image(truth_image(loaded.scene))
    size, path = (scene.camera.width, scene.camera.height), str(loaded.path or loaded.name)
    wanted = Measure("stages", seconds, flip=flip, every_metric=False)
    apart = None if limit is None else partial(in_own_process, limit=limit)
    entries, rows = [], []
    useful = configurations_for(scene.features, chosen)
    for at, each in enumerate(useful):
        progress(done * at / len(useful), f"{loaded.name}: {each.label}")
        row, _ = run(Cell(path, size, (), each, wanted), scene, reference, apart=apart)
        entries.append(row_entry(plain(row)))
        rows.append({**_flat(row, each), "scene": loaded.name})
    agreed = {}
    if margin is not None:
        margins = {**standard_study("default").checks.margins, "volpath": margin}
        small = load_scene(path, (160, 120)).scene
        agreed = plain(agreements(small, margins, batches=_BATCHES, progress=part_of(progress, done, 1.0)))
    return {"name": loaded.name, "size": list(size), "methods": entries, "agreement": agreed}, rows


def _flat(row: Any, chosen: Any) -> dict[str, Any]:
    """Return the numbers of a row, see `MethodsStudy`."""
    from dataclasses import fields

    from validation.metrics.errors import plain
    from validation.study.frame_times import FrameTimes

    times, error = row.times, row.error
    flat: dict[str, Any] = {name: getattr(row, name) for name in ("scene", "width", "height", "label", "method")}
    flat |= {"kernel": row.kernel, "parameters": dict(chosen.parameters)}
    flat |= {"frame_low_ms": times and times.frame.low_ms, "frame_high_ms": times and times.frame.high_ms}
    medians = times.medians if times else {}
    flat |= {f"{each.name}_ms": medians.get(each.name) for each in fields(FrameTimes)}
    for name in ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative"):
        flat[name] = error and plain(getattr(error, name))
    return flat | {"flip": row.flip and row.flip.value, "refused": row.reason, "note": row.note}


# Errors by cause

_BY_CAUSE = (
    *words(label="method", cause="error by", without="gone with"),
    *numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", how=_SHARE),
    *numbers(share="fraction of the whole", how={"percent": True, "places": 1}),
)
#: What is split by default: the methods and their parameters.
_SPLIT: tuple[tuple[str, dict[str, Any]], ...] = (
    ("ray-march", {"steps": 16, "shadow": "map"}),
    ("min-max", {}),
    ("froxel-fog", {}),
)


@one_error
def decomposition(
    scenes: Scenes = ("colonnade",),
    *,
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    size: Size | None = (240, 180),
    method_limit: float = LIMIT,
    force: bool = False,
    progress: Progress = None,
) -> Study:
    """Split the error of methods by its causes.

    The parts add up to the error: they are differences of renders in which one cause after the other is gone. The
    figure shows image, error and parts of the first scene.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files.
    method
        As of `airlight study methods`; a ray march by a map, min-max and froxel-fog by default.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter of each method that `--method` names; may be given several times.
    size
        Width and height [pixels], or WxH.
    method_limit
        A user method that is named is stopped after so long in a scene [s].
    force
        Start also what will take more than an hour, or more memory than there is.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from reports.machine.environment import activate

    activate()
    from reports.api.render import asked_configurations
    from validation.study.configuration import configuration

    usual = [configuration(name, parameters=values) for name, values in _SPLIT]
    chosen, apart = asked_configurations(method, kernel, settings, usual=usual, limit=method_limit)
    loaded = _scenes(scenes, size)
    _check_work("decomposition", loaded, chosen, force=force, progress=progress)
    data, tables, rows, drawn = [], [], [], []
    with telling(progress, "decomposition") as tell:
        for at, scene in enumerate(loaded):
            step = part_of(tell, at / len(loaded), (at + 1) / len(loaded))
            entries, split = _split(scene, chosen, limit=method_limit if apart else None, progress=step)
            width, height = scene.size
            data.append({"name": scene.name, "size": [width, height], "methods": entries})
            tables.append(_cause_table(f"{scene.name}, {width} x {height}: error of the airlight by cause", entries))
            rows += [
                {"scene": scene.name, "label": entry["label"], **part}
                for entry in entries
                if not entry["refused"]
                for part in (entry["whole"], *entry["parts"])
            ]
            drawn.append(split)
    return Study(
        name="decomposition",
        data=with_environment(scenes=data),
        drawn=tuple(tables),
        rows=tuple(rows),
        draw=partial(_draw_parts, drawn[0]) if drawn and drawn[0] else None,
    )


def _split(loaded: Any, chosen: list[Any], *, limit: float | None, progress: Any) -> tuple[list[dict[str, Any]], Any]:
    """Return the errors of a scene by cause, JSON-ready and with their images."""
    from realtime.errors import InputError as MethodError
    from realtime.scene.read_scene import read_scene
    from reports.machine.own_process import in_own_process
    from validation.estimates.quadrature import truth_image
    from validation.metrics.errors import plain
    from validation.study.decompose import decompose, exact_sum, part_numbers
    from validation.study.run import frame_of
    from validation.study.scene import configurations_for
    from validation.study.study import Cell

    scene = read_scene(loaded.scene)
    progress(0.0, f"{loaded.name}: the reference")
    truth = truth_image(loaded.scene).airlight
    exact = cache(partial(exact_sum, scene))
    entries, split = [], []
    useful = configurations_for(scene.features, chosen)
    for at, each in enumerate(useful):
        progress((1 + at) / (1 + len(useful)), f"{loaded.name}: {each.label}")

        def own(configuration: Any, each: Any = each) -> Any:
            cell = Cell(str(loaded.path or loaded.name), loaded.size, (), configuration)
            if limit is None:
                return frame_of(cell).airlight
            return in_own_process(frame_of, cell, name=each.method, limit=limit).airlight

        entry: dict[str, Any] = {"label": each.label, "method": each.method, "kernel": each.kernel}
        entry |= {"parameters": dict(each.parameters)}
        try:
            found = decompose(scene, each, truth, render=own, exact=exact)
        except MethodError as error:
            entries.append(entry | {"refused": str(error)})
            continue
        split.append(found)
        parts = [plain(part_numbers(part)) for part in (found.whole, *found.parts)]
        entries.append(entry | {"refused": None, "whole": parts[0], "parts": parts[1:]})
    return entries, split


def _cause_table(title: str, methods: list[dict[str, Any]]) -> Table:
    rows: list[Row] = []
    for entry in methods:
        if entry["refused"]:
            rows.append(Row({"label": entry["label"]}, reason=entry["refused"]))
            continue
        for at, part in enumerate((entry["whole"], *entry["parts"])):
            values: dict[str, Value] = {column.key: part.get(column.key) for column in _BY_CAUSE}
            rows.append(Row(values | {"label": "" if at else entry["label"]}))
    return table(title, _BY_CAUSE, rows)


def _draw_parts(split: list[Any], column: str) -> Any:
    """Return the image of each method, its error, and the parts that add up to it, on the scale of the page."""
    import numpy as np

    from reports.plotting.figure import new_figure, show_picture
    from reports.plotting.pictures import error_map, exposure, tone_mapped
    from reports.plotting.style import WIDTHS

    across = 3 + max(len(each.parts) for each in split)
    wide, size = WIDTHS[column], 6 if column == "double" else 4.5
    height, width = split[0].truth.shape[:2]
    figure = new_figure(wide, len(split) * (wide / across * height / width + 0.36))
    panels = figure.subplots(len(split), across, squeeze=False)
    for each, line in zip(split, panels):
        for panel in line:
            panel.set_axis_off()
        truth, image = (np.asarray(values, dtype=np.float64) for values in (each.truth, each.image))
        factor = exposure(truth)
        show_picture(line[0], tone_mapped(truth, factor), "reference", size)
        show_picture(line[1], tone_mapped(image, factor), each.configuration.label.replace(" (", "\n("), size)
        for panel, part in zip(line[2:], (each.whole, *each.parts)):
            fraction = "" if math.isnan(part.share) or part.cause == "whole" else f", {100 * part.share:.0f} %"
            title = f"{part.cause}\n{part.relative_rmse:.1e}{fraction}"
            show_picture(panel, error_map(truth, truth + part.image), title, size)
    return figure


# Growth with the work

_KEPT = Path(__file__).resolve().parents[2] / "validation/baselines/scaling"  # what `study scaling --json` printed
_EARLIER = "what `study scaling --json` printed, or a report.json of `report --full`"


@one_error
def scaling(
    scenes: Scenes = ("colonnade",),
    *,
    kinds: Words = "size,triangles,lights,map",
    method: Methods = (),
    kernel: Kernels = (),
    settings: Values = (),
    size: Size = (800, 600),
    against: File | None = None,
    method_limit: float = LIMIT,
    progress: Progress = None,
) -> Study:
    """Time methods as their work grows.

    Returns times, memory and exponents by pixels, triangles, lights, bounded media or texels of the map. Exit status 1
    if a time jumps, or grows with a higher power of the work than before.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files.
    kinds
        Some of size,triangles,lights,media,map.
    method
        As of `airlight study methods`; one configuration of each method with shadows by default.
    kernel
        Airlight kernel of the methods; may be given several times.
    settings
        NAME=VALUE, a parameter of each method that `--method` names; may be given several times.
    size
        Width and height [pixels], or WxH.
    against
        What this study printed before as JSON, to compare with; the baseline of the scene by default.
    method_limit
        A user method that is named is stopped after so long [s].
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from validation.study.ladders import KINDS, ladder

    wanted = listed("kinds", kinds)
    for kind in wanted:
        if kind not in KINDS:
            raise InputError(f"kinds: got {kind!r}, wanted some of {','.join(KINDS)}")
    names = [str(name) for name in several(scenes)]
    earlier = _earlier(None if against is None else Path(against), names)
    from reports.machine.environment import activate

    activate()
    from reports.api.render import asked_configurations
    from reports.report.others import scaling_data
    from reports.tables.scaling import cliffs, grown, scaling_tables
    from validation.study.growth import METHODS, study_scaling

    chosen, _ = asked_configurations(method, kernel, settings, usual=METHODS, limit=method_limit)
    pixels = pixels_of(size)
    assert pixels is not None
    # Scenes that have nothing of a kind are refused before an hour of work, not after.
    ladders = [(name, kind, ladder(kind, name, pixels)) for name in names for kind in wanted]
    records: list[dict[str, Any]] = []
    with telling(progress, "scaling") as tell:
        for at, (name, kind, steps) in enumerate(ladders):
            part = part_of(tell, at / len(ladders), (at + 1) / len(ladders))
            found = study_scaling(kind, steps, chosen, progress=counted(part))
            records += [scaling_data(name, pixels, each) for each in found]
    return Study(
        name="scaling",
        data=with_environment(scaling=records),
        drawn=tuple(scaling_tables(records)),
        wrong=(*cliffs(records), *grown(earlier, records)),
        draw=partial(_draw_scaling, records),
    )


def _earlier(against: Path | None, names: list[str]) -> list[dict[str, Any]]:
    """Return the records of an earlier run: of the file that the user names, or the baselines of built-in scenes.

    A baseline is what `airlight study scaling SCENE --json` printed once.
    """
    from reports.data.json_files import read_json
    from reports.tables.scaling import is_record

    kept = [_KEPT / f"{name}.json" for name in names]
    files = [path for path in kept if path.is_file()] if against is None else [against]
    records = []
    for path in files:
        data = read_json(path, _EARLIER)
        found = data.get("scaling") if isinstance(data, dict) else None
        if not isinstance(found, list) or not found or not all(map(is_record, found)):
            raise InputError(f"{path}: it holds no `scaling`; wanted {_EARLIER}")
        records += found
    return records


def _draw_scaling(records: list[dict[str, Any]], column: str) -> Any:
    """Return the time of a frame over its work, by kind of work, with the fitted exponents and the camera rays."""
    from reports.plotting.figure import new_figure
    from reports.plotting.style import WIDTHS, method_style
    from reports.tables.scaling import WORK

    kinds = list(dict.fromkeys(record["kind"] for record in records))
    width, double = WIDTHS[column], column == "double"
    across = min(len(kinds), 2 if double else 1)
    down = -(-len(kinds) // across)
    figure = new_figure(width, (0.42 if double else 0.9) * width * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, kind in zip(panels, kinds):
        costs: list[Any] = []
        for record in (each for each in records if each["kind"] == kind):
            costs = record["costs"]
            label = f"{record['label']}: power {record['growth']['frame']['exponent'] or math.nan:.2f}"
            times = [cost["frame"]["median_ms"] for cost in costs]
            panel.plot([cost["work"] for cost in costs], times, label=label, **method_style(record["label"].split()[0]))
        rays = [cost["rays"]["median_ms"] for cost in costs]
        panel.plot([cost["work"] for cost in costs], rays, color="0.6", linestyle=":", label="camera rays")
        panel.set(xscale="log", yscale="log", xlabel=f"{WORK[kind]} [1]", ylabel="time of a frame [ms]")
        panel.legend(loc="best")
    for panel in panels[len(kinds) :]:
        panel.remove()
    figure.suptitle(", ".join(dict.fromkeys(record["scene"] for record in records)))
    return figure


# The size of the shadow map

_SHARES = numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", p50="", p99="", max="", how=_SHARE)
_FLICKER = (
    *numbers("map"),
    *numbers(texels="texels a frame", how={"digits": 2}),
    *numbers("flicker", relative_rmse="rel. RMSE", how=_SHARE),
)


@one_error
def map_size(
    scenes: Scenes = (),
    *,
    method: MethodLike = "light-volumes",
    kernel: KernelLike | None = None,
    settings: Values = (),
    sizes: Words = "32,64,128,256,512,1024,2048,4096",
    size: Size = (160, 120),
    flicker: bool = False,
    frames: int = 9,
    step: float = 1e-3,
    method_limit: float = LIMIT,
    force: bool = False,
    progress: Progress = None,
) -> Study:
    """Measure error and flicker against the size of the shadow map.

    Also returns the slope of the relative RMSE, fitted to the logarithms. With `--flicker` the light circles slowly,
    and the change of the image from frame to frame is measured, less that of the reference.

    Parameters
    ----------
    scenes
        Built-in scenes, random:SEED and Mitsuba XML files; all built-in scenes for fog by default.
    method
        A method with a shadow map.
    kernel
        Airlight kernel of the method.
    settings
        NAME=VALUE, a parameter of the method; may be given several times. Errors of other causes must be well below
        that of the largest map.
    sizes
        Of the shadow map [texels], with commas.
    size
        Width and height of the image [pixels], or WxH.
    flicker
        Also move the light and measure how it flickers.
    frames
        Of the moving light, at least 2.
    step
        By how much the light turns from frame to frame [rad].
    method_limit
        A user method that is named is stopped after so long [s].
    force
        Start also what will take more than an hour, or more memory than there is.
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
    pixels, name = pixels_of(size), kernel_name(kernel)
    from reports.api.render import checked_configuration

    largest, apart = checked_configuration(method, kernel, parameters | {"map": texels[-1]}, limit=method_limit)
    activate()
    moves = {"frames": frames, "step": step} if flicker else None
    call: Any = _map_study
    if apart:
        from reports.machine.own_process import in_own_process

        call = partial(in_own_process, _map_study, name=largest.method, limit=method_limit)
        progress = progress is True
    from validation.scenes.registry import FOG_SCENES

    names = several(scenes) or list(FOG_SCENES)
    studied = call(names, pixels, texels, method, name, parameters, moves, force, progress)
    return _map_result(studied, pixels)


def _map_study(
    names: list[Any],
    pixels: Any,
    texels: list[int],
    method: Any,
    kernel: str | None,
    parameters: dict[str, Any],
    moves: dict[str, Any] | None,
    force: bool,
    progress: Progress,
) -> list[tuple[str, Any, Any]]:
    """Return of every scene its name, the errors, and the flicker where the light moves."""
    from realtime.scene.read_scene import read_scene
    from reports.api.scenes import opened
    from validation.study.configuration import configuration, prepared
    from validation.study.cost import check_work, frame_work, truth_work
    from validation.study.maps import map_errors, map_flicker

    loaded = [opened(name, pixels) for name in names]
    images = 1 + (moves["frames"] if moves else 0)
    works = [truth_work(pixels, lights=len(each.scene.emitters()), images=images) for each in loaded]
    works += [frame_work(pixels, frames=images * len(texels)) for _ in loaded]
    check_work(f"map-size, {pixels[0]} x {pixels[1]}", works, force=force)
    largest = configuration(method, kernel, parameters | {"map": texels[-1]})
    for each in loaded:  # refuse unusable scenes, and maps that exceed the memory, before any work
        prepared(read_scene(each.scene), largest)
    studied = []
    with telling(progress, "map-size") as tell:
        for at, each in enumerate(loaded):
            part = counted(part_of(tell, at / len(loaded), (at + 1) / len(loaded), before=f"{each.name}, "))
            how: dict[str, Any] = {"kernel": kernel, "parameters": parameters, "sizes": texels, "progress": part}
            errors = map_errors(each.scene, method, **how)
            about = each.animation.about
            moving = map_flicker(each.scene, method, about=about, **how, **moves) if moves else None
            studied.append((each.name, errors, moving))
    return studied


def _map_result(studied: list[tuple[str, Any, Any]], pixels: Any) -> Study:
    from validation.metrics.errors import plain

    tables, said, rows, data = [], [], [], []
    for name, errors, moving in studied:
        label = errors.configuration.label
        title = f"{name}, {pixels[0]} x {pixels[1]}, {label}"
        of_scene = [{"map": size, **vars(metrics)} for size, metrics in zip(errors.sizes, errors.metrics, strict=True)]
        rows += [{"scene": name, "label": label, **row} for row in of_scene]
        tables.append(table(f"{title}: error", (*numbers("map"), *_SHARES), of_scene))
        said.append(f"{name}: the relative RMSE {_trend(errors.slope)}.")
        if moving is not None:
            columns = (moving.sizes, moving.texels, moving.flicker, moving.errors)
            tables.append(table(f"{title}: flicker of a moving light", _FLICKER, zip(*columns, strict=True)))
            change = number(moving.truth_change, 2)
            said.append(f"{name}: the flicker {_trend(moving.slope)}; the reference itself changes by {change}.")
        data.append({"name": name, "method": label, "errors": plain(errors), "flicker": plain(moving)})
    return Study(
        name="map-size",
        data=with_environment(size=list(pixels), scenes=data),
        drawn=tuple(tables),
        said=tuple(said),
        rows=tuple(rows),
        draw=partial(_draw_maps, studied),
    )


def _trend(slope: Any) -> str:
    """Return how errors change with the size of the map, as the predicate of a sentence."""
    if math.isnan(slope.order):
        return "follows no law: too few errors above 0"
    spread = "" if math.isnan(slope.standard_error) else f" +- {slope.standard_error:.1g}"
    if abs(slope.order) < 0.01:
        return "does not depend on the size"
    if slope.order < 0:
        return f"does not fall: it grows as size^{-slope.order:.2f}{spread}"
    return f"falls as size^-{slope.order:.2f}{spread}"


def _draw_maps(studied: list[tuple[str, Any, Any]], column: str) -> Any:
    """Return the error over the size of the map, a line for each scene, with the fitted slope."""
    import numpy as np

    from reports.plotting.figure import name_sizes, new_figure
    from reports.plotting.style import WIDTHS, scene_styles

    width = WIDTHS[column]
    figure = new_figure(width, 0.45 * width if column == "double" else 1.05 * width)
    panel = figure.subplots()
    for (name, errors, _), style in zip(studied, scene_styles()):
        sizes, values, order = np.array(errors.sizes), np.array(errors.errors), errors.slope.order
        label = f"{name}: order {order:.2f} ± {errors.slope.standard_error:.2f}"
        panel.plot(sizes, values, linestyle="none", label=label, **style)
        if np.isfinite(order):
            level = np.exp(np.mean(np.log(values[values > 0]) + order * np.log(sizes[values > 0])))
            panel.plot(sizes, level * sizes**-order, color=style["color"])
    panel.set(xscale="log", yscale="log", title=studied[0][1].configuration.label)
    panel.set(xlabel="side of the shadow map [texels]", ylabel="relative RMSE of the airlight [1]")
    name_sizes(panel, studied[0][1].sizes)
    panel.legend(loc="best")
    return figure
