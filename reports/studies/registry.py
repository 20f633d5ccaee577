# SPDX-License-Identifier: BSD-3-Clause
"""The studies by name, what a study returns, and `airlight.study`."""

import importlib
import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError, nearest
from airlight.reports.tables.record import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from airlight.reports.tables.table import Table


FRACTION = {"digits": 2, "fraction": True}  #: how an error relative to the reference is printed
ENDINGS = (".csv", ".tex", ".md", ".json", ".pdf", ".png")  #: of the files that `Study.save` writes


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Study(Result):
    """The outcome of a study."""

    name: str
    data: Mapping[str, Any]  #: the result in what `airlight study NAME -o NAME.json` writes
    tables: "Sequence[Table]" = ()
    lines: Sequence[str] = ()
    faults: Sequence[str] = ()
    broken: Sequence[str] = ()  #: checks that failed
    #: A record for each measurement; a mapping where the columns of a study are no record's.
    rows: tuple[Any, ...] = ()
    #: returns the figure for a column, 'single' or 'double'
    draw: "Callable[[str], Figure] | None" = None

    @property
    def failures(self) -> Sequence[str]:
        """The faults of user methods, and the checks that failed."""
        return [*self.faults, *self.broken]

    @property
    def scene_name(self) -> str | None:
        """The scene of a study of one."""
        return self.data.get("scene")

    def to_dict(self) -> Any:
        """Return the data, as JSON has them."""
        from airlight.validation.columns import plain

        return plain(self.data)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.rows)

    def __getitem__(self, index: Any) -> Any:
        return self.rows[index]

    @property
    def title(self) -> str:
        """Its name."""
        return f"{self.name}, {len(self.rows)} rows" if self.rows else self.name

    def columns(self) -> dict[str, list[Any]]:
        """Return the rows as columns by name, as `pandas.DataFrame` takes them.

        The name of a value in a record within a row is its path, `times.frame.median_ms`.
        """
        from airlight.validation.columns import shown_values

        # Rows may have different columns: the union of all, with None where a row lacks one.
        rows = [row if isinstance(row, Mapping) else shown_values(row) for row in self.rows]
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name) for row in rows] for name in names}

    def save(self, path: Path | str, column: str = "double") -> Path:
        """Write the tables (.csv, .tex, .md), the data (.json) or the figure
        (.pdf, .png); return the path.

        Parameters
        ----------
        path
            Path of the file; its ending says what is written.
        column
            Width of a figure: 'single' (3.5 inches) or 'double' (7.16 inches).

        Raises
        ------
        InputError
            For another ending, and a study without a figure.
        """
        from airlight.reference.storage.files import write_text
        from airlight.reports.tables.drawing import csv, latex, markdown

        target = Path(path)
        ending = target.suffix.lower()
        # The ending decides: a figure, tables or data.
        if ending in (".pdf", ".png"):
            if self.draw is None:
                raise InputError(
                    f"{target}: the study {self.name} has no figure; write .csv, .tex, .md or .json"
                )
            from airlight.reports.plotting.figure import save_figure

            return save_figure(target, self.draw, column)
        if ending == ".csv":
            write_text(
                target,
                _columns_csv(self.columns()) if self.rows else "\n".join(map(csv, self.tables)),
            )
        elif ending == ".tex":
            write_text(target, "\n".join(latex([table]) for table in self.tables))
        elif ending == ".md":
            write_text(target, "\n".join(map(markdown, self.tables)))
        elif ending == ".json":
            said = self.enveloped(f"airlight study {self.name}")
            write_text(
                target,
                json.dumps(said, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
            )
        else:
            raise InputError(
                f"output: got {str(path)!r}, expected a name that ends in {', '.join(ENDINGS)}"
            )
        return target


def _columns_csv(columns: Mapping[str, Sequence[Any]]) -> str:
    from airlight.reports.tables.drawing import csv
    from airlight.reports.tables.table import Column, table

    # Columns without any value would be empty in every row.
    filled = {
        name: values
        for name, values in columns.items()
        if any(value is not None for value in values)
    }
    return csv(table("", [Column(name, name) for name in filled], list(zip(*filled.values()))))


def with_environment(**data: Any) -> dict[str, Any]:
    """Return data with the machine and the versions that made them."""
    from airlight.reports.machine.environment import describe_environment
    from airlight.validation.columns import plain

    return {"environment": describe_environment(), **plain(data)}


#: The studies by name, with the module of each; a study is imported when it is asked for.
STUDIES = {
    "methods": "methods",
    "decomposition": "methods",
    "scaling": "growth",
    "kernels": "kernels",
    "stability": "kernels",
    "integrals": "kernels",
    "noise": "variation",
    "motion": "variation",
    "slab": "clouds",
}


_WITHOUT_FIGURE = ("methods", "stability", "integrals")


def endings_of(name: str) -> tuple[str, ...]:
    """Return the endings of the files that a study can write."""
    return tuple(
        ending
        for ending in ENDINGS
        if name not in _WITHOUT_FIGURE or ending not in (".pdf", ".png")
    )


def find_study(name: str) -> Callable[..., Any]:
    """Return the function of a study.

    Raises
    ------
    InputError
        For an unknown study; the nearest is named.
    """
    if name not in STUDIES:
        raise InputError(
            f"study: got {name!r}, expected one of {', '.join(STUDIES)}" + nearest(name, STUDIES)
        )
    function: Callable[..., Any] = getattr(
        importlib.import_module(f"airlight.reports.studies.{STUDIES[name]}"), name.replace("-", "_")
    )
    return function


def summary(name: str) -> str:
    """Return the first sentence of a study's help."""
    return " ".join((inspect.getdoc(find_study(name)) or "").split("\n\n")[0].split())


def study(name: str, *arguments: Any, **named: Any) -> Any:
    """Run a study: measurements of methods and kernels, with tables and a figure.

    `airlight study NAME --help` lists the arguments of a study. It returns rows, tables and data;
    `save`, or -o, writes tables (.csv, .tex, .md), data (.json) or the figure (.pdf, .png).

    Parameters
    ----------
    name
        A name of `airlight list studies`.
    arguments, named
        Arguments of the study.

    Raises
    ------
    InputError
        For an unknown study, and what the study refuses.

    Examples
    --------
    >>> import airlight
    >>> airlight.study("slab", 2.0, 30.0, orders=[1])["1"]["reflectance"] > 0
    True
    """
    return find_study(name)(*arguments, **named)
