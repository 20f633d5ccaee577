# SPDX-License-Identifier: BSD-3-Clause
"""A progress bar with the time left, on the error stream; plain lines where that is no terminal."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float, str], None]
Steps = Callable[[int, int, str], None]  # (done, total, what)


class Interrupted(Exception):
    """Ctrl-C in a command that can say what is kept of the work."""


_PATIENCE = 2.0  # seconds before anything is shown
_PLAIN_EVERY = 10.0  # seconds between the lines of a plain stream


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Yield a function (share done, what) that shows how far the work is.

    Work that ends within two seconds shows nothing.
    """
    if sys.stderr.isatty():
        yield from _rich_bar(title)
    else:
        yield _plain_lines(title)


def part_of(tell: Progress | None, first: float, last: float, *, before: str = "") -> Progress:
    """Return what a part of some work tells its share to: `tell` hears of shares from `first` to `last` of all of it.

    Parameters
    ----------
    tell
        Told the share of all the work and what comes next; nobody is without it.
    first, last
        What share of the work is done when the part begins and when it ends.
    before
        Put before what comes next.
    """
    if tell is None:
        return lambda share, what: None
    # Not first + share (last - first): both ends are met to the last digit.
    return lambda share, what: tell((1 - share) * first + share * last, before + what)


def counted(tell: Progress | None) -> Steps:
    """Return what work that counts its steps, (done, total, what), tells them to: `tell` hears of shares."""
    if tell is None:
        return lambda done, total, what: None
    return lambda done, total, what: tell(done / total, what)


def _rich_bar(title: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[what]}"),
    )
    start = time.monotonic()
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task(title, total=1.0, what="")
    shown = False

    def tell(share: float, what: str) -> None:
        nonlocal shown
        if not shown and time.monotonic() - start > _PATIENCE:
            shown = True
            bar.start()
        bar.update(task, completed=share, what=what)

    try:
        yield tell
    finally:
        if shown:
            bar.stop()


def _plain_lines(title: str) -> Progress:
    start = last = time.monotonic()

    def tell(share: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - start < _PATIENCE or now - last < _PLAIN_EVERY or not 0 < share < 1:
            return
        last = now
        left = (now - start) * (1 - share) / share
        print(f"{title}: {100 * share:.0f} %, about {left:.0f} s left, {what}", file=sys.stderr, flush=True)

    return tell
