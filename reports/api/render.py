# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.load_scene` and `airlight.render`: a frame or an animation by a real-time
method, and what it costs.

A user's method that is named, 'module:function' or 'file.py:function', runs in a separate process,
which it may end or never leave. A function that Python gives runs here.
"""

import operator
import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from airlight.errors import InputError
from airlight.reports.api.configurations import checked_configuration
from airlight.reports.api.frames import Asked, plan_of, rendered_animation, rendered_frame
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
    exclude,
    one_error,
    output_files,
    pixels_of,
    whole_numbers,
)
from airlight.validation.scenes.names import check_scene

if TYPE_CHECKING:
    from airlight.reports.api.results import Plan, RenderedFrames, Rendering
    from airlight.reports.api.scenes import OpenScene


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
        changes of lights, colours or a homogeneous medium, for `compare --sequence`. Further frames
        of an earlier run by this name are removed.
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
    if plan:
        of_method = {"method": method != "ray-march", "kernel": kernel, "run": run or None}
        of_method |= {"frame": frame or None, **dict.fromkeys(parameters, True)}
        exclude("plan", "renders nothing, by no method", of_method)
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
    asked = Asked(scene, pixels_of(size), changes_of(change), precision, chosen, run, frame)
    shown = progress if isinstance(progress, bool) else None
    call: Any = operator.call
    # A loaded scene cannot leave this process, so that user code runs here then. A callback cannot
    # cross either: the other process shows the bar itself.
    if apart and isinstance(scene, str | os.PathLike):
        from airlight.reports.machine.own_process import in_own_process

        call, progress = partial(in_own_process, name=chosen.method), shown
    if plan:
        return call(plan_of, asked)
    if frames is not None:
        return call(rendered_animation, asked, files, frames, animate, progress)
    # The other process returns arrays; files are written here, where the result is.
    rendered: Rendering = call(rendered_frame, asked, samples, timed, progress)
    for path in files:
        rendered.save(path)
    # The record says how a picture was toned, which a PNG file cannot.
    curve = (
        tone_curve(rendered.total).words
        if any(path.suffix.lower() == ".png" for path in files)
        else None
    )
    return replace(rendered, files=tuple(map(str, files)), tone_curve=curve)


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
