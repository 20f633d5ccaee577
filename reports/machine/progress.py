# SPDX-License-Identifier: BSD-3-Clause
"""A progress bar with the time left, on the error stream; plain lines where that is no terminal."""

import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float, str], None]
Steps = Callable[[int, int, str], None]  # (done, total, what)

_PATIENCE = 2.0  # seconds before anything is shown
_EVERY, _PLAIN_EVERY = 0.1, 10.0  # seconds between two states on a terminal, and between the lines of a plain stream
_BAR, _ERASE = 20, "\r\x1b[2K"  # width of the bar, and the code that empties a line of a terminal


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Yield a function (fraction done, what) that shows the progress of the work and the time left.

    Work that ends within two seconds shows nothing. A terminal has one line, which goes away at the end.
    """
    terminal = sys.stderr.isatty()
    start, last = time.monotonic(), -math.inf

    def progress(fraction: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - start < _PATIENCE or now - last < (_EVERY if terminal else _PLAIN_EVERY):
            return
        last = now
        # The mean pace of all work decides: by that of the last minute one long part would make the estimate jump.
        left = f"about {_clock((now - start) * (1 - fraction) / fraction)} left, " if fraction > 0 else ""
        words = f"{100 * fraction:.0f} %, {left}{what}"
        if not terminal:
            print(f"{title}: {words}", file=sys.stderr, flush=True)
            return
        bar = "#" * int(_BAR * fraction)
        line = f"{title} [{bar:{_BAR}}] {words}"[: shutil.get_terminal_size().columns - 1]
        print(f"{_ERASE}{line}", end="\r", file=sys.stderr, flush=True)  # other messages begin at the left

    try:
        yield progress
    finally:
        if terminal and last > start:
            print(_ERASE, end="", file=sys.stderr, flush=True)


def _clock(seconds: float) -> str:
    """Return minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def part_of(progress: Progress | None, first: float, last: float, *, before: str = "") -> Progress:
    """Return the callback for a part of some work, from fraction `first` to `last`; `before` precedes its words."""
    if progress is None:
        return lambda fraction, what: None
    # This form, unlike first + fraction (last - first), gives both ends exactly.
    return lambda fraction, what: progress((1 - fraction) * first + fraction * last, before + what)


def counted(progress: Progress | None) -> Steps:
    """Return the callback (done, total, what) for work that counts its steps; `progress` is called with fractions."""
    if progress is None:
        return lambda done, total, what: None
    return lambda done, total, what: progress(done / total, what)
