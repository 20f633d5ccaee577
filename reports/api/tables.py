# SPDX-License-Identifier: BSD-3-Clause
"""Tables and reports as results of the Python API: frozen, plain numbers by name, tables in a notebook."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from analytic.cases import Cases
from reports.api.results import as_array

if TYPE_CHECKING:
    from reports.tables.table import Row

Array = NDArray[np.float64]

_SHOWN = 12  #: rows of integrals shown in a notebook


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Integrals:
    """The airlight integral of some cases by a kernel."""

    J: Array  #: by the kernel [1/m], of the shape of the columns that were given
    value: Array | None  #: certified, or as given by the file [1/m], of the same shape
    kernel: str
    precision: str  #: 'single' or 'double'
    cases: Cases  #: the cases, one after the other
    summary: Mapping[str, Any]  #: number of rows and, with values to compare, the quantiles of the relative error

    @property
    def error(self) -> Array | None:
        """The signed relative error (J - value) / value; None where there is nothing to compare with."""
        if self.value is None:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.value == self.J, 0.0, (self.J - self.value) / np.abs(self.value))

    def numpy(self, dtype: DTypeLike | None = None) -> NDArray[Any]:
        """Return J as an array of one's own, which can be written to."""
        return np.array(self.J, dtype=dtype)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return as_array(self.J, dtype, copy)

    def __len__(self) -> int:
        return self.J.size

    def to_dict(self) -> dict[str, list[Any]]:
        """Return columns by name, a value for each case, as `pandas.DataFrame` takes them."""
        cases = self.cases
        names = {"phase": cases.phase, "g": cases.g, "foot": cases.foot, "height": cases.height}
        names |= {"x0": cases.x0, "x1": cases.x1, "sigma_t": cases.sigma_t, "J": self.J.reshape(-1)}
        names |= {} if self.value is None else {"value": self.value.reshape(-1)}
        return {name: np.asarray(values).tolist() for name, values in names.items()}

    def _repr_html_(self) -> str:
        from reports.api.html import block, paragraph
        from reports.tables.drawing import html
        from reports.tables.table import Column, table

        data = {"": list(range(len(self)))} | self.to_dict()
        columns = [Column(name, name, digits=9) for name in data]
        rows = list(zip(*data.values()))[:_SHOWN]
        left = len(self) - len(rows)
        more = paragraph(f"and {left} more") if left else ""
        return block(self._title(), html(table("", columns, rows)), more)

    def _title(self) -> str:
        compared = self.summary.get("p50") is not None
        errors = [f"{name} {self.summary[name]:.3g}" for name in ("p50", "p99", "max")] if compared else []
        words = f"; relative error {', '.join(errors)}" if errors else ""
        return f"{len(self)} integrals by {self.kernel} in {self.precision} precision{words}"

    def __repr__(self) -> str:
        return f"Integrals({self._title()})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BenchTable:
    """Speed against error: a row for each configuration in each scene.

    A row has `scene`, `width`, `height`, `label`, `method`, `kernel`; medians `frame_ms` with its quartiles
    `frame_low_ms` and `frame_high_ms`, `airlight_ms`, `surface_ms`, `light_moved_ms`, `objects_moved_ms`
    (after these moved), `light_moved_camera_kept_ms` (after the light moved, camera rays kept), `colours_changed_ms`
    (after only medium or colours changed) [ms]; of the airlight `relative_rmse`, `relative_bias`, `p50`, `p99`, `max`,
    `nonfinite` and `negative`; `refused`, why the method cannot render the scene, and `note`. Missing values
    are None.
    """

    rows: tuple[Mapping[str, Any], ...]
    environment: Mapping[str, Any]  #: the machine and the versions

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        return iter(self.rows)

    def __getitem__(self, index: int) -> Mapping[str, Any]:
        return self.rows[index]

    def to_dict(self) -> dict[str, list[Any]]:
        """Return columns by name, as `pandas.DataFrame` takes them."""
        names = list(dict.fromkeys(name for row in self.rows for name in row))
        return {name: [row.get(name) for row in self.rows] for name in names}

    def fastest(self, error: float, scene: str | None = None) -> Mapping[str, Any] | None:
        """Return the row of the fastest frame whose relative RMSE is at most `error`; None where there is none.

        Parameters
        ----------
        error
            Relative RMSE of the airlight, such as 0.01.
        scene
            Its name; all scenes by default.
        """
        from reports.tables.methods import fastest_within

        entries = [
            {"row": row, "error": row, "times": row["frame_ms"] and {"frame": {"median_ms": row["frame_ms"]}}}
            for row in self.rows
            if scene in (None, row["scene"])
        ]
        best = fastest_within(error, entries)
        return best["row"] if best else None

    def _repr_html_(self) -> str:
        from reports.api.html import block
        from reports.tables.drawing import html
        from reports.tables.methods import methods_table

        keys = ("label", "frame", "frame_rate", "airlight", "light_moved", "relative_rmse", "relative_bias", "p99")
        parts: dict[str, list[Row]] = {}
        for row in self.rows:
            parts.setdefault("{scene}, {width} x {height}".format_map(row), []).append(_bench_row(row))
        return block(self._title(), *(html(methods_table(title, rows, *keys)) for title, rows in parts.items()))

    def _title(self) -> str:
        from reports.machine.environment import machine_in_words

        return machine_in_words(self.environment)

    def __repr__(self) -> str:
        scenes = ", ".join(dict.fromkeys(row["scene"] for row in self.rows))
        return f"BenchTable({len(self.rows)} rows: {scenes})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Report:
    """An error report that was written."""

    folder: Path
    data: Mapping[str, Any]  #: the content of report.json

    @property
    def page(self) -> Path:
        """The HTML page."""
        return self.folder / "report.html"

    @property
    def claims(self) -> tuple[str, ...]:
        """The sentences at the top of the page."""
        return tuple(claim["text"] for claim in self.data["claims"])

    @property
    def confirmed(self) -> bool:
        """Whether no check speaks against the truth, and at least one confirms each layer."""
        from reports.data.claims import confirmed

        return confirmed(self.data["scenes"])

    def _repr_html_(self) -> str:
        from reports.api.html import block, bullets, link
        from reports.tables.drawing import html
        from reports.tables.methods import fastest_table

        scenes = ", ".join(scene["name"] for scene in self.data["scenes"])
        title = f"Report on {scenes}, {self.data['created']}"
        fastest = html(fastest_table(self.data["scenes"]))
        return block(title, bullets(self.claims), fastest, f"<p>{link(_address(self.page), str(self.page))}</p>")

    def __repr__(self) -> str:
        return f"Report({str(self.folder)!r}, {len(self.data['scenes'])} scenes)"


