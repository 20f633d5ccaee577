# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy baselines: what every configuration was found to be wrong by, kept as text, scene by scene.

A file `baselines/SCENE.json` holds for each configuration the errors of its airlight and of its lit surface against the
truth, at a small size, a number on a line, keys in order: what a change moved is what the version control shows. Errors
depend on the machine by rounding alone, so they are compared strictly, both ways, with the band and the floor of
`validation.statistics.noise`: an improvement must be written down too, or the next fault hides in it.

Times depend on the machine. Kept is only how much of the processors a frame takes, in frames of `unshadowed (exact)`:
of both the shortest of many in turns, all threads together. Processor time hardly knows of other programs: on two
threads among seventeen the ratio of `ray-march (steps=100)` on three-media was 12 in each of three runs, that of the
wall clock between 53 and 62. A frame fails only where it takes more than three times as much, timed again and for
longer: at a small size it is half launches, whose share differs from processor to processor. Graphics processors are
not timed. `airlight diff` is for finer looks at times.

Every file has a revision and the reason for it; CHANGELOG.md must name both, which a test checks.
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
SLOWER = 3.0  #: a frame that takes this much more of the processors beside the yardstick fails

ERRORS = ("mean", "relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")

Baseline = Mapping[str, Any]


@dataclass(frozen=True)
class Move:
    """One number, or one configuration, that is not what the baseline says."""

    scene: str
    label: str  #: of the configuration; empty for the scene itself
    what: str  #: 'airlight relative_rmse', or in words what is missing
    old: float | None = None
    new: float | None = None
    allowed: float | None = None  #: how far it might have moved


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
        raise InputError(f"baseline {path}: no JSON ({error}); restore it from the version control") from error
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema != SCHEMA:
        raise InputError(f"baseline {path}: the schema is {schema!r}, wanted {SCHEMA!r}; remove it and measure again")
    return data


def stray_baselines(scenes: Container[str], folder: Path = FOLDER) -> list[str]:
    """Return the names of baselines whose scene is gone."""
    return sorted(path.stem for path in folder.glob("*.json") if path.stem not in scenes)


def write_baseline(data: Baseline, folder: Path = FOLDER) -> Path:
    """Write a baseline as text that a person can compare line by line; return its path."""
    path = baseline_path(data["scene"], folder)
    write_text(path, json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def compare_baseline(kept: Baseline | None, found: Baseline, *, tolerance: float = ERROR_TOLERANCE) -> list[Move]:
    """Return what moved.

    Parameters
    ----------
    kept
        The baseline, None where there is none: then everything is missing.
    found
        What was measured now; without times where its entries have none.
    tolerance
        Relative band of errors.
    """
    scene = found["scene"]
    if kept is None:
        return [Move(scene, "", "no baseline: write one with `airlight baselines --update`")]
    moves = []
    if kept["size"] != found["size"]:
        moves.append(Move(scene, "", f"size: {kept['size']} before, {found['size']} now"))
    for layer in ("airlight", "surface"):
        numbers = kept["truth"][layer], found["truth"][layer]
        moves += _numbers(scene, "", f"truth of the {layer}", *numbers, tolerance=0.0, pixels=0)
    before, after = kept["configurations"], found["configurations"]
    moves += [Move(scene, label, "a baseline without its configuration") for label in before if label not in after]
    moves += [Move(scene, label, "a configuration without baseline") for label in after if label not in before]
    pixels = found["size"][0] * found["size"][1]
    for label in [label for label in before if label in after]:
        one, two = before[label], after[label]
        if one.get("refused") != two.get("refused"):
            moves.append(Move(scene, label, f"refused: {one.get('refused')} before, {two.get('refused')} now"))
            continue
        for layer in ("airlight", "surface"):
            numbers = one.get(layer, {}), two.get(layer, {})
            moves += _numbers(scene, label, layer, *numbers, tolerance=tolerance, pixels=pixels)
        moves += _slower(scene, label, one.get("frame_ratio"), two.get("frame_ratio"))
    return moves


def updated(kept: Baseline | None, found: Baseline, because: str | None) -> Baseline | None:
    """Return the next revision of a baseline, None where nothing moved.

    Numbers that did not move beyond the noise stay as they were: what the version control shows is what moved.

    Raises
    ------
    InputError
        If something moved and no reason is given.
    """
    if kept is None:
        return {**found, "revision": 1, "because": because or FIRST}
    moves = compare_baseline(kept, found)
    if not moves:
        return None
    if not because or not because.strip():
        raise InputError(
            f"baselines: {len(moves)} numbers of {found['scene']} moved; say why with --because, and say the same in "
            "CHANGELOG.md"
        )
    moved = {move.label for move in moves}
    before = kept["configurations"]
    configurations = {
        label: _with_ratio(entry, before.get(label, {})) if label in moved or label not in before else before[label]
        for label, entry in found["configurations"].items()
    }
    revision = {"revision": kept["revision"] + 1, "because": " ".join(because.split())}
    return {**found, "configurations": configurations, **revision}


def changelog_line(data: Baseline) -> str:
    """Return the line that CHANGELOG.md must hold for the revision of a baseline."""
    return f"Baselines of `{data['scene']}`, revision {data['revision']}: {data['because']}."


def _numbers(
    scene: str, label: str, layer: str, old: Baseline, new: Baseline, *, tolerance: float, pixels: int
) -> Iterator[Move]:
    """Compare the numbers of one layer, both ways."""
    for name in sorted({*old, *new}):
        before, after = old.get(name), new.get(name)
        if before is None or after is None:  # not-a-number is null
            if before is not after:
                yield Move(scene, label, f"{layer} {name}", before, after)
            continue
        scale = abs(before) if name == "mean" else 1.0  # its floor is relative to itself
        rmse = old.get("relative_rmse") or 0.0
        band = error_band(name, before / (scale or 1.0), tolerance=tolerance, pixels=pixels, rmse=rmse) * scale
        # Half a unit of the last of the digits that are kept.
        band += 0.5e-5 * abs(before)
        if abs(after - before) > band:
            yield Move(scene, label, f"{layer} {name}", before, after, band)


def _slower(scene: str, label: str, old: float | None, new: float | None) -> Iterator[Move]:
    if old is not None and new is not None and new > SLOWER * old:
        yield Move(scene, label, "frames of unshadowed (exact) a frame", old, new, (SLOWER - 1) * old)


def _with_ratio(entry: Baseline, before: Baseline) -> dict[str, Any]:
    """Return an entry with the time that it had before, where none was taken now."""
    ratio = {name: before[name] for name in ("frame_ratio",) if name in before}
    return {**ratio, **entry} if "refused" not in entry else dict(entry)
