# SPDX-License-Identifier: BSD-3-Clause
"""Mitsuba's log: its warnings, and notes on scene files, go to the error stream, each once."""

import re
import sys

import mitsuba as mi

_PLACE = re.compile(r"^\[[^\]]*\]\s*(\S+\(\):\s*)?")  # file and line, and of Python the function


class _OncePerLine(mi.Appender):
    """Prints each message once, in a line."""

    def __init__(self) -> None:
        super().__init__()
        self._said: set[str] = set()

    def append(self, level: mi.LogLevel, text: str) -> None:
        """Write a message."""
        # Mitsuba repeats a message for every plugin that causes it.
        words = _PLACE.sub("", " ".join(text.split()))
        if words not in self._said:
            self._said.add(words)
            print(f"airlight: note: {words}", file=sys.stderr)

    def log_progress(
        self, progress: float, name: str, formatted: str, eta: str, ptr: object = None
    ) -> None:
        """Mitsuba's progress bars are not shown."""


def log_to_error_stream() -> None:
    """Let Mitsuba's messages go to the error stream; standard output stays
    for what commands print.
    """
    logger = mi.logger()
    formatter = logger.formatter()
    formatter.set_has_date(False)
    formatter.set_has_log_level(False)
    logger.clear_appenders()
    logger.add_appender(_OncePerLine())
