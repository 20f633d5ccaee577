# SPDX-License-Identifier: BSD-3-Clause
"""`airlight scenes`, `airlight methods`, `airlight kernels`: what there is, one line each."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from reports.tables.table import Table

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def scenes(json: Json = False) -> None:
    """List the built-in scenes."""
    from reports.tables.lists import scene_list

    _show(scene_list(), json)


def methods(json: Json = False) -> None:
    """List the real-time methods with their parameters."""
    from reports.tables.lists import method_list

    _show(method_list(), json)


def kernels(json: Json = False) -> None:
    """List the airlight kernels with their parameters."""
    from reports.tables.lists import kernel_list

    _show(kernel_list(), json)


def _show(table: "Table", as_json: bool) -> None:
    from reports.tables.drawing import text_of
    from reports.tables.terminal import print_json, print_table

    if as_json:
        print_json([{key: text_of(value) for key, value in row.values.items()} for row in table.rows])
    else:
        print_table(table)
