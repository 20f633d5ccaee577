# SPDX-License-Identifier: BSD-3-Clause
"""A model from the rows of sweeps: `python -m validation.advise.fit ROWS.parquet [-o MODEL.json]`.

The choice is the cheapest of several predictions, and the cheapest is the one whose error was predicted too low more
often than others: margins of single predictions do not add up. So a margin is added to all predicted errors, the least
of a list with which the choices in scenes that were held out hold their error as often as they promise.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from validation.advise.choose import LEAST, SHARE
from validation.advise.features import features
from validation.advise.judge import Judgement, held_out_choices, judged
from validation.advise.model import PACKAGED, AdviceModel, ConfigurationModel, write_model
from validation.advise.regression import fit_regression
from validation.advise.rows import COSTS, SceneRow, read_rows

FEWEST = 6  #: scenes that a configuration is fitted to
_MARGINS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)  # decades


def fit_rows(rows: Sequence[SceneRow], about: Mapping[str, Any] | None = None) -> AdviceModel:
    """Return the model of some rows: of every configuration that was done in enough scenes."""
    refused = Counter(row.chosen for row in rows if row.refused)
    done: dict[Any, list[SceneRow]] = {}
    for row in rows:
        if not row.refused:
            done.setdefault(row.chosen, []).append(row)
    models = []
    for chosen, own in sorted(done.items(), key=lambda pair: pair[0].label):
        timed = [row for row in own if np.isfinite(row.cost)]
        if len({row.image[0] for row in timed}) < FEWEST:
            continue
        error = np.log10(np.maximum([row.error for row in own], LEAST))
        cost = np.log10([row.cost / (row.properties["pixels"] / 1e6) for row in timed])
        models.append(
            ConfigurationModel(
                chosen,
                fit_regression(_numbers(own), error),
                fit_regression(_numbers(timed), cost),
                len(own),
                refused[chosen],
            )
        )
    return AdviceModel(tuple(models), about or {})


def _numbers(rows: Sequence[SceneRow]) -> NDArray[np.float64]:
    return np.array([features(row.properties) for row in rows])


def fit_and_judge(rows: Sequence[SceneRow], about: Mapping[str, Any]) -> tuple[AdviceModel, Judgement]:
    """Return the model of all rows, with the margin that scenes held out ask for, and how well it chose there.

    Raises
    ------
    InputError
        If no configuration was done in enough scenes.
    """
    if not fit_rows(rows).configurations:
        raise InputError(f"rows: no configuration was done in {FEWEST} scenes or more; sweep more scenes")
    judgement = None
    for margin in _MARGINS:
        judgement = judged(held_out_choices(rows, fit_rows, margin), margin)
        if judgement.held >= SHARE or np.isnan(judgement.held):
            break
    assert judgement is not None
    words = {"scenes": len({row.image[0] for row in rows}), "rows": len(rows), "margin": judgement.margin}
    return fit_rows(rows, {**about, **words, "judgement": _plain(judgement)}), judgement


def _plain(judgement: Judgement) -> dict[str, Any]:
    return {name: None if value != value else value for name, value in asdict(judgement).items()}


def judgement_lines(judgement: Judgement) -> list[str]:
    """Return what a judgement says, in sentences."""
    return [
        f"{judgement.scenes} scenes, each held out once, {judgement.choices} choices.",
        f"Predicted to hold the error: {judgement.promised:.1%} of the choices; of these {judgement.held:.1%} did, "
        f"with a margin of {judgement.margin:g} decades.",
        f"Some configuration held the error in {judgement.possible:.1%}: there the choice did in "
        f"{judgement.held_of_possible:.1%}, and was within 1.3 times of the fastest that held it in "
        f"{judgement.close:.1%}.",
    ]


def main(words: Sequence[str] | None = None) -> int:
    """Fit, judge and write a model."""
    parser = argparse.ArgumentParser(prog="python -m validation.advise.fit", description=main.__doc__)
    parser.add_argument("rows", nargs="+", type=Path, help="Parquet files of sweeps, or their folders")
    parser.add_argument("-o", "--output", type=Path, default=PACKAGED, help="the model; the package's by default")
    parser.add_argument("--cost", choices=COSTS, default=COSTS[0], help="the column that is the cost of a frame")
    given = parser.parse_args(words)
    try:
        rows, made = read_rows(given.rows, given.cost)
        model, judgement = fit_and_judge(rows, made | {"cost": given.cost})
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    write_model(model, given.output)
    print("\n".join(judgement_lines(judgement)))
    print(f"{given.output}: {len(model.configurations)} configurations")
    return 0


if __name__ == "__main__":
    sys.exit(main())
