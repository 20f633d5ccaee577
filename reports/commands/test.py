# SPDX-License-Identifier: BSD-3-Clause
"""`airlight test [PYTEST ARGUMENTS]`: the tests of this checkout."""

from pathlib import Path
from typing import Annotated

import typer

# Processes that share the tests. Dr.Jit's kernels use every processor already: with two processes on two busy cores the
# suite took as long as with one (96 s against 98 s, 2026-11-21), and the tests of timing are disturbed.
_WORKERS = 0


def run_tests(
    context: typer.Context,
    everything: Annotated[bool, typer.Option("--all", help="Also the statistical and the slow tests.")] = False,
    workers: Annotated[int, typer.Option(min=0, help="Processes that share the tests; 0 for this one.")] = _WORKERS,
) -> None:
    """Run the fast tests of the source checkout, or all; other arguments go to pytest, paths are relative to it."""
    import os
    import sys

    from reports.machine.environment import MissingError, prepare

    root = Path(__file__).resolve().parents[2]
    if not (root / "tests").is_dir():
        raise MissingError(
            f"there are no tests in {root}, they come with the source only: clone it and run `./airlight test` there"
        )
    prepare()
    command = [sys.executable, "-m", "pytest"]
    command += ["-n", str(workers)] if workers else []
    command += [] if everything else ["-m", "not statistical and not slow"]
    os.chdir(root)
    sys.stdout.flush()
    os.execv(sys.executable, [*command, *context.args])
