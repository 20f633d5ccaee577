# SPDX-License-Identifier: BSD-3-Clause
"""The scenes in which a configuration errs most, and the command that shows each again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reports.sweep.read import Sweep
from reports.sweep.samples import Sample
from validation.study.row import PROPERTY

COUNT = 10  #: worst scenes of a configuration


@dataclass(frozen=True)
class Worst:
    """A scene in which a configuration errs more than in others."""

    key: str  #: of the row
    scene: str
    medium: str | None  #: changes to the scene's medium; None for its own
    relative_rmse: float | None  #: None where the image has no finite pixel
    p99: float | None
    relative_bias: float | None
    truth_error: float | None
    nonfinite: int
    properties: dict[str, float | None]
    command: str


def worst(sweep: Sweep, sample: Sample, properties: Sequence[str], count: int = COUNT) -> list[Worst]:
    """Return the worst scenes of a configuration, the worst first; of equals the first of the sweep.

    Parameters
    ----------
    sweep
        Has the rows.
    sample
        Of the configuration.
    properties
        Which ones are told of each scene.
    count
        How many scenes.
    """
    errors = np.where(np.isnan(sample.errors), -np.inf, sample.errors)
    order = np.lexsort((-errors, -sample.nonfinite.astype(bool).astype(float)))
    places = [place for place in order if sample.measured[place]][:count]

    def known(column: str, row: int) -> float | None:
        value = float(sweep.numbers(column)[row])
        return value if np.isfinite(value) else None

    return [
        Worst(
            key=sweep.texts("key")[row],
            scene=sample.scenes[place],
            medium=sweep.texts("medium")[row],
            relative_rmse=float(sample.errors[place]) if np.isfinite(sample.errors[place]) else None,
            p99=known("error.p99", row),
            relative_bias=known("error.relative_bias", row),
            truth_error=known("reference.error", row),
            nonfinite=int(sample.nonfinite[place]),
            properties={name: known(f"{PROPERTY}{name}", row) for name in properties},
            command=sweep.texts("command")[row] or "",
        )
        for place in places
        for row in [sample.rows[place]]
    ]
