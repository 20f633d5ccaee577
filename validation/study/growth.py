# SPDX-License-Identifier: BSD-3-Clause
"""How the times of rows grow with the work of a scene.

A column t = t_0 w^e of the work w has the exponent e, the slope of log t over log w by least squares. The constant cost
of a frame makes the exponent of a time smaller. Between two steps a time may grow at most as

| work | a frame | the light moved | objects moved | why |
|---|---|---|---|---|
| pixels | 1 | 1 | 1 | each ray is by itself |
| triangles | 1/2 | 1 | 1 | rays meet silhouettes; preparation looks at every triangle |
| lights | 1 | 1 | 1 | one after the other |
| texels on a side of a map | 1 | 2 | 2 | a ray crosses a row of texels; the map has their square |

A step that is steeper by more than `CLIFF` is a cliff, where it takes longer than `_SHORT`: something overflows there.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import linregress

from validation.arrays import Counted
from validation.columns import record_of
from validation.study.ladders import Step
from validation.study.row import Row
from validation.study.run import run
from validation.study.study import Cell, Study
from validation.timing import Scaling, TimeGrowth

TIMES = ("frame", "light_moved", "objects_moved")
CLIFF = 0.6  #: steeper than the exponent by so much: 4 times the work then takes 2.3 times as long as it may
_SHORT = 5.0  # a time below which launches and clocks decide [ms]
#: By kind of work, the exponents of `TIMES`.
USUAL = {
    "size": (1.0, 1.0, 1.0),
    "triangles": (0.5, 1.0, 1.0),
    "lights": (1.0, 1.0, 1.0),
    "map": (1.0, 2.0, 2.0),
}


def study_growth(study: Study, kind: str, steps: Sequence[Step], *, progress: Counted | None = None) -> list[Scaling]:
    """Measure how methods grow with a kind of work, in steps of `validation.study.ladders.ladder`, in the first scene.

    A method ends at the first step that it refuses.
    """
    name, rows = study.scenes[0], list[list[Row]]([] for _ in study.configurations)
    for number, step in enumerate(steps):
        scene = step.scene()
        size = scene.camera.width, scene.camera.height
        for place, (chosen, own) in enumerate(zip(study.configurations, rows, strict=True)):
            if all(row.status == "done" for row in own):
                asked = replace(chosen, parameters=tuple((dict(chosen.parameters) | dict(step.parameters)).items()))
                own.append(run(Cell(name, size, (), asked, study.measure, (kind, step.work)), scene, None)[0])
            if progress is not None:
                done = number * len(rows) + place + 1
                progress(done, len(steps) * len(rows), f"{kind} {step.work:g}, {chosen.label}")
    found = []
    for chosen, own in zip(study.configurations, rows):
        costs: list[dict[str, Any]] = [
            {**row.times.measured, "work": row.work.amount, "rays": row.work.rays, "memory": row.memory}
            for row in own
            if row.times is not None and row.work is not None
        ]
        works = [cost["work"] for cost in costs]
        times = {each: [cost[each].median_ms for cost in costs] for each in TIMES}
        scaling = {
            "scene": Path(name).stem,
            "size": study.sizes[0],
            "label": chosen.label,
            "kind": kind,
            "costs": costs,
            "growth": {each: growth(kind, each, works, values) for each, values in times.items()},
            "refused": own[-1].reason,
        }
        found.append(record_of(scaling, Scaling))
    return found


def growth(kind: str, name: str, works: Sequence[float], times: Sequence[float]) -> TimeGrowth:
    """Return how one of `TIMES`, [ms] at steps of a kind of work, the least first, grows with the work."""
    exponent, standard_error = fitted_exponent(works, times)
    steps = list(pairwise(zip(works, times)))
    local = [
        (math.log(after / before) / math.log(second / first), second) for (first, before), (second, after) in steps
    ]
    steepest, at = max(local, default=(None, None))
    most = USUAL[kind][TIMES.index(name)] + CLIFF
    cliff = any(slope > most and after > _SHORT for (slope, _), (_, (_, after)) in zip(local, steps))
    found = {"exponent": exponent, "standard_error": standard_error, "steepest": steepest, "at": at, "cliff": cliff}
    return record_of(found, TimeGrowth)


def fitted_exponent(works: ArrayLike, values: ArrayLike) -> tuple[float, float]:
    """Return the exponent with which values (n,) grow with works (n,), and its standard error.

    The exponent is that of least squares of the logarithms, NaN for fewer than two values that are positive and finite;
    its standard error, from the scatter about the line, for fewer than three.
    """
    n, e = np.asarray(works, dtype=np.float64), np.asarray(values, dtype=np.float64)
    counts = (e > 0) & np.isfinite(e)
    if counts.sum() < 2:
        return math.nan, math.nan
    line = linregress(np.log(n[counts]), np.log(e[counts]))
    return float(line.slope), float(line.stderr) if counts.sum() > 2 else math.nan
