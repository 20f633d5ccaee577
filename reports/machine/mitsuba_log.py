# SPDX-License-Identifier: BSD-3-Clause
"""Mitsuba's log: its warnings, and notes on scene files, go to the error stream, each once."""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mitsuba as mi

_PLACE = re.compile(r"^\[[^\]]*\]\s*(\S+\(\):\s*)?")  # file and line, and of Python the function


class _OncePerLine(mi.Appender):
    """Says what it has not said yet, in a line each."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__()
        self._say = say
        self._said: set[str] = set()

    def append(self, level: mi.LogLevel, text: str) -> None:
        """Write a message."""
        words = _PLACE.sub("", " ".join(text.split()))
        if words not in self._said:
            self._said.add(words)
            self._say(words)

    def log_progress(self, progress: float, name: str, formatted: str, eta: str, ptr: object = None) -> None:
        """Mitsuba's progress bars are not shown."""


def log_to_error_stream() -> None:
    """Let Mitsuba's messages go to the error stream; standard output stays for what commands print."""
    _log_to(lambda words: print(f"airlight: note: {words}", file=sys.stderr))


@contextmanager
def collected_notes() -> Iterator[list[str]]:
    """Within the block, Mitsuba's messages are added to a list; after it they go to the error stream."""
    notes: list[str] = []
    _log_to(notes.append)
    try:
        yield notes
    finally:
        log_to_error_stream()


def _log_to(say: Callable[[str], None]) -> None:
    logger = mi.logger()
    formatter = logger.formatter()
    formatter.set_has_date(False)
    formatter.set_has_log_level(False)
    logger.clear_appenders()
    logger.add_appender(_OncePerLine(say))
