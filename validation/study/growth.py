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
from dataclasses import dataclass
from itertools import pairwise

from realtime.errors import InputError
from realtime.scene.read_scene import Scene
from validation.clock import Timing, time_repeated
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


@dataclass(frozen=True)
class Cost:
    """What a frame costs at one step."""

    work: float
    frame: Timing
    light_moved: Timing
    objects_moved: Timing
    rays: Timing  #: the camera rays alone: the least that a frame takes which casts them
    memory: float | None  #: at the peak, beyond what was there before [MiB]; None where the system does not say


@dataclass(frozen=True)
class Growth:
    """How one time grows with the work."""

    exponent: float  #: NaN for fewer than two steps
    standard_error: float  #: from the scatter about the line; NaN for fewer than three steps
    steepest: float  #: exponent between two steps that follow one another
    at: float  #: the work of the second of these
    cliff: bool  #: whether that is more than it may be


@dataclass(frozen=True)
class Scaling:
    """How a method grows with one kind of work."""

    kind: str
    configuration: Configuration
    costs: tuple[Cost, ...]
    growth: dict[str, Growth]  #: of `TIMES`
    refused: str | None = None  #: why there are no more steps


def study_scaling(
    kind: str,
    steps: Sequence[Step],
    configurations: Sequence[Configuration],
    *,
    seconds: float = 0.3,
    progress: Progress | None = None,
) -> list[Scaling]:
    """Measure how methods grow with a kind of work, in steps of `validation.study.ladders.ladder`."""
    costs: dict[Configuration, list[Cost]] = {chosen: [] for chosen in configurations}
    refused: dict[Configuration, str] = {}
    total = len(steps) * len(configurations)
    for number, step in enumerate(steps):
        scene = step.scene()
        for place, chosen in enumerate(configurations):
            if chosen not in refused:
                try:
                    costs[chosen].append(_cost(scene, step, chosen, seconds))
                except REFUSALS as error:
                    refused[chosen] = str(error)
            if progress is not None:
                progress(number * len(configurations) + place + 1, total, f"{kind} {step.work:g}, {chosen.label}")
    return [
        Scaling(
            kind,
            chosen,
            tuple(found),
            {name: growth(kind, name, found) for name in TIMES},
            refused.get(chosen),
        )
        for chosen, found in costs.items()
    ]


def _cost(scene: Scene, step: Step, chosen: Configuration, seconds: float) -> Cost:
    if step.parameters:
        own = dict(chosen.parameters) | dict(step.parameters)
        chosen = configuration(chosen.method, chosen.kernel, own)
    camera = scene.camera
    done = render(scene, Cell("", (camera.width, camera.height), (), chosen, Measure("stages", seconds)))
    if done.times is None:
        raise InputError(done.reason or "")
    rays = time_repeated(camera_rays(prepared(scene, chosen)), seconds=0.5 * seconds, least=3)
    frame, light, objects = (getattr(done.times, name) for name in TIMES)
    return Cost(step.work, frame, light, objects, rays, done.memory)


def growth(kind: str, name: str, costs: Sequence[Cost]) -> Growth:
    """Return how one of `TIMES` grows with the work, from the costs of steps, the least work first."""
    times = [getattr(cost, name).median_ms for cost in costs]
    order, standard_error = fitted_slope([cost.work for cost in costs], times)
    local = [
        (math.log(after / before) / math.log(second.work / first.work), second.work, after)
        for (first, second), (before, after) in zip(pairwise(costs), pairwise(times))
    ]
    steepest, at, _ = max(local, default=(math.nan, math.nan, 0.0))
    most = GROWTH[kind][TIMES.index(name)] + CLIFF
    cliff = any(slope > most and time > _SHORT for slope, _, time in local)
    return Growth(-order, standard_error, steepest, at, cliff)
