# SPDX-License-Identifier: BSD-3-Clause
"""Two reports compared: methods that got slower or less accurate beyond the noise, that
are new or that are gone.

`validation.statistics.noise` derives the limits of noise. A finding is worse, better, or a note;
anything worse makes the comparison fail, and so does a missing method: a method that is no longer
measured is no longer guarded.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from airlight.errors import InputError
from airlight.reports.data.records import Report, Scene
from airlight.reports.diff.times import NO_TIMES, Finding, TimeComparison, compare_times
from airlight.reports.report.claims import confirmed
from airlight.reports.tables.agreement import verdict
from airlight.reports.tables.costs import TIMES, WORK, same_records
from airlight.reports.tables.table import Table, fields_of, table, words
from airlight.validation.metrics.errors import Metrics
from airlight.validation.papers.claims import QUARTILES, Claim
from airlight.validation.statistics.noise import FLOORS, TIME_TOLERANCE, error_band, other_power
from airlight.validation.study.row import Row

_ERRORS = ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")
_TIMED = ("frames/s", "ms")  #: units of times
_COLUMNS = (
    *fields_of(Finding, "verdict", "scene", "method", "what"),
    *fields_of(Finding, "old", "new", digits=4),
    *words("change"),
)
Change = tuple[str, str, float | None, float | None]  # verdict, what, old, new


@dataclass(frozen=True)
class Difference:
    """All differences of two reports."""

    worse: int  #: findings that make the comparison fail
    findings: tuple[Finding, ...]  #: the worse ones first
    errors_compared: int
    times: TimeComparison


def compare_reports(
    old: Report,
    new: Report,
    *,
    time_tolerance: float | None = TIME_TOLERANCE,
) -> Difference:
    """Compare two reports of `read_report`; the tolerance of times is relative, None compares none.

    Reports without a common number are refused.
    """
    if time_tolerance is not None and not 0 < time_tolerance < math.inf:
        raise InputError(
            f"--time-tolerance: got {time_tolerance:g}, expected a number above 0, such as 0.1 for "
            "10 %"
        )
    # Scenes and methods are matched by their names. One that is gone is a failure, one that is new
    # a note.
    before, after = ({scene.name: scene for scene in report.scenes} for report in (old, new))
    findings: list[Finding] = []
    compared = 0
    for name in before:
        if name not in after:
            findings.append(Finding("worse", name, "", "the scene is gone"))
            continue
        findings += _reference(before[name], after[name])
        differences, count = _methods(before[name], after[name])
        findings += differences
        compared += count
    findings += [
        Finding("note", name, "", "the scene is new") for name in after if name not in before
    ]
    # Times are compared once for all scenes: the noise of the machine is seen only in all of them
    # together.
    times, slower = compare_times(old, new, tolerance=time_tolerance)
    findings += [*slower, *_stability(old, new), *_growth(old, new)]
    findings += _papers(old, new)
    # A comparison of nothing must not pass.
    if not compared and not times.compared:
        raise InputError(
            "reports: no number can be compared: no method of a scene was measured in both at one "
            "size; "
            "give two reports of the same scenes with the same effort"
        )
    return difference_of(findings, compared, times)


def difference_of(
    findings: list[Finding], compared: int, times: TimeComparison = NO_TIMES
) -> Difference:
    """Return the difference that some findings make, the worse ones first."""
    # The sort is stable: within a verdict the order of the reports stays.
    rank = {"worse": 0, "better": 1, "note": 2}
    ordered = tuple(sorted(findings, key=lambda finding: rank[finding.verdict]))
    worse = sum(finding.verdict == "worse" for finding in findings)
    return Difference(worse, ordered, compared, times)


# Errors, scene by scene and method by method


def _methods(old: Scene, new: Scene) -> tuple[list[Finding], int]:
    """Return the findings on the methods of a scene, and how many numbers were compared."""
    name = old.name
    before, after = ({entry.label: entry for entry in scene.methods} for scene in (old, new))
    findings = [Finding("worse", name, label, "gone") for label in before if label not in after]
    findings += [Finding("note", name, label, "new") for label in after if label not in before]
    # Errors against another reference, or at another size, say nothing; whether a method runs or
    # refuses is compared all the same.
    reason = _incomparable(old, new)
    if reason:
        findings.append(reason)
    compared = 0
    for label in [label for label in before if label in after]:
        changes, count = _entries(before[label], after[label], errors=reason is None)
        findings += [
            Finding(found, name, label, what, was, now) for found, what, was, now in changes
        ]
        compared += count
    return findings, compared


def _entries(old: Row, new: Row, *, errors: bool) -> tuple[list[Change], int]:
    """Compare a configuration in a scene, and where `errors` can be compared
    these: return how many were.
    """
    # A row with a reason has no numbers.
    if bool(old.reason) != bool(new.reason):
        words = f"refused: {new.reason}" if new.reason else "no longer refused"
        # Leaving a method out for the time it takes is a decision of the user, not a fault.
        decided = "left out" in (old.status, new.status)
        return [("note" if decided else "worse" if new.reason else "better", words, None, None)], 0
    if old.layer != new.layer:
        return [("note", "errors not compared: they are of different layers", None, None)], 0
    if not errors:
        return [], 0
    # Errors of noisy runs have intervals, and are taken only where both reports have them.
    noisy = bool(old.noise and new.noise)
    parts = [
        _errors(_errors_of(old, noisy), _errors_of(new, noisy), prefix=""),
        _errors(_numbers(old.surface_error), _numbers(new.surface_error), prefix="surface "),
        _flip(old, new),
    ]
    return [change for changes, _ in parts for change in changes], sum(count for _, count in parts)


def _incomparable(old: Scene, new: Scene) -> Finding | None:
    """Say why the errors of a scene cannot be compared, None if they can."""
    # Errors change with the pixels that they are taken over.
    if old.size != new.size:
        sizes = " and ".join("x".join(map(str, scene.size)) for scene in (old, new))
        return Finding("note", old.name, "", f"errors not compared: the images are {sizes} pixels")
    # Without a mean there is nothing to doubt the reference by.
    before, after = (scene.reference.mean for scene in (old, new))
    if before is None or after is None:
        return None
    # Each error is that of the mean absolute value, so the means differ by at most the sum of both.
    # A dark reference has no relative error: its mean is 0.
    stated = [scene.reference.relative_error for scene in (old, new)]
    errors = [each for each in stated if each is not None]
    if abs(after - before) > (sum(errors) + FLOORS["mean"]) * abs(before):
        # An error that is not known may be as large as the difference.
        if len(errors) < len(stated) and before > 0 and after > 0:
            words = (
                "errors not compared: the reference has another mean, and its error is not known"
            )
            return Finding("note", old.name, "", words, before, after)
        words = (
            "the reference moved (mean radiance): another scene by this name, or another reference; "
            "errors not compared"
        )
        return Finding("worse", old.name, "", words, before, after)
    return None


#: of `Metrics` by name, and `NAME_within`, half of the interval of a number
Numbers = Mapping[str, Any]


def _numbers(errors: Metrics | None) -> Numbers:
    return asdict(errors) if errors else {}


def _errors_of(entry: Row, noisy: bool) -> Numbers:
    """Return the errors of an image, or those of noisy runs, without quantiles of a single one."""
    # A single noisy run has random quantiles: the mean of several runs, with its interval, replaces
    # them.
    error = _numbers(entry.error)
    if not noisy or entry.noise is None:
        return error
    noise = {f"relative_{name}": value for name, value in vars(entry.noise).items()}
    return {name: error[name] for name in ("pixels", "nonfinite", "negative")} | noise


def _errors(old: Numbers, new: Numbers, *, prefix: str) -> tuple[list[Change], int]:
    """Compare the errors of a configuration in one layer; what has an
    interval may differ by it too.
    """
    if not old or not new:
        gone: Change = ("worse", f"{prefix}error is gone", None, None)
        fresh: Change = ("note", f"{prefix}error is new", None, None)
        return [gone] if old else [fresh] if new else [], 0
    changes: list[Change] = []
    compared = 0
    for name in _ERRORS:
        # A number that is NaN in one report alone is a difference: something became, or stopped
        # being, not finite.
        before, after = old.get(name), new.get(name)
        what = f"{prefix}{name}"
        if before is None or after is None:
            if before is not after:  # JSON writes NaN as null
                changes.append(("worse" if after is None else "better", what, before, after))
            continue
        compared += 1
        # The band is the part that differs without a cause; the half intervals of two independent
        # estimates add in quadrature.
        band = error_band(name, before, pixels=old["pixels"], rmse=old["relative_rmse"])
        band += math.hypot(*(each.get(f"{name}_within", 0.0) for each in (old, new)))
        # A bias has a sign: its size is what gets worse.
        grown = abs(after) - abs(before)
        if abs(grown) > band:
            changes.append(("worse" if grown > 0 else "better", what, before, after))
    return changes, compared


def _flip(old: Row, new: Row) -> tuple[list[Change], int]:
    before, after = (entry.flip.value if entry.flip else None for entry in (old, new))
    if before is None or after is None:
        return [], 0
    if abs(after - before) <= error_band("flip", before):
        return [], 1
    return [("worse" if after > before else "better", "HDR-FLIP", before, after)], 1


# References, kernels that break, times that grow


def _reference(old: Scene, new: Scene) -> Iterator[Finding]:
    """Compare the reference of a scene in two reports."""
    name = old.name
    # The verdict over all checks first, then each check by its name.
    if not confirmed([new]) and confirmed([old]):
        yield Finding("worse", name, "", "the reference is no longer confirmed")
    elif confirmed([new]) and not confirmed([old]):
        yield Finding("better", name, "", "the reference is confirmed now")
    for key, agreement in old.agreement.items():
        if key not in new.agreement:
            yield Finding("worse", name, "", f"the comparison with {key} is gone")
            continue
        was, is_now = verdict(agreement), verdict(new.agreement[key])
        # An estimator that had no time has not spoken against the reference.
        if was is True and is_now is None:
            yield Finding(
                "note", name, "", f"{key} ran out of time before it could confirm the reference"
            )
        # Where another check spoke against it before, the verdict over all checks does not say so.
        if was is not False and is_now is False and not confirmed([old]):
            yield Finding("worse", name, "", f"{key} contradicts the reference")
    # Counts of shadow rays grow with the pixels, so that only images of one size have comparable
    # ones.
    if old.size == new.size:
        for key in ("disagreements", "left"):
            before, after = getattr(old.reference, key), getattr(new.reference, key)
            if after > before:
                yield Finding(
                    "worse", name, "", f"lit intervals of the reference: {key}", before, after
                )


def _stability(old: Report, new: Report) -> Iterator[Finding]:
    """Compare which kernels break their bars."""
    before, after = (
        {entry.kernel: entry.broken for entry in report.stability} for report in (old, new)
    )
    for kernel in before:
        if kernel in after and after[kernel] and not before[kernel]:
            yield Finding("worse", "", kernel, f"breaks its bar: {after[kernel][0]}")
        elif kernel in after and before[kernel] and not after[kernel]:
            yield Finding("better", "", kernel, "keeps its bars again")


def _growth(old: Report, new: Report) -> Iterator[Finding]:
    """Compare the powers of the work with which times grow."""
    # `other_power` is the change of the exponent, and zero where noise may explain it.
    for before, after in same_records(old.scaling, new.scaling):
        for name, growth in after.growth.items():
            if change := other_power(before.growth[name], growth):
                was, is_now = before.growth[name].exponent, growth.exponent
                what = f"the power of the {WORK[after.kind]} with which {TIMES[name]} grows"
                yield Finding(
                    "worse" if change > 0 else "better", after.scene, after.label, what, was, is_now
                )


# Claims of papers


def _papers(old: Report, new: Report) -> Iterator[Finding]:
    """Compare which claims are reproduced."""
    before, after = ({(row.paper, row.item): row for row in report.papers} for report in (old, new))
    # A report without papers did not measure them.
    if not before or not after:
        return
    for (paper, item), row in before.items():
        now = after.get((paper, item))
        name = f"{paper}, {item}"
        if now is None:
            yield Finding("worse", "", "", f"{name}: the row is gone")
        # The paper did not change: an edited figure is another claim.
        elif now.published != row.published:
            yield Finding(
                "worse", "", "", f"{name}: the published figure", row.published, now.published
            )
        elif now.verdict != row.verdict:
            what = f"{name}: {now.verdict}, was {row.verdict}"
            yield Finding(_kind(row, now), "", "", what, row.measured, now.measured)


def _kind(row: Claim, now: Claim) -> str:
    # A busy machine can overturn a verdict on times: on rates, and on quotients of what has
    # quartiles.
    if row.unit in _TIMED or QUARTILES in f"{row.interval} {now.interval}":
        return "note"
    if "reproduced" in (row.verdict, now.verdict):
        return "worse" if row.verdict == "reproduced" else "better"
    return "note"


# Printed output


def difference_tables(difference: Difference) -> list[Table]:
    """Return the findings that have numbers, the worse ones first."""
    rows = [
        vars(each) | {"change": _change(each)} for each in difference.findings if _has_row(each)
    ]
    return [table("", _COLUMNS, rows)] if rows else []


def difference_lines(difference: Difference) -> list[str]:
    """Return the other findings, what could be seen of times, and how many are worse and better."""
    lines = [
        f"{finding.verdict}: {f'{finding.scene}: ' if finding.scene else ''}{finding.what}"
        for finding in difference.findings
        if not _has_row(finding)
    ]
    better = sum(finding.verdict == "better" for finding in difference.findings)
    return [
        *lines,
        _times_line(difference),
        f"{difference.worse} worse, {better} better, {difference.errors_compared} errors compared",
    ]


def _has_row(finding: Finding) -> bool:
    return bool(finding.old is not None or finding.new is not None or finding.method)


def _change(finding: Finding) -> str:
    """Return the change in percent, or as a factor where it is more than
    double or less than half.
    """
    if finding.old is None or finding.new is None or finding.old == 0:
        return ""
    # A percentage reads well between a half and the double; beyond, a factor does.
    ratio = abs(finding.new / finding.old)
    return f"{100 * (ratio - 1):+.1f} %" if 0.5 < ratio < 2 else f"x {ratio:.3g}"


def _times_line(difference: Difference) -> str:
    times = difference.times
    if not times.compared:
        return "times: none compared"
    where = (
        "one machine" if times.same_machine else "two machines, so beside the median of all frames"
    )
    # With a larger ratio of the quartiles the machine was not quiet.
    busy = (
        f"; the machine was busy (quartiles {times.spread:.2f} times apart)"
        if times.spread > 1.25
        else ""
    )
    return (
        f"times: {times.compared} configurations, {where}; all frames together {times.drift:.2f} "
        "times the old; "
        f"the least slowdown that would be seen is {times.least:.2f} times{busy}"
    )
