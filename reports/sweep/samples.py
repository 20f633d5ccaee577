# SPDX-License-Identifier: BSD-3-Clause
"""What the scenes say of each configuration: one sample a scene, however many cells a scene has.

Cells of one scene are not independent of one another, so they do not count twice: of the media of a scene the one with
the largest error stands for it. A configuration is a method with its kernel, its parameters and the size of its image.

Scenes that were drawn at random are a sample of what their ranges hold, and claims are about these alone; scenes that
somebody chose are a sample of nothing, and stand in for it only where there are no others.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reports.sweep.read import Numbers, Sweep, Texts, natural
from validation.study.row import FRAME_MS, NO_REFERENCE

FAULTS = ("failed", "hung", "aborted")  #: what became of a cell that neither ended nor was refused
UNTOLD = "no reference"  #: of a scene whose reference was not done, so that no method was asked


@dataclass(frozen=True)
class Sample:
    """One configuration over the scenes, one entry a scene."""

    label: str  #: as tables name it in full
    method: str
    scenes: tuple[str, ...]
    rows: tuple[int, ...]  #: of the sweep: where each scene's cell with the largest error stands
    statuses: tuple[str, ...]  #: what became of each scene: that of its row, or `UNTOLD`
    errors: Numbers  #: relative RMSE [1]: infinite where the image has no finite pixel, NaN where nothing was measured
    reference_errors: Numbers  #: the reference's own, over its mean [1]; 0 where it says nothing
    nonfinite: Numbers  #: pixels with NaN or infinity, in all cells of a scene
    times: Numbers  #: of a frame [ms], see `comparable_times`; NaN elsewhere

    @property
    def measured(self) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
        """Which scenes have an image to compare."""
        return np.array([status == "done" for status in self.statuses], dtype=bool)

    def count(self, *statuses: str) -> int:
        """Return how many scenes ended so."""
        return sum(status in statuses for status in self.statuses)


def drawn_at_random(sweep: Sweep) -> bool:
    """Return whether any scene was drawn at random, so that claims are about such scenes alone."""
    return bool(np.isfinite(sweep.numbers("seed")).any())


def samples(sweep: Sweep) -> list[Sample]:
    """Return the sample of every configuration, sorted by method and label."""
    labels, scenes, statuses = sweep.texts("label"), sweep.texts("scene"), _statuses(sweep)
    methods, errors = sweep.texts("method"), errors_of(sweep)
    reference_errors = np.nan_to_num(sweep.numbers("reference.error"), nan=0.0)
    nonfinite = np.nan_to_num(sweep.numbers("error.nonfinite"), nan=0.0)
    times = np.where(comparable_times(sweep), sweep.numbers(FRAME_MS), np.nan)
    counted = np.isfinite(sweep.numbers("seed")) if drawn_at_random(sweep) else np.ones(len(sweep), dtype=bool)
    groups: dict[tuple[str, str, str], dict[str, list[int]]] = {}
    for row, label in enumerate(labels):
        if counted[row]:
            group = groups.setdefault((label, methods[row], _size(sweep, row)), {})
            group.setdefault(scenes[row], []).append(row)
    groups = dict(sorted(groups.items(), key=lambda item: tuple(map(natural, (item[0][1], item[0][0], item[0][2])))))
    several = Counter((label, method) for label, method, _ in groups)
    full = [f"{label}{size}" if several[label, method] > 1 else label for label, method, size in groups]
    badness = [_badness(status, error) for status, error in zip(statuses, errors.tolist())]
    made = []
    for (_, method, _), whole, group in zip(groups, full, groups.values()):
        worst = tuple(max(rows, key=badness.__getitem__) for rows in group.values())
        places = list(worst)
        made.append(
            Sample(
                label=whole,
                method=method,
                scenes=tuple(group),
                rows=worst,
                statuses=tuple(statuses[places]),
                errors=errors[places],
                reference_errors=reference_errors[places],
                nonfinite=np.array([nonfinite[rows].sum() for rows in group.values()]),
                times=times[places],
            )
        )
    return made


def comparable_times(sweep: Sweep) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return which rows have times that may be compared with one another.

    Those that were taken while nothing else of the sweep ran on the host, on the host, device and threads that have the
    most such rows.
    """
    hosts, devices = sweep.texts("origin.host"), sweep.texts("origin.device")
    places = list(zip(hosts, devices, np.nan_to_num(sweep.numbers("origin.threads")).tolist()))
    alone = sweep.numbers("cost.alone") == 1
    most = Counter(place for place, timed in zip(places, alone) if timed).most_common(1)
    return alone & np.array([bool(most) and place == most[0][0] for place in places], dtype=bool)


def errors_of(sweep: Sweep) -> Numbers:
    """Return the relative RMSE of every row: NaN where nothing was measured, infinite where the image is unusable.

    Where the reference is black, an image that is black too has no error, and any other an infinite one. An image
    without a finite pixel has an infinite error.
    """
    done = sweep.texts("status") == "done"
    relative, absolute = sweep.numbers("error.relative_rmse"), sweep.numbers("error.rmse")
    unknown = np.where(absolute == 0, 0.0, np.inf)
    return np.where(done, np.where(np.isfinite(relative), relative, unknown), np.nan)


def _size(sweep: Sweep, row: int) -> str:
    width, height = sweep.numbers("width")[row], sweep.numbers("height")[row]
    return f" at {width:.0f} x {height:.0f}" if np.isfinite(width) and np.isfinite(height) else ""


def _statuses(sweep: Sweep) -> Texts:
    """Return what became of every row, and of those whose scene has no reference `UNTOLD`."""
    reasons = zip(sweep.texts("status"), sweep.texts("reason"))
    untold = [status in FAULTS and (reason or "").startswith(NO_REFERENCE) for status, reason in reasons]
    return np.where(untold, UNTOLD, sweep.texts("status"))


def _badness(status: str, error: float) -> tuple[int, float]:
    """Order the cells of a scene: a fault stands for it before any error, the rest only where nothing was measured."""
    return (2 if status in FAULTS else 1 if status == "done" else 0), 0.0 if np.isnan(error) else error


@dataclass(frozen=True)
class Fastest:
    """In how many scenes each configuration is the fastest within an error."""

    target: float
    counts: tuple[int, ...]  #: by configuration
    none: int  #: scenes in which no configuration is within the error
    scenes: int  #: in which whatever was measured was timed with the machine to itself


def fastest_within(made: Sequence[Sample], target: float) -> Fastest:
    """Return in how many scenes each configuration is the fastest within an error."""
    best: dict[str, tuple[float, int]] = {}
    timed: dict[str, bool] = {}
    for place, sample in enumerate(made):
        rows = zip(sample.scenes, sample.statuses, sample.errors, sample.nonfinite, sample.times)
        for scene, status, error, bad, time in rows:
            if status != "done":
                continue
            timed[scene] = timed.get(scene, True) and bool(np.isfinite(time))
            if error <= target and not bad and time < best.get(scene, (np.inf, 0))[0]:
                best[scene] = (float(time), place)
    scenes = {scene for scene, fully in timed.items() if fully}
    counts = [0] * len(made)
    for scene, (_, place) in best.items():
        counts[place] += scene in scenes
    return Fastest(target, tuple(counts), len(scenes) - sum(counts), len(scenes))
