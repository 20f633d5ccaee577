# SPDX-License-Identifier: BSD-3-Clause
"""What frames of clouds take that go on with the collectors of the last frame."""

from collections.abc import Mapping
from typing import Any

import drjit as dr

from realtime.frame.renderer import frame_renderer, run_cast_and_shade, run_method
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import Scene
from validation.configurations.timing import Timing, first_frame, time_repeated

#: Three steps at most, one where the collector of the last frame still is one (within 0.05 of its spread).
WARM: Mapping[str, Any] = {"start": "previous", "iterations": 3, "settled": 0.05}


def time_frames(scene: Scene, *, seconds: float = 1.0) -> dict[str, Timing]:
    """Return the times of a frame with the collectors of the last one: `frame`, and that after the `light_moved`."""
    renderer = frame_renderer(scene, METHODS["cloud-collectors"], **WARM)
    cache = first_frame(renderer)

    def work() -> None:
        cast, by_light = run_cast_and_shade(renderer)
        dr.eval(run_method(renderer, cache.state, cast, by_light, cache.lists, None, cache.carried))

    maps = time_repeated(lambda: renderer.prepare(scene), seconds=seconds)
    frame = time_repeated(work, seconds=seconds)
    moved = (maps.median_ms + frame.median_ms, maps.low_ms + frame.low_ms, maps.high_ms + frame.high_ms)
    return {"frame": frame, "light_moved": Timing(*moved, min(maps.repetitions, frame.repetitions))}
