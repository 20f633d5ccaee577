# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.load_scene` and `airlight.render`: a frame or an animation by a real-time
method, and what it costs.

A user's method that is named, 'module:function' or 'file.py:function', runs in a separate process,
which it may end or never leave. A function that Python gives runs here.
"""

import operator
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError
from airlight.reports.api.inputs import (
    Files,
    KernelLike,
    MethodLike,
    ModelLike,
    Progress,
    SceneLike,
    Size,
    Values,
    changes_of,
    chosen_model,
    configuration_of,
    exclude,
    kernel_name,
    note,
    one_error,
    output_files,
    pixels_of,
    several,
    telling,
    whole_numbers,
)
from airlight.validation.scenes.names import check_scene

if TYPE_CHECKING:
    from airlight.reports.api.results import Plan, RenderedFrames, Rendering
    from airlight.reports.api.scenes import OpenScene
    from airlight.validation.study.configuration import Configuration

_STAGES = ("surface", "shade", "render")  # the recorded functions of a frame


@one_error
def load_scene(
    scene: SceneLike, size: Size | None = None, *, model: ModelLike | None = None
) -> "OpenScene":
    """Load a scene.

    Parameters
    ----------
    scene
        A built-in name (`airlight.SCENES`), random:SEED, the path of a Mitsuba XML or pbrt file, a
        Mitsuba dictionary, or a Mitsuba scene.
    size
        Width and height of its image [pixels], or 'WxH'; the scene's own by default.
    model
        The equation of its references, see `reference`; by default the one that its file names,
        else the physical one.

    Raises
    ------
    InputError
        For what is no scene, or cannot be read.

    Examples
    --------
    >>> import airlight
    >>> scene = airlight.load_scene("open-fog", size=(32, 24))
    >>> scene
    OpenScene(open-fog, 32 x 24)
    >>> scene.plan()["lights"]
    '1 point'
    """
    check_scene(scene)
    chosen = chosen_model(model)
    from airlight.reports.api.scenes import opened

    return opened(scene, size, model=chosen)


@one_error
def render(
    scene: SceneLike,
    method: MethodLike = "ray-march",
    kernel: KernelLike | None = None,
    *,
    change: Values = (),
    size: Size | None = None,
    precision: Literal["single", "double"] = "single",
    samples: int = 1,
    frames: int | None = None,
    animate: str | None = None,
    run: int = 0,
    frame: int = 0,
    output: Files = (),
    plan: bool = False,
    timed: bool = False,
    progress: Progress = None,
    **parameters: Any,
) -> "Rendering | RenderedFrames | Plan":
    """Render a frame or an animation; say what a frame costs.

    An animation is one turn: lights circle, objects turn, the medium's density swings, colours
    rotate. Each frame recomputes only what depends on the motion. Ctrl-C keeps the finished frames.

    Parameters
    ----------
    scene
        A built-in scene, random:SEED or a Mitsuba XML or pbrt file; from Python also what
        `load_scene` takes or returns.
    method
        A method of `airlight list methods`, or a user's as MODULE:FUNCTION, FILE.py:FUNCTION or FILE.glsl; from Python
        also a function itself, ``method(view, *, kernel=None, **parameters)``, from a module or a notebook.
    kernel
        Airlight kernel, see `airlight list kernels`; 'exact' for a method that calls one.
    change
        Change the camera, a light or a medium of the scene, such as medium.sigma_t=0.1; may be given several times.
    size
        Width and height [pixels], or WxH; the scene's own by default.
    precision
        Whether the method computes in float32 (single) or float64 (double).
    samples
        Camera rays per pixel. More than one gives a picture without aliasing; errors are
        measured at pixel centres.
    frames
        Render an animation with this many frames, as NAME-0001.exr and so on. NAME.json lists the
        changes of lights, colours or a homogeneous medium, for `compare --frames`.
    animate
        The motion: light, objects, medium, colour, or several with commas; the
        scene's animation by default.
    run
        Number of the run. A noisy method draws different random numbers in each run, and the same
        ones when a run is repeated.
    frame
        Number of the frame in its run; of an animation, number of its first frame.
    output
        A file to write: .exr for all layers, .png for a tone-mapped picture; may be given several
        times. The command writes SCENE.png where it has none. From Python nothing is written then.
    plan
        Say what the scene needs from the method, and render nothing.
    timed
        Also measure the time of a frame, which takes some seconds.
    progress
        Called with (fraction done, what); True shows a bar.
    parameters
        Parameters of the method, such as ``steps=64``.

    Raises
    ------
    InputError
        For unknown names, features that the method refuses, and options that do not go together.

    Examples
    --------
    >>> import airlight
    >>> frame = airlight.render("open-fog", "ray-march", size=(32, 24), steps=64)
    >>> frame
    Rendering(open-fog by ray-march (steps=64), 32 x 24)
    >>> frame.airlight.shape, frame.airlight.dtype.name
    ((24, 32, 3), 'float32')
    """
    # All words are checked first; then Mitsuba starts, which takes seconds.
    whole_numbers(samples=samples, frames=frames, run=run, frame=frame)
    files = output_files(output, ".exr (all layers)", ".png (a picture)")
    _check(files, samples=samples, frames=frames, animate=animate, plan=plan, timed=timed)
    # Both select random numbers and have to fit a signed 32-bit number.
    for name, number in (("run", run), ("frame", frame)):
        if not 0 <= number < 2**31:
            raise InputError(
                f"{name}: got {number}, expected a whole number from 0 up to, but not, {2**31}"
            )
    check_scene(scene)
    from airlight.reports.machine.environment import activate

    activate()  # a user's module may need a variant when it is imported
    from airlight.realtime.methods.shader.source import is_shader
    from airlight.reports.plotting.pictures import tone_curve

    # `apart` says that the method is user code that is named and can be imported elsewhere.
    named = checked_configuration(method, kernel, parameters)
    chosen, apart = named
    if is_shader(chosen.method):
        exclude("method", "a shader computes in float32", {"precision": precision != "single"})
    # Everything that another process needs to render the same frame; it can be pickled if the scene
    # is a name.
    asked = _Asked(scene, pixels_of(size), changes_of(change), precision, chosen, run, frame)
    shown = progress if isinstance(progress, bool) else None
    call: Any = operator.call
    # A loaded scene cannot leave this process, so that user code runs here then. A callback cannot
    # cross either: the other process shows the bar itself.
    if apart and isinstance(scene, str | os.PathLike):
        from airlight.reports.machine.own_process import in_own_process

        call, progress = partial(in_own_process, name=chosen.method), shown
    if plan:
        return call(_plan, asked)
    if frames is not None:
        return call(_animation, asked, files, frames, animate, progress)
    # The other process returns arrays; files are written here, where the result is.
    rendered: Rendering = call(_frame, asked, samples, timed, progress)
    for path in files:
        rendered.save(path)
    # The record says how a picture was toned, which a PNG file cannot.
    curve = (
        tone_curve(rendered.total).words
        if any(path.suffix.lower() == ".png" for path in files)
        else None
    )
    return replace(rendered, files=tuple(map(str, files)), tone_curve=curve)


@dataclass(frozen=True)
class _Asked:
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


def _check(
    files: list[Path],
    *,
    samples: int,
    frames: int | None,
    animate: str | None,
    plan: bool,
    timed: bool,
) -> None:
    """Refuse options that do not go together before any work."""
    # Numbers by themselves come before pairs of options.
    for name, value in (("samples", samples), ("frames", frames)):
        if value is not None and value < 1:
            raise InputError(f"{name}: got {value}, expected 1 or more")
    if plan:
        beside = {"output": files, "frames": frames, "samples": samples > 1, "timed": timed}
        exclude("plan", "renders nothing", beside)
    if animate is not None and frames is None:
        raise InputError("animate: got no number of frames; add frames, such as --frames 24")
    if frames is not None and not files:
        raise InputError(
            "frames: got no place for the files; add an output, such as -o NAME.exr or -o NAME.png"
        )
    # An animation reports medians over its frames and writes many files: averaging rays or timing
    # one frame belongs to a still frame.
    if frames is not None:
        single = {"samples": samples > 1, "timed": timed}
        exclude("frames", "an animation has one ray a pixel and says what its frames cost", single)


def checked_configuration(
    method: Any, kernel: Any = None, parameters: Any = None
) -> "tuple[Configuration, bool]":
    """Return a configuration, checked, and whether its code is a user's that is named.

    Such code is imported in a separate process, never here.
    """
    from airlight.realtime.methods.shader.source import is_shader
    from airlight.reports.machine.opengl import require_opengl
    from airlight.validation.study.configuration import Configuration, configuration

    # A configuration was checked when it was made.
    if isinstance(method, Configuration):
        return configuration_of(method, kernel, parameters), method.own
    # A GLSL file needs a driver, whose absence is a matter of the machine and has its own exit
    # status.
    if isinstance(method, str) and is_shader(method):
        require_opengl()
    # A colon separates module and name: only user code has one.
    apart = (isinstance(method, str) and ":" in method) or (
        isinstance(kernel, str) and ":" in kernel
    )
    if not apart:
        return configuration_of(method, kernel, parameters), False
    from airlight.reports.machine.own_process import in_own_process

    # An import may crash or never end, so that the process that checks user code is one that can be
    # ended.
    return in_own_process(
        configuration, method, kernel_name(kernel), parameters or {}, name=method
    ), True


def _ready(
    asked: _Asked, frames: int, layers: bool, progress: Progress
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


def _frame(asked: _Asked, samples: int, timed: bool, progress: Progress) -> "Rendering":
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


def _animation(
    asked: _Asked, files: list[Path], frames: int, moves: str | None, progress: Progress
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
            changes_by_frame.append(frame_changes(moved, animation))
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
    # NAME.json lies beside EXR files only, the files that `compare --frames` reads.
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


def _write_frames(
    path: Path,
    scene: str,
    changes: list[dict[str, tuple[float, ...]] | None],
    objects: dict[str, Any],
) -> tuple[str, ...]:
    """Write NAME.json beside the frames NAME-0001.exr, which `compare --frames` reads,
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


