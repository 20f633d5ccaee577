# SPDX-License-Identifier: BSD-3-Clause
"""Figures 6 and 7 of Billeter, Sintorn, Assarsson 2010 measured again: frames a second, and the error.

Fig. 6 shows a simple scene with an omni light at three sizes of the shadow map. Fig. 7 shows a hall of columns, by
marching and by the light volume. Neither scene is available: `omni-box` and `colonnade` stand for them. The paper gives
no image size for Fig. 6, so both have that of Fig. 7. The published hall has one map; ours has a lamp that shines in
all directions, so its map has six faces.

Every frame is compared with the truth at one pixel in `stride` along both axes. The paper's marcher samples the
visibility and evaluates the airlight where that changes (`realtime.methods.ray_march`, ``sum=transitions``). The usual
one, which sums the integrand, stands beside it as a peer.
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
from validation.scenes.loading import load_scene

Array = NDArray[np.float64]

SIZE = (1024, 1024)  #: of the published images [pixels]
LIMIT = 30.0  #: frames that take longer are not measured [s]


@dataclass(frozen=True)
class FigureEntry:
    """One image of a figure, and the configuration that stands for it here."""

    where: str
    scene: str
    map: int  #: [texels]
    method: str
    parameters: tuple[tuple[str, float | str], ...] = ()  #: without the map
    fps: float | None = None  #: published frames a second; None if the paper has no such image

    def configuration(self, kernel: str) -> Configuration:
        """Return the configuration to measure with a kernel."""
        values = dict(self.parameters) | {"map": self.map}
        sums_integrand = self.method == "ray-march" and "sum" not in values
        return configuration(self.method, None if sums_integrand else kernel, values)

    @property
    def volume(self) -> str | None:
        """Of a light volume, which form of it, by a name of `VOLUMES`; None for other methods."""
        if self.method != "light-volumes":
            return None
        values = dict(self.parameters)
        if values.get("evaluation") == "mesh":
            return "mesh"
        return "upright walk" if self.upright else "walk"

    @property
    def upright(self) -> bool:
        """Whether its light volume has upright walls."""
        return dict(self.parameters).get("walls") == "upright"


#: The forms of the light volume: as published, its height field walked, and that with upright walls.
VOLUMES = ("mesh", "walk", "upright walk")
TILES = "tiles"  #: `where` of rows whose airlight is interpolated between the corners of tiles
_TOLERANCE = ("tolerance", TOLERANCE)
_MESH: tuple[tuple[str, float | str], ...] = (("evaluation", "mesh"),)
#: The height field of the mesh, walked without triangles; and the same with upright walls where the map jumps.
_WALK, _UPRIGHT = ((("evaluation", "walk"), ("walls", walls)) for walls in ("slanted", "upright"))


def _march(steps: int) -> tuple[tuple[str, float | str], ...]:
    return (("steps", steps), ("spacing", "uniform"), ("shadow", "map"))


#: The marcher of the paper evaluates the airlight where the visibility changes.
_TRANSITIONS: tuple[tuple[str, float | str], ...] = (("sum", "transitions"),)


FIGURES: tuple[FigureEntry, ...] = (
    *(
        FigureEntry(where, "omni-box", size, "light-volumes", how, fps)
        for where, size, fps in (("Fig. 6a", 32, 230), ("Fig. 6b", 128, 165), ("Fig. 6c", 512, 25))
        for how in (_MESH, _WALK, _UPRIGHT)
    ),
    FigureEntry("Fig. 7a", "colonnade", 512, "ray-march", (*_march(150), *_TRANSITIONS), 25),
    FigureEntry("Fig. 7b", "colonnade", 512, "ray-march", (*_march(400), *_TRANSITIONS), 10),
    *(FigureEntry("Fig. 7c", "colonnade", 512, "light-volumes", how, 96) for how in (_MESH, _WALK, _UPRIGHT)),
    FigureEntry("peer", "colonnade", 512, "ray-march", _march(150)),
    FigureEntry("peer", "colonnade", 512, "ray-march", _march(400)),
    FigureEntry("peer", "colonnade", 512, "min-max"),
    # Interpolation between the corners of tiles, which the paper does not have.
    FigureEntry(TILES, "colonnade", 512, "light-volumes", (*_WALK, _TOLERANCE)),
    FigureEntry(TILES, "colonnade", 512, "light-volumes", (*_UPRIGHT, _TOLERANCE)),
    FigureEntry(TILES, "colonnade", 512, "ray-march", (*_march(400), _TOLERANCE)),
)


@dataclass(frozen=True)
class FigureRow:
    """One image, measured; if it could not be measured, `missing` says why and all times and errors are None."""

    entry: FigureEntry  #: what the paper published
    size: tuple[int, int]  #: [pixels]
    light_moved: Timing | None = None  #: a frame after the light moved: shadow map, volume, all stages
    static: Timing | None = None  #: a frame with static light and geometry, of a camera that moved
    light_moved_camera_kept: Timing | None = None  #: after the light moved, with the camera rays of the last frame
    colours_changed: Timing | None = None  #: after only medium or colours changed: map, tiles, camera rays are kept
    error: Metrics | None = None  #: of the airlight against the truth
    missing: str | None = None


@dataclass(frozen=True)
class _Stage:
    """A scene at the size of the frame, and its truth at the compared pixels."""

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
        Callback with the share done and a description of the next step, or None.
    """
    rows: list[FigureRow] = []
    stage: _Stage | None = None
    shown = None
    for entry in entries:
        chosen = entry.configuration(kernel)
        if progress is not None:
            progress(len(rows) / len(entries), f"{entry.where}, {entry.scene}, {chosen.label}")
        if entry.scene != shown:
            stage, shown = _stage(entry.scene, size), entry.scene
        assert stage is not None
        rows.append(_figure_row(entry, stage, chosen, seconds=seconds, limit=limit))
    return rows


