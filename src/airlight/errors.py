# SPDX-License-Identifier: BSD-3-Clause
"""The one exception for a user's mistake, the one for what is missing on the machine, those of a
damaged archive, and the name that a user may have meant.

Both sides of a comparison raise them: they compute nothing.
"""

import difflib
import importlib.util
import zipfile
import zlib
from collections.abc import Iterable

#: what NumPy raises where an archive of arrays is missing, damaged or none
DAMAGED: tuple[type[Exception], ...] = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    AttributeError,
    TypeError,  # from a single array, which is no archive
    RuntimeError,  # from an archive that seems encrypted, or compressed in an unknown way
    zipfile.BadZipFile,
    zlib.error,
)


class InputError(ValueError):
    """An input that cannot be used: the user repairs it, and it is not a fault of the program.

    The message is one line that says what was given, what is expected and what to do. The command
    line prints it without a traceback and exits with status 2.
    """


class MissingError(RuntimeError):
    """Something that airlight needs is missing on this machine.

    The message is one line that says what is missing and what to type. The command line prints it
    without a traceback and exits with status 3.
    """

    extra: str | None = None  #: whose packages are missing, where it is these


def require(package: str, extra: str, what: str) -> None:
    """Raise MissingError where a package of an extra is not installed, before any work."""
    if importlib.util.find_spec(package) is None:
        error = MissingError(
            f"{what} needs the package {package}: `./airlight` brings it in a clone, `pip install "
            f"{package}` elsewhere"
        )
        error.extra = extra
        raise error


def nearest(word: str, known: Iterable[str]) -> str:
    """Return '; did you mean X?' for the end of a message about `word`, an empty string
    where nothing known is near.
    """
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.4)
    return f"; did you mean {close[0]!r}?" if close else ""
