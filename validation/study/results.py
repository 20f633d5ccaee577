# SPDX-License-Identifier: BSD-3-Clause
"""Results on disk: data that JSON can hold, and arrays. `reference.storage.kept` names and keeps them.

So a study computes only what changed, and one that was killed goes on.
"""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.storage.kept import Kept, load, stopwatch, store
from validation.columns import plain

_DATA = "data"  # the name of the array that holds the data as JSON

Computed = tuple[Any, Mapping[str, NDArray[Any]]]  #: data, records among it, and arrays


@dataclass(frozen=True)
class Result:
    """A result, and whether it was there already."""

    data: Any  #: as JSON holds it
    arrays: Mapping[str, NDArray[Any]] = field(repr=False)
    made: float  #: when it was computed [s since 1970]
    seconds: float  #: to compute it from nothing [s]
    cached: bool  #: whether it was there already

    @property
    def measured(self) -> str:
        """Date and time of the computation."""
        return date(self.made)


def cached_result(
    key: str, compute: Callable[[], Computed], *, worth: Callable[[Any], bool] = lambda data: True
) -> Result:
    """Return the result that is kept, or compute and keep it, if its data are worth it."""
    found = load(key)
    if found is None:
        spent = stopwatch()
        data, arrays = compute()
        text = json.dumps(plain(data), allow_nan=False).encode()
        whole = {**arrays, _DATA: np.frombuffer(text, dtype=np.uint8)}
        found = store(key, whole, spent()) if worth(data) else Kept(whole, spent(), time.time(), False)
    return _result(found)


def date(seconds: float | None = None) -> str:
    """Return date and time, now by default, as YYYY-MM-DD HH:MM:SS with the time zone."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z", time.localtime(seconds))


def _result(kept: Kept) -> Result:
    """Return a result as it comes from the disk, also where it has just been computed."""
    arrays = {name: array for name, array in kept.arrays.items() if name != _DATA}
    data = json.loads(np.asarray(kept.arrays[_DATA]).tobytes())
    return Result(data, arrays, kept.made, round(kept.spent.seconds, 3), kept.loaded)
