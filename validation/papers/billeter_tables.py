# SPDX-License-Identifier: BSD-3-Clause
"""Figures 6 and 7 and Table 1 of Billeter, Sintorn, Assarsson 2010 measured
again, after the light moved.

Neither scene is available: `omni-box` stands for the scene of Fig. 6, `colonnade` for the Sponza
atrium and `tangle` for the mesh "Yeah Right". The paper gives no image size for Fig. 6 and Table 1: all
have that of Fig. 7. The published hall has one map; ours has a lamp that shines in all directions,
so its map has six faces in Fig. 7; in Table 1 a spot takes its place. The light volume is the
paper's mesh; its height field walked without triangles stands beside it as `walk`. The paper's
marcher evaluates the airlight where the visibility changes.

Errors are against the quadrature, at one pixel in `stride` along both axes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.frame.image import Frame, render_frame
from airlight.realtime.frame.renderer import FrameRenderer
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.reference import reference_of_pixels
from airlight.validation.arrays import Array
from airlight.validation.clock import time_repeated, timed
from airlight.validation.metrics.errors import error_metrics, known
from airlight.validation.papers.claims import Figure, Figures, Result, quartiles
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.scenes.parts import spot_light
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study.configuration import Parameters, configuration, prepared
from airlight.validation.study.frame_times import moved_light

SIZE = (1024, 1024)  #: of the published images [pixels]
MAPS = (1024, 2048, 4096)  #: of Table 1 [texels]
_SECONDS = 0.1  # for each timing [s]
_LONGEST = 30.0  # frames that take longer are not measured [s]
_MESH = "light-volumes-2010"

_Number = TypeVar("_Number", bound=np.generic)


@dataclass(frozen=True)
class PublishedImage:
    """A scene that stands for one of the paper, and how its image is made."""

    scene: str
    method: str
    parameters: Parameters


def _marched(steps: int) -> PublishedImage:
    """Return an image of the paper's marcher, which adds up what lies between transitions."""
    march = {"sum": "transitions", "spacing": "uniform", "shadow": "map"}
    return PublishedImage("colonnade", "ray-march", {**march, "map": 512, "steps": steps})


#: The images by the names of their figures.
IMAGES: Mapping[str, PublishedImage] = {
    "Fig. 6a": PublishedImage("omni-box", _MESH, {"map": 32}),
    "Fig. 6b": PublishedImage("omni-box", _MESH, {"map": 128}),
    "Fig. 6c": PublishedImage("omni-box", _MESH, {"map": 512}),
    "Fig. 7a": _marched(150),
    "Fig. 7b": _marched(400),
    "Fig. 7c": PublishedImage("colonnade", _MESH, {"map": 512}),
    "walk": PublishedImage("colonnade", "light-volumes", {"walls": "slanted", "map": 512}),
    "epipolar": PublishedImage("colonnade", "min-max", {"map": 512}),
}


def billeter_tables(size: tuple[int, int] = SIZE, maps: tuple[int, ...] = MAPS) -> Figures:
    """Return rates and errors, at a size of the frames [pixels] and of the maps of Table 1."""
    return {**_images(size), **_table(size, maps)}


def _images(size: tuple[int, int]) -> Figures:
    figures: dict[str, Result] = {}
    # An odd stride: then every position in tiles of 4 x 4 pixels is compared somewhere.
    stride = 2 * (max(size) // 256) + 1
    for scene_name in dict.fromkeys(image.scene for image in IMAGES.values()):
        loaded = load_scene(scene_name, size).scene
        scene = read_scene(loaded)
        pixels = sampled(np.arange(size[0] * size[1]).reshape(size[::-1]), stride)
        # The reference is computed for the compared pixels alone.
        true = reference_of_pixels(loaded, pixels.ravel()).airlight.reshape(*pixels.shape, 3)
        for name, image in IMAGES.items():
            if image.scene == scene_name:
                chosen = configuration(image.method, "exact", image.parameters)
                figures |= attempted(
                    (f"{name} fps", f"{name} error"),
                    partial(_image, name, partial(prepared, scene, chosen), true, stride),
                )
    return figures


def _image(name: str, renderer: Callable[[], FrameRenderer], true: Array, stride: int) -> Figures:
    ready = renderer()
    # The error comes first: a frame that takes too long is not timed.
    error = error_metrics(true, sampled(frame_within(ready).airlight, stride)).relative_rmse
    return {f"{name} error": known(error), f"{name} fps": _rate(ready)}


def _rate(renderer: FrameRenderer) -> Figure:
    return quartiles(time_repeated(moved_light(renderer), seconds=_SECONDS, least=3).rate)


def sampled(image: NDArray[_Number], stride: int) -> NDArray[_Number]:
    """Return one pixel in `stride` along both axes of an image, beginning at the
    middle of the first block.
    """
    return image[stride // 2 :: stride, stride // 2 :: stride]


def _table(size: tuple[int, int], maps: tuple[int, ...]) -> Figures:
    figures: dict[str, Result] = {}
    for name in ("colonnade", "tangle"):
        scene = read_scene(table_scene(name, size))
        for texels in maps:
            for tessellation in ("static", "adaptive"):
                figures |= _view(scene, f"{name} {texels}", texels, tessellation)
    last = maps[-1]
    static, adaptive = (figures[f"colonnade {last} {how} fps"] for how in ("static", "adaptive"))
    # Where one of both rates was not measured, the reason stands in place of the gain.
    if isinstance(static, Figure) and isinstance(adaptive, Figure):
        gain: Result = adaptive.over(static)
    else:
        gain = static if isinstance(static, str) else adaptive
    return figures | {f"colonnade {last} gain": gain}


def table_scene(name: str, size: tuple[int, int]) -> mi.Scene:
    """Return the scene of a view: a built-in scene, the hall with a spot in place of its lamp."""
    if name != "colonnade":
        return load_scene(name, size).scene
    described = SCENES["colonnade"].build()
    lamp: Any = described["lamp"]
    described["lamp"] = spot_light(
        lamp["intensity"]["value"],
        position=lamp["position"],
        target=[-1.13, 0.97, 1.67],
        cutoff=56.7,
        beam=56.7,
    )
    scene = mi.load_dict(described)
    resize(scene, size)
    return scene


def _view(scene: Scene, view: str, texels: int, tessellation: str) -> Figures:
    """Return the rate of a view of Table 1."""
    rate = f"{view} {tessellation} fps"
    chosen = configuration(_MESH, "exact", {"tessellation": tessellation, "map": texels})

    def measured() -> Figures:
        renderer = prepared(scene, chosen)
        # One frame before the timing, which compiles and says whether frames are fast enough to
        # time.
        frame_within(renderer)
        return {rate: _rate(renderer)}

    return attempted((rate,), measured)


def frame_within(renderer: FrameRenderer) -> Frame:
    """Render a frame, unless frames take too long for timing."""
    frame, took = timed(lambda: render_frame(renderer))
    if took.seconds > _LONGEST:
        raise TimeoutError(
            f"a frame takes {took.seconds:.0f} s, more than the limit of {_LONGEST:g} s"
        )
    return frame


def attempted(names: tuple[str, ...], work: Callable[[], Figures]) -> Figures:
    """Return the results of a piece of work; where it failed, the reason under each of `names`."""
    try:
        return work()
    except (InputError, MemoryError, TimeoutError) as reason:
        return dict.fromkeys(names, f"not measured: {str(reason) or 'out of memory'}")
