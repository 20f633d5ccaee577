# SPDX-License-Identifier: BSD-3-Clause
"""Standard streams that can be written, however the process was started."""

import io
import os
import sys


def usable_streams() -> None:
    """Open closed standard streams to nothing, and let no character be too much for an output.

    A file that is opened where a stream was closed would take its number, and with it all that is printed. An output in
    ASCII has question marks for what it lacks.
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
