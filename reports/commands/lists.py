# SPDX-License-Identifier: BSD-3-Clause
"""`airlight list`: the scenes, methods and kernels that there are."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from reports.commands.completion import one_of

if TYPE_CHECKING:
    from reports.tables.table import Table

KINDS = ("scenes", "methods", "kernels")

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def list_(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="WHAT",
            help="scenes, methods or kernels; all three by default.",
            autocompletion=one_of(*KINDS),
            show_default=False,
        ),
    ] = None,
    json: Json = False,
) -> None:
    """List the built-in scenes, the methods and the kernels.

    Methods and kernels stand with the defaults of their parameters, which --set changes.
    """
    from reports.tables.lists import kernel_list, method_list, scene_list
    from reports.tables.terminal import print_json, print_table

    tables = {"scenes": scene_list, "methods": method_list, "kernels": kernel_list}
    if what is not None and what not in tables:
        from analytic.errors import InputError, nearest

        raise InputError(f"list: got {what!r}, wanted one of {', '.join(tables)}" + nearest(what, tables))
    if json:
        data = {name: _plain(tables[name]()) for name in (tables if what is None else [what])}
        print_json(data if what is None else data[what])
    elif what is not None:
        print_table(tables[what]())
    else:
        from dataclasses import replace

        for name, made in tables.items():
            print_table(replace(made(), title=name.capitalize()))


def _plain(table: "Table") -> list[dict[str, Any]]:
    from reports.tables.drawing import text_of

    return [{key: text_of(value) for key, value in row.values.items()} for row in table.rows]
