# SPDX-License-Identifier: BSD-3-Clause
"""`airlight render SCENE`: a frame or an animation by a real-time method, with what it costs."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import (
    USUAL_LIMIT,
    Changes,
    Force,
    GivenKernels,
    Meshes,
    MethodLimit,
    Ranges,
    Scene,
    Settings,
    Size,
    drawn_from,
    single,
)


def render(
    scene: Scene,
    method: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A method of `airlight list methods`, or your own as MODULE:FUNCTION or FILE.py:FUNCTION; "
            "ray-march by default.",
            show_default=False,
            autocompletion=completion.methods,
        ),
    ] = None,
    kernel: GivenKernels = None,
    settings: Settings = None,
    change: Changes = None,
    meshes: Meshes = None,
    ranges: Ranges = None,
    size: Size = None,
    precision: Annotated[
        str,
        typer.Option(metavar="NAME", help="single or double.", autocompletion=completion.one_of("single", "double")),
    ] = "single",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write the layers here, an .exr file.", show_default=False),
    ] = None,
    preview: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a picture here, a .png file, through the tone curve x (1 + x/w^2) / (1 + x).",
            show_default=False,
        ),
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="N",
            help="Camera rays a pixel, for pictures without stairs; a method's error is judged at pixel centres.",
        ),
    ] = 1,
    frames: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Render an animation of so many frames, as NAME-0001.exr and so on.",
            show_default=False,
        ),
    ] = None,
    animate: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT",
            help="What moves: light, objects, medium, colour, or several with commas; the scene's by default.",
            show_default=False,
        ),
    ] = None,
    force: Force = False,
    method_limit: MethodLimit = USUAL_LIMIT,
    plan: Annotated[bool, typer.Option("--plan", help="Print what the scene needs of a method, and stop.")] = False,
    time: Annotated[
        bool, typer.Option("--time", help="Also measure what a frame costs, some seconds; --json does so too.")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print times as JSON.")] = False,
) -> None:
    """Render a frame or an animation; print what a frame costs.

    An animation is one turn: lights circle, objects turn, the medium's density swings, colours go round. Each frame
    recomputes only what depends on the motion. Ctrl-C keeps the finished frames.

    Without --output and --preview no file is written.
    """
    from functools import partial

    from reports.commands.own_methods import checked_configuration
    from reports.machine.environment import activate
    from reports.machine.own_process import in_own_process
    from validation.scenes.changes import parse_changes
    from validation.scenes.loading import parse_size
    from validation.study.configuration import parse_settings

    name = single("--method", method) or "ray-march"
    own_kernel, given = single("--kernel", kernel), parse_settings(settings or [])
    chosen = checked_configuration(name, own_kernel, given, limit=method_limit)
    outputs = {"exr": output, "png": preview}
    _check_outputs(outputs, frames, animate)
    _check_samples(samples, outputs, frames)
    pixels = parse_size(size) if size else None
    changes = parse_changes(change or [])
    variant = activate()
    (scene,) = drawn_from([scene], meshes, ranges)
    call = partial(in_own_process, name=name, limit=method_limit) if chosen.own else _call
    if plan:
        _print_plan(call(_plan, scene, pixels, changes, precision, chosen), json=json)
    elif frames is None:
        rendered = call(_render, scene, pixels, changes, precision, chosen, outputs, samples, force, time or json)
        _print_times(rendered | {"device": variant}, json=json)
    else:
        rendered = call(_render_frames, scene, pixels, changes, precision, chosen, outputs, frames, animate, force)
        _print_frames(rendered | {"device": variant}, json=json)


def _call(function: Callable[..., dict[str, Any]], *arguments: Any) -> dict[str, Any]:
    return function(*arguments)


def _check_outputs(outputs: dict[str, Path | None], frames: int | None, animate: str | None) -> None:
    """Refuse outputs that cannot be written, before any work."""
    from analytic.errors import InputError
    from reference.storage.files import ensure_writable
    from reports.interchange.frames import check_ending, numbered

    if outputs["exr"] is not None:
        check_ending("--output", outputs["exr"], ".exr", instead="; --preview NAME.png writes a picture")
    if outputs["png"] is not None:
        check_ending("--preview", outputs["png"], ".png", instead="; --output NAME.exr writes the layers")
    if animate is not None and frames is None:
        raise InputError("--animate: got no number of frames; add --frames N")
    if frames is not None and not any(outputs.values()):
        raise InputError("--frames: got no place for the files; add --output NAME.exr or --preview NAME.png")
    for path in outputs.values():
        if path is not None:
            ensure_writable(path if frames is None else numbered(path, 1, frames))


def _check_samples(samples: int, outputs: dict[str, Path | None], frames: int | None) -> None:
    """Refuse several rays a pixel where nothing shows them."""
    from analytic.errors import InputError

    if samples > 1 and not any(outputs.values()):
        raise InputError("--samples: got no place for the picture; add --preview NAME.png or --output NAME.exr")
    if samples > 1 and frames is not None:
        raise InputError("--samples: got --frames too, wanted one of them: animations have one ray a pixel")


def _plan(name_or_path: str, pixels: tuple[int, int] | None, changes: dict, precision: str, chosen) -> dict[str, Any]:
    """Return what a scene needs of a method."""
    from realtime.methods.registry import find_method
    from realtime.methods.shadow_planes.method import prepare_shadow_planes
    from realtime.methods.shadow_planes.plane_counts import caster_plan, describe_casters
    from realtime.parameters import values
    from realtime.scene.features import describe
    from realtime.scene.light_points import with_light_points
    from realtime.scene.read_scene import read_scene
    from validation.scenes.loading import load_scene

    scene = read_scene(load_scene(name_or_path, pixels, changes).scene, precision)
    words, notes = describe(scene.features), list(scene.features.notes)
    method = find_method(chosen.method)
    if scene.area_lights:
        own = {name: value for name, value in chosen.parameters if name in values(method.light_points)}
        points = replace(method.light_points, **own)
        words["light points"] = f"{points.points} of each light with extent, {points.pattern}"
        scene = with_light_points(scene, 1, "ring")  # the casters as the middle of each sees them
    if method.prepare is prepare_shadow_planes:
        casters = caster_plan(scene)
        words |= describe_casters(casters)
        _warn(casters.warnings)
    return {"plan": words, "notes": notes}


def _print_plan(plan: dict[str, Any], *, json: bool) -> None:
    from reports.tables.terminal import print_json

    if json:
        print_json(plan)
    else:
        print("\n".join([f"{name}: {value}" for name, value in plan["plan"].items()] + plan["notes"]))


def _warn(warnings) -> None:
    """Print warnings about the casters on the error stream, once a command."""
    for warning in warnings:
        print(f"airlight: warning: {warning}", file=sys.stderr)


def _check_work(name: str, scene, chosen, frames: int | None = None, *, force: bool) -> None:
    from validation.study.configuration import rendered_lights
    from validation.study.cost import TIMED, check_work, frame_work, steps_of

    size = scene.camera.width, scene.camera.height
    marches = chosen.method == "ray-march" or "steps" in dict(chosen.parameters)
    steps = steps_of(chosen.parameters) if marches else 0
    work = frame_work(
        size, lights=rendered_lights(scene, chosen), steps=steps, frames=TIMED if frames is None else frames
    )
    check_work(f"render {name}, {size[0]} x {size[1]}, {chosen.label}", [work], force=force)


def _prepared(scene, chosen, *, extra_layers: bool = False):
    """Return the frame renderer; print the notes on the scene, and the warnings of its casters."""
    from realtime.methods.shadow_planes.method import PlanePreparation
    from reports.machine.printing import print_notes
    from validation.study.configuration import prepared

    print_notes(scene.features.notes)
    renderer = prepared(scene, chosen, extra_layers=extra_layers)
    stages = renderer.groups.of_point if renderer.groups is not None else renderer
    if stages is not None and isinstance(stages.prepare, PlanePreparation):
        _warn(stages.prepare.casters.warnings)
    return renderer


def _render(
    name_or_path: str,
    pixels: tuple[int, int] | None,
    changes: dict,
    precision: str,
    chosen,
    outputs: dict[str, Path | None],
    samples: int,
    force: bool,
    timed: bool,
) -> dict[str, Any]:
    """Render a frame, write it and return what it costs if that is asked for."""
    import drjit as dr

    from realtime.frame.samples import render_samples
    from realtime.methods.registry import find_method
    from realtime.scene.read_scene import read_scene
    from reports.interchange.frames import write_frame
    from reports.machine.progress import progress_bar
    from validation.scenes.loading import load_scene
    from validation.study.configuration import prepared
    from validation.study.cost import TIMED

    loaded = load_scene(name_or_path, pixels, changes)
    scene = read_scene(loaded.scene, precision)
    _check_work(loaded.name, scene, chosen, samples + (TIMED if timed else 0), force=force)
    layers = outputs["exr"] is not None and samples == 1 and bool(find_method(chosen.method).layers)
    renderer = _prepared(scene, chosen, extra_layers=layers)
    with progress_bar(f"{loaded.name}: {samples} rays a pixel") as progress:
        frame = render_samples(renderer, samples, lambda done: progress(done, "the picture"))
    curve = write_frame(loaded.name, chosen, frame, outputs=outputs, samples=samples)
    # The further layers of a method do not belong to what a frame costs.
    costs = _costs(prepared(scene, chosen) if layers else renderer) if timed else {}
    return {
        "scene": loaded.name,
        "method": chosen.label,
        "size": [scene.camera.width, scene.camera.height],
        **costs,
        "threads": dr.thread_count(),
        "samples": samples,
        "tone_curve": curve and curve.words,
        "files": [str(path) for path in outputs.values() if path is not None],
    }


def _costs(renderer) -> dict[str, Any]:
    """Return what frames cost, after nothing changed and after something did."""
    from validation.study.frame_times import time_frame

    times = time_frame(renderer).medians
    stages = [{"name": name, "ms": times.pop(name)} for name in ("surface", "airlight")]
    return {f"{name}_ms": time for name, time in times.items()} | {"fps": 1000 / times["frame"], "stages": stages}


def _render_frames(
    name_or_path: str,
    pixels: tuple[int, int] | None,
    changes: dict,
    precision: str,
    chosen,
    outputs: dict[str, Path | None],
    frames: int,
    animate: str | None,
    force: bool,
) -> dict[str, Any]:
    """Render the frames of an animation, write them and return what they cost."""
    from dataclasses import replace

    from realtime.methods.registry import find_method
    from realtime.scene.read_scene import read_scene
    from reports.interchange.frames import write_frames
    from reports.machine.progress import progress_bar
    from validation.scenes.animation import parse_moves
    from validation.scenes.loading import load_scene

    loaded = load_scene(name_or_path, pixels, changes)
    scene = read_scene(loaded.scene, precision)
    animation = loaded.animation
    if animate is not None:
        animation = replace(animation, moves=parse_moves(animate))
    _check_work(loaded.name, scene, chosen, frames, force=force)
    layered = outputs["exr"] is not None and bool(find_method(chosen.method).layers)
    renderer = _prepared(scene, chosen, extra_layers=layered)
    with progress_bar(f"{loaded.name}: {frames} frames") as progress:
        written = write_frames(
            loaded.name, renderer, chosen, animation, frames=frames, outputs=outputs, progress=progress
        )
    size = [scene.camera.width, scene.camera.height]
    return {"scene": loaded.name, "method": chosen.label, "size": size} | written


def _print_times(times: dict[str, Any], *, json: bool) -> None:
    from reports.tables.methods import rate_words
    from reports.tables.terminal import print_json

    if json:
        print_json(times)
        return
    name = f"{times['scene']}, {times['method']}"
    if "frame_ms" in times:
        stages = ", ".join(f"{stage['name']} {stage['ms']:.3g} ms" for stage in times["stages"])
        print(f"{name}: {times['frame_ms']:.3g} ms a frame ({rate_words(times['frame_ms'])})")
        print(f"  {stages}")
        moved, objects = times["light_moved_ms"], times["objects_moved_ms"]
        print(f"  {moved:.3g} ms after the light moved, {objects:.3g} ms after objects moved")
        print(f"  camera rays kept: {times['light_moved_camera_kept_ms']:.3g} ms after the light moved,")
        print(f"    {times['colours_changed_ms']:.3g} ms after only medium or colours changed")
        print(f"  {times['device']}, {times['threads']} threads")
    else:
        print(f"{name}; --time measures what a frame costs")
    if times["tone_curve"]:
        print(f"  picture: {times['tone_curve']}")
    if times["samples"] > 1:
        print(f"  {times['samples']} rays a pixel: for looking at; a method's error is judged at pixel centres")
    size = " x ".join(map(str, times["size"]))
    for path in times["files"]:
        what = "airlight, surface, their sum, depth" if path.lower().endswith(".exr") else "a picture"
        print(f"wrote {path}: {what}, {size} pixels")
    if not times["files"]:
        print("nothing written: --preview NAME.png writes a picture, --output NAME.exr the layers")


def _print_frames(written: dict[str, Any], *, json: bool) -> None:
    from reports.tables.methods import rate_words
    from reports.tables.terminal import print_json

    if json:
        print_json(written)
        return
    move, rendered, moves = written["move_ms"], written["render_ms"], " and ".join(written["moves"])
    print(f"{written['scene']}, {written['method']}: {written['frames']} frames, {moves} moving")
    print(
        f"  {written['frame_ms']:.3g} ms a frame ({rate_words(written['frame_ms'])}): {move:.3g} ms to move, "
        f"{rendered:.3g} ms to render, keeping what stood still; {written['device']}"
    )
    size = " x ".join(map(str, written["size"]))
    for ending in dict.fromkeys(Path(path).suffix for path in written["files"]):
        files = [path for path in written["files"] if path.endswith(ending)]
        print(f"wrote {files[0]} to {files[-1]}: {len(files)} files, {size} pixels")
