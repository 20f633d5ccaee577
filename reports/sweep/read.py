# SPDX-License-Identifier: BSD-3-Clause
"""The Parquet of a sweep, read by columns: without Mitsuba, and without a scene."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from validation.sweep.row import COLUMNS, PROPERTY, STATUSES

FILE = "sweep.parquet"  #: in the folder of a sweep

Texts = NDArray[np.object_]
Numbers = NDArray[np.float64]

#: Columns without which nothing can be said.
_NEEDED = (
    *("key", "scene", "seed", "medium", "method", "label", "status", "reason"),
    *("relative_rmse", "rmse", "truth_error"),
)


@dataclass(frozen=True)
class Sweep:
    """Rows by columns, one of each key, sorted: the order in which they were finished is chance."""

    path: Path
    columns: Mapping[str, NDArray[Any]] = field(repr=False)  #: texts as objects, None for null; numbers with NaN
    properties: tuple[str, ...]  #: names of the scenes' properties, without what begins their columns

    def __len__(self) -> int:
        return len(self.columns["key"])

    def texts(self, name: str) -> Texts:
        """Return a column of text, None for null; all None for one that the Parquet lacks."""
        missing = np.full(len(self), None, dtype=object)
        return self.columns.get(name, missing)

    def numbers(self, name: str) -> Numbers:
        """Return a column of numbers, NaN for null; truth values are 0 and 1; all NaN for one that it lacks."""
        missing = np.full(len(self), np.nan)
        return self.columns.get(name, missing)

    def property(self, name: str) -> Numbers:
        """Return a property of the scene of every row, NaN where it is not known."""
        return self.numbers(PROPERTY + name)

    def pictures(self, keys: Sequence[str]) -> dict[str, bytes]:
        """Return the pictures that the Parquet has of these rows, by key."""
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        with _reading(self.path):
            if not keys or "picture" not in pq.read_schema(self.path).names:
                return {}
            wanted = pc.field("key").isin(list(keys)) & pc.field("picture").is_valid()
            columns = ["key", "picture"]
            found = pq.read_table(self.path, columns=columns, filters=wanted, page_checksum_verification=True)
            return dict(zip(found["key"].to_pylist(), found["picture"].to_pylist()))


def read_sweep(path: Path | str) -> Sweep:
    """Read the rows of a sweep.

    Parameters
    ----------
    path
        Of the Parquet, or of the folder that holds it.

    Raises
    ------
    InputError
        If there is none, it cannot be read, has no rows, or is not what this version of airlight writes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = _file_of(Path(path))
    with _reading(file):
        schema = pq.read_schema(file)
        names = [name for name in schema.names if name != "picture"]
        missing = [name for name in _NEEDED if name not in names]
        if missing:
            raise InputError(
                f"{file} has no column {missing[0]!r}, wanted the columns of a sweep of this version of airlight; "
                "run the sweep again: what its rows hold is kept"
            )
        kinds = {column.name: column.kind for column in COLUMNS}
        for name in names:
            text = pa.types.is_string(schema.field(name).type) or pa.types.is_large_string(schema.field(name).type)
            if text != (kinds.get(name, "float64") == "string") and name in kinds:
                raise InputError(
                    f"{file} has {schema.field(name).type} in the column {name!r}, wanted {kinds[name]}; "
                    "run the sweep again with this version of airlight"
                )
        wanted = [name for name in names if name in kinds or name.startswith(PROPERTY)]
        table = pq.read_table(file, columns=wanted, page_checksum_verification=True)
    if not table.num_rows:
        raise InputError(f"{file} has no rows: no cell of the sweep has ended; run it to its end, or for longer")
    columns = {name: _array(table[name]) for name in table.column_names}
    unknown = sorted(set(columns["status"]) - set(STATUSES))
    if unknown:
        raise InputError(f"{file} has the status {unknown[0]!r}, wanted one of {', '.join(STATUSES)}; run it again")
    _, first = np.unique(columns["key"].astype(str), return_index=True)
    order = [
        tuple(natural(columns[name][row] or "") for name in ("scene", "method", "label", "medium")) for row in first
    ]
    kept = first[sorted(range(len(first)), key=order.__getitem__)]
    columns = {name: values[kept] for name, values in columns.items()}
    properties = tuple(sorted(name.removeprefix(PROPERTY) for name in columns if name.startswith(PROPERTY)))
    return Sweep(file, columns, properties)


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Say in a line what is wrong with a file that Arrow cannot read."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError) as error:
        words = " ".join(str(error).split())
        raise InputError(f"{file} cannot be read as Parquet: {words[:160]}; run the sweep again") from error


def natural(text: str) -> tuple[str | int, ...]:
    """Return what sorts text as a reader does: random:9 before random:10."""
    return tuple(int(part) if place % 2 else part for place, part in enumerate(re.split(r"(\d+)", text)))


def _file_of(path: Path) -> Path:
    """Return the Parquet that a path names."""
    file = path / FILE if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file} is not there; wanted the folder of a sweep, `airlight sweep -o DIR`, or its Parquet")
    return file


def _array(column: Any) -> NDArray[Any]:
    """Return a column of Arrow as an array: texts as objects, all else as float64 with NaN for null."""
    import pyarrow as pa

    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
