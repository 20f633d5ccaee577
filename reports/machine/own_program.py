# SPDX-License-Identifier: BSD-3-Clause
"""A program that others wrote, such as the adapter of an engine, with a limit in time.

A process of ours starts it, and passes on what it printed: it leads the group that ends as a whole
when the time is up or when the caller ends, however it ends (`realtime/child_process.py`).
"""

import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from airlight.realtime.child_process import ChildProcess, connection_to_caller, end_group
from airlight.reports.machine.environment import child_environment


@dataclass(frozen=True)
class Ended:
    """How a program ended."""

    status: int  #: its exit status; below 0 the signal that ended it
    output: str
    errors: str  #: what it wrote to its error stream


def run_program(
    words: Sequence[str], *, name: str, limit: float, environment: Mapping[str, str]
) -> Ended:
    """Run a program, and wait for its end; `name` is what messages call it.

    Raises EndedError if it takes longer than `limit` [s]: then it and all that it started is ended.
    """
    process = ChildProcess(__name__, name=name, limit=limit, environment=child_environment())
    try:
        return Ended(*process.ask((list(words), dict(environment))))
    finally:
        process.end()


def main() -> None:
    """Run the program that the caller names, and answer with how it ended."""
    caller = connection_to_caller()
    words, environment = caller.recv()
    # The program inherits the group, and not the pipe to the caller.
    ran = subprocess.run(
        words,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
    )
    caller.send((ran.returncode, ran.stdout, ran.stderr))
    end_group()  # what it left behind


if __name__ == "__main__":
    main()
