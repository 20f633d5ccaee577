# SPDX-License-Identifier: BSD-3-Clause
"""The rows of a sweep from its Parquet: by configuration, errors, costs and properties of its scenes."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analytic.errors import InputError
from validation.configurations.methods import Configuration

_PROPERTY = "property."
#: Which cost is fitted: processor time, which a busy machine changes least, where every row has it.
COSTS = ("frame_ms", "frame_cpu_ms")


@dataclass(frozen=True)
class SceneRow:
    """A configuration in a scene."""

    image: tuple[str, str, int, int]  #: scene, medium, width and height
    chosen: Configuration
    properties: Mapping[str, float]
    refused: bool
    error: float = np.nan  #: relative RMSE
    cost: float = np.nan  #: of a frame [ms]; not a number where it was not timed


def read_rows(paths: Iterable[Path], cost: str = COSTS[0]) -> tuple[list[SceneRow], dict[str, Any]]:
    """Return the rows of Parquet files that were done or refused, and which versions and device made them.

    Parameters
    ----------
    paths
        Of the files, or of the folders of sweeps.
    cost
        The column that is the cost of a frame, of `COSTS`.

    Raises
    ------
    InputError
        For a file that is no Parquet of a sweep, and rows without properties.
    """
    import pyarrow.parquet as pq

    rows: list[SceneRow] = []
    made: dict[str, set[str]] = {name: set() for name in ("airlight", "mitsuba", "drjit", "device")}
    for given in paths:
        path = given / "sweep.parquet" if given.is_dir() else given
        try:
            columns = pq.read_schema(path).names
            wanted = [name for name in columns if name != "picture"]
            table = pq.read_table(path, columns=wanted).to_pylist()
        except (OSError, ValueError) as error:
            raise InputError(f"rows: cannot read {path}: {error}; wanted the Parquet of airlight sweep") from error
        if not {"method", "relative_rmse", "status", cost} <= set(columns):
            raise InputError(f"rows: {path} lacks the column {cost} or is no Parquet of airlight sweep")
        rows += _usable(table, cost)
        for row in table:
            for name, values in made.items():
                values |= {str(row[name])} if row.get(name) else set()
    if not rows:
        raise InputError("rows: none was done with times and properties; wanted a sweep with times of this version")
    return rows, {name: sorted(values) for name, values in made.items()}


def _usable(table: list[dict[str, Any]], cost: str) -> Iterable[SceneRow]:
    known: dict[tuple[str, str, int, int], dict[str, float]] = {}
    for row in table:
        properties = {
            name.removeprefix(_PROPERTY): value
            for name, value in row.items()
            if name.startswith(_PROPERTY) and value is not None
        }
        if properties:
            known[_image(row)] = properties
    for row in table:
        properties = known.get(_image(row), {})
        chosen = Configuration(row["method"], row["kernel"], tuple(json.loads(row["parameters"] or "{}").items()))
        if not properties:
            continue
        if row["status"] == "refused":
            yield SceneRow(_image(row), chosen, properties, True)
        elif row["status"] == "done" and row["relative_rmse"] is not None:
            yield SceneRow(_image(row), chosen, properties, False, row["relative_rmse"], row[cost] or np.nan)


def _image(row: Mapping[str, Any]) -> tuple[str, str, int, int]:
    return row["scene"], row["medium"] or "", row["width"], row["height"]
