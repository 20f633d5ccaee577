# SPDX-License-Identifier: BSD-3-Clause
"""The verdicts on the claims of papers in two reports, compared."""

from collections.abc import Iterator

from reports.diff.finding import Finding, Report

#: Units of figures that depend on how busy the machine was: another verdict is a note.
_TIMED = ("frames/s", "ms", "%", "times")


def compare_papers(old: Report, new: Report, gone: str) -> Iterator[Finding]:
    """Compare which claims are reproduced.

    Parameters
    ----------
    old, new
        The reports; one without rows, of an older version, is compared with nothing.
    gone
        What a row is that only the old report has: 'worse', or 'note'.
    """
    before, after = ({(row["paper"], row["item"]): row for row in report.get("papers", ())} for report in (old, new))
    if not before or not after:
        return
    for (paper, item), row in before.items():
        now = after.get((paper, item))
        name = f"{paper}, {item}"
        if now is None:
            yield Finding(gone, "", "", f"{name}: the row is gone")
        elif now["published"] != row["published"]:
            yield Finding("worse", "", "", f"{name}: the published figure", row["published"], now["published"])
        elif now["verdict"] != row["verdict"]:
            what = f"{name}: {now['verdict']}, was {row['verdict']}"
            yield Finding(_kind(row, now), "", "", what, row["measured"], now["measured"])


def _kind(row: Report, now: Report) -> str:
    if row["unit"] in _TIMED:
        return "note"
    if "reproduced" in (row["verdict"], now["verdict"]):
        return "worse" if row["verdict"] == "reproduced" else "better"
    return "note"
