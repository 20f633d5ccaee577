# SPDX-License-Identifier: BSD-3-Clause
"""Two reports compared: what got slower or less accurate beyond the noise, what is new and what is gone.

What counts as noise is derived in `validation.statistics.noise`. A finding is worse, better, or a note; anything worse
makes the comparison fail, and so does what disappeared: a method that is no longer measured is no longer guarded.
"""

from dataclasses import asdict, dataclass
from typing import Any

from analytic.errors import InputError
from reports.diff.errors import compare_methods
from reports.diff.finding import Finding, Report
from reports.diff.papers import compare_papers
from reports.diff.times import TimeComparison, compare_times
from reports.diff.truth_and_claims import compare_claims, compare_truth, compare_winners
from validation.statistics.noise import ERROR_TOLERANCE, TIME_TOLERANCE


@dataclass(frozen=True)
class Difference:
    """All differences of two reports."""

    findings: tuple[Finding, ...]
    errors: int  #: numbers compared
    times: TimeComparison

    @property
    def worse(self) -> tuple[Finding, ...]:
        """The findings that make the comparison fail."""
        return tuple(finding for finding in self.findings if finding.verdict == "worse")

    def to_json(self) -> dict[str, Any]:
        """Return everything, ready for JSON."""
        times = {name: value for name, value in asdict(self.times).items() if name != "findings"}
        summary = {"worse": len(self.worse), "findings": [asdict(finding) for finding in self.findings]}
        return summary | {"errors_compared": self.errors, "times": times}


def compare_reports(
    old: Report,
    new: Report,
    *,
    error_tolerance: float = ERROR_TOLERANCE,
    time_tolerance: float | None = TIME_TOLERANCE,
    common: bool = False,
) -> Difference:
    """Compare two reports.

    Parameters
    ----------
    old, new
        From `reports.data.reader.read_report`.
    error_tolerance
        Relative band of errors.
    time_tolerance
        Relative band of times; None compares no times.
    common
        What only one of the reports holds is a note, not a loss.

    Raises
    ------
    InputError
        If no number of one can be compared with one of the other, or a tolerance is not above zero.
    """
    for name, value in (("error", error_tolerance), ("time", time_tolerance)):
        if value is not None and not 0 < value < float("inf"):
            raise InputError(f"--{name}-tolerance: got {value:g}, wanted a number above 0, such as 0.1 for 10 %")
    before, after = ({scene["name"]: scene for scene in report["scenes"]} for report in (old, new))
    findings: list[Finding] = []
    compared = 0
    gone = "note" if common else "worse"
    for name in before:
        if name not in after:
            findings.append(Finding(gone, name, "", "the scene is gone"))
            continue
        findings += compare_truth(before[name], after[name], gone)
        differences, count = compare_methods(before[name], after[name], tolerance=error_tolerance, gone=gone)
        findings += differences
        compared += count
    findings += [Finding("note", name, "", "the scene is new") for name in after if name not in before]
    times = compare_times(old, new, tolerance=time_tolerance)
    findings += [*times.findings, *compare_claims(old, new), *compare_winners(before, after)]
    findings += compare_papers(old, new, gone)
    if not compared and not times.compared:
        raise InputError(
            "reports: no number can be compared: no method of a scene was measured in both at one size; "
            "give two reports of the same scenes with the same effort"
        )
    rank = {"worse": 0, "better": 1, "note": 2}
    return Difference(tuple(sorted(findings, key=lambda finding: rank[finding.verdict])), compared, times)
