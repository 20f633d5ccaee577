# SPDX-License-Identifier: BSD-3-Clause
"""Accuracy baselines: the known errors of every configuration, one text file per scene, and
the tool that writes them.

    python -m tests.evidence.baselines [SCENE ...]                          # says what moved
    python -m tests.evidence.baselines [SCENE ...] --update --because "..."   # writes what moved, with its reason

A file `baselines/SCENE.json` holds the errors of the airlight and of the lit surface against the
reference for each configuration, at a small image size. Each line holds one number and the keys are
sorted, so that a diff of the file shows what a change moved. Errors depend on the machine by
rounding alone, so the comparison is strict, with the band and the floor of
`validation.statistics.noise`. It fails in both directions: if nobody recorded an improvement, a
later fault of the same size would go unseen. Every file has a revision and the reason for it.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.columns import plain
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.registry import SCENES
from airlight.validation.statistics.noise import ERROR_TOLERANCE, error_band
from airlight.validation.study.configuration import STANDARD, Configuration
from airlight.validation.study.reference import of_image
from airlight.validation.study.run import run
from airlight.validation.study.scene import configurations_for
from airlight.validation.study.study import Cell, Measure

FOLDER = Path(__file__).parent / "baselines"
SIZE = (64, 48)  # of the images [pixels]
FOG = "open-fog"  # the scene in which every kernel is measured

ERRORS = ("mean", "relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")
_SURFACE = ("relative_rmse", "max", "nonfinite")  # methods change the surface only by their shadows

Baseline = Mapping[str, Any]

#: The scenes that scatter light once; methods that refuse height fog or grids say why in their
#: baseline. Scenes of many lights are for methods with noise, which have no baselines; the others
#: take minutes in them.
SCATTER_ONCE = tuple(name for name, record in SCENES.items() if not (record.clouds or record.many))


@dataclass(frozen=True)
class Move:
    """One number, or one configuration, that is not what the baseline says."""

    scene: str
    label: str  # of the configuration; empty for the scene itself
    what: str  # the number, such as 'airlight relative_rmse', or a sentence on what is missing
    old: float | None = None
    new: float | None = None
    allowed: float | None = None  # largest difference that is no move


def read_baseline(scene: str) -> Baseline | None:
    """Return the baseline of a scene, None where there is none."""
    path = FOLDER / f"{scene}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def baseline_configurations(name: str, scene: Scene) -> tuple[Configuration, ...]:
    """Return what the baseline of a scene holds: the standard configurations, and
    every kernel in one scene.
    """
    kernels = [Configuration("unshadowed", kernel) for kernel in KERNELS] if name == FOG else []
    return tuple(dict.fromkeys((*configurations_for(scene, STANDARD), *kernels)))


def measure_baseline(name: str) -> dict[str, Any]:
    """Measure what the baseline of a built-in scene holds, without revision and reason."""
    loaded = load_scene(name, SIZE)
    scene = read_scene(loaded.scene)
    reference = reference_image(loaded.scene)
    chosen = baseline_configurations(name, scene)
    return {
        "scene": name,
        "size": list(SIZE),
        "reference": {
            layer: _rounded({"mean": getattr(reference, layer).mean()})
            for layer in ("airlight", "surface")
        },
        "configurations": {each.label: _entry(scene, each, reference) for each in chosen},
    }


def _entry(scene: Scene, chosen: Configuration, reference: ReferenceImage) -> dict[str, Any]:
    """Return the errors of one configuration, or why it was refused."""
    row, frame = run(
        Cell("", SIZE, (), chosen, Measure("none", every_metric=False)), scene, of_image(reference)
    )
    if row.error is None or frame is None:
        return {"refused": row.reason}
    numbers = plain(row.error) | {
        "mean": float(np.mean(np.asarray(frame.airlight, dtype=np.float64)))
    }
    entry: dict[str, Any] = {"airlight": _rounded({name: numbers[name] for name in ERRORS})}
    if row.surface_error is not None:
        surface = plain(row.surface_error)
        entry["surface"] = _rounded({name: surface[name] for name in _SURFACE})
    return entry


def _rounded(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return numbers rounded to the six digits that a baseline keeps."""
    values = {name: plain(value) for name, value in numbers.items()}
    return {name: float(f"{v:.6g}") if isinstance(v, float) else v for name, v in values.items()}


