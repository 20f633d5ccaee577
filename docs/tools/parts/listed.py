# SPDX-License-Identifier: BSD-3-Clause
"""The commands, methods, parameters and kernels of the program, and the keys of a report."""

import re
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

from airlight.reports.commands.list import list as list_
from airlight.reports.data.records import meanings, record_types
from airlight.reports.tables.drawing import markdown
from airlight.reports.tables.table import Name, Row, Table


def table(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    """Return a Markdown table whose first columns, of words, stand to the left and the
    others, of numbers, right.
    """
    rule = ["---" if number < words else "---:" for number in range(len(headers))]
    return "\n".join("| " + " | ".join(row) + " |" for row in [headers, rule, *rows]) + "\n"


def _cell(words: str) -> str:
    """Return words as a cell of a table."""
    return _with_code(" ".join(words.split()).replace("|", "\\|"))


def _with_code(words: str) -> str:
    """Return words in which options are code: two hyphens would become a dash."""
    return re.sub(r"(?<![\w`-])(--[a-z][a-z-]*)", r"`\1`", words)


def methods() -> str:
    """Return the methods with links to their sections."""
    shown = list_("methods").tables[0].only("name", "what", "kernel", "shadows", "source")
    return markdown(_named(shown, lambda name: f"methods.md#{name}"))


def _named(shown: Table, address: Callable[[str], str] = lambda name: "") -> Table:
    """Return a table whose names are code, with links where they have an address."""
    rows = (
        Row(row.values | {"name": Name(row.values["name"], address(row.values["name"]))})
        for row in shown.rows
    )
    return replace(shown, rows=tuple(rows))


def parameters(method: str) -> str:
    """Return a table of a method's parameters: values, the default first, and what they do."""
    from airlight.realtime.methods.registry import METHODS

    return _fields(METHODS[method])


def light_samples() -> str:
    """Return a table of the parameters that all methods have for area lights."""
    from airlight.realtime.area_lights.points import LightSamples

    return _fields(LightSamples)


def history() -> str:
    """Return a table of the parameters of a history."""
    from airlight.realtime.methods.history import History

    return _fields(History)


def _fields(record: Any) -> str:
    rows = [(f"`{item.name}`", *_parameter(item)) for item in fields(record)]
    return (
        table(("`--set`", "values", "what it does"), rows, 3)
        if rows
        else "The method has no parameters."
    )


def _parameter(item: Any) -> tuple[str, str]:
    """Return the values of a parameter, its default first, and what it does."""
    from airlight.realtime.parameters import limits_of, wanted_values

    limits = limits_of(item)
    # The default first, then the other choices, each once.
    if isinstance(item.default, str) and limits.choices:
        values = ", ".join(
            f"`{choice}`" for choice in dict.fromkeys((item.default, *limits.choices))
        )
    else:
        values = f"{item.default}; {wanted_values(item)}"
    return _cell(values), _cell(limits.help)


def kernels() -> str:
    """Return the kernels."""
    return markdown(_named(list_("kernels").tables[0]))


def models() -> str:
    """Return the equations of engines: their terms, what was read, and what was not checked."""
    from airlight.validation.scenes.models import PRESETS

    rows = [
        (
            f"`{each.usage}`",
            f"{each.title} {each.version}",
            f"`{each.terms}`",
            _cell(each.unchecked),
            _cell(each.read),
        )
        for each in PRESETS.values()
    ]
    return table(("`--model`", "engine", "its terms", "not checked", "read in"), rows, 5)


def model_parameters() -> str:
    """Return the parameters of the equations of engines with their defaults."""
    from airlight.validation.scenes.models import PRESETS

    rows = [
        (f"`{each.key}`" if at == 0 else "", f"`{one.words}`", _cell(one.what))
        for each in PRESETS.values()
        for at, one in enumerate(each.parameters)
    ]
    return table(("model", "parameter and default", "what it is"), rows, 3)


def studies() -> str:
    """Return the studies with what each measures."""
    from airlight.reports.studies.registry import STUDIES, summary

    return table(
        ("study", "what it measures"), [(f"`{name}`", _cell(summary(name))) for name in STUDIES], 2
    )


def sweep_columns() -> str:
    """Return the columns of a sweep's rows."""
    from airlight.validation.study.row import COLUMNS

    rows = [(f"`{each.key}`", each.unit, _cell(each.meaning)) for each in COLUMNS]
    return table(("column", "unit", "meaning"), rows, 3)


def commands() -> str:
    """Return every command and every study with its arguments, options and words."""
    from airlight.reports.commands.main import command_names, find_command

    shown = []
    # Cyclopts writes a heading of its own, which is cut off.
    for words in command_names():
        name = " ".join(["airlight", *words])
        _, _, text = find_command(words).generate_docs(usage_name=name).partition("\n")
        shown.append(f"## {name}\n{_with_code(text)}")
    return "\n".join(shown)


def report_keys(*parts: str) -> str:
    """Return tables of the keys of parts of `report.json`, or of the file
    itself, from its records.
    """
    found = []
    # A part is named by its record, in lower case with hyphens.
    for part in parts or ("report",):
        record = record_types()[part.title().replace("-", "")]
        rows = [(f"`{name}`", what) for name, what in meanings(record).items()]
        found.append(
            (f"**{part.replace('-', ' ')}**\n\n" if parts else "")
            + table(("key", "what it is"), rows, 2)
        )
    return "\n".join(found)
