# SPDX-License-Identifier: BSD-3-Clause
"""Rows on disk: a database to which finished rows are added, and the Parquet and JSON files of it.

`rows.sqlite` has each row once, by its key: a row whose key is there already replaces it. A row
that was added is on disk: a run that is killed, or whose disk is full, loses nothing that was
finished. One run at a time writes.
"""

import heapq
import json
import sqlite3
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from airlight.errors import InputError
from airlight.reference.storage.files import atomic_path, ensure_folder
from airlight.validation.study.row import COLUMNS, arrow_schema, property_names

#: The values of a row by the names of `validation.study.row.COLUMNS`: numbers, words and truth
#: values, None where one is not known; the picture is bytes.
Values = dict[str, Any]

#: files of the folder of a study
ROWS, PARQUET, JSON = "rows.sqlite", "sweep.parquet", "sweep.jsonl"

#: Number of the worst rows of a configuration, by each of `_WORST_BY`, that keep their
#: pictures in the Parquet.
PICTURES = 12
_WORST_BY = ("error.relative_rmse", "error.p99", "error.max")

_TABLE = (
    "CREATE TABLE IF NOT EXISTS rows (key TEXT PRIMARY KEY, status TEXT, data TEXT, picture BLOB)"
)
_ADD = "INSERT INTO rows VALUES (?, ?, ?, ?) ON CONFLICT DO UPDATE SET (status, data, picture) = "
_ADD += "(excluded.status, excluded.data, excluded.picture)"


class RowStore:
    """The rows of a folder, open for adding."""

    def __init__(self, folder: Path) -> None:
        self.folder = ensure_folder(folder)
        self.path = self.folder / ROWS
        self._rows = sqlite3.connect(self.path, timeout=0.0, isolation_level=None)
        # An exclusive lock from the first transaction on: a second run into the same folder is
        # refused at once, not at its first row.
        try:
            self._rows.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._rows.execute("BEGIN EXCLUSIVE")
            self._rows.execute(_TABLE)
            self._rows.execute("COMMIT")
        except sqlite3.OperationalError as error:
            self.close()
            if "locked" in str(error):
                raise InputError(
                    f"another sweep writes into {folder}: wait for it, or name another folder by -o"
                ) from None
            raise OSError(f"{error}: {self.path}") from error
        except sqlite3.DatabaseError as error:
            self.close()
            raise InputError(
                f"{self.path}: {error}; remove it, or name another folder by -o"
            ) from None
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "RowStore":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Give up the lock."""
        self._rows.close()

    def __contains__(self, key: object) -> bool:
        return self._one("SELECT 1 FROM rows WHERE key = ?", key) is not None

    def __len__(self) -> int:
        return int(self._rows.execute("SELECT count(*) FROM rows").fetchone()[0])

    def status(self, key: str) -> str | None:
        """Return the status of a row; None where there is none."""
        cells = self._one("SELECT status FROM rows WHERE key = ?", key)
        return None if cells is None else cells[0]

    def row(self, key: str) -> Values:
        """Return the row of a key that was added before."""
        cells = self._one("SELECT data, picture FROM rows WHERE key = ?", key)
        assert cells is not None, "it was added before"
        return _row(*cells)

    def add(self, row: Mapping[str, object]) -> None:
        """Add a row, or replace the one of the same key.

        If the disk is full an OSError names the file; the rows are as they were.
        """
        data = {
            name: value for name, value in row.items() if value is not None and name != "picture"
        }
        text = json.dumps(data, allow_nan=False)
        try:
            self._rows.execute(_ADD, (row["key"], row["status"], text, row.get("picture")))
        except sqlite3.OperationalError as error:
            raise OSError(f"{error}; {len(self)} rows are kept: {self.path}") from error

    def rows(self) -> Iterator[Values]:
        """Yield every row once, in the order in which they were first finished."""
        for data, picture in self._rows.execute("SELECT data, picture FROM rows ORDER BY rowid"):
            yield _row(data, picture)

    def write_parquet(self) -> Path:
        """Write `sweep.parquet` from all rows, whole or not at all, and return its path."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        # Rows are read three times, one by one: for the worst, for the columns, and to be written.
        pictured = worst_rows(self.rows())
        schema = arrow_schema(property_names(self.rows()))
        target = self.folder / PARQUET
        with (
            atomic_path(target) as temporary,
            pq.ParquetWriter(
                temporary, schema, compression="zstd", write_page_checksum=True
            ) as writer,
        ):
            batch: list[Values] = []
            for row in self.rows():
                batch.append(row if row["key"] in pictured else row | {"picture": None})
                if len(batch) == 4096:  # written at once: memory holds no more rows
                    writer.write_table(pa.Table.from_pylist(batch, schema=schema))
                    batch = []
            writer.write_table(pa.Table.from_pylist(batch, schema=schema))
        return target

    def write_json(self) -> Path:
        """Write `sweep.jsonl`, a row a line without its picture, whole or not at
        all, and return its path.
        """
        target = self.folder / JSON
        with atomic_path(target) as temporary, open(temporary, "w", encoding="utf-8") as file:
            for (data,) in self._rows.execute("SELECT data FROM rows ORDER BY rowid"):
                file.write(data + "\n")
        return target

    def _one(self, question: str, key: object) -> tuple[Any, ...] | None:
        """Return the cells of the row of a key, by a question; None where there is none."""
        cells: tuple[Any, ...] | None = self._rows.execute(question, (key,)).fetchone()
        return cells


def worst_rows(rows: Iterator[Values]) -> set[str]:
    """Return the keys of the worst rows of each configuration, which alone keep their pictures."""
    worst: dict[tuple[str, str], list[tuple[float, str]]] = {}
    for row in rows:
        for measure in _WORST_BY:
            if row.get(measure) is not None and row.get("picture") is not None:
                # A heap whose root is the least bad of the worst: the next worse one replaces it.
                best = worst.setdefault((row["label"], measure), [])
                heapq.heappush(best, (row[measure], row["key"]))
                if len(best) > PICTURES:
                    heapq.heappop(best)
    return {key for best in worst.values() for _, key in best}


def _row(data: str, picture: bytes | None) -> Values:
    return {**dict.fromkeys(each.key for each in COLUMNS), **json.loads(data), "picture": picture}
