# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy baselines: the known errors of every configuration, one text file per scene.

A file `baselines/SCENE.json` holds the errors of the airlight and of the lit surface against the truth for each
configuration, at a small image size. Each line holds one number and the keys are sorted, so that a diff of the file
shows what a change moved. Errors depend on the machine by rounding alone, so the comparison is strict, with the band
and the floor of `validation.statistics.noise`. It fails in both directions: if nobody recorded an improvement, a later
fault of the same size would go unseen.

Times depend on the machine, so a baseline keeps only a ratio: the processor time of a frame over that of a frame of
`unshadowed (exact)`, each the shortest of many, measured in turns, summed over all threads. Other programs hardly
change processor time: on two threads, among seventeen busy ones, the ratio of `ray-march (steps=100)` on `three-media`
was 12 in each of three runs, while the ratio of wall-clock times was between 53 and 62. The comparison fails only if
the ratio is more than three times the kept one, after the frame was timed again and for longer: launches take half of
so small a frame, and their share differs between processors. Frames on graphics processors are not timed. `airlight
diff` compares times more finely.

Every file has a revision and a reason for it. CHANGELOG.md must name both; a test checks that.
"""

import json
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reference.storage.files import write_text
from validation.statistics.noise import ERROR_TOLERANCE, error_band

SCHEMA = "airlight-baseline/1"
FOLDER = Path(__file__).parent.parent / "baselines"
SIZE = (64, 48)  #: of the images [pixels]
FIRST = "measured for the first time"  #: the reason of the first revision
SLOWER = 3.0  #: a ratio of processor times above this multiple of the kept one fails

ERRORS = ("mean", "relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")

Baseline = Mapping[str, Any]


@dataclass(frozen=True)
class Move:
    """One number, or one configuration, that is not what the baseline says."""

    scene: str  #: name of the scene
    label: str  #: of the configuration; empty for the scene itself
    what: str  #: the number, such as 'airlight relative_rmse', or a sentence on what is missing
    old: float | None = None  #: what the baseline holds
    new: float | None = None  #: what was measured
    allowed: float | None = None  #: largest difference that is no move


def baseline_path(scene: str, folder: Path = FOLDER) -> Path:
    """Return where the baseline of a scene is kept."""
    return folder / f"{scene}.json"


def read_baseline(scene: str, folder: Path = FOLDER) -> Baseline | None:
    """Return the baseline of a scene, None where there is none.

    Raises
    ------
    InputError
        If the file is not what `write_baseline` wrote.
    """
    path = baseline_path(scene, folder)
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"baseline {path}: not valid JSON ({error}); restore it from version control") from error
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema != SCHEMA:
        raise InputError(f"baseline {path}: the schema is {schema!r}, wanted {SCHEMA!r}; remove it and measure again")
    return data


def stray_baselines(scenes: Container[str], folder: Path = FOLDER) -> list[str]:
    """Return the names of baselines that have no scene, sorted."""
    return sorted(path.stem for path in folder.glob("*.json") if path.stem not in scenes)


def write_baseline(data: Baseline, folder: Path = FOLDER) -> Path:
    """Write a baseline as text with one number per line, and return its path."""
    path = baseline_path(data["scene"], folder)
    write_text(path, json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def compare_baseline(kept: Baseline | None, measured: Baseline, *, tolerance: float = ERROR_TOLERANCE) -> list[Move]:
    """Return what moved between a baseline and a new measurement.

    Parameters
    ----------
    kept
        The baseline, or None if the scene has none yet.
    measured
        The new measurement. Entries without a time are compared without it.
    tolerance
        Relative band of errors [1].
    """
    scene = measured["scene"]
    if kept is None:
        return [Move(scene, "", "no baseline: write one with `airlight baselines --update`")]
    moves = []
    if kept["size"] != measured["size"]:
        moves.append(Move(scene, "", f"size: {kept['size']} before, {measured['size']} now"))
    for layer in ("airlight", "surface"):
        numbers = kept["truth"][layer], measured["truth"][layer]
        moves += _numbers(scene, "", f"truth of the {layer}", *numbers, tolerance=0.0, pixels=0)
    before, after = kept["configurations"], measured["configurations"]
    moves += [Move(scene, label, "a baseline without its configuration") for label in before if label not in after]
    moves += [Move(scene, label, "a configuration without baseline") for label in after if label not in before]
    pixels = measured["size"][0] * measured["size"][1]
    for label in [label for label in before if label in after]:
        old, new = before[label], after[label]
        if old.get("refused") != new.get("refused"):
            moves.append(Move(scene, label, f"refused: {old.get('refused')} before, {new.get('refused')} now"))
            continue
        for layer in ("airlight", "surface"):
            numbers = old.get(layer, {}), new.get(layer, {})
            moves += _numbers(scene, label, layer, *numbers, tolerance=tolerance, pixels=pixels)
        moves += _slower(scene, label, old.get("frame_ratio"), new.get("frame_ratio"))
    return moves


def updated(kept: Baseline | None, measured: Baseline, because: str | None) -> Baseline | None:
    """Return the next revision of a baseline, or None if nothing moved.

    Entries whose numbers did not move beyond the noise keep their old numbers, so that a diff shows only what moved.

    Parameters
    ----------
    kept
        The baseline, or None if the scene has none yet.
    measured
        The new measurement.
    because
        The reason for the revision, one sentence without its full stop.

    Raises
    ------
    InputError
        If something moved and no reason is given.
    """
    if kept is None:
        return {**measured, "revision": 1, "because": because or FIRST}
    moves = compare_baseline(kept, measured)
    if not moves:
        return None
    if not because or not because.strip():
        raise InputError(
            f"baselines: {len(moves)} numbers of {measured['scene']} moved; say why with --because, and say the same "
            "in CHANGELOG.md"
        )
    moved = {move.label for move in moves}
    before = kept["configurations"]
    configurations = {
        label: _with_ratio(entry, before.get(label, {})) if label in moved or label not in before else before[label]
        for label, entry in measured["configurations"].items()
    }
    revision = {"revision": kept["revision"] + 1, "because": " ".join(because.split())}
    return {**measured, "configurations": configurations, **revision}


def changelog_line(data: Baseline) -> str:
    """Return the line that CHANGELOG.md must hold for the revision of a baseline."""
    return f"Baselines of `{data['scene']}`, revision {data['revision']}: {data['because']}."


def _numbers(
    scene: str, label: str, layer: str, old: Baseline, new: Baseline, *, tolerance: float, pixels: int
) -> Iterator[Move]:
    """Compare the numbers of one layer, both ways."""
    for name in sorted({*old, *new}):
        before, after = old.get(name), new.get(name)
        if before is None or after is None:  # JSON holds null for NaN
            if before is not after:
                yield Move(scene, label, f"{layer} {name}", before, after)
            continue
        scale = abs(before) if name == "mean" else 1.0  # its floor is relative to itself
        rmse = old.get("relative_rmse") or 0.0
        band = error_band(name, before / (scale or 1.0), tolerance=tolerance, pixels=pixels, rmse=rmse) * scale
        # The file keeps six digits: allow half a unit of the last one.
        band += 0.5e-5 * abs(before)
        if abs(after - before) > band:
            yield Move(scene, label, f"{layer} {name}", before, after, band)


def _slower(scene: str, label: str, old: float | None, new: float | None) -> Iterator[Move]:
    if old is not None and new is not None and new > SLOWER * old:
        yield Move(scene, label, "frames of unshadowed (exact) a frame", old, new, (SLOWER - 1) * old)


def _with_ratio(entry: Baseline, before: Baseline) -> dict[str, Any]:
    """Return an entry that keeps its old time if it was not timed now."""
    ratio = {name: before[name] for name in ("frame_ratio",) if name in before}
    return {**ratio, **entry} if "refused" not in entry else dict(entry)
