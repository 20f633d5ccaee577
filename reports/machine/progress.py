# SPDX-License-Identifier: BSD-3-Clause
"""A progress bar with the time left, on the error stream; plain lines where that is no terminal."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float, str], None]
Steps = Callable[[int, int, str], None]  # (done, total, what)


_PATIENCE = 2.0  # seconds before anything is shown
_PLAIN_EVERY = 10.0  # seconds between the lines of a plain stream


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Yield a function (fraction done, what) that shows how far the work is.

    Work that ends within two seconds shows nothing.
    """
    if sys.stderr.isatty():
        yield from _rich_bar(title)
    else:
        yield _plain_lines(title)


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


def seconds_left(elapsed: float, fraction: float) -> float | None:
    """Return how long the rest takes if it goes on like this [s]; None at the beginning."""
    return elapsed * (1 - fraction) / fraction if fraction > 0 else None


def _rich_bar(title: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from reports.tables.record import colours_wanted

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.fields[what]}"),
    )
    start = time.monotonic()
    console = Console(stderr=True, color_system="auto" if colours_wanted() else None)
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task(title, total=1.0, what="", left="")
    shown = False

    def progress(fraction: float, what: str) -> None:
        nonlocal shown
        elapsed = time.monotonic() - start
        if not shown and elapsed > _PATIENCE:
            shown = True
            bar.start()
            console.show_cursor(True)  # Rich hides it, and Ctrl-C ends the process before it would show it again
        # Rich's own column considers the last half minute alone, so that one long part makes the estimate jump.
        left = seconds_left(elapsed, fraction)
        bar.update(task, completed=fraction, what=what, left="" if left is None else f"about {_clock(left)} left")

    try:
        yield progress
    finally:
        if shown:
            bar.stop()


def _clock(seconds: float) -> str:
    """Return minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def _plain_lines(title: str) -> Progress:
    start = last = time.monotonic()

    def progress(fraction: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - start < _PATIENCE or now - last < _PLAIN_EVERY or not 0 < fraction < 1:
            return
        last = now
        left = seconds_left(now - start, fraction)
        print(f"{title}: {100 * fraction:.0f} %, about {left:.0f} s left, {what}", file=sys.stderr, flush=True)

    return progress
