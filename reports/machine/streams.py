# SPDX-License-Identifier: BSD-3-Clause
"""Standard streams that can be written, however the process was started."""

import codecs
import io
import os
import sys
import unicodedata

# What tables and messages have that ASCII has not, and Unicode's own compatibility forms do not give.
_PLAIN = {"─": "-", "━": "-", "│": "|", "±": "+-", "×": "x", "–": "-", "—": "-", "≤": "<=", "≥": ">=", "≈": "~"}  # noqa: RUF001


def usable_streams() -> None:
    """Open closed standard streams to nothing, and let no character be too much for an output.

    A file that is opened where a stream was closed would take its number, and with it all that is printed. An output in
    ASCII gets the nearest characters that it has.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free, which is this
    sys.stdin = sys.stdin or os.fdopen(0, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    codecs.register_error("nearest", _nearest)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="nearest")


def _nearest(error: UnicodeError) -> tuple[str, int]:
    """Replace what an encoding does not have by the nearest ASCII."""
    assert isinstance(error, UnicodeEncodeError)
    characters = error.object[error.start : error.end]
    return "".join(_PLAIN.get(character) or _decomposed(character) for character in characters), error.end


def _decomposed(character: str) -> str:
    return unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"
