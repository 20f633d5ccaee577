# SPDX-License-Identifier: BSD-3-Clause
"""The digest of a sweep, as Markdown for a page of the documentation."""

from dataclasses import replace

from reports.sweep import tables
from reports.sweep.summary import Summary, goes_with_words, headlines
from reports.tables.drawing import markdown
from reports.tables.table import Measured, Table, Value


def digest(said: Summary) -> str:
    """Return what a sweep says in few tables and sentences, as Markdown."""
    drawn = "random scenes" if said.drawn else "scenes, chosen by name"
    when = f", computed between {said.started[0]} and {said.started[1]}" if said.started else ""
    versions = ", ".join(f"{name} {' and '.join(said.versions[name])}" for name in ("airlight", "mitsuba", "drjit"))
    hosts = "; ".join(f"{each.device}, {each.threads} threads" for each in said.hosts)
    ended = ", ".join(f"{count} {status}" for status, count in said.statuses.items())
    parts = [
        f"{said.scenes} {drawn}, {len(said.samples)} configurations, {len(said.sweep)} cells ({ended}){when}; "
        f"{versions}; {hosts}.",
        *_listed([f"**{each['kind']}:** {each['text']}" for each in headlines(said)]),
        markdown(_in_cells(tables.errors_table(said))),
    ]
    if any(each.scenes for each in said.fastest):
        parts.append(markdown(_in_cells(tables.speed_table(said))))
    if said.correlations:
        parts += _listed(goes_with_words(said))
    parts += [markdown(drawn_table) for drawn_table in _others(said)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _others(said: Summary) -> list[Table]:
    """Return the tables of what there is of refusals, faults, truths and properties."""
    refusals = tables.refusals_table(said).only("status", "reason", "scenes", "cells")
    several = [
        refusals,
        tables.faults_table(said, most=10),
        tables.truths_table(said),
        tables.properties_table(said),
    ]
    return [each for each in several if each.rows]


def _listed(sentences: list[str]) -> list[str]:
    return ["\n".join(f"- {words}" for words in sentences)] if sentences else []


def _in_cells(table: Table) -> Table:
    """Return a table whose intervals stand behind their number: in columns of their own they would take a wide page."""
    spread = {column.key: column for column in table.columns if column.spread}

    def words(key: str, value: Value) -> Value:
        if key not in spread or not isinstance(value, Measured):
            return value
        column = spread[key]
        factor, places = (100, column.places) if column.percent else (1, 1)
        ends = " to ".join(f"{factor * end:.{places}f}" for end in (value.low, value.high))
        return f"{factor * value.median:.{places}f}{' %' if column.percent else ''} ({ends})"

    columns = tuple(replace(column, spread="") for column in table.columns)
    rows = tuple(
        replace(row, values={key: words(key, value) for key, value in row.values.items()}) for row in table.rows
    )
    return replace(table, columns=columns, rows=rows)
