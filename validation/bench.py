# SPDX-License-Identifier: BSD-3-Clause
"""Speed against error: every configuration of a scene is timed and compared with the quadrature truth."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from realtime.errors import InputError
from realtime.frame import Frame, render_frame
from realtime.frozen import Frozen
from realtime.methods import find_method
from realtime.plan import Plan
from realtime.scene import Scene, read_scene
from reference.quadrature import TruthImage
from validation.configurations import STANDARD, Configuration, prepared
from validation.flip import Flip, flip_hdr
from validation.load import LoadedScene
from validation.metrics import Metrics, error_metrics
from validation.timing import FrameTimes, time_frame
from validation.truth import truth_image

Progress = Callable[[int, int, str], None]

_LONG = 25.0  # a first frame, with the compilation of its kernels, that took longer is not timed at a larger size [s]


@dataclass(frozen=True)
class Measurement:
    """What one configuration costs in one scene and how wrong it is."""

    configuration: Configuration
    frame: Frame | None  #: None where it was refused
    times: FrameTimes | None
    error: Metrics | None  #: of the airlight
    surface_error: Metrics | None
    flip: Flip | None = None  #: HDR-FLIP of all light, airlight and surface; None where it was not asked for
    refused: str | None = None  #: why this configuration cannot render this scene
    note: str | None = None  #: what its times are, where not those of the others


def configurations_for(plan: Plan, configurations: Sequence[Configuration] = STANDARD) -> tuple[Configuration, ...]:
    """Leave out what the scene does not need.

    Variants that differ in their shadows need something that casts one, the paper's way with bounded media needs such
    media, in clear air.
    """
    needless = set() if plan.shadows else {"shadow", "order", "map"}
    needless |= set() if plan.clear else {"media"}
    return tuple(chosen for chosen in configurations if not needless & set(dict(chosen.parameters)))


def measure(
    scene: Scene,
    chosen: Configuration,
    *,
    truth: TruthImage,
    timed: Scene | None = None,
    seconds: float = 0.6,
    with_flip: bool = False,
) -> Measurement:
    """Render, compare and time one configuration.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene`, at the size of the truth.
    chosen
        The configuration.
    truth
        The quadrature truth of the same scene.
    timed
        The scene at another size to time, where that differs from the size of the truth.
    seconds
        Time to spend on each timing.
    with_flip
        Also compute HDR-FLIP; where that cannot be had, it holds a note.
    """
    try:
        renderer = prepared(scene, chosen)
        begin = time.perf_counter()
        frame = render_frame(renderer)
        took = time.perf_counter() - begin
    except InputError as error:
        return Measurement(chosen, None, None, None, None, refused=str(error))
    notes = []
    if timed is not None and took > _LONG:
        timed = None
        notes.append(f"timed at {scene.camera.width} x {scene.camera.height}: larger frames take minutes")
    if ":" in chosen.method and not isinstance(renderer.airlight, Frozen):
        notes.append("not frozen: its Python runs again for every frame")
    times = time_frame(renderer if timed is None else prepared(timed, chosen), seconds=seconds)
    return Measurement(
        chosen,
        frame,
        times,
        error_metrics(truth.airlight, frame.airlight),
        error_metrics(truth.surface, frame.surface) if scene.plan.surfaces else None,
        flip_hdr(truth.airlight + truth.surface, frame.airlight + frame.surface) if with_flip else None,
        note="; ".join(notes) or None,
    )


def bench(
    loaded: LoadedScene, configurations: Sequence[Configuration] = STANDARD, *, progress: Progress | None = None
) -> Iterator[tuple[Scene, Measurement]]:
    """Measure the configurations of a scene at its own size, one after the other."""
    scene = read_scene(loaded.scene)
    chosen = configurations_for(scene.plan, configurations)
    truth = truth_image(loaded.scene)
    for number, one in enumerate(chosen):
        yield scene, measure(scene, one, truth=truth)
        if progress is not None:
            progress(number + 1, len(chosen), loaded.name)


def knows_shadows(chosen: Configuration) -> bool:
    """Return whether a configuration renders volumetric shadows."""
    return find_method(chosen.method).shadows and dict(chosen.parameters).get("shadow") != "none"
