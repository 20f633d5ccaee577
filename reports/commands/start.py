# SPDX-License-Identifier: BSD-3-Clause
"""The start of the `airlight` command: signals and streams before all that takes time."""

import os
import sys

from airlight.reports.machine.process_start import EXTRAS, default_signals, usable_streams


def main() -> None:
    """Run the command line, and end the process with its status."""
    default_signals()
    usable_streams()
    from airlight.reports.commands.main import run

    sys.exit(run(sys.argv[1:], extras=os.environ.pop(EXTRAS, None)))