def compare_baseline(kept: Baseline | None, measured: Baseline) -> list[Move]:
    """Return what moved between a baseline and a new measurement."""
    scene = measured["scene"]
    if kept is None:
        return [Move(scene, "", "no baseline: write one with --update")]
    moves = []
    if kept["size"] != measured["size"]:
        moves.append(Move(scene, "", f"size: {kept['size']} before, {measured['size']} now"))
    for layer in ("airlight", "surface"):
        # The reference is float64: it has no band, and no floor.
        moves += _numbers(
            scene,
            "",
            f"reference of the {layer}",
            kept["reference"][layer],
            measured["reference"][layer],
            0.0,
            0,
        )
    before, after = kept["configurations"], measured["configurations"]
    moves += [
        Move(scene, label, "a baseline without its configuration")
        for label in before
        if label not in after
    ]
    moves += [
        Move(scene, label, "a configuration without baseline")
        for label in after
        if label not in before
    ]
    pixels = measured["size"][0] * measured["size"][1]
    for label in [label for label in before if label in after]:
        old, new = before[label], after[label]
        if old.get("refused") != new.get("refused"):
            moves.append(
                Move(
                    scene, label, f"refused: {old.get('refused')} before, {new.get('refused')} now"
                )
            )
            continue
        for layer in ("airlight", "surface"):
            moves += _numbers(
                scene, label, layer, old.get(layer, {}), new.get(layer, {}), ERROR_TOLERANCE, pixels
            )
    return moves


def _numbers(
    scene: str, label: str, layer: str, old: Baseline, new: Baseline, tolerance: float, pixels: int
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
        band = (
            error_band(name, before / (scale or 1.0), tolerance=tolerance, pixels=pixels, rmse=rmse)
            * scale
        )
        # The file keeps six digits: allow half a unit of the last one.
        band += 0.5e-5 * abs(before)
        if abs(after - before) > band:
            yield Move(scene, label, f"{layer} {name}", before, after, band)


def updated(kept: Baseline | None, measured: Baseline, because: str) -> Baseline | None:
    """Return the next revision of a baseline, or None if nothing moved.

    Entries whose numbers did not move beyond the noise keep their old numbers, so that a
    diff shows only what moved.
    """
    moves = compare_baseline(kept, measured)
    if not moves:
        return None
    before = kept["configurations"] if kept else {}
    moved = {move.label for move in moves}
    entries = {
        label: entry if label in moved or label not in before else before[label]
        for label, entry in measured["configurations"].items()
    }
    revision = 1 + (kept["revision"] if kept else 0)
    return {
        **measured,
        "configurations": entries,
        "revision": revision,
        "because": " ".join(because.split()),
    }


def main() -> int:
    """Compare, print what moved, and write it if asked to."""
    parser = argparse.ArgumentParser(description="The accuracy baselines of built-in scenes.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="all by default")
    parser.add_argument("--update", action="store_true", help="write what moved")
    parser.add_argument("--because", default="", help="why numbers moved; --update needs it")
    asked = parser.parse_args()
    if unknown := set(asked.scenes) - set(SCATTER_ONCE):
        parser.error(
            f"no built-in scene of fog: {', '.join(sorted(unknown))}; expected: "
            f"{', '.join(SCATTER_ONCE)}"
        )
    if asked.update and not asked.because.strip():
        parser.error("--update needs --because")
    from airlight.reports.machine.environment import activate

    activate()
    found = 0
    for name in asked.scenes or SCATTER_ONCE:
        kept, measured = read_baseline(name), measure_baseline(name)
        moves = compare_baseline(kept, measured)
        found += len(moves)
        print(
            f"{name}: {len(measured['configurations'])} configurations, {len(moves)} numbers moved"
        )
        for move in moves:
            numbers = (
                ""
                if move.old is None or move.new is None
                else f": {move.old:.6g} -> {move.new:.6g}"
            )
            print(f"    {move.label}: {move.what}{numbers}")
        if asked.update and (new := updated(kept, measured, asked.because)) is not None:
            text = json.dumps(new, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False)
            (FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    return 1 if found and not asked.update else 0


if __name__ == "__main__":
    sys.exit(main())
