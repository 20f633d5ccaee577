# SPDX-License-Identifier: BSD-3-Clause
"""The stages of a frame, each timed by itself: the device must come to rest between them, which a frame need not do."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr

from realtime.frame.renderer import FrameRenderer, Stages

#: The `Stages` of a frame, in their order, and what the page calls them.
WORDS = {
    "prepare": "shadow maps or planes",
    "surface": "camera rays and surface",
    "shade": "surface, rays cached",
    "render": "airlight",
}


def timed_stages(renderer: FrameRenderer) -> tuple[FrameRenderer, dict[str, float]]:
    """Return a renderer that does the same, and a dictionary that its next frame fills with the time of stages [ms]."""
    times: dict[str, float] = {}

    def clocked(stages: Stages) -> Stages:
        timed: dict[str, Any] = {name: _clocked(name, getattr(stages, name), times) for name in WORDS}
        return replace(stages, **timed)

    return replace(renderer, structures={key: clocked(stages) for key, stages in renderer.structures.items()}), times


def _clocked(name: str, stage: Callable[..., Any], times: dict[str, float]) -> Callable[..., Any]:
    def clocked(*arguments):
        dr.sync_thread()
        begin = time.perf_counter()
        result = stage(*arguments)
        if name != "prepare":  # whose states need not be arrays alone
            dr.eval(result)
        dr.sync_thread()
        times[name] = times.get(name, 0.0) + 1e3 * (time.perf_counter() - begin)
        return result

    return clocked
