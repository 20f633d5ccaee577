# SPDX-License-Identifier: BSD-3-Clause
"""The one exception for a user's mistake, and the name that a user may have meant.

Both sides of a comparison raise it: it computes nothing.
"""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """An input that cannot be used: the user repairs it, and it is not a fault of the program.

    The message is one line that says what was given, what is expected and what to do. The command
    line prints it without a traceback and exits with status 2.
    """


def nearest(word: str, known: Iterable[str]) -> str:
    """Return '; did you mean X?' for the end of a message about `word`, an empty string
    where nothing known is near.
    """
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.4)
    return f"; did you mean {close[0]!r}?" if close else ""
