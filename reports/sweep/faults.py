# SPDX-License-Identifier: BSD-3-Clause
"""Refusals with their reasons, faults of rows at any error, and the scenes with the largest errors.

Refusals and faults are of all rows, drawn scenes and named ones. Faults of a method that
reproduces a paper with its errors is no fault, and counted apart.

Reasons are counted after their numbers were taken out: "light 3 of 8" and
"light 1 of 2" are one reason.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reports.sweep.samples import FAULTS, Sample, Sweep
from airlight.reports.tables.methods import published
from airlight.validation.columns import column
from airlight.validation.study.row import PROPERTY

#: Possible faults of an image: name, the column that counts the pixels, and a description.
CHECKS = (
    ("not finite", "error.nonfinite", "pixels of the airlight that are NaN or infinite"),
    (
        "surface not finite",
        "surface_error.nonfinite",
        "pixels of the lit surfaces that are NaN or infinite",
    ),
    ("negative", "error.negative", "pixels of the airlight with a negative value"),
    (
        "surface negative",
        "surface_error.negative",
        "pixels of the lit surfaces with a negative value",
    ),
    (
        "outside of the bound",
        "stated.outside",
        "pixels whose error is larger than the bound that the method states",
    ),
)


@dataclass(frozen=True)
class Reason:
    """Why cells have no numbers."""

    status: str
    reason: str  #: numbers replaced by N, an example's scene by SCENE
    labels: tuple[str, ...]  #: of the configurations, the most frequent first
    scenes: int
    cells: int
    example: str  #: the command of one of them


@dataclass(frozen=True)
class Fault:
    """An image that is wrong whatever its error."""

    check: str = column("what", meaning="of `CHECKS`")
    scene: str = column()
    label: str = column("method")
    pixels: int = column()
    of: int = column(meaning="pixels compared")
    command: str = column("shown by")


@dataclass(frozen=True)
class Check:
    """How many rows were checked for a fault, and how many have it."""

    check: str = column("what would be wrong")
    rows: int = column("images checked")
    scenes: int = column()
    faulty_rows: int = column("images at fault")
    faulty_scenes: int = column("scenes at fault")
    published: int = column("more as a paper has it")
    meaning: str = column("which means")


def reasons(sweep: Sweep) -> list[Reason]:
    """Return why cells have no numbers, each reason once, the most frequent first."""
    statuses = ["refused", "left out", *FAULTS]
    groups: dict[tuple[str, str], list[int]] = {}
    # Rows of one status and one reason without its numbers are one group.
    texts, status, scenes = sweep["reason"], sweep["status"], sweep["scene"]
    for row in np.flatnonzero(np.isin(status.astype(str), statuses)).tolist():
        groups.setdefault(
            (status[row], without_numbers(texts[row] or "no reason given", scenes[row])), []
        ).append(row)
    labels, commands = sweep["label"], sweep["command"]
    made = [
        Reason(
            status=status,
            reason=reason,
            labels=tuple(label for label, _ in Counter(labels[rows]).most_common()),
            scenes=len(set(scenes[rows])),
            cells=len(rows),
            example=commands[rows[0]] or "",
        )
        for (status, reason), rows in groups.items()
    ]
    return sorted(made, key=lambda each: (statuses.index(each.status), -each.cells, each.reason))


def without_numbers(reason: str, scene: str) -> str:
    """Return a reason in which numbers are N and the scene is SCENE: the same for every scene."""
    text = re.sub(r"\s+", " ", reason.replace(scene, "SCENE")).strip()
    # Not in names: RGB8, light-volumes2.
    return re.sub(r"(?<![\w.-])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w-])", "N", text)


def checks(sweep: Sweep) -> list[Check]:
    """Return how many images were checked for each fault, and how many have it."""
    made, apart = [], _published(sweep)
    for name, counted, meaning in CHECKS:
        pixels, scenes = sweep[counted], sweep["scene"]
        # NaN: the row was not checked, for instance as its method states no bound.
        wrong = np.nan_to_num(pixels) > 0
        says, bad = np.isfinite(pixels) & ~apart, wrong & ~apart
        made.append(
            Check(
                name,
                int(says.sum()),
                len(set(scenes[says])),
                int(bad.sum()),
                len(set(scenes[bad])),
                int((wrong & apart).sum()),
                meaning,
            )
        )
    return made


def faults(sweep: Sweep) -> list[Fault]:
    """Return every image that is wrong, those with the most pixels first within a check."""
    labels, scenes, commands, of = (
        sweep[name] for name in ("label", "scene", "command", "error.pixels")
    )
    made, apart = [], _published(sweep)
    for name, counted, _ in CHECKS:
        pixels = np.where(apart, 0.0, np.nan_to_num(sweep[counted]))
        for row in sorted(np.flatnonzero(pixels > 0), key=lambda row: (-pixels[row], row)):
            # An image without a finite pixel compares none.
            whole = 0 if np.isnan(of[row]) else int(of[row])
            made.append(
                Fault(name, scenes[row], labels[row], int(pixels[row]), whole, commands[row] or "")
            )
    return made


def _published(sweep: Sweep) -> NDArray[np.bool_]:
    """Return which rows are of methods that reproduce a paper with its errors."""
    configurations = zip(*(sweep[name] for name in ("method", "kernel", "parameters")))
    return np.array([bool(published(*each)) for each in configurations], dtype=bool)


@dataclass(frozen=True)
class Worst:
    """A scene in which a configuration errs more than in others."""

    key: str  #: of the row
    scene: str
    medium: str | None  #: changes to the scene's medium; None for its own
    relative_rmse: float | None  #: None where the image has no finite pixel
    p99: float | None
    relative_bias: float | None
    reference_error: float | None
    nonfinite: int
    properties: dict[str, float | None]
    command: str


def worst(sweep: Sweep, sample: Sample, properties: Sequence[str]) -> list[Worst]:
    """Return the worst scenes of a configuration, the worst first, with
    some of their properties.
    """
    # Scenes with pixels that are not finite come first, as no error tells how bad they are; then by
    # error. lexsort takes its last key first.
    errors = np.where(np.isnan(sample.errors), -np.inf, sample.errors)
    order = np.lexsort((-errors, -sample.nonfinite.astype(bool).astype(float)))
    # The ten worst scenes.
    places = [place for place in order if sample.measured[place]][:10]

    def known(column: str, row: int) -> float | None:
        value = float(sweep[column][row])
        return value if np.isfinite(value) else None

    return [
        Worst(
            key=sweep["key"][row],
            scene=sample.scenes[place],
            medium=sweep["medium"][row],
            relative_rmse=float(sample.errors[place])
            if np.isfinite(sample.errors[place])
            else None,
            p99=known("error.p99", row),
            relative_bias=known("error.relative_bias", row),
            reference_error=known("reference.error", row),
            nonfinite=int(sample.nonfinite[place]),
            properties={name: known(f"{PROPERTY}{name}", row) for name in properties},
            command=sweep["command"][row] or "",
        )
        for place in places
        for row in [sample.rows[place]]
    ]
