# SPDX-License-Identifier: BSD-3-Clause
"""`airlight test [PYTEST ARGUMENTS]`: the tests of this checkout."""

from pathlib import Path
from typing import Annotated

import typer


def run_tests(
    context: typer.Context,
    everything: Annotated[
        bool,
        typer.Option("--all", help="Also the statistical and slow tests, all mutations and all baselines among them."),
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            show_default=False,
            help="Processes that share the tests; 0 for this one; 2 by default if there are two cores.",
        ),
    ] = None,
) -> None:
    """Run the fast tests of the source checkout, or all tests.

    Other arguments go to pytest; paths are relative to the checkout.

    The fast tests compile kernels quickly, which is most of their work, unless AIRLIGHT_COMPILATION=full asks for what
    everything else runs. Images are the same bit for bit.

    --all also prints a summary and writes the date, the machine and the counts into docs/verification.md. With --all
    and arguments for pytest, tests of all tiers run and nothing is written. Exit status 1 if anything failed.
    """
    import os
    import sys

    from reports.machine import quick_compilation
    from reports.machine.environment import MissingError, prepare, threads

    root = Path(__file__).resolve().parents[2]
    if not (root / "tests").is_dir():
        raise MissingError(
            f"there are no tests in {root}, they come with the source only: clone it and run `./airlight test` there"
        )
    variant = prepare().variant
    shared = (2 if threads() > 1 else 0) if workers is None else workers
    # Each process begins with its own half of the files, so that few kernels are compiled and few scenes loaded twice.
    sharing = ["-n", str(shared), "--dist", "worksteal"] if shared else []
    os.chdir(root)
    if everything and not context.args:
        from reports.docs.full_run import all_parts, run_all
        from reports.machine.environment import describe_environment, machine_in_words
        from reports.machine.gpu import cuda_status

        device = cuda_status().reason if variant == "cuda_ad_rgb" else None
        machine = machine_in_words(describe_environment() | {"variant": variant, "device": device})
        if not run_all(all_parts(sharing), root, machine=machine):
            raise typer.Exit(1)
        return
    if not everything and variant == "llvm_ad_rgb" and quick_compilation.VARIABLE not in os.environ:
        os.environ.update(quick_compilation.settings())  # of processes that have not begun
    tiers = [] if everything else ["-m", "not statistical and not slow"]
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-m", "pytest", *sharing, *tiers, *context.args])
