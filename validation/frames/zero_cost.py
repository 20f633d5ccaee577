# SPDX-License-Identifier: BSD-3-Clause
"""Checks that what a scene does not need costs nothing: the time of a frame with it over one without it.

The two frames are rendered in turns, so that other load on the machine affects both alike. The ratio is the median over
the turns.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.frame.renderer import run_cast_and_shade, run_method, run_stages
from realtime.scene.read_scene import Scene, read_scene
from validation.configurations.methods import Configuration, prepared
from validation.configurations.timing import times_in_turns
from validation.scenes.loading import load_scene, resize
from validation.scenes.parts import mitsuba_mesh, placed, rotation
from validation.scenes.solids import torus
from validation.scenes.sphere_spot import sphere_spot


@dataclass(frozen=True)
class ZeroCost:
    """The time of a frame with something that it does not need, over the time of a frame without it."""

    what: str
    ratio: float  #: median over the turns
    low: float  #: first quartile of the ratio
    high: float  #: third quartile of the ratio
    with_ms: float
    without_ms: float
    turns: int

    @property
    def least_ratio(self) -> float:
        """The ratio less two standard errors of its median, for normally distributed ratios."""
        return self.ratio - 2 * 1.2533 * (self.high - self.low) / 1.349 / self.turns**0.5


def zero_costs(*, size: tuple[int, int] = (800, 600), turns: int = 60) -> list[ZeroCost]:
    """Measure `no_casters` and `unseen_casters` at an image size [pixels]."""
    return [no_casters(size=size, turns=turns), unseen_casters(size=size, turns=turns)]


def no_casters(*, size: tuple[int, int] = (800, 600), turns: int = 60) -> ZeroCost:
    """Compare `shadow-planes` with `unshadowed` in a scene without casters, with the same kernel."""
    scene = read_scene(load_scene("open-fog", size).scene)
    works = [_frame(scene, method) for method in ("shadow-planes", "unshadowed")]
    return _compared("a frame of shadow planes without casters, against unshadowed", works, turns=turns)


def unseen_casters(*, size: tuple[int, int] = (800, 600), turns: int = 60) -> ZeroCost:
    """Compare the airlight of a scene with casters behind the camera with that of the scene without them.

    Only tile lists and airlight are timed. Mitsuba's camera rays and surfaces do cost more in a scene of more shapes,
    and a light that moves costs time for the triangles of all casters, also of those that are culled.
    """
    works = [_airlight(sphere_spot_with(unseen, size)) for unseen in (41, 0)]
    return _compared("airlight with 41 casters behind the camera, against none", works, turns=turns)


def _frame(scene: Scene, method: str) -> Callable[[], Any]:
    renderer = prepared(scene, Configuration(method, "exact"))
    ready = renderer.prepare(scene)
    return lambda: run_stages(renderer, ready)


def _airlight(scene: Scene) -> Callable[[], Any]:
    renderer = prepared(scene, Configuration("shadow-planes", "exact"))
    cast, by_light = run_cast_and_shade(renderer)
    dr.eval(cast, by_light)
    ready = renderer.prepare(scene)
    return lambda: dr.eval(run_method(renderer, ready, cast, by_light))


def _compared(what: str, works: list[Callable[[], Any]], *, turns: int) -> ZeroCost:
    with_ms, without_ms = times_in_turns(works, seconds=0, least=turns, most=turns, alternate=True).T
    low, ratio, high = (float(value) for value in np.percentile(with_ms / without_ms, [25, 50, 75]))
    medians = float(np.median(with_ms)), float(np.median(without_ms))
    return ZeroCost(what, ratio, low, high, *medians, turns)


def sphere_spot_with(unseen: int, size: tuple[int, int]) -> Scene:
    """Return the scene `sphere-spot` at a size [pixels] with a number of rings behind the camera."""
    described = sphere_spot()
    for number in range(unseen):
        where = (0.73 * (number % 7) - 2.3, -9.7 - 0.61 * (number // 7), 1.3)
        ring = placed(torus(0.29, 0.071, (31, 17)), where, rotation((0.3, 1, 0.2), 23.0 * number))
        described[f"unseen-{number}"] = mitsuba_mesh(f"unseen-{number}", ring, (0.31, 0.37, 0.41))
    scene = mi.load_dict(described)
    resize(scene, size)
    return read_scene(scene)
