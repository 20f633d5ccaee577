# SPDX-License-Identifier: BSD-3-Clause
"""`airlight diff OLD NEW`: what got slower or less accurate between two reports."""

from pathlib import Path
from typing import Annotated

import typer


def diff(
    old: Annotated[
        Path,
        typer.Argument(metavar="OLD", help="report.json, or its folder, to compare with.", show_default=False),
    ],
    new: Annotated[
        Path, typer.Argument(metavar="NEW", help="report.json, or its folder, to judge.", show_default=False)
    ],
    error_tolerance: Annotated[
        float,
        typer.Option(
            metavar="SHARE", help="Relative change of an error that is noise; that of a maximum is twice as wide."
        ),
    ] = 0.02,
    time_tolerance: Annotated[
        float, typer.Option(metavar="SHARE", help="Relative change of a time that is noise, on a quiet machine.")
    ] = 0.25,
    times: Annotated[bool, typer.Option("--times/--no-times", help="Compare times too.")] = True,
    common: Annotated[
        bool,
        typer.Option("--common", help="Compare what both reports hold; what is missing from the new one is no loss."),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare two reports: what got slower or less accurate.

    Also what got better, what is new and what is gone.

    Errors have little noise: they may change by a relative band, or by float32 rounding. Times have much: the quartiles
    of both reports tell how busy the machine was, and a change must show in all stages that share it. Between two
    machines, times are compared relative to the median of all. Exit status 1 if anything is worse, gone, newly refused
    or no longer finite, or if the truth is no longer confirmed.
    """
    from reports.data.reader import read_report
    from reports.diff.compare import compare_reports
    from reports.diff.table import print_difference
    from reports.tables.terminal import print_json

    difference = compare_reports(
        read_report(old),
        read_report(new),
        error_tolerance=error_tolerance,
        time_tolerance=time_tolerance if times else None,
        common=common,
    )
    if json:
        print_json(difference.to_json())
    else:
        print_difference(difference)
    if difference.worse:
        raise typer.Exit(1)