def _numbered(path: Path, number: int, frames: int) -> Path:
    """Return name-0001.exr for name.exr; the first frame has the number 1."""
    # At least four digits, so that `frames/####.exr` names them.
    digits = max(4, len(str(frames)))
    return path.with_name(f"{path.stem}-{number:0{digits}d}{path.suffix}")


def _plan(asked: _Asked) -> "Plan":
    """Return the features that a scene needs."""
    from airlight.realtime.scene.read_scene import describe
    from airlight.reports.api.results import Plan

    loaded, read = asked.read()
    return Plan(scene=loaded.name, plan=describe(read), notes=tuple(read.features.notes))


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


def _check_work(name: str, scene: Any, chosen: "Configuration", frames: int) -> None:
    from airlight.validation.study.configuration import configuration_work
    from airlight.validation.study.cost import check_work

    what = f"render {name}, {scene.camera.width} x {scene.camera.height}, {chosen.label}"
    check_work(what, [configuration_work(scene, chosen, frames)])


_KERNEL = "kernel="  # begins a setting that names a kernel


def asked_configurations(
    methods: Any, kernels: Any, settings: Any, *, usual: Any = None
) -> "tuple[list[Configuration], bool]":
    """Return the configurations to measure, and whether all user code is named: it can
    then run in other processes.

    A method is a name, a function or a configuration. A name without kernel and settings stands for
    its standard configurations; 'all', the default, for `usual`, or those of every built-in method
    for fog. Every method is measured with each kernel and with all settings, given by name or as
    NAME=VALUE; kernel=NAME is one more kernel.
    """
    from airlight.realtime.methods.shader.source import is_users
    from airlight.validation.study.configuration import (
        Configuration,
        chosen_configurations,
        configuration,
        parse_settings,
    )

    # A word kernel=NAME is one more kernel; every other word is a setting.
    named_kernels = several(kernels)
    if isinstance(settings, Mapping):
        given = dict(settings)
    else:
        named_kernels += [
            word.removeprefix(_KERNEL) for word in several(settings) if word.startswith(_KERNEL)
        ]
        given = parse_settings([word for word in several(settings) if not word.startswith(_KERNEL)])
    option = "set" if given else "kernel" if named_kernels else ""
    # `apart` stays true as long as every method can be imported by its name in another process.
    chosen: list[Configuration] = []
    apart = True
    for method in several(methods) or ["all"]:
        if method == "all":
            # A kernel or a setting that only some of all methods know would be dropped in silence.
            if option:
                raise InputError(
                    f"{option}: got no single method that it is for; name methods by --method"
                )
            chosen += chosen_configurations() if usual is None else usual
        elif isinstance(method, Configuration):
            chosen.append(method)
        # A function of Python: it cannot be imported by name, so that it runs here.
        elif not isinstance(method, str):
            chosen += [
                configuration(method, kernel_name(kernel), given)
                for kernel in named_kernels or (None,)
            ]
            apart = False
        # A user's method, or a built-in one with settings: one configuration for each kernel.
        elif option or is_users(method):
            chosen += [checked_configuration(method, k, given)[0] for k in named_kernels or (None,)]
        else:
            chosen += chosen_configurations([method])
    # Two words may name one configuration, which is measured once. A kernel that is a function also
    # keeps all of it in this process.
    return list(dict.fromkeys(chosen)), apart and not any(
        callable(kernel) for kernel in named_kernels
    )
