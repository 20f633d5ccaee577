# SPDX-License-Identifier: BSD-3-Clause
"""The one exception for what a user gave wrong, on the side of the ground truth.

`realtime` defines its own: the two sides share no code. The command line catches both.
"""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """An input that cannot be used: the user mends it, and it is not a fault of the program.

    The message is one line that says what was given, what is wanted and what to do. The command line prints it
    without a traceback and exits with status 2.
    """


def nearest(word: str, known: Iterable[str]) -> str:
    """Return '; did you mean X?' for the end of a message about `word`, an empty string where nothing known is near."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.4)
    return f"; did you mean {close[0]!r}?" if close else ""
