# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C and SIGTERM end a process of ours at once, by the system's default.

Python's own way, a KeyboardInterrupt in the middle of whatever runs, waits for a kernel to end and shows a traceback.
Nothing is lost by an end at any moment: files are written whole or not at all, results are kept as they come.
"""

import signal


def default_signals() -> None:
    """Let SIGINT and SIGTERM end this process, which a shell reports as the status 130 and 143; for main programs."""
    for number in (signal.SIGINT, signal.SIGTERM):
        # What the parent ignores stays ignored, as by nohup and for jobs in the background.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
