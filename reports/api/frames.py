# SPDX-License-Identifier: BSD-3-Clause
"""The work of `airlight.render`: a frame, an animation, and what a scene needs.

These functions take what was asked for as one record, so that they can run in another process.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.reports.api.inputs import Progress, exclude, note, telling

if TYPE_CHECKING:
    from airlight.reports.api.results import Plan, RenderedFrames, Rendering
    from airlight.validation.study.configuration import Configuration

_STAGES = ("surface", "shade", "render")  # the recorded functions of a frame


@dataclass(frozen=True)
class Asked:
    """A scene to render and its configuration."""

    scene: Any
    pixels: tuple[int, int] | None
    changes: Mapping[str, tuple[float, ...]]
    precision: str
    chosen: "Configuration"
    run: int
    frame: int

    @property
    def random(self) -> dict[str, int | None]:
        """The numbers that decide the random numbers of a frame, None for 0."""
        return {"run": self.run or None, "frame": self.frame or None}

    def read(self) -> tuple[Any, Any]:
        """Return the scene, loaded, and as methods read it."""
        from airlight.realtime.scene.read_scene import read_scene
        from airlight.reports.api.scenes import opened

        loaded = opened(self.scene, self.pixels, self.changes)
        return loaded, read_scene(loaded.scene, self.precision)


def plan_of(asked: Asked) -> "Plan":
    """Return the features that a scene needs."""
    from airlight.realtime.scene.read_scene import describe
    from airlight.reports.api.results import Plan

    loaded, read = asked.read()
    return Plan(scene=loaded.name, plan=describe(read), notes=tuple(read.features.notes))


def rendered_frame(asked: Asked, samples: int, timed: bool, progress: Progress) -> "Rendering":
    """Render a frame, and time it where that is asked for."""
    import drjit as dr

    from airlight.realtime.frame.samples import render_samples
    from airlight.realtime.scene.read_scene import describe
    from airlight.reports.api.results import Rendering, sealed
    from airlight.reports.machine.environment import activate
    from airlight.validation.study.configuration import prepared
    from airlight.validation.study.cost import TIMED
    from airlight.validation.study.run import layered_frame
    from airlight.validation.study.turns import time_alone

    # `_ready` estimates the work of all frames of this command, frames of the timing included.
    variant, chosen = activate(), asked.chosen
    loaded, read, renderer, layered = _ready(
        asked, samples + (TIMED if timed else 0), samples == 1, progress
    )
    # Warnings belong before the work, the bar after them.
    warnings = _warnings(renderer)
    with telling(progress, f"{loaded.name}: {samples} rays a pixel") as tell:
        frame = render_samples(renderer, samples, lambda done: tell(done, "the picture"))
    image = layered_frame(loaded.name, chosen, frame)
    # The header of the file says what a pixel is and which numbers repeat the noise.
    attributes = {"airlight:pixel": "area", "airlight:samples": str(samples)} if samples > 1 else {}
    if renderer.method.noisy:
        attributes |= {"airlight:run": str(asked.run), "airlight:frame": str(asked.frame)}
    image = replace(image, attributes=dict(image.attributes) | attributes)
    times, device = None, f"{variant}, {dr.thread_count()} threads"
    if timed:  # the further layers of a method do not belong to what a frame costs
        cost = time_alone(prepared(read, chosen) if layered else renderer)
        times, device = cost.times, cost.device or device
    # The record holds what a caller needs to render the frame again, besides the image.
    return Rendering(
        scene=loaded.name,
        image=sealed(image),
        method=chosen.method,
        kernel=chosen.kernel,
        parameters=dict(chosen.parameters),
        label=chosen.label,
        precision=asked.precision,
        plan=describe(read),
        notes=(*read.features.notes, *warnings),
        times=times,
        samples=samples,
        device=device,
    )


def rendered_animation(
    asked: Asked, files: list[Path], frames: int, moves: str | None, progress: Progress
) -> "RenderedFrames":
    """Render the frames of an animation and write each as soon as it is done."""
    import numpy as np

    from airlight.analytic.clock import stopwatch
    from airlight.reports.api.results import RenderedFrames, write_image
    from airlight.reports.machine.environment import activate
    from airlight.reports.plotting.pictures import tone_curve
    from airlight.validation.scenes.animation import (
        animate,
        frame_changes,
        frame_objects,
        moved_parts,
        parse_moves,
    )
    from airlight.validation.study.frame_times import timed_image
    from airlight.validation.study.run import layered_frame

    variant, chosen = activate(), asked.chosen
    # --animate replaces the motion that the scene names.
    moved_by = None if moves is None else parse_moves(moves)
    # A picture has no room for further layers, an EXR file has.
    layers = any(path.suffix.lower() == ".exr" for path in files)
    loaded, read, renderer, _ = _ready(asked, frames, layers, progress)
    animation = loaded.animation if moved_by is None else replace(loaded.animation, moves=moved_by)
    _warnings(renderer)
    for path in files:
        _remove_older(path, frames)
    # Per frame: milliseconds to move the scene and to render it, and the changes that NAME.json
    # repeats.
    costs: list[tuple[float, float]] = []
    changes_by_frame: list[dict[str, tuple[float, ...]] | None] = []
    # all frames share the tone curve of the first, so that a light that fades looks it
    reusable = curve = None
    shapes = frame_objects(renderer.scene, animation, frames)
    # The generator moves the scene when it is asked for the next frame: the time from here to the
    # first line of the loop is the time to move.
    moving = stopwatch()
    with telling(progress, f"{loaded.name}: {frames} frames") as tell:
        for number, moved in enumerate(animate(renderer.scene, animation, frames), 1):
            to_move = moving().ms
            # `reusable` is what the last frame prepared and this one may reuse, as an engine does.
            frame, reusable, to_render = timed_image(
                renderer, moved, reusable, **moved_parts(animation)
            )
            costs.append((to_move, to_render))
            # Changes of the scene hold in each frame; those that move go before them.
            named = frame_changes(moved, animation)
            changes_by_frame.append(None if named is None else {**asked.changes, **named})
            curve = curve or tone_curve(frame.airlight + frame.surface)
            for path in files:
                write_image(
                    _numbered(path, number, frames),
                    layered_frame(loaded.name, chosen, frame),
                    curve,
                )
            del frame  # the next one needs its room
            tell(number / frames, f"frame {number} of {frames}")
            moving = stopwatch()
    # NAME.json lies beside EXR files only, the files that `compare --sequence` reads.
    about = [
        written
        for path in files
        if path.suffix.lower() == ".exr"
        for written in _write_frames(path, loaded.name, changes_by_frame, shapes)
    ]
    # The first frame compiles kernels and is left out of the medians, unless it is the only one.
    move_ms, render_ms = (float(value) for value in np.median(np.array(costs[1:] or costs), axis=0))
    # The recordings tell a developer whether motion made a stage compile again.
    return RenderedFrames(
        scene=loaded.name,
        method=chosen.label,
        size=(read.camera.width, read.camera.height),
        frames=frames,
        moves=tuple(animation.moves),
        move_ms=move_ms,
        render_ms=render_ms,
        frame_ms=move_ms + render_ms,
        recordings={
            stage: getattr(getattr(renderer.stages, stage), "n_recordings", 0) for stage in _STAGES
        },
        device=variant,
        files=(
            *(
                str(_numbered(path, number, frames))
                for path in files
                for number in range(1, frames + 1)
            ),
            *about,
        ),
    )


def _ready(
    asked: Asked, frames: int, layers: bool, progress: Progress
) -> tuple[Any, Any, Any, bool]:
    """Return a scene, loaded and read, what renders it, and whether with the
    further layers of the method.
    """
    from airlight.realtime.methods.registry import find_method
    from airlight.validation.study.configuration import prepared

    # The costs and the notes need the scene, and come before any kernel compiles.
    loaded, read = asked.read()
    _check_work(loaded.name, read, asked.chosen, frames)
    note(progress, read.features.notes)
    # Only methods of clouds have further layers, and they cost time: a caller says whether it can
    # use them.
    layered = layers and find_method(asked.chosen.method).renders_clouds
    renderer = prepared(read, asked.chosen, extra_layers=layered)
    # A run or a frame number would change nothing, and the user expects new noise.
    if not renderer.method.noisy:
        exclude("method", f"{asked.chosen.label} draws no random numbers", asked.random)
    return loaded, read, replace(renderer, run=asked.run, frame=asked.frame), layered


def _check_work(name: str, scene: Any, chosen: "Configuration", frames: int) -> None:
    from airlight.validation.study.configuration import configuration_work
    from airlight.validation.study.cost import check_work

    what = f"render {name}, {scene.camera.width} x {scene.camera.height}, {chosen.label}"
    check_work(what, [configuration_work(scene, chosen, frames)])


def _warnings(renderer: Any) -> tuple[str, ...]:
    """Return the faults of planes in the order of a paper, and print them on the error stream."""
    import sys

    from airlight.realtime.methods.published.biri2006.method import PaperPreparation

    # Only the published order of Biri et al. 2006 can fail in this way; other methods have no
    # warnings.
    preparation = renderer.stages.prepare
    warnings: tuple[str, ...] = (
        preparation.warnings if isinstance(preparation, PaperPreparation) else ()
    )
    for warning in warnings:
        print(f"airlight: warning: {warning}", file=sys.stderr)
    return warnings


def _write_frames(
    path: Path,
    scene: str,
    changes: list[dict[str, tuple[float, ...]] | None],
    objects: dict[str, Any],
) -> tuple[str, ...]:
    """Write NAME.json beside the frames NAME-0001.exr, which `compare --sequence` reads,
    where changes have names.
    """
    from airlight.reference.storage.files import write_text
    from airlight.validation.motion.frames_file import FramesRecord

    # A change without a name cannot be repeated by `compare`: such an animation has no record, and
    # neither has a single frame.
    named = [each for each in changes if each is not None]
    if len(named) < max(len(changes), 2):
        return ()
    by_name = {name: tuple(each[name] for each in named) for name in named[0]}
    record = FramesRecord(
        len(named), scene=scene, pixel="centre", layer="airlight", changes=by_name, objects=objects
    )
    write_text(path.with_suffix(".json"), record.text() + "\n")
    return (str(path.with_suffix(".json")),)


def _remove_older(path: Path, frames: int) -> None:
    """Remove what an earlier run left under this name and the new one will not replace: its record
    of changes, and the last frames of a longer one; files of other programs stay.
    """
    from airlight.validation.motion.frames_file import SCHEMA

    record, is_exr = path.with_suffix(".json"), path.suffix.lower() == ".exr"
    if is_exr and SCHEMA.encode() in _head(record):
        record.unlink()
    # A frame of ours names its method, a picture of ours its program.
    mark, number = b"airlight:method" if is_exr else b"Software\0airlight", frames + 1
    while mark in _head(older := _numbered(path, number, frames)):
        older.unlink()
        number += 1


def _head(path: Path) -> bytes:
    """Return the beginning of a file, which says what made it; nothing where there is none."""
    if not path.is_file():
        return b""
    with path.open("rb") as stream:
        return stream.read(1 << 16)


def _numbered(path: Path, number: int, frames: int) -> Path:
    """Return name-0001.exr for name.exr; the first frame has the number 1."""
    # At least four digits, so that `frames/####.exr` names them.
    digits = max(4, len(str(frames)))
    return path.with_name(f"{path.stem}-{number:0{digits}d}{path.suffix}")
