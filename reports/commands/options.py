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


def numbers_by_name(option: str, text: str) -> dict[str, float]:
    """Return the numbers of an option such as 'sigma_t=0.1,albedo=0.9'.

    Raises
    ------
    InputError
        If a part has another form, or a name is there twice.
    """
    numbers: dict[str, float] = {}
    for part in listed(option, text) if text.strip() else []:
        name, equals, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            equals = ""
        if not equals or not name.strip() or name.strip() in numbers:
            from analytic.errors import InputError

            raise InputError(f"{option}: got {part!r}, wanted NAME=VALUE, each name once, such as sigma_t=0.1")
        numbers[name.strip()] = number
    return numbers
