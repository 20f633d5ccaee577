# SPDX-License-Identifier: BSD-3-Clause
"""Tables of airlight integrals: one case a row, read from CSV, checked, and integrated.

Two sets of columns are known, each in any order and beside others:

    tag, phase, g, t, h, x0, x1, sigma_t, value                         the ray by foot (t) and height (h)
    phase, g, ox, oy, oz, dx, dy, dz, lx, ly, lz, x0, x1, sigma_t, value      the ray by origin, direction and light

`phase` is in the words of `analytic.phase.phase_from_words`, such as hg or mie:6. `tag`, `g` (then 0) and `value` may
be missing. An x1 of `inf` is a ray that never ends.
"""

import csv
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from analytic.geometry import foot_and_height
from analytic.panels import airlight_segments
from analytic.phase import phase_from_words

Array = NDArray[np.float64]

_RAY = ("ox", "oy", "oz", "dx", "dy", "dz", "lx", "ly", "lz")
_FOOT = ("t", "h")


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
    rows: tuple[tuple[str, ...], ...]  #: the text of all columns, to write the table out again; none from memory


def read_cases(path: str | Path, *, phase: str | None = None) -> Cases:
    """Read a table of cases.

    Parameters
    ----------
    path
        A CSV file with a header line; see the module's docstring for the columns.
    phase
        Words of a phase function for all rows, in place of the column, which may then be missing; the values of the
        file, which are of others, are left out.

    Raises
    ------
    InputError
        For a file that cannot be read, a missing column, a word where a number belongs, a number out of its range or an
        unknown phase function: the message names file, line (from 1, the header) and column.
    """
    header, lines = _read_text(Path(path))
    if phase is None:
        return checked_cases(Table(str(path), header, lines))
    phase_from_words(phase)
    if "phase" not in header:
        header, lines = [*header, "phase"], [(number, [*cells, ""]) for number, cells in lines]
    column = header.index("phase")
    replaced = [(number, [*cells[:column], phase, *cells[column + 1 :]]) for number, cells in lines]
    return replace(checked_cases(Table(str(path), header, replaced)), value=None)


def checked_cases(table: "Table") -> Cases:
    """Return the cases of a table.

    Raises
    ------
    InputError
        As `read_cases` does.
    """
    header = table.header
    rays = "t" not in header and any(name in header for name in _RAY)
    table.require("phase", *(_RAY if rays else _FOOT), "x0", "x1", "sigma_t")
    columns = {name: table.numbers(name) for name in ("x0", "x1", "sigma_t", *(_RAY if rays else _FOOT))}
    g = table.numbers("g") if "g" in header else np.zeros(table.count)
    phase = tuple(cell.strip().lower() for cell in table.cells("phase"))
    for row, name in enumerate(phase):
        reason = "'tabulated' has no place for its table here" if name == "tabulated" else _fault(name)
        if reason:
            raise InputError(f"{table.where(row, 'phase')}: {reason}")
    table.check("g", np.abs(g) < 1, "a number between -1 and 1")
    table.check("sigma_t", columns["sigma_t"] >= 0, "a number >= 0")
    table.check("x1", columns["x1"] >= columns["x0"], "a number >= x0, or inf")
    origin = direction = light = None
    if rays:
        origin, direction, light = (np.stack([columns[n] for n in _RAY[k : k + 3]], axis=1) for k in (0, 3, 6))
        length = np.sqrt(np.sum(direction**2, axis=1))
        table.check("dx", np.abs(length - 1) <= 1e-5, "a direction of length 1")
        foot, height = foot_and_height(origin, direction, light)
    else:
        foot, height = columns["t"], columns["h"]
        table.check("h", height >= 0, "a number >= 0")
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
        tuple(header),
        tuple(tuple(cells) for _, cells in table.lines),
    )


def integrate_cases(cases: Cases, *, rtol: float = 1e-10) -> tuple[Array, Array]:
    """Return J and its error estimate [1/m] for every case, (cases,), by `analytic.panels.airlight_segments`.

    `rtol` is the relative error asked for [1].
    """
    value, error = np.empty(len(cases.phase)), np.empty(len(cases.phase))
    for name, g in sorted(set(zip(cases.phase, cases.g.tolist()))):
        rows = np.flatnonzero((np.array(cases.phase) == name) & (cases.g == g))
        columns = (cases.foot[rows], cases.height[rows], cases.x0[rows], cases.x1[rows], cases.sigma_t[rows])
        value[rows], error[rows] = airlight_segments(*columns, phase_from_words(name, g=g), rtol=rtol)
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
class Table:
    """The text of a table and where it came from, for messages."""

    name: str  #: path of the file
    header: list[str]
    lines: list[tuple[int, list[str]]]  #: number of the line in the file, cells

    @property
    def count(self) -> int:
        """How many cases there are."""
        return len(self.lines)

    def require(self, *names: str) -> None:
        """Refuse a table without these columns."""
        missing = [name for name in names if name not in self.header]
        if missing:
            raise InputError(
                f"{self.name}, line 1: no column '{missing[0]}'; the file has {', '.join(self.header)}: add it, the "
                f"columns wanted are phase, x0, x1, sigma_t and either t, h or {', '.join(_RAY)}"
            )

    def cells(self, name: str) -> list[str]:
        """Return the text of the column `name`, one entry for each row."""
        column = self.header.index(name)
        return [cells[column] for _, cells in self.lines]

    def where(self, row: int, name: str) -> str:
        """Return the words for a message that name the cell of a row in the column `name`."""
        return f"{self.name}, line {self.lines[row][0]}, column '{name}'"

    def numbers(self, name: str, *, infinite: bool = False) -> Array:
        """Return the column `name` as numbers, (rows,), finite but for `x1` and where `infinite` allows it.

        Raises
        ------
        InputError
            For a cell that is no number, or not finite, with its line and column.
        """
        values = np.empty(len(self.lines))
        for row, cell in enumerate(self.cells(name)):
            try:
                values[row] = float(cell)
            except ValueError:
                raise InputError(f"{self.where(row, name)}: '{cell}' is not a number; write one") from None
            fine = not math.isnan(values[row]) if infinite or name == "x1" else math.isfinite(values[row])
            if not fine:
                raise InputError(f"{self.where(row, name)}: {cell} is not finite; write a finite number")
        return values

    def check(self, name: str, fine: NDArray[np.bool_], wanted: str) -> None:
        """Refuse the column `name` where a row is not `fine`, (rows,); `wanted` says what it should be.

        Raises
        ------
        InputError
            With the first such cell.
        """
        if not fine.all():
            row = int(np.argmin(fine))
            given = self.cells(name)[row]
            raise InputError(f"{self.where(row, name)}: {given} is out of range; wanted {wanted}")


def _read_text(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header and the lines with cells, each with its number in the file."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, cells) for cells in reader if cells]
    except (OSError, UnicodeDecodeError, csv.Error) as reason:
        raise InputError(f"{path} cannot be read as a CSV file: {reason}; give a text file with a header") from None
    if len(lines) < 2:
        raise InputError(f"{path} has {'no lines' if not lines else 'a header only'}; wanted a header and cases")
    header = [cell.strip() for cell in lines[0][1]]
    for number, cells in lines[1:]:
        if len(cells) != len(header):
            raise InputError(
                f"{path}, line {number}: {len(cells)} cells under a header of {len(header)} columns; write one for each"
            )
    return header, lines[1:]
