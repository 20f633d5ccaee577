# SPDX-License-Identifier: BSD-3-Clause
"""The times of two reports compared, by the rules of `validation.statistics.noise`."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from airlight.reports.data.records import Report, Size
from airlight.reports.tables.methods import runs_of
from airlight.validation.statistics.noise import (
    SHORTEST,
    Times,
    drift,
    growths,
    least_ratio,
    slower_stages,
    spread,
)
from airlight.validation.timing import FrameTimes


@dataclass(frozen=True)
class Finding:
    """A difference between two reports."""

    verdict: str  #: 'worse', 'better' or 'note'
    scene: str  #: empty for what concerns the whole report
    method: str  #: label of the configuration; empty for what concerns the scene
    what: str  #: the number, or a sentence
    old: float | None = None
    new: float | None = None

    @property
    def words(self) -> str:
        """The finding without its verdict."""
        return ", ".join(each for each in (self.scene, self.method, self.what) if each)


_MACHINE = ("processor", "threads", "variant", "device")


@dataclass(frozen=True)
class TimeComparison:
    """The times of two reports compared."""

    compared: int  #: configurations
    same_machine: bool
    machine: tuple[str, ...]  #: how the machines and versions differ, in words
    spread: float  #: upper over lower quartile, of the noisier report
    least: float  #: least ratio of two times that is significant
    drift: float  #: median ratio of all frames


#: Nothing was timed.
NO_TIMES = TimeComparison(0, True, (), 1.0, 1.0, 1.0)


def compare_times(
    old: Report, new: Report, *, tolerance: float | None
) -> tuple[TimeComparison, list[Finding]]:
    """Compare the times of two reports, with findings; parameters as in
    `reports.diff.compare.compare_reports`.
    """
    # Differences of machine and versions are notes in every case: they explain what follows.
    machine, changes = _machines(old, new)
    notes = [Finding("note", "", "", change) for change in changes]
    if tolerance is None:
        return TimeComparison(0, machine, changes, 1.0, 1.0, 1.0), notes
    notes += [*_changed("old", old), *_changed("new", new)]
    pairs, otherwise = _pairs(old, new)
    notes += otherwise
    # The noisier report decides the least ratio that is significant. The drift, the median ratio of
    # all frames, is the part of a change that all methods share.
    spread_of_noisier = max(spread(_all_times(old)), spread(_all_times(new)))
    least = least_ratio(spread_of_noisier, same_machine=machine, tolerance=tolerance)
    common = drift(pairs.values()) if pairs else 1.0
    findings = [*notes, *_drift(common, least, machine, len(pairs))]
    grown = {key: growths(*times, common) for key, times in pairs.items()}
    for key, times in pairs.items():
        # Other configurations tell the noise: a change of this one must not pass for it.
        others = [growth for other, several in grown.items() if other != key for growth in several]
        tests = 2 * (len(others) + len(grown[key]))  # in both directions
        findings += _configuration(
            *key, *times, least=least, common=common, machine=machine, others=others, tests=tests
        )
    return TimeComparison(len(pairs), machine, changes, spread_of_noisier, least, common), findings


def _machines(old: Report, new: Report) -> tuple[bool, tuple[str, ...]]:
    """Return whether both reports come from one machine, and what differs, in words."""
    # Processor, threads, variant and device make a machine; another version of a package is a
    # change that the comparison may be meant to judge.
    before, after = old.environment, new.environment
    pairs = {key: (getattr(before, key), getattr(after, key)) for key in _MACHINE}
    changes = [f"{key}: {was} -> {now}" for key, (was, now) in pairs.items() if was != now]
    same, versions = not changes, (before.versions, after.versions)
    if before.airlight != after.airlight:
        changes.append(f"airlight: {before.airlight} -> {after.airlight}")
    for name in sorted({*versions[0], *versions[1]} - {"airlight"}):
        old_version, new_version = (installed.get(name) for installed in versions)
        changes += [f"{name}: {old_version} -> {new_version}"] if old_version != new_version else []
    if before.llvm != after.llvm:
        changes.append(f"llvm: {before.llvm} -> {after.llvm}")
    return same, tuple(changes)


def _changed(which: str, report: Report) -> Iterator[Finding]:
    """Yield a note on each scene during whose run the machine changed."""
    for scene in report.scenes:
        for run in runs_of(scene.methods):
            if run.steady is False:
                words = (
                    f"the machine changed while the times of the {which} report were measured, "
                    f"{run.started} (factor)"
                )
                yield Finding("note", scene.name, "", words, run.within, run.between)


Key = tuple[str, str]  # scene and label


def _pairs(old: Report, new: Report) -> tuple[dict[Key, tuple[Times, Times]], list[Finding]]:
    """Return the pairs of comparable times, and a note on each time without a partner."""
    before, after = _timed(old), _timed(new)
    pairs: dict[Key, tuple[Times, Times]] = {}
    notes: dict[Finding, None] = dict.fromkeys(_lost(before, new))
    # Two times are a pair if frames of one size were timed in one way. Notes are keys of a
    # dictionary, which drops repetitions and keeps the order.
    for key in [key for key in before if key in after]:
        (size, note, old_times), (new_size, new_note, new_times) = before[key], after[key]
        if size != new_size:
            sizes = " and ".join("x".join(map(str, pixels)) for pixels in (size, new_size))
            notes[
                Finding(
                    "note", key[0], "", f"times not compared: the frames timed are {sizes} pixels"
                )
            ] = None
        elif note != new_note:
            notes[
                Finding(
                    "note",
                    *key,
                    f"times not compared: {note or 'as usual'} before, {new_note or 'as usual'} now",
                )
            ] = None
        # The cache gave both reports the same measurement: it cannot differ.
        elif new_times.run is not None and new_times == old_times:
            words = f"times not compared: both reports show the run of {new_times.run.started}"
            notes[Finding("note", key[0], "", words)] = None
        else:
            pairs[key] = old_times.measured, new_times.measured
    return pairs, list(notes)


def _timed(report: Report) -> dict[Key, tuple[Size, str | None, FrameTimes]]:
    """Return the size of the frames that were timed, the device or the note on how, and
    times, by scene and label.
    """
    return {
        (scene.name, entry.label): (scene.timed, entry.device or entry.note, entry.times)
        for scene in report.scenes
        for entry in scene.methods
        if entry.times
    }


def _lost(before: Iterable[Key], new: Report) -> Iterator[Finding]:
    """Yield a note on each scene whose methods still run and have no times any more."""
    for scene in new.scenes:
        runs = {entry.label for entry in scene.methods if not (entry.reason or entry.times)}
        lost = [label for name, label in before if name == scene.name and label in runs]
        if lost:
            yield Finding("note", scene.name, "", f"times are gone: {', '.join(lost)}")


def _all_times(report: Report) -> list[Times]:
    return [times.measured for _, _, times in _timed(report).values()]


def _drift(common: float, least: float, machine: bool, count: int) -> list[Finding]:
    """Return a finding if all frames got slower or faster together."""
    if not machine or count == 0 or 1 / least < common < least:
        return []
    words = "every frame, in the median: the machine, or what all methods share (time ratio)"
    return [Finding("worse" if common > 1 else "better", "", "", words, 1.0, common)]


def _configuration(
    scene: str,
    label: str,
    old: Times,
    new: Times,
    *,
    least: float,
    common: float,
    machine: bool,
    others: list[float],
    tests: int,
) -> list[Finding]:
    """Return the stages of one configuration that got slower or faster."""
    # On one machine a method is judged by its own ratio even if all frames got faster; where all
    # got slower, the drift is a finding of its own and excuses the method. Two machines are
    # compared beside the drift only.
    floor = 1.0 if machine else 0.0
    slower = slower_stages(
        old, new, least=least, scale=max(floor, common), others=others, tests=tests
    )
    faster = slower_stages(
        new, old, least=least, scale=max(floor, 1 / common), others=others, tests=tests
    )
    moved = [("worse", stage) for stage in slower] + [("better", stage) for stage in faster]
    beside = "" if machine else f", beside the median of all ({common:.2f} times)"
    return [
        Finding(
            verdict,
            scene,
            label,
            f"{stage} [ms]{beside}",
            old[stage].median_ms,
            new[stage].median_ms,
        )
        for verdict, stage in moved
        # Stages below the shortest time that can be judged are left out.
        if max(old[stage].median_ms, new[stage].median_ms) >= SHORTEST
    ]
