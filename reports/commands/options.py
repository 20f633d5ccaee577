# SPDX-License-Identifier: BSD-3-Clause
"""Options that several commands have, and lists in options."""

from typing import Annotated

import typer

from reports.machine.own_process import LIMIT

Force = Annotated[
    bool, typer.Option("--force", help="Start also what will take more than an hour, or more memory than there is.")
]
MethodLimit = Annotated[
    float, typer.Option("--method-limit", help="Your own method is stopped after so long in a scene [s].")
]
USUAL_LIMIT = LIMIT
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--change", help="NAME=VALUE, a camera, light or medium that differs: medium.sigma_t=0.1, for instance."
    ),
]


def listed(option: str, text: str) -> list[str]:
    """Return the words of an option that commas part.

    Raises
    ------
    InputError
        If one of them is empty.
    """
    words = [word.strip() for word in text.split(",")]
    if not all(words):
        from analytic.errors import InputError

        raise InputError(f"{option}: got {text!r}, wanted names with commas between them, none of them empty")
    return words
