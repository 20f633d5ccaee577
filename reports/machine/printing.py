# SPDX-License-Identifier: BSD-3-Clause
"""How commands print the tables of one run."""

import sys
import time
from collections.abc import Iterable

from reports.tables.table import Table
from reports.tables.terminal import print_table


def print_tables(tables: Iterable[Table], *, as_markdown: bool = False) -> None:
    """Print tables one after the other."""
    for table in tables:
        print_table(table, as_markdown=as_markdown)


def print_heading() -> None:
    """Print the date and the machine, the first line of tables in Markdown."""
    from reports.machine.environment import describe_environment, machine_in_words

    print(f"{time.strftime('%Y-%m-%d')}, {machine_in_words(describe_environment())}.")


def print_notes(notes: Iterable[str]) -> None:
    """Print what a user should know of a scene on the error stream, a line for each note."""
    for note in notes:
        print(f"airlight: note: {note}", file=sys.stderr)
