# SPDX-License-Identifier: BSD-3-Clause
"""Figures 6 and 7 of Billeter, Sintorn, Assarsson 2010 again: frames a second beside the published ones, and the error.

Fig. 6 is a simple scene with an omni light at three sizes of the shadow map, Fig. 7 a hall of columns by marching and
by the light volume. Neither published scene is at hand: `omni-box` and `colonnade` stand for them. The paper gives no
size of the image for Fig. 6; that of Fig. 7 is taken for both. Its hall has one map, ours a lamp that shines all round,
with six.

Every frame is judged twice, at one pixel in `stride` along both axes: against the truth, and against what its own
shadow map stands for, the height field met in float64 (`validation.oracles.light_volume`). What a marcher misses of
the second is its steps and, as it looks texels up without interpolation, the steps of the map.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeError
from realtime.frame.renderer import Frame, FrameRenderer, render_frame, run_stages
from realtime.scene.read_scene import Scene, read_scene
from realtime.shadow_maps.shadow_map import cast_shadow_map
from reference.quadrature.image import quadrature_image
from reference.scene.read import TruthScene, read_truth
from validation.configurations.methods import TOLERANCE, Configuration, configuration, prepared
from validation.configurations.timing import (
    Timing,
    changed_look,
    first_frame,
    moved_light,
    moved_light_alone,
    time_in_turns,
)
from validation.metrics.errors import Metrics, error_metrics
from validation.oracles.light_volume import traced_walls, twin_airlight
from validation.scenes.loading import load_scene

Array = NDArray[np.float64]

SIZE = (1024, 1024)  #: of the published images [pixels]
LIMIT = 30.0  #: a frame that takes longer is not measured [s]


@dataclass(frozen=True)
class FigureEntry:
    """One image of a figure, and what stands for it here."""

    where: str
    scene: str
    map: int  #: [texels]
    method: str
    parameters: tuple[tuple[str, float | str], ...] = ()  #: without the map
    fps: float | None = None  #: published; None for a peer that the paper does not have

    def configuration(self, kernel: str) -> Configuration:
        """Return the configuration to measure."""
        values = dict(self.parameters) | {"map": self.map}
        return configuration(self.method, None if self.method == "ray-march" else kernel, values)

    @property
    def upright(self) -> bool:
        """Whether the walls of its light volume stand upright."""
        return dict(self.parameters).get("walls") == "upright"


TILES = "tiles"  #: where rows stand whose airlight is interpolated between the corners of tiles
_TOLERANCE = ("tolerance", TOLERANCE)
_MESH: tuple[tuple[str, float | str], ...] = (("evaluation", "mesh"),)
#: The height field of the mesh without triangles, and with upright walls where the map jumps.
_WALK, _UPRIGHT = ((("evaluation", "walk"), ("walls", walls)) for walls in ("slanted", "upright"))


def _march(steps: int) -> tuple[tuple[str, float | str], ...]:
    return (("steps", steps), ("spacing", "uniform"), ("shadow", "map"))


FIGURES: tuple[FigureEntry, ...] = (
    *(
        FigureEntry(where, "omni-box", size, "light-volumes", how, fps)
        for where, size, fps in (("Fig. 6a", 32, 230), ("Fig. 6b", 128, 165), ("Fig. 6c", 512, 25))
        for how in (_MESH, _WALK, _UPRIGHT)
    ),
    FigureEntry("Fig. 7a", "colonnade", 512, "ray-march", _march(150), 25),
    FigureEntry("Fig. 7b", "colonnade", 512, "ray-march", _march(400), 10),
    *(FigureEntry("Fig. 7c", "colonnade", 512, "light-volumes", how, 96) for how in (_MESH, _WALK, _UPRIGHT)),
    FigureEntry("peer", "colonnade", 512, "min-max"),
    # Between the corners of tiles, which the paper has not.
    FigureEntry(TILES, "colonnade", 512, "light-volumes", (*_WALK, _TOLERANCE)),
    FigureEntry(TILES, "colonnade", 512, "light-volumes", (*_UPRIGHT, _TOLERANCE)),
    FigureEntry(TILES, "colonnade", 512, "ray-march", (*_march(400), _TOLERANCE)),
)


@dataclass(frozen=True)
class FigureRow:
    """One image, measured beside what was published; without times and errors where `missing` says why."""

    entry: FigureEntry
    size: tuple[int, int]  #: [pixels]
    light_moved: Timing | None = None  #: a frame after the light moved: shadow map, volume, all stages
    static: Timing | None = None  #: a frame with static light and geometry, of a camera that moved
    light_moved_camera_kept: Timing | None = (
        None  #: a frame after the light moved, the camera rays of the last one kept
    )
    colours_changed: Timing | None = (
        None  #: a frame after only medium or colours changed: map, tiles, camera rays are kept
    )
    error: Metrics | None = None  #: of the airlight against the truth
    map_error: Metrics | None = None  #: of the airlight against what the shadow map stands for
    missing: str | None = None


@dataclass(frozen=True)
class _Stage:
    """A scene at the size of the frame, and its truth at some pixels of it."""

    scene: Scene
    truth: TruthScene  #: of the pixels that are compared
    stride: int
    airlight: Array  #: the truth

    def compared(self, image: Array) -> Array:
        return sampled(image, self.stride)


def figure_rows(
    entries: Sequence[FigureEntry] = FIGURES,
    *,
    kernel: str = "exact",
    size: tuple[int, int] = SIZE,
    seconds: float = 0.6,
    limit: float = LIMIT,
    progress: Callable[[float, str], None] | None = None,
) -> list[FigureRow]:
    """Measure images of the figures.

    Parameters
    ----------
    entries
        What to measure.
    kernel
        Airlight kernel of the methods that call one.
    size
        Of the frames [pixels].
    seconds
        Time to spend on a timing, about.
    limit
        A frame that takes longer is not measured [s].
    progress
        Told the share done and what comes next.
    """
    rows: list[FigureRow] = []
    stage: _Stage | None = None
    twins: dict[tuple[int, bool], Array] = {}
    shown = None
    for entry in entries:
        chosen = entry.configuration(kernel)
        if progress is not None:
            progress(len(rows) / len(entries), f"{entry.where}, {entry.scene}, {chosen.label}")
        if entry.scene != shown:
            stage, twins, shown = _stage(entry.scene, size), {}, entry.scene
        assert stage is not None
        rows.append(_figure_row(entry, stage, chosen, twins, seconds=seconds, limit=limit))
    return rows


def _stage(name: str, size: tuple[int, int]) -> _Stage:
    loaded = load_scene(name, size).scene
    # An odd step: over tiles of 4 x 4 pixels every place in a tile has its turn.
    stride = 2 * (max(size) // 256) + 1
    truth = sampled_truth(read_truth(loaded), stride)
    return _Stage(read_scene(loaded), truth, stride, quadrature_image(truth).airlight)


def sampled(image: Array, stride: int) -> Array:
    """Return one pixel in `stride` along both axes of an image, from the middle of the first ones on."""
    return image[stride // 2 :: stride, stride // 2 :: stride]


def sampled_truth(truth: TruthScene, stride: int) -> TruthScene:
    """Return the scene with only the rays of the pixels that `sampled` takes."""
    direction = sampled(truth.direction.reshape(truth.height, truth.width, 3), stride)
    height, width, _ = direction.shape
    return replace(truth, width=width, height=height, direction=direction.reshape(-1, 3))


def _figure_row(
    entry: FigureEntry,
    stage: _Stage,
    chosen: Configuration,
    twins: dict[tuple[int, bool], Array],
    *,
    seconds: float,
    limit: float,
) -> FigureRow:
    camera = stage.scene.camera
    size = camera.width, camera.height
    try:
        renderer = prepared(stage.scene, chosen)
        frame = frame_within(renderer, limit)
    except (InputError, RealtimeError, MemoryError, TimeoutError) as reason:
        return FigureRow(entry, size, missing=str(reason) or "out of memory")
    key = entry.map, entry.upright
    if key not in twins:
        distance = stage.compared(np.asarray(frame.distance, dtype=np.float64))
        twins[key] = _twin(entry, stage, distance)
    shown = stage.compared(frame.airlight)
    return FigureRow(
        entry,
        size,
        **time_rates(renderer, seconds),
        error=error_metrics(stage.airlight, shown),
        map_error=error_metrics(twins[key], shown),
    )


def _twin(entry: FigureEntry, stage: _Stage, distance: Array) -> Array:
    """Return what the shadow maps of an entry stand for."""
    scene = stage.scene
    maps = [cast_shadow_map(scene.geometry, light, entry.map) for light in scene.lights]
    walls = traced_walls(scene, maps) if entry.upright else None
    return twin_airlight(stage.truth, maps, distance=distance, walls=walls)


def frame_within(renderer: FrameRenderer, limit: float) -> Frame:
    """Render a frame, or say that frames take too long to be timed.

    Raises
    ------
    TimeoutError
        If it took longer than `limit` [s], compiling included.
    """
    start = time.perf_counter()
    frame = render_frame(renderer)
    taken = time.perf_counter() - start
    if taken > limit:
        raise TimeoutError(f"a frame takes {taken:.0f} s, more than the limit of {limit:g} s")
    return frame


def time_rates(renderer: FrameRenderer, seconds: float) -> dict[str, Any]:
    """Time frames after the light moved and with less than that, in turns; the fields of a row by name."""
    kept = first_frame(renderer)
    works = {
        "light_moved": moved_light(renderer),
        "static": lambda: run_stages(renderer, kept.prepared),
        "light_moved_camera_kept": moved_light_alone(renderer, kept),
        "colours_changed": changed_look(renderer, kept),
    }
    return dict(zip(works, time_in_turns(list(works.values()), seconds=3 * seconds, least=3), strict=True))
