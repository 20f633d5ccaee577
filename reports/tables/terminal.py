# SPDX-License-Identifier: BSD-3-Clause
"""Tables for a terminal, and the same numbers as JSON."""

import json
from collections.abc import Sequence
from typing import Any


def print_json(data: Any) -> None:
    """Print data as JSON; not-a-number must be None by now."""
    print(json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False))


def print_table(headers: Sequence[str], rows: Sequence[Sequence[str]], title: str | None = None) -> None:
    """Print a table: the first column to the left, the others to the right; as wide as it needs where piped."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for number, header in enumerate(headers):
        table.add_column(header, justify="left" if number == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    _print(table)


def print_words(rows: Sequence[Sequence[str]], headers: Sequence[str]) -> None:
    """Print a table of words, every column to the left."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for header in headers:
        table.add_column(header, overflow="fold")
    for row in rows:
        table.add_row(*row)
    _print(table)


def _print(table) -> None:
    """Print a table as wide as the terminal, or as it needs where piped."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=240)
    console.print(table)


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with some significant digits, a dash for none."""
    return "-" if value is None else f"{value:.{digits}g}"
