# SPDX-License-Identifier: BSD-3-Clause
"""Parts of pages that list what the program has: modules, names, commands, methods, kernels."""

import ast
import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from airlight.reports.commands.list import list as list_
from airlight.reports.data.records import meanings, record_types
from airlight.reports.tables.drawing import markdown
from airlight.reports.tables.table import Name, Row, Table

ROOT = Path(__file__).resolve().parents[2]
#: Words in the help of parameters, and the pages that they link to.
LINKS = {"between the corners of tiles": "methods.md#between-the-corners-of-tiles"}


def table(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    """Return a Markdown table whose first columns, of words, stand to the left and the
    others, of numbers, right.
    """
    rule = ["---" if number < words else "---:" for number in range(len(headers))]
    return "\n".join("| " + " | ".join(row) + " |" for row in [headers, rule, *rows]) + "\n"


#: Results of the functions of `import airlight`.
_RESULTS = (
    "airlight.reports.api.results.Rendering",
    "airlight.reports.api.results.Reference",
    "airlight.reports.api.comparisons.ImageComparison",
    "airlight.reports.api.comparisons.SceneComparison",
    "airlight.reports.api.comparisons.Fitted",
    "airlight.reports.api.report.Report",
    "airlight.reports.studies.registry.Study",
    "airlight.reports.studies.methods.MethodsStudy",
    "airlight.reports.studies.kernels.Integrals",
    "airlight.reports.studies.clouds.SlabStudy",
)


def _public() -> dict[str, Any]:
    """Return the public names of `airlight` with their values."""
    import airlight

    return {name: getattr(airlight, name) for name in sorted(_homes(), key=str.lower)}


def _homes() -> dict[str, str]:
    """Return the module of each public name."""
    import airlight

    # The stub lists what is public; values are imported when somebody asks for them.
    stub = ast.parse(Path(airlight.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    lines = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    return {name.name: f"airlight.{line.module}" for line in lines for name in line.names}


def _documented(value: Any) -> bool:
    return inspect.isfunction(value) or inspect.isclass(value)


def names() -> str:
    """Return the public names of `airlight`, each with a sentence and a link to its signature."""
    homes = _homes()
    rows = [
        (f"{{py:obj}}`{name} <{value.__module__}.{value.__name__}>`", _sentence(value))
        if _documented(value)
        else (f"`{name}`", f"see `{homes[name]}`")
        for name, value in _public().items()
    ]
    return table(("name", "what it is"), rows, 2)


def signatures() -> str:
    """Return the functions and classes of `import airlight` with their docstrings, and the
    results that they return.
    """
    # Classes that functions return belong to the reference of the API, though nobody imports them.
    paths = {
        f"{each.__module__}.{each.__name__}": each
        for each in _public().values()
        if _documented(each)
    }
    classes = {path: inspect.isclass(value) for path, value in paths.items()} | dict.fromkeys(
        _RESULTS, True
    )
    shown = [
        f".. autoclass:: {path}\n   :members:" if is_class else f".. autofunction:: {path}"
        for path, is_class in classes.items()
    ]
    return "```{eval-rst}\n" + "\n\n".join(shown) + "\n```"


def _sentence(value: Any) -> str:
    """Return the first sentence of a docstring, as a cell of a table."""
    return _cell((inspect.getdoc(value) or "").split("\n\n")[0])


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
    what = _cell(limits.help)
    # Words in the help may have a section of the documentation.
    for words, link in LINKS.items():
        what = what.replace(words, f"[{words}]({link})")
    return _cell(values), what


def kernels() -> str:
    """Return the kernels."""
    return markdown(_named(list_("kernels").tables[0]))


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


@cache
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
