# SPDX-License-Identifier: BSD-3-Clause
"""What a process does that a signal ends: it removes what is unfinished, says one line, and is gone.

Python's own way, an exception in the middle of whatever runs, is not safe here: raised during an import, in a
destructor or in a function that Dr.Jit calls it ends in a traceback or an abort, and while a kernel runs it is not
raised at all. So a thread of its own waits for the signal. It needs the interpreter for some microseconds, which all
long work in C++ leaves free, and ends the process without unwinding it. The handler is kept where the system keeps
handlers, so whoever writes a file finds it there and says what to remove.
"""

import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_PATIENCE = 5.0  # seconds that cleaning up may take, on a network drive for instance
_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
_HINT = "no file is left half-written; run the same command again"


class Stopper:
    """The handler of SIGINT and SIGTERM, and what they find to do."""

    def __init__(self, *, quiet: bool = False) -> None:
        self.cleanups: list[Callable[[], object]] = []
        self.hints: list[Callable[[], str]] = []
        self.ending = False
        self._quiet = quiet

    def __call__(self, number: int, frame: object) -> None:
        """Do nothing: the thread acts, also where Python's code does not run."""

    def watch(self, signals: int) -> None:
        """Wait for a signal, which is a byte that can be read; a second one does not wait for the cleaning up."""
        number = os.read(signals, 1)[0]
        self.ending = True
        threading.Thread(target=self._end, args=(number,), daemon=True).start()
        try:
            select.select([signals], [], [], _PATIENCE)
        except OSError:  # on Windows it waits for sockets alone
            time.sleep(_PATIENCE)
        os._exit(128 + number)

    def _end(self, number: int) -> None:
        with suppress(OSError):
            # The work goes on while this cleans up; what it says now nobody should read.
            said = os.dup(2)
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 1)
            os.dup2(null, 2)
        for work in reversed(self.cleanups.copy()):
            with suppress(Exception):
                work()
        if not self._quiet:
            with suppress(Exception):
                hint = next((words() for words in self.hints.copy()), _HINT)
                clean = "\r\x1b[K\x1b[?25h" if os.isatty(said) else ""  # a progress bar hides the cursor
                line = f"{clean}{_WORDS[signal.Signals(number)]}: {' '.join(hint.split())}\n"
                os.write(said, line.encode("utf-8", "replace"))
        os._exit(128 + number)


def stop_on_signals(*, quiet: bool = False) -> None:
    """Let SIGINT end this process with status 130 and SIGTERM with 143, from now on; for a main program alone.

    A second call changes nothing.

    Parameters
    ----------
    quiet
        Whether to say nothing, in a process that another one started and speaks for.
    """
    if _stopper() is not None:
        return
    stopper = Stopper(quiet=quiet)
    end, start = os.pipe()
    with suppress(AttributeError):  # on Windows from Python 3.12 on
        os.set_blocking(start, False)
    threading.Thread(target=stopper.watch, args=(end,), name="signals", daemon=True).start()
    signal.set_wakeup_fd(start, warn_on_full_buffer=False)
    for number in _WORDS:
        # What the parent ignores stays ignored, as by nohup and for jobs in the background.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stopper)


@contextmanager
def cleaned_up(work: Callable[[], object]) -> Iterator[None]:
    """Call `work` if a signal ends the process within the block; what else ends the block is the caller's to handle."""
    stopper = _stopper()
    if stopper is None:
        yield
        return
    stopper.cleanups.append(work)
    try:
        yield
    finally:
        wait_if_stopped()  # the work that was cleaned up must not be called a failure meanwhile
        stopper.cleanups.remove(work)


@contextmanager
def hint_when_stopped(words: Callable[[], str]) -> Iterator[None]:
    """Say `words()`, what is kept and how to go on, if a signal ends the process within the block.

    Of blocks within one another the outermost speaks.
    """
    stopper = _stopper()
    if stopper is None:
        yield
        return
    stopper.hints.append(words)
    try:
        yield
    finally:
        stopper.hints.remove(words)


def wait_if_stopped() -> None:
    """Return, but not where a signal is ending the process: then the end comes here."""
    stopper = _stopper()
    while stopper is not None and stopper.ending:
        time.sleep(1)


def end_unstopped() -> None:
    """Let signals stop the process no more: its work is done, and its status shall say so while Python ends.

    Python gives its handlers up before it has ended; a signal then would be the status of work that is done.
    """
    wait_if_stopped()
    if _stopper() is not None:
        for number in _WORDS:
            signal.signal(number, signal.SIG_IGN)


def _stopper() -> Stopper | None:
    """Return the handler of this process; None where the main program has its own way with signals."""
    handlers = (signal.getsignal(number) for number in _WORDS)
    return next((handler for handler in handlers if isinstance(handler, Stopper)), None)
