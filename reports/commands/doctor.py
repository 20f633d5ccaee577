# SPDX-License-Identifier: BSD-3-Clause
"""`airlight doctor`: what works on this machine, and how to mend what does not."""

from typing import Annotated

import typer


def doctor(
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    missing: Annotated[bool, typer.Option("--missing", hidden=True, help="For the launcher.")] = False,
) -> None:
    """Show what works on this machine, and how to mend what does not.

    That is Python and its packages, LLVM, CUDA, OptiX, and a test kernel in a process of its own. Exit status 3 if no
    kernel can be run.
    """
    from reports.machine.doctor import diagnose, print_diagnosis
    from reports.machine.environment import install_line, missing_packages
    from reports.tables.terminal import print_json

    if missing:  # two lines: Debian's names of the packages, and what to type on this system
        packages = missing_packages()
        print(" ".join(packages), install_line(packages) if packages else "", sep="\n")
        return
    diagnosis = diagnose()
    if json:
        print_json(diagnosis)
    else:
        print_diagnosis(diagnosis)
    if not diagnosis["works"]:
        raise typer.Exit(3)
