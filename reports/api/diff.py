# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.diff`: two reports compared."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.api.inputs import File, exclude
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table

if TYPE_CHECKING:
    from airlight.reports.diff.compare import Difference

_TIME_TOLERANCE = 0.25  #: relative change of a time that counts as noise on a quiet machine


def diff(
    old: File,
    new: File,
    *,
    time_tolerance: float = _TIME_TOLERANCE,
) -> "ReportDifference":
    """Compare two reports: what got slower or less accurate.

    Two reports on engines are compared as well: which numbers moved, and which verdicts turned.
    The result also has what got better, what is new and what is gone.

    Errors have little noise: they may change by 2 %, a maximum by 4 %, or by float32 rounding.
    Times have more noise: the quartiles of both reports say how busy the machine was, and a change
    must appear in all stages that share it. Times of two machines are compared relative to the
    median of all. The exit status is 1 if anything is worse, gone, newly refused or no longer
    finite, or if the reference is no longer confirmed.

    Parameters
    ----------
    old
        The earlier report.json, or its folder.
    new
        The later report.json, or its folder.
    time_tolerance
        Relative change of a time that counts as noise on a quiet machine; inf compares no times.
    """
    from airlight.reports.data.records import read_report
    from airlight.reports.diff.compare import compare_reports
    from airlight.reports.engines.record import FILE, engines_file

    # Both kinds of report have one folder by default: neither may be passed over in silence.
    for given in (Path(old), Path(new)):
        if all((given / name).is_file() for name in ("report.json", FILE)):
            raise InputError(
                f"{given} has two reports, on methods and on engines; name report.json or {FILE} "
                "in it"
            )
    # Reports on engines have no times.
    on_engines = engines_file(Path(old)), engines_file(Path(new))
    if on_engines[0] and on_engines[1]:
        from airlight.reports.api.engines import difference_of_engines

        of_times = {"time_tolerance": time_tolerance not in (_TIME_TOLERANCE, math.inf)}
        exclude("diff", "reports on engines have no times", of_times)
        moved = difference_of_engines(on_engines[0], on_engines[1])
        return ReportDifference(old=str(old), new=str(new), difference=moved)
    # An infinite tolerance leaves times out.
    tolerance = None if time_tolerance == math.inf else time_tolerance
    reports = read_report(Path(old)), read_report(Path(new))
    found = compare_reports(*reports, time_tolerance=tolerance)
    return ReportDifference(old=str(old), new=str(new), difference=found)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ReportDifference(Result):
    """The differences of two reports."""

    old: str  #: file or folder
    new: str
    difference: "Difference"  #: every finding

    @property
    def title(self) -> str:
        """The two reports."""
        return f"{self.new} against {self.old}"

    @property
    def tables(self) -> Sequence[Table]:
        """The findings, the worse ones first."""
        from airlight.reports.diff.compare import difference_tables

        return difference_tables(self.difference)

    @property
    def lines(self) -> Sequence[str]:
        """How much was compared."""
        from airlight.reports.diff.compare import difference_lines

        return difference_lines(self.difference)

    @property
    def failures(self) -> Sequence[str]:
        """The findings that are worse."""
        return [each.words for each in self.difference.findings if each.verdict == "worse"]

    def to_dict(self) -> dict[str, Any]:
        """Return every finding."""
        from airlight.validation.columns import plain

        return plain(self.difference)
