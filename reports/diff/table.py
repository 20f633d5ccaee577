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
_BUSY = 1.25  # a spread of quartiles from which on the machine was not quiet


def print_difference(found: Difference) -> None:
    """Print the findings as a table, the worse ones first, and a sentence on what could be seen."""
    rows = [_row(one) for one in found.findings if one.old is not None or one.new is not None or one.method]
    if rows:
        print_table(table("", _COLUMNS, rows))
    for one in found.findings:
        if one.old is None and one.new is None and not one.method:
            print(f"{one.verdict}: {f'{one.scene}: ' if one.scene else ''}{one.what}")
    print(_times_line(found))
    better = sum(one.verdict == "better" for one in found.findings)
    print(f"{len(found.worse)} worse, {better} better, {found.errors} errors compared")


def _row(one: Finding) -> tuple[str | float | None, ...]:
    return (one.verdict, one.scene, one.method, one.what, one.old, one.new, _change(one))


def _change(one: Finding) -> str:
    """Return the change in percent, or as a factor where it is more than double or less than half."""
    if one.old is None or one.new is None or one.old == 0:
        return ""
    ratio = abs(one.new / one.old)
    return f"{100 * (ratio - 1):+.1f} %" if 0.5 < ratio < 2 else f"x {ratio:.3g}"


def _times_line(found: Difference) -> str:
    times = found.times
    if not times.compared:
        return "times: none compared"
    where = "one machine" if times.same_machine else "two machines, so beside the median of all frames"
    busy = f"; the machine was busy (quartiles {times.spread:.2f} times apart)" if times.spread > _BUSY else ""
    return (
        f"times: {times.compared} configurations, {where}; all frames together {times.drift:.2f} times the old; "
        f"the least slowdown that would be seen is {times.least:.2f} times{busy}"
    )
