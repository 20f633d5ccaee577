# SPDX-License-Identifier: BSD-3-Clause
"""Results of a report on disk: data that JSON can hold, and files (bytes by name).

`reference.storage.kept` names and keeps them. So a report computes only what changed, and one that was killed goes on.
"""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reference.storage.kept import Kept, Spent, load, stopwatch, store

_DATA = "data"  # the name of the array that holds the data as JSON
_FILE = "file-"  # prefix of the names of arrays that hold a file

Computed = tuple[dict[str, Any], Mapping[str, bytes]]  # data and files


@dataclass(frozen=True)
class CachedResult:
    """A result, and whether it was there already."""

    data: dict[str, Any]  #: what JSON can hold
    files: Mapping[str, bytes] = field(repr=False)  #: contents by name
    measured: str  #: date and time of the computation
    seconds: float  #: to compute it from nothing [s]
    cached: bool  #: whether it was there already


def load_result(key: str) -> CachedResult | None:
    """Return the result of a key; None if it is missing."""
    kept = load(key)
    return None if kept is None else _result(kept)


def store_result(key: str, computed: Computed, spent: Spent) -> CachedResult:
    """Keep what was computed, and what it took."""
    data, files = computed
    arrays = {_FILE + name: _bytes_array(content) for name, content in files.items()}
    return _result(store(key, arrays | {_DATA: _bytes_array(json.dumps(data, allow_nan=False).encode())}, spent))


def cached_result(key: str, compute: Callable[[], Computed]) -> CachedResult:
    """Return the result that is kept, or compute and keep it."""
    kept = load_result(key)
    if kept is not None:
        return kept
    spent = stopwatch()
    return store_result(key, compute(), spent())


def now() -> str:
    """Return date and time as YYYY-MM-DD HH:MM:SS with the time zone."""
    return _date(time.time())


def _date(seconds: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S %z", time.localtime(seconds))


def _result(kept: Kept) -> CachedResult:
    """Return a result as it comes from the disk, also where it has just been computed."""
    files = {name.removeprefix(_FILE): array.tobytes() for name, array in kept.arrays.items() if name != _DATA}
    data = json.loads(kept.arrays[_DATA].tobytes())
    return CachedResult(data, files, _date(kept.made), round(kept.spent.seconds, 3), kept.loaded)


def _bytes_array(content: bytes) -> np.ndarray:
    return np.frombuffer(content, dtype=np.uint8)