def _address(page: Path) -> str:
    """Return the address of a page, relative inside the current folder: a notebook shows only files below it."""
    try:
        return page.resolve().relative_to(Path(os.getcwd()).resolve()).as_posix()
    except ValueError:
        return page.resolve().as_uri()


def _bench_row(row: Mapping[str, Any]) -> "Row":
    from reports.tables.methods import ERRORS, per_second
    from reports.tables.table import Measured, Row

    remarks = (row["note"],) if row["note"] else ()
    if row["refused"]:
        return Row({"label": row["label"]}, f"refused: {row['refused']}", remarks)
    frame = Measured(row["frame_ms"], row["frame_low_ms"], row["frame_high_ms"])
    times = {"frame": frame, "frame_rate": per_second(frame)}
    times |= {name: row[f"{name}_ms"] for name in ("airlight", "light_moved")}
    return Row({"label": row["label"], **times, **{name: row.get(name) for name in ERRORS}}, remarks=remarks)


@dataclass(frozen=True, eq=False, repr=False)
class PaperClaims:
    """The claims of papers with their verdicts."""

    rows: tuple[Mapping[str, Any], ...]  #: as they stand under `papers` of report.json
    left_out: int  #: claims that need images

    def __len__(self) -> int:
        return len(self.rows)

    def to_dict(self) -> dict[str, list[Any]]:
        """Return columns by name, a value for each claim, as `pandas.DataFrame` takes them."""
        return {name: [row[name] for row in self.rows] for name in (self.rows[0] if self.rows else ())}

    def _repr_html_(self) -> str:
        from reports.api.html import block
        from reports.tables.drawing import html
        from reports.tables.papers import paper_tables

        return block(repr(self), *(html(each) for each in paper_tables(self.rows)))

    def __repr__(self) -> str:
        from reports.tables.papers import count_words

        return f"PaperClaims({count_words([row for row in self.rows if row['verdict'] is not None])})"
