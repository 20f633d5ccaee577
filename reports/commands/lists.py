# SPDX-License-Identifier: BSD-3-Clause
"""`airlight scenes`, `airlight methods`, `airlight kernels`: what there is, one line each."""

from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def scenes(json: Json = False) -> None:
    """List the built-in scenes."""
    from validation.scenes.registry import SCENES

    keys = ("name", "purpose", "published")
    _show([{key: getattr(record, key) for key in keys} for record in SCENES.values()], json)


def methods(json: Json = False) -> None:
    """List the real-time methods with their parameters."""
    from realtime.methods.registry import METHODS

    _show(
        [
            {
                "name": record.name,
                "what": record.summary,
                "kernel": "yes" if record.uses_kernel else "no",
                "shadows": "yes" if record.shadows else "no",
                "parameters": ", ".join(f"{name}={value}" for name, value in record.defaults.items()),
                "source": record.source,
            }
            for record in METHODS.values()
        ],
        json,
    )


def kernels(json: Json = False) -> None:
    """List the airlight kernels with their parameters."""
    from realtime.kernels.registry import KERNELS

    _show(
        [
            {
                "name": record.name,
                "what": record.summary,
                "parameters": ", ".join(f"{name}={value}" for name, value in record.parameters.items()),
                "source": record.source,
            }
            for record in KERNELS.values()
        ],
        json,
    )


def _show(rows: list[dict[str, str]], as_json: bool) -> None:
    from reports.tables.terminal import print_json, print_words

    if as_json:
        print_json(rows)
    else:
        print_words([list(row.values()) for row in rows], list(rows[0]))
