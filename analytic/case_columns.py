# SPDX-License-Identifier: BSD-3-Clause
"""Cases from arrays in memory, with the columns and the checks of `analytic.cases.read_cases`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.cases import Cases, Table, checked_cases
from analytic.errors import InputError

Array = NDArray[np.float64]

_NAMES = {"foot": "t", "height": "h"}  # the names of the design, and those of the files
_WORDS = ("phase", "tag")
_VECTORS = {"origin": "ox oy oz", "direction": "dx dy dz", "light": "lx ly lz"}


def cases_from_columns(columns: Mapping[str, Any], *, name: str = "cases") -> tuple[Cases, tuple[int, ...]]:
    """Return cases from columns in memory, and the shape that their values have together.

    Parameters
    ----------
    columns
        By name the columns of `analytic.cases`, of any shapes that broadcast together. `foot` and `height` may stand
        for `t` and `h`, and `origin`, `direction` and `light`, (..., 3), for the coordinates of rays.
    name
        What messages call them; they count rows from 0.

    Raises
    ------
    InputError
        As `read_cases`, and for columns whose shapes do not go together.
    """
    given: dict[str, Any] = {}
    for key, values in columns.items():
        if key in _VECTORS:
            given |= _coordinates(key, values, name)
        else:
            given[_NAMES.get(key, key)] = np.asarray(values)
    known = {key: values for key, values in given.items() if key in _KNOWN}
    try:
        spread = np.broadcast_arrays(*known.values())
    except ValueError:
        shapes = ", ".join(f"{key} {values.shape}" for key, values in known.items())
        raise InputError(
            f"{name}: the columns have shapes that do not go together: {shapes}; give equal ones"
        ) from None
    shape = spread[0].shape if spread else ()
    flat = {key: values.reshape(-1) for key, values in zip(known, spread)}
    if not all(len(values) for values in flat.values()):
        raise InputError(f"{name}: the columns are empty; give at least one case")
    count = len(next(iter(flat.values()))) if flat else 0
    return checked_cases(_Columns(name, list(flat), [], flat, count)), shape


_KNOWN = frozenset(
    ("phase", "tag", "g", "t", "h", "x0", "x1", "sigma_t", "value", *" ".join(_VECTORS.values()).split())
)


def _coordinates(key: str, values: Any, name: str) -> dict[str, Array]:
    vectors = np.asarray(values)
    if vectors.ndim == 0 or vectors.shape[-1] != 3:
        raise InputError(f"{name}, column '{key}': got an array of shape {vectors.shape}, wanted (..., 3)")
    return {letter: vectors[..., number] for number, letter in enumerate(_VECTORS[key].split())}


@dataclass(frozen=True)
class _Columns(Table):
    """Columns that are arrays already."""

    arrays: Mapping[str, Any] = field(default_factory=dict)
    rows: int = 0

    @property
    def count(self) -> int:
        return self.rows

    def require(self, *names: str) -> None:
        missing = [name for name in names if name not in self.arrays]
        if missing:
            wanted = {key: word for word, key in _NAMES.items()}.get(missing[0], missing[0])
            raise InputError(
                f"{self.name}: no column '{wanted}'; got {', '.join(self.arrays) or 'none'}; "
                "wanted phase, x0, x1, sigma_t and either foot and height or origin, direction and light"
            )

    def cells(self, name: str) -> list[str]:
        return [str(value) for value in self.arrays[name].tolist()]

    def where(self, row: int, name: str) -> str:
        return f"{self.name}, row {row}, column '{name}'"

    def numbers(self, name: str, *, infinite: bool = False) -> Array:
        try:
            values = np.array(self.arrays[name], dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{self.name}, column '{name}': got no numbers; wanted an array of numbers") from None
        fine = ~np.isnan(values) if infinite or name == "x1" else np.isfinite(values)
        self.check(name, fine, "a finite number")
        return values
