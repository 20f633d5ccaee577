# SPDX-License-Identifier: BSD-3-Clause
r"""The times of a method by the work of a scene: an exponent that fits all steps, and the steepest between two.

With the time t = t_0 w^e of the work w, e is the slope of log t over log w, by least squares. What every frame costs,
whatever the work, makes it smaller. Between two steps a time may grow at most as

| work | a frame | the light moved | objects moved | why |
|---|---|---|---|---|
| pixels | 1 | 1 | 1 | each ray is by itself |
| triangles | 1/2 | 1 | 1 | rays meet silhouettes; what is prepared looks at every triangle |
| lights | 1 | 1 | 1 | one after the other |
| media | 1 | 1 | 1 | one after the other |
| texels on a side of a map | 1 | 2 | 2 | a ray crosses a row of texels; the map has their square |

A step that is steeper by more than `CLIFF` is a cliff, where it takes longer than `_SHORT`: something overflows there.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

from realtime.errors import InputError
from realtime.scene.read_scene import Scene
from validation.clock import time_repeated
from validation.metrics.errors import plain
from validation.study.configuration import Configuration, configuration, prepared
from validation.study.frame_times import camera_rays
from validation.study.ladders import Step
from validation.study.maps import fitted_slope
from validation.study.run import REFUSALS, render
from validation.study.study import Cell, Measure

Progress = Callable[[int, int, str], None]

#: What is measured by default: the defaults of the methods that know shadows, and a marcher on the same map.
METHODS = (
    Configuration("shadow-planes", "exact"),
    Configuration("light-volumes", "exact"),
    Configuration("min-max", "exact"),
    Configuration("ray-march", None, (("steps", 100), ("shadow", "map"))),
)
TIMES = ("frame", "light_moved", "objects_moved")
CLIFF = 0.6  #: steeper than the exponent by so much: 4 times the work then takes 2.3 times as long as it may
_SHORT = 5.0  # a time below which launches and clocks decide [ms]
#: By kind of work, the exponents of `TIMES`.
GROWTH = {
    "size": (1.0, 1.0, 1.0),
    "triangles": (0.5, 1.0, 1.0),
    "lights": (1.0, 1.0, 1.0),
    "media": (1.0, 1.0, 1.0),
    "map": (1.0, 2.0, 2.0),
}


Record = dict[str, Any]


def study_scaling(
    kind: str,
    steps: Sequence[Step],
    configurations: Sequence[Configuration],
    *,
    seconds: float = 0.3,
    progress: Progress | None = None,
) -> list[Record]:
    """Measure how methods grow with a kind of work, in steps of `validation.study.ladders.ladder`.

    Returns
    -------
    list of dict
        For each method its `label` and the `kind`; `costs`, by step, see `_cost`; `growth`, by name of `TIMES`, see
        `growth`; and in `refused` why there are no more steps, or None.
    """
    costs: dict[str, list[Record]] = {chosen.label: [] for chosen in configurations}
    refused: dict[str, str] = {}
    total = len(steps) * len(configurations)
    for number, step in enumerate(steps):
        scene = step.scene()
        for place, chosen in enumerate(configurations):
            if chosen.label not in refused:
                try:
                    costs[chosen.label].append(_cost(scene, step, chosen, seconds))
                except REFUSALS as error:
                    refused[chosen.label] = str(error)
            if progress is not None:
                progress(number * len(configurations) + place + 1, total, f"{kind} {step.work:g}, {chosen.label}")
    records = []
    for label, found in costs.items():
        works = [cost["work"] for cost in found]
        times = {name: growth(kind, name, works, [cost[name]["median_ms"] for cost in found]) for name in TIMES}
        records.append({"label": label, "kind": kind, "costs": found, "growth": times, "refused": refused.get(label)})
    return records


def _cost(scene: Scene, step: Step, chosen: Configuration, seconds: float) -> Record:
    """Return what a frame costs at one step.

    Beside the `work` and the `TIMES` there are those of the camera `rays` alone, the least that a frame takes which
    casts them, and the `memory` at the peak, beyond what was there before [MiB].
    """
    if step.parameters:
        own = dict(chosen.parameters) | dict(step.parameters)
        chosen = configuration(chosen.method, chosen.kernel, own)
    camera = scene.camera
    done, _ = render(scene, Cell("", (camera.width, camera.height), (), chosen, Measure("stages", seconds)))
    if done.times is None:
        raise InputError(done.reason or "")
    rays = time_repeated(camera_rays(prepared(scene, chosen)), seconds=0.5 * seconds, least=3)
    times = {name: getattr(done.times, name) for name in TIMES} | {"rays": rays}
    return {"work": step.work} | {name: plain(time) for name, time in times.items()} | {"memory": done.memory}


def growth(kind: str, name: str, works: Sequence[float], times: Sequence[float]) -> Record:
    """Return how one of `TIMES`, [ms] at steps of a kind of work, the least first, grows with the work.

    Returns
    -------
    dict
        The `exponent`, None for fewer than two steps, and its `standard_error` from the scatter about the line, None
        for fewer than three; the `steepest` exponent between two steps that follow one another, the work of the second
        of them, `at`, and whether that is a `cliff`, more than it may be.
    """
    order, standard_error = fitted_slope(works, times)
    steps = list(pairwise(zip(works, times)))
    local = [
        (math.log(after / before) / math.log(second / first), second) for (first, before), (second, after) in steps
    ]
    steepest, at = max(local, default=(math.nan, math.nan))
    most = GROWTH[kind][TIMES.index(name)] + CLIFF
    cliff = any(slope > most and after > _SHORT for (slope, _), (_, (_, after)) in zip(local, steps))
    found = {"exponent": -order, "standard_error": standard_error, "steepest": steepest, "at": at, "cliff": cliff}
    return dict(plain(found))
