# SPDX-License-Identifier: BSD-3-Clause
"""How a process of ours begins: signals end it at once, by the system's default; its streams can be
written; the launcher adds what it lacks.

Python's own way, a KeyboardInterrupt in the middle of whatever runs, waits for a kernel to end and
shows a traceback. Nothing is lost by an end at any moment: files are written whole or not at all,
results are kept as they come.
"""

import io
import os
import signal
import sys
from pathlib import Path

#: the variable by which the launcher is told what to add, and tells what it added
EXTRAS = "AIRLIGHT_EXTRAS"


def default_signals() -> None:
    """Let SIGINT and SIGTERM end this process, which a shell reports as the status 130
    and 143; for main programs.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        # Signals that the parent ignores stay ignored, as by nohup and for jobs in the background.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


def usable_streams() -> None:
    """Open closed standard streams to nothing, and let no character fail in an output.

    A file that is opened where a stream was closed would take its number, and with it all that is
    printed. An output in ASCII has question marks for what it lacks.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free, which is this
    sys.stdin = sys.stdin or os.fdopen(0, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def start_again_with(extras: str) -> None:
    """Let the launcher, where there is one, take the place of this process, add extras,
    and run the same command.
    """
    launcher = Path(__file__).resolve().parents[2] / "airlight"
    if launcher.is_file():
        sys.stdout.flush()
        os.execve(launcher, [str(launcher), *sys.argv[1:]], os.environ | {EXTRAS: extras})
