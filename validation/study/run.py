# SPDX-License-Identifier: BSD-3-Clause
"""Speed against error: every configuration of a scene is timed and compared with the quadrature truth."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from analytic.errors import InputError as TruthError
from realtime.errors import InputError
from realtime.frame.renderer import Frame, FrameRenderer, light_groups, render_frame
from realtime.methods.registry import find_method
from realtime.numerics.recorded import Frozen
from realtime.scene.features import SceneFeatures
from realtime.scene.read_scene import Scene, read_scene
from reference.quadrature.ray_values import TruthImage
from reference.storage.exr import Image
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import Metrics, error_metrics
from validation.metrics.flip import Flip, flip_hdr
from validation.scenes.loading import LoadedScene, load_scene
from validation.study.clock import peak_memory
from validation.study.configuration import STANDARD, Configuration, prepared
from validation.study.frame_times import FrameTimes, time_frame

Progress = Callable[[int, int, str], None]
#: Calls a function with arguments in another process: ``apart(function, *arguments, name=the method's)``.
Apart = Callable[..., Any]

_DOUBTFUL = 0.5  # share of the limit: after a longer preparation, the time of a frame is estimated before it begins
_RECORDED = 1.0  # in a first frame that takes less, its recording takes a part of time and memory that counts [s]
_LONG = 25.0  # after a longer first frame, compilation included, no larger frame is timed [s]


@dataclass(frozen=True)
class Rendering:
    """A frame by one configuration and its cost, not yet compared with anything."""

    frame: Frame | None  #: None if the method refused the scene
    times: FrameTimes | None
    knows_shadows: bool  #: whether it renders volumetric shadows
    refused: str | None = None  #: why there is no frame
    left_out: bool = False  #: whether only the time speaks against this configuration, which could render the scene
    note: str | None = None  #: how its times differ from those of other configurations
    memory: float | None = None  #: at the peak of the timed frame, beyond what was there before [MiB]; None: not known


@dataclass(frozen=True)
class Measurement:
    """The cost and the error of one configuration in one scene."""

    configuration: Configuration  #: what was measured
    frame: Frame | None  #: None if the method refused the scene
    times: FrameTimes | None
    error: Metrics | None  #: of the airlight
    surface_error: Metrics | None
    flip: Flip | None = None  #: HDR-FLIP of airlight plus surface; None if it was not asked for
    refused: str | None = None  #: why there is no frame
    left_out: bool = False  #: whether only the time speaks against this configuration, which could render the scene
    note: str | None = None  #: how its times differ from those of other configurations
    knows_shadows: bool | None = None  #: whether it renders volumetric shadows; None: the method's record says it
    memory: float | None = None  #: at the peak of the timed frame, beyond what was there before [MiB]; None: not known


def configurations_for(
    features: SceneFeatures, configurations: Sequence[Configuration] = STANDARD
) -> tuple[Configuration, ...]:
    """Return the configurations that differ in this scene from the ones before them.

    Variants of the shadows are left out if nothing casts a shadow. The published treatment of bounded media is left out
    if the scene has none, or if they do not lie in clear air, and so are light points where no light has an extent.
    """
    without_effect = set() if features.shadows else {"shadow", "order", "map"}
    without_effect |= set() if features.clear else {"media"}
    without_effect |= set() if features.area_lights else {"points", "pattern"}
    return tuple(chosen for chosen in configurations if not without_effect & set(dict(chosen.parameters)))


def measure(
    scene: Scene,
    chosen: Configuration,
    *,
    truth: TruthImage,
    timed: Scene | None = None,
    seconds: float = 0.6,
    with_flip: bool = False,
    slow: float | None = None,
    limit: float | None = None,
    probe: Callable[[], Scene] | None = None,
    render: Callable[[], Rendering] | None = None,
) -> Measurement:
    """Render, compare and time one configuration.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene.read_scene`, at the size of the truth.
    truth
        The quadrature truth of the same scene.
    timed, seconds, slow, limit, probe
        See `render_and_time`.
    with_flip
        Whether to compute HDR-FLIP; if the package is missing, the result holds a note.
    render
        Renders and times instead of `render_and_time`, in another process.
    """
    if render is None:
        rendered = render_and_time(scene, chosen, timed=timed, seconds=seconds, slow=slow, limit=limit, probe=probe)
    else:
        try:
            rendered = render()
        except (InputError, TruthError) as error:
            rendered = Rendering(None, None, True, refused=str(error))
    frame = rendered.frame
    if frame is None:
        return Measurement(
            chosen,
            None,
            None,
            None,
            None,
            refused=rendered.refused,
            left_out=rendered.left_out,
            knows_shadows=rendered.knows_shadows,
        )
    return Measurement(
        chosen,
        frame,
        rendered.times,
        error_metrics(truth.airlight, frame.airlight),
        error_metrics(truth.surface, frame.surface) if scene.features.surfaces else None,
        flip_hdr(truth.airlight + truth.surface, frame.airlight + frame.surface) if with_flip else None,
        note=rendered.note,
        knows_shadows=rendered.knows_shadows,
        memory=rendered.memory,
    )


def render_and_time(
    scene: Scene,
    chosen: Configuration,
    *,
    timed: Scene | None = None,
    seconds: float = 0.6,
    slow: float | None = None,
    limit: float | None = None,
    probe: Callable[[], Scene] | None = None,
) -> Rendering:
    """Render and time one configuration.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene.read_scene`.
    timed
        The scene at the size of the timed frames; None if that is the size of the scene.
    slow
        See `validation.study.frame_times.time_frame` [s].
    limit, probe
        A configuration is left out if a frame of it would take longer than `limit` [s]. The estimate comes from what
        the frame prepares and from a frame of the small scene that `probe` returns. It is made only where the
        preparation takes long, and for a user's own method.
    """
    shadows = knows_shadows(chosen)
    try:
        begin = time.perf_counter()
        renderer = prepared(scene, chosen)
        took = time.perf_counter() - begin
        if limit is not None and probe is not None:
            doubtful = chosen.own or took * len(light_groups(renderer)) > _DOUBTFUL * limit
            reason = _too_long(renderer, probe, chosen, limit) if doubtful else None
            if reason:
                return Rendering(None, None, shadows, refused=reason, left_out=True)
        begin = time.perf_counter()
        frame = render_frame(renderer)
        took = time.perf_counter() - begin
    except InputError as error:
        return Rendering(None, None, shadows, refused=str(error))
    notes = []
    if timed is not None and took > _LONG:
        timed = None
        notes.append(f"timed at {scene.camera.width} x {scene.camera.height}: larger frames take minutes")
    if chosen.own and not isinstance(renderer.render, Frozen):
        notes.append("not frozen: its Python runs again for every frame")
    shown = renderer if timed is None else prepared(timed, chosen)
    spent: list[float] = []

    def again() -> None:
        begin = time.perf_counter()
        render_frame(shown)
        spent.append(time.perf_counter() - begin)

    memory = peak_memory(again)
    if timed is not None and spent and spent[0] < _RECORDED:
        memory = peak_memory(again)
    times = time_frame(shown, seconds=seconds, slow=slow, took=spent[-1] if spent else None)
    return Rendering(frame, times, shadows, note="; ".join(notes) or None, memory=memory)


def render_and_time_by_name(
    name_or_path: str,
    size: tuple[int, int],
    chosen: Configuration,
    *,
    timed: tuple[int, int] | None = None,
    probe: tuple[int, int] | None = None,
    seconds: float = 0.6,
    slow: float | None = None,
    limit: float | None = None,
) -> Rendering:
    """Do what `render_and_time` does in a process that has loaded nothing: scenes are named, with their sizes."""

    def at(size: tuple[int, int]) -> Scene:
        return read_scene(load_scene(name_or_path, size).scene)

    return render_and_time(
        at(size),
        chosen,
        timed=None if timed is None or timed == size else at(timed),
        seconds=seconds,
        slow=slow,
        limit=limit,
        probe=None if probe is None else lambda: at(probe),
    )


def render_by_name(name_or_path: str, size: tuple[int, int], chosen: Configuration) -> Frame:
    """Render a frame in a process that has loaded nothing."""
    return render_frame(prepared(read_scene(load_scene(name_or_path, size).scene), chosen))


def _too_long(renderer: FrameRenderer, probe: Callable[[], Scene], chosen: Configuration, limit: float) -> str | None:
    """Return why a frame would take too long, or None.

    It is judged by its preparation once kernels are compiled and, where that takes long and for a user's own method,
    by the second frame of a small scene, whose preparation takes as long. Of many groups of lights only the first are
    prepared before the frame; the others take as long each.
    """
    begin = time.perf_counter()
    states = renderer.prepare(renderer.scene)
    dr.sync_thread()
    preparation = time.perf_counter() - begin
    if renderer.groups is not None:
        preparation *= len(states) / sum(state is not None for state in states)
    del states
    words = f"more than the limit of {limit:g} s"
    if preparation > limit:
        return f"not measured: what a frame prepares takes {preparation:.2g} s, {words}"
    if not chosen.own and preparation <= _DOUBTFUL * limit:
        return None
    small, large = prepared(probe(), chosen), renderer.scene.camera
    render_frame(small)
    begin = time.perf_counter()
    render_frame(small)
    took = time.perf_counter() - begin
    camera = small.scene.camera
    share = (large.width * large.height) / (camera.width * camera.height)
    expected = preparation + max(0.0, took - preparation) * share
    if expected <= limit:
        return None
    return (
        f"not measured: by a frame of {camera.width} x {camera.height} pixels that took {took:.2g} s, "
        f"{min(took, preparation):.2g} s of these for what it prepares, a frame of {large.width} x {large.height} "
        f"would take {expected:.0f} s, {words}"
    )


def bench(
    loaded: LoadedScene,
    configurations: Sequence[Configuration] = STANDARD,
    *,
    apart: Apart | None = None,
    progress: Progress | None = None,
) -> Iterator[tuple[Scene, Measurement]]:
    """Yield the measurements of a scene's configurations at its own size, one after the other.

    Methods of the user's own are called by `apart`, if given.
    """
    scene = read_scene(loaded.scene)
    chosen = configurations_for(scene.features, configurations)
    truth = truth_image(loaded.scene)
    for number, configuration in enumerate(chosen):
        render = None
        if configuration.own and apart is not None:
            size = scene.camera.width, scene.camera.height
            render = partial(
                apart,
                render_and_time_by_name,
                str(loaded.path or loaded.name),
                size,
                configuration,
                name=configuration.method,
            )
        yield scene, measure(scene, configuration, truth=truth, render=render)
        if progress is not None:
            progress(number + 1, len(chosen), loaded.name)


def knows_shadows(chosen: Configuration) -> bool:
    """Return whether a configuration renders volumetric shadows."""
    return find_method(chosen.method).shadows and dict(chosen.parameters).get("shadow") != "none"


def layered_frame(name: str, chosen: Configuration, frame: Frame) -> Image:
    """Return a frame of the scene of that name as layers; the header says what rendered it."""
    attributes = {"airlight:scene": name, "airlight:method": chosen.method}
    attributes |= {"airlight:kernel": chosen.kernel} if chosen.kernel else {}
    attributes |= {f"airlight:{key}": str(value) for key, value in chosen.parameters}
    return Image({"airlight": frame.airlight, "surface": frame.surface, **frame.extra}, frame.distance, attributes)