def _stage(name: str, size: tuple[int, int]) -> _Stage:
    loaded = load_scene(name, size).scene
    # An odd stride: then every position in tiles of 4 x 4 pixels is compared somewhere.
    stride = 2 * (max(size) // 256) + 1
    truth = sampled_truth(read_truth(loaded), stride)
    return _Stage(read_scene(loaded), truth, stride, quadrature_image(truth).airlight)


def sampled(image: Array, stride: int) -> Array:
    """Return one pixel in `stride` along both axes of an image, beginning at the middle of the first block."""
    return image[stride // 2 :: stride, stride // 2 :: stride]


def sampled_truth(truth: TruthScene, stride: int) -> TruthScene:
    """Return the scene with the rays of only those pixels that `sampled` takes."""
    direction = sampled(truth.direction.reshape(truth.height, truth.width, 3), stride)
    height, width, _ = direction.shape
    return replace(truth, width=width, height=height, direction=direction.reshape(-1, 3))


def _figure_row(
    entry: FigureEntry,
    stage: _Stage,
    chosen: Configuration,
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
    shown = stage.compared(frame.airlight)
    return FigureRow(
        entry,
        size,
        **time_rates(renderer, seconds),
        error=error_metrics(stage.airlight, shown),
    )


def frame_within(renderer: FrameRenderer, limit: float) -> Frame:
    """Render a frame, unless frames take too long for timing.

    Raises
    ------
    TimeoutError
        If the frame took longer than `limit` [s], compilation included.
    """
    start = time.perf_counter()
    frame = render_frame(renderer)
    taken = time.perf_counter() - start
    if taken > limit:
        raise TimeoutError(f"a frame takes {taken:.0f} s, more than the limit of {limit:g} s")
    return frame


def time_rates(renderer: FrameRenderer, seconds: float) -> dict[str, Any]:
    """Time frames in turns for about 3 `seconds` [s] and return the timings by the name of their field in a row."""
    kept = first_frame(renderer)
    works = {
        "light_moved": moved_light(renderer),
        "static": lambda: run_stages(renderer, kept.state),
        "light_moved_camera_kept": moved_light_alone(renderer, kept),
        "colours_changed": changed_look(renderer, kept),
    }
    return dict(zip(works, time_in_turns(list(works.values()), seconds=3 * seconds, least=3), strict=True))
