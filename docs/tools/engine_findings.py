# SPDX-License-Identifier: BSD-3-Clause
"""The three findings on engines that `docs/engines/findings` reports to their projects: renders them
again, and writes their figures and pictures.

    python docs/tools/engine_findings.py [three playcanvas eevee]

Each finding is a few captures of one scene. Only the airlight counts. The figures go into
`docs/data/engine-findings.json`, of which `fill_pages.py` makes the tables.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture

import airlight
from airlight.reference.storage.exr import read_exr
from airlight.reference.storage.files import temporary_folder, write_bytes
from airlight.reference.storage.store import date
from airlight.reports.api.capture import Capture
from airlight.reports.plotting.pictures import error_map, exposure, png_bytes, tone_mapped
from airlight.validation.arrays import Array

DOCS = Path(__file__).resolve().parents[1]
RECORD = DOCS / "data" / "engine-findings.json"
GALLERY = DOCS / "gallery"
SIZE = (160, 120)


@dataclass(frozen=True)
class Run:
    """One capture of a finding."""

    name: str  #: of the row
    settings: Sequence[str] = ()
    change: Sequence[str] = ()
    edit: Sequence[str] = ()


def capture(engine: str, scene: str, run: Run, folder: Path) -> tuple[Array, Capture]:
    """Return the airlight that an engine makes, and its capture."""
    file = folder / "capture.exr"
    made = airlight.capture(
        engine,
        scene,
        output=file,
        size=SIZE,
        settings=list(run.settings),
        change=list(run.change),
        edit=list(run.edit),
    )
    return read_exr(file).layers["airlight"].astype(np.float64), made


def three(folder: Path) -> dict[str, Any]:
    """Render with lights of several strengths: light is density, and no image is twice as bright."""
    runs = [Run(f"{dim:g}", [f"dim={dim:g}"]) for dim in (1e-4, 1e-3, 1e-2, 1e-1, 1.0)]
    made = [capture("three", "open-fog", run, folder) for run in runs]
    dim = made[0][0]
    rows = [
        {"lights": float(run.name), "mean": float(image.mean() / dim.mean())}
        for run, (image, _) in zip(runs, made)
    ]
    # The adapter divides the image by the factor of the lights: a linear engine repeats itself.
    pictures(
        "three-linear", dim, [("lights times 0.0001", dim), ("lights as they are", made[-1][0])]
    )
    return said(made[0][1], "open-fog", rows)


def playcanvas(folder: Path) -> dict[str, Any]:
    """Render lamps of several intensities: one below 1 is decoded as a colour."""
    lamps = (0.125, 0.25, 0.5, 0.75, 1.0, 2.0, 4.0)
    # The adapter divides intensities by 16, which is in the engine's law.
    runs = [
        Run(f"{lamp:g}", ["plainIntensity=1"], [f"light.intensity={16 * lamp:g}"]) for lamp in lamps
    ]
    made = [capture("playcanvas", "open-fog", run, folder) for run in runs]
    one = made[lamps.index(1.0)][0]
    rows = [
        {"intensity": lamp, "airlight": float(image.mean() / one.mean())}
        for lamp, (image, _) in zip(lamps, made)
    ]
    half = made[lamps.index(0.5)][0]
    pictures(
        "playcanvas-intensity", one, [("intensity 1", one), ("intensity 0.5, twice", 2 * half)]
    )
    return said(made[0][1], "open-fog", rows)


def eevee(folder: Path) -> dict[str, Any]:
    """Render with several slices: the bias follows their length, as samples lie half of one too near."""
    reference = np.asarray(airlight.reference("open-fog", size=SIZE).airlight, dtype=np.float64)
    rows = []
    shown = []
    for slices in (32, 64, 128, 256):
        # Slices of one length; several samples, so that the jitter is a mean.
        fixed = ["volumetric_sample_distribution=0", "taa_render_samples=4"]
        run = Run(f"{slices}", [f"volumetric_samples={slices}", *fixed])
        image, made = capture("eevee", "open-fog", run, folder)
        bias = image.mean(axis=(0, 1)) / reference.mean(axis=(0, 1)) - 1
        rows.append({"slices": slices, **dict(zip("RGB", map(float, bias)))})
        shown.append((f"{slices} slices", image))
    pictures("eevee-slices", reference, [shown[0], shown[2]], error=True)
    return said(made, "open-fog", rows)


def said(made: Capture, scene: str, rows: list[dict[str, float]]) -> dict[str, Any]:
    """Return the record of a finding."""
    return {
        "engine": made.engine,
        "version": made.version,
        "device": made.device,
        "scene": scene,
        "rows": rows,
    }


def pictures(
    name: str, reference: Array, shown: Sequence[tuple[str, Array]], *, error: bool = False
) -> None:
    """Write two images side by side, or their errors against a reference."""
    factor = exposure(reference)
    made = [
        error_map(reference, image) if error else tone_mapped(image, factor) for _, image in shown
    ]
    gap = np.full((made[0].shape[0], 8, 3), 255, dtype=np.uint8)
    both = np.concatenate([made[0], gap, made[1]], axis=1)
    large = Picture.fromarray(both).resize((2 * both.shape[1], 2 * both.shape[0]), Picture.NEAREST)
    write_bytes(GALLERY / f"finding-{name}.png", png_bytes(np.asarray(large)))


FINDINGS: dict[str, Callable[[Path], dict[str, Any]]] = {
    "three": three,
    "playcanvas": playcanvas,
    "eevee": eevee,
}


def main() -> None:
    """Render the findings, and write their record."""
    parser = argparse.ArgumentParser(description="Findings on engines, rendered again.")
    parser.add_argument("names", nargs="*", choices=[*FINDINGS, []], help="all by default")
    names = parser.parse_args().names or list(FINDINGS)
    record = json.loads(RECORD.read_text("utf-8")) if RECORD.is_file() else {"findings": {}}
    for name in names:
        with temporary_folder() as folder:
            record["findings"][name] = FINDINGS[name](folder) | {"measured": date()}
        print(json.dumps(record["findings"][name], indent=1))
    record["size"] = SIZE
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
