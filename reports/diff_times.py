# SPDX-License-Identifier: BSD-3-Clause
"""The times of two reports compared, by the rules of `validation.noise`."""

from dataclasses import dataclass, field
from typing import Any

from reports.diff_finding import Finding, Report
from validation.noise import SHORTEST, Times, drift, least_ratio, slower_stages, spread

_MACHINE = ("processor", "threads", "variant", "device")


@dataclass(frozen=True)
class TimeComparison:
    """What two reports say of the speed."""

    compared: int  #: configurations
    same_machine: bool
    machine: tuple[str, ...]  #: how the machines and versions differ, in words
    spread: float  #: quartiles of the noisier report, upper over lower
    least: float  #: least ratio of two times that means something
    drift: float  #: median ratio of all frames
    findings: tuple[Finding, ...] = field(default=())


def compare_times(old: Report, new: Report, *, tolerance: float | None) -> TimeComparison:
    """Compare the times of two reports; parameters as in `reports.diff.compare_reports`."""
    machine, changes = _machines(old, new)
    notes = [Finding("note", "", "", one) for one in changes]
    if tolerance is None:
        return TimeComparison(0, machine, changes, 1.0, 1.0, 1.0, tuple(notes))
    timed = [report["settings"].get("timed") for report in (old, new)]
    if timed[0] != timed[1]:
        sizes = " and ".join("x".join(map(str, size or ["?"])) for size in timed)
        notes.append(Finding("note", "", "", f"times not compared: the frames timed are {sizes} pixels"))
        return TimeComparison(0, machine, changes, 1.0, 1.0, 1.0, tuple(notes))
    kept = new.get("kept")
    if kept:
        notes.append(Finding("note", "", "", f"{kept} results of the new report were measured earlier and kept"))
    pairs = _pairs(old, new)
    both = max(spread(_all_times(old)), spread(_all_times(new)))
    least = least_ratio(both, same_machine=machine, tolerance=tolerance)
    common = drift(pairs.values()) if pairs else 1.0
    findings = [*notes, *_drift(common, least, machine, len(pairs))]
    for (scene, label), (one, two) in pairs.items():
        findings += _configuration(scene, label, one, two, least=least, common=common, machine=machine)
    return TimeComparison(len(pairs), machine, changes, both, least, common, tuple(findings))


def _machines(old: Report, new: Report) -> tuple[bool, tuple[str, ...]]:
    """Return whether both reports come from one machine, and what differs, in words."""
    before, after = old["environment"], new["environment"]
    changes = [f"{key}: {before.get(key)} -> {after.get(key)}" for key in _MACHINE if before.get(key) != after.get(key)]
    same = not changes
    versions = before.get("versions", {}), after.get("versions", {})
    for name in sorted({*versions[0], *versions[1]}):
        one, two = (found.get(name) for found in versions)
        changes += [f"{name}: {one} -> {two}"] if one != two else []
    if before.get("llvm") != after.get("llvm"):
        changes.append(f"llvm: {before.get('llvm')} -> {after.get('llvm')}")
    return same, tuple(changes)


def _pairs(old: Report, new: Report) -> dict[tuple[str, str], tuple[Times, Times]]:
    """Return the times of what both reports timed alike."""
    before, after = (_timed(report) for report in (old, new))
    shared = [key for key in before if key in after and before[key][0] == after[key][0]]
    return {key: (before[key][1], after[key][1]) for key in shared}


def _timed(report: Report) -> dict[tuple[str, str], tuple[Any, Times]]:
    """Return how and how long, by scene and label; a note says that another size was timed."""
    return {
        (scene["name"], one["label"]): ((one.get("note"), scene["size"] if one.get("note") else None), one["times"])
        for scene in report["scenes"]
        for one in scene["methods"]
        if one.get("times") and "frame" in one["times"]
    }


def _all_times(report: Report) -> list[Times]:
    return [one["times"] for scene in report["scenes"] for one in scene["methods"] if one.get("times")]


def _drift(common: float, least: float, machine: bool, count: int) -> list[Finding]:
    """Judge what all frames share."""
    if not machine or count == 0 or 1 / least < common < least:
        return []
    words = "every frame, in the median: the machine, or what all methods share (time ratio)"
    return [Finding("worse" if common > 1 else "better", "", "", words, 1.0, common)]


def _configuration(
    scene: str, label: str, old: Times, new: Times, *, least: float, common: float, machine: bool
) -> list[Finding]:
    """Return the stages of one configuration that got slower or faster."""
    floor = 1.0 if machine else 0.0
    slower = slower_stages(old, new, least=least, scale=max(floor, common))
    faster = slower_stages(new, old, least=least, scale=max(floor, 1 / common))
    moved = [("worse", stage) for stage in slower] + [("better", stage) for stage in faster]
    beside = "" if machine else f", beside the median of all ({common:.2f} times)"
    return [
        Finding(verdict, scene, label, f"{stage} [ms]{beside}", old[stage]["median_ms"], new[stage]["median_ms"])
        for verdict, stage in moved
        if max(old[stage]["median_ms"], new[stage]["median_ms"]) >= SHORTEST
    ]
