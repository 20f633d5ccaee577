# SPDX-License-Identifier: BSD-3-Clause
"""The one exception for what a user gave wrong, on the side of the reference.

`realtime` defines its own: the two sides share no code. The command line catches both.
"""

import difflib
from collections.abc import Callable, Iterable
from typing import TypeVar

Value = TypeVar("Value")


class InputError(ValueError):
    """An input that cannot be used: the user repairs it, and it is not a fault of the program.

    The message is one line that says what was given, what is expected and what to do. The command line prints it
    without a traceback and exits with status 2.
    """


def nearest(word: str, known: Iterable[str]) -> str:
    """Return '; did you mean X?' for the end of a message about `word`, an empty string where nothing known is near."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.4)
    return f"; did you mean {close[0]!r}?" if close else ""


def named_values(option: str, words: Iterable[str], read: Callable[[str], Value], wanted: str) -> dict[str, Value]:
    """Return values by name from words of the form 'NAME=VALUE'.

    `option`: where the words stand, for messages; `words`: what the user wrote; `read`: returns the value of a text
    that is not empty, or raises ValueError; `wanted`: what a word should look like, for messages. Raises InputError if
    a word has another form, or two words give one name different values.
    """
    values: dict[str, Value] = {}
    for word in words:
        name, _, text = (part.strip() for part in word.partition("="))
        try:
            if not name or not text:
                raise ValueError(word)
            value = read(text)
        except ValueError:
            raise InputError(f"{option}: got {word!r}, expected {wanted}") from None
        if values.setdefault(name, value) != value:
            first = next(each.strip() for each in words if each.partition("=")[0].strip() == name)
            raise InputError(f"{option}: got {first} and {word.strip()}, expected one of them: each name once")
    return values
