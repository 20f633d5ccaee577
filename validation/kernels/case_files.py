# SPDX-License-Identifier: BSD-3-Clause
"""Tables of airlight integrals: one case a row, read from CSV or from arrays in memory,
checked, and integrated.

Two sets of columns are known, each in any order and beside others:

    tag, phase, g, foot, height, x0, x1, sigma_t, value                 the ray by foot and height, or t and h
    phase, g, ox, oy, oz, dx, dy, dz, lx, ly, lz, x0, x1, sigma_t, value      the ray by origin, direction and light

`phase` is in the words of `analytic.phase.phase_from_words`, such as hg or mie:6. `tag`, `phase`
(then isotropic), `g` (then 0) and `value` may be missing. An x1 of `inf` is a ray that never ends.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.panels import airlight_segments
from airlight.analytic.phase import phase_from_words
from airlight.errors import InputError
from airlight.validation.arrays import Array, Bools
from airlight.validation.readers import each_once, read_csv

_RAY = ("ox", "oy", "oz", "dx", "dy", "dz", "lx", "ly", "lz")
_FOOT = ("foot", "height")
_SHORT = {"foot": "t", "height": "h"}  # as the certified file has them
_VECTORS = {"origin": _RAY[:3], "direction": _RAY[3:6], "light": _RAY[6:]}
_KNOWN = frozenset(
    ("phase", "tag", "g", "x0", "x1", "sigma_t", "value", *_FOOT, *_SHORT.values(), *_RAY)
)


@dataclass(frozen=True)
class Cases:
    """The rows of a table of cases, arrays of shape (n,) in the order of the file."""

    phase: tuple[str, ...]  #: phase functions, in the words of `analytic.phase.phase_from_words`
    g: Array  #: mean cosine, 0 where the phase function has none
    foot: Array  #: [m]
    height: Array  #: [m]
    x0: Array  #: [m]
    x1: Array  #: [m], may be infinite
    sigma_t: Array  #: [1/m]
    value: Array | None  #: J [1/m] as given by the file
    tag: tuple[str, ...] | None  #: kind of each case as given by the file
    origin: Array | None  #: (n, 3) [m], where the file gives rays
    direction: Array | None  #: unit vectors, (n, 3), where the file gives rays
    light: Array | None  #: (n, 3) [m], where the file gives rays
    header: tuple[str, ...]  #: names of all columns of the file
    #: the text of all columns, to write the table out again; none of generated rays
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...] = ()  #: of the rows in their file; none from memory

    def place(self, row: int) -> str:
        """Return where a row is, in words: its line in the file, or its number."""
        return f"line {self.lines[row]}" if self.lines else f"row {row}"


def read_cases(path: str | Path) -> Cases:
    """Read a table of cases.

    `path`: a CSV file with a header line; see the module's docstring for the columns. Raises
    InputError for a file that cannot be read, a missing column, a word where a number belongs, a
    number out of its range or an unknown phase function: the message names file, line (from 1, the
    header) and column.
    """
    (_, header), *lines = read_csv(Path(path)) or [(1, [])]
    if not lines:
        raise InputError(
            f"{path} has {'a header only' if header else 'no lines'}; expected a header and cases"
        )
    # Which of two columns of one name is meant nobody can tell.
    each_once(f"{path}, header", tuple(filter(None, header)))
    # From rows of cells to columns of text, by the names of the header.
    columns = dict(zip(header, zip(*(cells for _, cells in lines), strict=True), strict=True))
    return _checked(_Table(str(path), columns, tuple(number for number, _ in lines)))


def cases_from_columns(columns: Mapping[str, ArrayLike]) -> tuple[Cases, tuple[int, ...]]:
    """Return cases from columns in memory, and the shape that their values have together.

    `columns`: by name the columns of this module, of any shapes that broadcast together; `origin`,
    `direction` and `light`, (..., 3), may stand for the coordinates of rays. Raises InputError as
    `read_cases`, and for columns whose shapes do not go together; messages count rows from 0.
    """
    # Vectors are split into the columns of a file, such as ox, oy, oz; both ways share all checks
    # from there on.
    arrays: dict[str, NDArray[np.generic]] = {}
    for key, values in columns.items():
        column = np.asarray(values)
        if key not in _VECTORS:
            arrays[key] = column
        elif column.ndim == 0 or column.shape[-1] != 3:
            raise InputError(
                f"cases, column '{key}': got an array of shape {column.shape}, expected (..., 3)"
            )
        else:
            arrays |= {letter: column[..., number] for number, letter in enumerate(_VECTORS[key])}
    # Columns with other names are left out: their shapes need not fit.
    arrays = {key: values for key, values in arrays.items() if key in _KNOWN}
    try:
        spread = np.broadcast_arrays(*arrays.values())
    except ValueError:
        shapes = ", ".join(f"{key} {values.shape}" for key, values in arrays.items())
        raise InputError(
            f"cases: the columns have shapes that do not go together: {shapes}; give equal ones"
        ) from None
    # The common shape is returned so that the results can have it, too.
    shape = spread[0].shape if spread else ()
    flat = {key: values.reshape(-1) for key, values in zip(arrays, spread)}
    if not all(len(values) for values in flat.values()):
        raise InputError("cases: the columns are empty; give at least one case")
    return _checked(_Table("cases", flat)), shape


def _checked(table: "_Table") -> Cases:
    """Return the cases of a table."""
    header = tuple(table.columns)
    for name, short in _SHORT.items():
        if name in header and short in header:
            raise InputError(
                f"{table.name}: the columns '{name}' and '{short}' are the same; leave one of them "
                "out"
            )
    # Foot and height win where a table has both sets of columns.
    rays = table.named("foot") not in header and any(name in header for name in _RAY)
    table.require(*(_RAY if rays else _FOOT), "x0", "x1", "sigma_t")
    columns = {
        name: table.numbers(name) for name in ("x0", "x1", "sigma_t", *(_RAY if rays else _FOOT))
    }
    g = table.numbers("g") if "g" in header else np.zeros(table.count)
    words = table.cells("phase") if "phase" in header else ["isotropic"] * table.count
    phase = tuple(cell.strip().lower() for cell in words)
    # The first row with an unknown phase function is named; `_fault` remembers what it has tried.
    for row, name in enumerate(phase):
        reason = (
            "'tabulated' has no place for its table here" if name == "tabulated" else _fault(name)
        )
        if reason:
            raise InputError(f"{table.where(row, 'phase')}: {reason}")
    # A mean cosine that no phase function takes would be dropped.
    table.check(
        "g",
        (g == 0) | (np.array(phase) == "hg"),
        "0, or 'hg' in a column 'phase': other phase functions have no g",
    )
    # At |g| = 1 the phase function is a delta function.
    table.check("g", np.abs(g) < 1, "a number between -1 and 1")
    table.check("sigma_t", columns["sigma_t"] >= 0, "a number >= 0")
    table.check("x1", columns["x1"] >= columns["x0"], "a number >= x0, or inf")
    origin = direction = light = None
    if rays:
        origin, direction, light = (
            np.stack([columns[n] for n in _RAY[k : k + 3]], axis=1) for k in (0, 3, 6)
        )
        # Files have directions in decimals: their length need not be 1 to the last digit.
        length = np.sqrt(np.sum(direction**2, axis=1))
        table.check("dx", np.abs(length - 1) <= 1e-5, "a direction of length 1")
        foot, height = foot_and_height(origin, direction, light)
    else:
        foot, height = columns["foot"], columns["height"]
        table.check("height", height >= 0, "a number >= 0")
    return Cases(
        phase,
        np.where(np.array(phase) == "hg", g, 0.0),
        foot,
        height,
        columns["x0"],
        columns["x1"],
        columns["sigma_t"],
        table.numbers("value", infinite=True) if "value" in header else None,
        tuple(table.cells("tag")) if "tag" in header else None,
        origin,
        direction,
        light,
        header,
        tuple(zip(*map(table.cells, header), strict=True)),
        table.lines,
    )


def integrate_cases(
    cases: Cases, *, rtol: float = 1e-10, table: Sequence[float] | None = None
) -> tuple[Array, Array]:
    """Return J and its error estimate [1/m] for every case, (cases,), by
    `analytic.panels.airlight_segments`.

    `rtol` is the relative error asked for [1], `table` has the values of the
    phase function 'tabulated'.
    """
    value, error = np.empty(len(cases.phase)), np.empty(len(cases.phase))
    # A quadrature takes one phase function at a time: rows are grouped by phase function and g.
    for name, g in sorted(set(zip(cases.phase, cases.g.tolist()))):
        rows = np.flatnonzero((np.array(cases.phase) == name) & (cases.g == g))
        columns = (
            cases.foot[rows],
            cases.height[rows],
            cases.x0[rows],
            cases.x1[rows],
            cases.sigma_t[rows],
        )
        phase = phase_from_words(name, g=g, table=table)
        value[rows], error[rows] = airlight_segments(*columns, phase, rtol=rtol)
    return value, error


@cache
def _fault(words: str) -> str:
    """Return why words name no phase function, nothing where they do."""
    try:
        phase_from_words(words)
    except InputError as reason:
        return str(reason)
    return ""


@dataclass(frozen=True)
class _Table:
    """Columns and where they came from, for messages."""

    name: str  #: path of the file, or what messages call the columns
    columns: Mapping[str, Sequence[str] | NDArray[np.generic]]  #: by name text or numbers, (rows,)
    #: number of each row's line in the file; none for columns from memory
    lines: tuple[int, ...] = ()

    @property
    def count(self) -> int:
        """How many cases there are."""
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def named(self, name: str) -> str:
        """Return the name that the table has for a column: foot and height have short ones, too."""
        return name if name in self.columns else _SHORT.get(name, name)

    def require(self, *names: str) -> None:
        """Refuse a table without these columns."""
        missing = [name for name in names if self.named(name) not in self.columns]
        if not missing:
            return
        place = f"{self.name}, line 1" if self.lines else self.name
        rays = ", ".join(_RAY if self.lines else _VECTORS)
        raise InputError(
            f"{place}: no column '{missing[0]}'; got {', '.join(self.columns) or 'none'}; expected "
            "x0, x1, sigma_t "
            f"and either foot and height or {rays}"
        )

    def cells(self, name: str) -> list[str]:
        """Return the text of the column `name`, one entry for each row."""
        return [str(value) for value in np.asarray(self.columns[self.named(name)]).tolist()]

    def where(self, row: int, name: str) -> str:
        """Return the words for a message that name the cell of a row in the column `name`."""
        place = f"line {self.lines[row]}" if self.lines else f"row {row}"
        return f"{self.name}, {place}, column '{self.named(name)}'"

    def numbers(self, name: str, *, infinite: bool = False) -> Array:
        """Return the column `name` as numbers, (rows,), finite except for `x1` and
        where `infinite` allows it.

        Raises InputError for a cell that is no number, or not finite, with its place.
        """
        try:
            # NumPy converts the whole column at once; only when this fails is the cell that caused
            # it looked for.
            values = np.array(self.columns[self.named(name)], dtype=np.float64)
        except (TypeError, ValueError):
            row = next(
                (row for row, cell in enumerate(self.cells(name)) if not _is_number(cell)), 0
            )
            raise InputError(
                f"{self.where(row, name)}: '{self.cells(name)[row]}' is not a number; write one"
            ) from None
        # An infinite x1 is a ray that never ends; anything else must be finite.
        fine = ~np.isnan(values) if infinite or name == "x1" else np.isfinite(values)
        self.check(name, fine, "a finite number")
        return values

    def check(self, name: str, fine: Bools, wanted: str) -> None:
        """Refuse the column `name` where a row is not `fine`, (rows,);
        `wanted` says what it should be.

        Raises InputError with the first such cell.
        """
        if not fine.all():
            row = int(np.argmin(fine))
            raise InputError(
                f"{self.where(row, name)}: {self.cells(name)[row]} is out of range; expected "
                f"{wanted}"
            )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
