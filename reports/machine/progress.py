# SPDX-License-Identifier: BSD-3-Clause
"""A progress bar with the time left, on the error stream; plain lines where that is no terminal."""

import itertools
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

Progress = Callable[[float, str], None]
Steps = Callable[[int, int, str], None]  # (done, total, what)

_PATIENCE = 2.0  # seconds before anything is shown


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Yield a function (fraction done, what) that shows the progress of the work and the time left.

    Work that ends within two seconds shows nothing.
    """
    if sys.stderr.isatty():
        yield from _rich_bar(title)
    else:
        yield _plain_lines(title)


def _rich_bar(title: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from airlight.reports.tables.record import colours_wanted

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}{task.fields[what]}"),
    )
    # Nothing is shown in the first seconds: most work ends within them.
    start = time.monotonic()
    console = Console(stderr=True, color_system="auto" if colours_wanted() else None)
    # it prints messages of others above itself
    bar = Progress(*columns, console=console, transient=True)
    task = bar.add_task(title, total=1.0, what="", left="")
    shown = False

    def progress(fraction: float, what: str) -> None:
        nonlocal shown
        elapsed = time.monotonic() - start
        if not shown and elapsed > _PATIENCE:
            shown = True
            bar.start()
            # Rich hides it, and Ctrl-C ends the process before it would show it again
            console.show_cursor(True)
        bar.update(task, completed=fraction, what=what, left=_left(elapsed, fraction))

    try:
        yield progress
    finally:
        if shown:
            bar.stop()


def _plain_lines(title: str) -> Progress:
    start = last = time.monotonic()

    def progress(fraction: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        # Ten seconds between two lines.
        if now - start < _PATIENCE or now - last < 10:
            return
        last = now
        print(
            f"{title}: {100 * fraction:.0f} %, {_left(now - start, fraction)}{what}",
            file=sys.stderr,
            flush=True,
        )

    return progress


def _left(elapsed: float, fraction: float) -> str:
    """Return the time left at the mean pace of all work; by the last half minute, one
    long part makes it jump.
    """
    return f"about {_clock(elapsed * (1 - fraction) / fraction)} left, " if fraction > 0 else ""


def _clock(seconds: float) -> str:
    """Return minutes and seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def part_of(progress: Progress | None, first: float, last: float, *, before: str = "") -> Progress:
    """Return the callback for a part of some work, from fraction `first` to `last`;
    `before` precedes its words.
    """
    if progress is None:
        return lambda fraction, what: None
    # This form, unlike first + fraction (last - first), gives both ends exactly.
    return lambda fraction, what: progress((1 - fraction) * first + fraction * last, before + what)


def sharing(progress: Progress | None, parts: Iterable[tuple[str, float]]) -> list[Progress]:
    """Return the callback for each part of some work: of a part the words before its own,
    and how long it will take.
    """
    # A cached result takes a hundredth of a second to read.
    named = [(words, max(0.01, seconds)) for words, seconds in parts]
    # Parts get fractions in proportion to their expected times; a cached one still gets a little,
    # so that no two ends are equal.
    ends = [0.0, *itertools.accumulate(seconds for _, seconds in named)]
    return [
        part_of(progress, first / ends[-1], last / ends[-1], before=words)
        for (words, _), (first, last) in zip(named, itertools.pairwise(ends))
    ]


def counted(progress: Progress | None) -> Steps:
    """Return the callback (done, total, what) for work that counts its steps; `progress`
    is called with fractions.
    """
    if progress is None:
        return lambda done, total, what: None
    return lambda done, total, what: progress(done / total, what)
