# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight diff` prints."""

from reports.diff.compare import Difference
from reports.diff.finding import Finding
from reports.tables.table import Column, table, words
from reports.tables.terminal import print_table

_COLUMNS = (
    Column("verdict", "", words=True),
    *words("scene", "method", "what"),
    Column("old", "old", digits=4),
    Column("new", "new", digits=4),
    Column("change", "change", words=True),
)
_BUSY = 1.25  # with a larger ratio of the quartiles the machine was not quiet


def print_difference(difference: Difference) -> None:
    """Print the findings as a table, the worse ones first, and a sentence on what could be seen."""
    rows = [_row(finding) for finding in difference.findings if _has_row(finding)]
    if rows:
        print_table(table("", _COLUMNS, rows))
    for finding in difference.findings:
        if not _has_row(finding):
            print(f"{finding.verdict}: {f'{finding.scene}: ' if finding.scene else ''}{finding.what}")
    print(_times_line(difference))
    better = sum(finding.verdict == "better" for finding in difference.findings)
    print(f"{len(difference.worse)} worse, {better} better, {difference.errors} errors compared")


def _has_row(finding: Finding) -> bool:
    return bool(finding.old is not None or finding.new is not None or finding.method)


def _row(finding: Finding) -> tuple[str | float | None, ...]:
    return (finding.verdict, finding.scene, finding.method, finding.what, finding.old, finding.new, _change(finding))


def _change(finding: Finding) -> str:
    """Return the change in percent, or as a factor where it is more than double or less than half."""
    if finding.old is None or finding.new is None or finding.old == 0:
        return ""
    ratio = abs(finding.new / finding.old)
    return f"{100 * (ratio - 1):+.1f} %" if 0.5 < ratio < 2 else f"x {ratio:.3g}"


def _times_line(difference: Difference) -> str:
    times = difference.times
    if not times.compared:
        return "times: none compared"
    where = "one machine" if times.same_machine else "two machines, so beside the median of all frames"
    busy = f"; the machine was busy (quartiles {times.spread:.2f} times apart)" if times.spread > _BUSY else ""
    return (
        f"times: {times.compared} configurations, {where}; all frames together {times.drift:.2f} times the old; "
        f"the least slowdown that would be seen is {times.least:.2f} times{busy}"
    )
