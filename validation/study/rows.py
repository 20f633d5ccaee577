# SPDX-License-Identifier: BSD-3-Clause
"""Rows on disk: one file to which finished rows are added, and the Parquet that is made of it.

`rows.jsonl` has a line for each row: a checksum and the row as JSON. A line is written with one call, so a process that
is killed leaves at most one torn line at the end, which the next run cuts off; nothing that was finished is lost. A row
whose key is there already replaces it, in the Parquet too, so no row is there twice. A full disk leaves the file as it
was. One run at a time writes: it holds a lock that the system drops when the process ends. Where there is a Parquet
alone, it is as good: a run begins with its rows.
"""

import base64
import heapq
import json
import os
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reference.storage.files import atomic_path, ensure_folder
from validation.study.row import arrow_schema, checked_row, property_names

ROWS, PARQUET = "rows.jsonl", "sweep.parquet"  #: files of a sweep's folder

#: Of every configuration, so many of the worst rows by each of `_WORST_BY` keep their pictures in the Parquet.
PICTURES = 12
_WORST_BY = ("relative_rmse", "p99", "max")

_BATCH = 4096  # rows that the Parquet is written in at once
_DIGITS = 9  # of the checksum, and a space


class RowStore:
    """The rows of a folder, open for adding."""

    def __init__(self, folder: Path) -> None:
        self.folder = ensure_folder(folder)
        self.path = self.folder / ROWS
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        try:
            _lock(self._file, self.folder)
            self._places: dict[str, tuple[int, int]] = {}  # key -> offset and length of its last line
            self._statuses: dict[str, str] = {}
            self._end = 0
            self._read()
            if not self._places:
                self._take_over()
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> "RowStore":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Give up the lock."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __contains__(self, key: object) -> bool:
        return key in self._places

    def __len__(self) -> int:
        return len(self._places)

    def status(self, key: str) -> str | None:
        """Return the status of a row; None where there is none."""
        return self._statuses.get(key)

    def row(self, key: str) -> dict[str, Any]:
        """Return the row of a key that is there."""
        offset, length = self._places[key]
        os.lseek(self._file, offset, os.SEEK_SET)
        row = _row(os.read(self._file, length))
        assert row is not None, "it was read, or written, before"
        return row

    def add(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Add a row, or replace the one of the same key, and return it as it is kept.

        Raises
        ------
        InputError
            If it is no row.
        OSError
            If the disk is full: the file is as it was, and the message names it.
        """
        row = checked_row(values)
        line = _line(row)
        try:
            os.lseek(self._file, self._end, os.SEEK_SET)
            written = 0
            while written < len(line):
                written += os.write(self._file, line[written:])
        except OSError as error:
            os.ftruncate(self._file, self._end)
            raise OSError(error.errno, f"{error.strerror}; {len(self)} rows are kept", str(self.path)) from error
        self._places[row["key"]] = (self._end, len(line))
        self._statuses[row["key"]] = row["status"]
        self._end += len(line)
        return row

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield every row once, in the order in which they were finished."""
        for key in sorted(self._places, key=self._places.__getitem__):
            yield self.row(key)

    def write_parquet(self) -> Path:
        """Write `sweep.parquet` from all rows, whole or not at all, and return its path."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        shown = worst_rows(self.rows())
        schema = arrow_schema(property_names(self.rows()))
        target = self.folder / PARQUET
        with (
            atomic_path(target) as temporary,
            pq.ParquetWriter(temporary, schema, compression="zstd", write_page_checksum=True) as writer,
        ):
            batch: list[dict[str, Any]] = []
            for row in self.rows():
                batch.append(row if row["key"] in shown else row | {"picture": None})
                if len(batch) == _BATCH:
                    writer.write_table(pa.Table.from_pylist(batch, schema=schema))
                    batch = []
            writer.write_table(pa.Table.from_pylist(batch, schema=schema))
        return target

    def _take_over(self) -> None:
        """Begin with the rows of a Parquet that somebody brought here without the file that it was made of."""
        source = self.folder / PARQUET
        if not source.is_file():
            return
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            with pq.ParquetFile(source) as file:
                for batch in file.iter_batches(batch_size=_BATCH):
                    for row in batch.to_pylist():
                        self.add(row)
        except pa.ArrowException as error:
            words = " ".join(str(error).split())
            raise InputError(
                f"{source}: it cannot be read ({words}); remove it, or name another folder by -o"
            ) from None

    def _read(self) -> None:
        with os.fdopen(os.dup(self._file), "rb") as file:
            file.seek(0)
            for line in file:
                row = _row(line)
                if row is not None:
                    self._places[row["key"]] = (self._end, len(line))
                    self._statuses[row["key"]] = row["status"]
                elif not line.endswith(b"\n"):
                    break  # torn by a kill: what comes next is written over it
                self._end += len(line)
        os.ftruncate(self._file, self._end)


def worst_rows(rows: Iterator[Mapping[str, Any]]) -> set[str]:
    """Return the keys of the rows whose pictures are worth keeping: the worst of each configuration."""
    worst: dict[tuple[str, str], list[tuple[float, str]]] = {}
    for row in rows:
        for measure in _WORST_BY:
            if row.get(measure) is not None and row.get("picture") is not None:
                best = worst.setdefault((row["label"], measure), [])
                heapq.heappush(best, (row[measure], row["key"]))
                if len(best) > PICTURES:
                    heapq.heappop(best)
    return {key for best in worst.values() for _, key in best}


def _line(row: Mapping[str, Any]) -> bytes:
    kept = {name: value for name, value in row.items() if value is not None}
    if "picture" in kept:
        kept["picture"] = base64.b64encode(kept["picture"]).decode()
    text = json.dumps(kept, allow_nan=False, ensure_ascii=True).encode()
    return f"{zlib.crc32(text):08x} ".encode() + text + b"\n"


def _row(line: bytes) -> dict[str, Any] | None:
    """Return the row of a line; None where the line is damaged."""
    text = line[_DIGITS:].rstrip(b"\n")
    if not line.endswith(b"\n") or line[:_DIGITS] != f"{zlib.crc32(text):08x} ".encode():
        return None
    kept = json.loads(text)
    if "picture" in kept:
        kept["picture"] = base64.b64decode(kept["picture"])
    return checked_row(kept)


def _lock(file: int, folder: Path) -> None:
    """Refuse a folder into which another run writes."""
    try:
        import fcntl
    except ImportError:  # Windows: two runs at once are the user's to avoid
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"another sweep writes into {folder}: wait for it, or name another folder by -o") from None
