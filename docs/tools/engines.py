# SPDX-License-Identifier: BSD-3-Clause
"""Engines of others in six scenes: renders, judges, and says which numbers moved since the captures
that the repository keeps.

    python docs/tools/engines.py                  # renders in every engine that is here
    python docs/tools/engines.py --keep --diagnose  # and keeps captures, numbers and the strip

After an update of an engine, in `docs/adapters/package.json` or its adapter, the first says what it
changed. Kept captures are half floats, without their sum: `.ci/run` judges them without an engine.
"""

import argparse
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image as Picture

import airlight
from airlight.reference.storage.exr import read_exr
from airlight.reference.storage.files import temporary_folder, write_text
from airlight.reports.api.engines import EnginesReport
from airlight.reports.engines.record import FILE, engines_text

DOCS = Path(__file__).resolve().parents[1]
KEPT = DOCS / "data" / "captures"
STRIP = DOCS / "gallery" / "engines.jpg"
MOST = 2_000_000  #: bytes of all captures
WIDE = 1600  #: of the strip [pixels]


def main() -> None:
    """Render, compare with what is kept, and keep it if asked to."""
    parser = argparse.ArgumentParser(description="Engines of others, and what they changed.")
    parser.add_argument("--engines", default="all", help="names of adapters, as of airlight report")
    parser.add_argument("--images", type=Path, help="a report with captures, in place of new ones")
    parser.add_argument("--diagnose", action="store_true", help="look for faults in kept images")
    parser.add_argument("--keep", action="store_true", help="keep captures, numbers and the strip")
    asked = parser.parse_args()
    with temporary_folder() as folder:
        made = airlight.report(
            engines=asked.engines, images=asked.images, output=folder / "new", progress=True
        )
        print(made.text())
        if asked.keep:
            keep(folder / "new", folder / "half", diagnose=asked.diagnose)
        elif (KEPT / FILE).is_file():
            print(airlight.diff(KEPT, folder / "new").text())
    sys.exit(made.status)


def keep(made: Path, halves: Path, *, diagnose: bool) -> None:
    """Write captures in half floats, judge these, and keep what the pages and CI need."""
    halves.mkdir()
    for path in sorted(made.glob("*.*.exr")):
        write_half(path, halves / path.name)
    shutil.copy(made / FILE, halves)
    size = sum(path.stat().st_size for path in halves.glob("*.exr"))
    if size > MOST:
        sys.exit(f"the captures take {size} bytes, expected at most {MOST}")
    judged = airlight.report(
        engines="all", images=halves, output=halves / "judged", diagnose=diagnose
    )
    assert isinstance(judged, EnginesReport)
    # A capture of an engine that is gone must not stay.
    shutil.rmtree(KEPT, ignore_errors=True)
    KEPT.mkdir(parents=True)
    for path in halves.glob("*.exr"):
        shutil.copy(path, KEPT)
    # Pictures are not kept, and the command is that which renders all.
    cells = tuple(
        replace(cell, files={"image": cell.files["image"]} if cell.files else {})
        for cell in judged.data.cells
    )
    scenes = tuple(replace(scene, files={}) for scene in judged.data.scenes)
    command = "airlight report --engines all" + (" --diagnose" if diagnose else "")
    kept = replace(judged.data, command=command, scenes=scenes, cells=cells)
    write_text(KEPT / FILE, engines_text(kept))
    with Picture.open(halves / "judged" / "strip.png") as strip:
        small = strip.convert("RGB").resize((WIDE, round(WIDE * strip.height / strip.width)))
        small.save(STRIP, quality=88, optimize=True)
    print(f"kept {len(list(KEPT.glob('*.exr')))} captures, {size} bytes")


def write_half(source: Path, target: Path) -> None:
    """Write the layers of a capture in half floats, with its header."""
    image = read_exr(source)
    channels = {}
    for layer in ("airlight", "surface"):
        values = image.layers[layer].astype(np.float16)
        if not np.isfinite(values).all():
            sys.exit(f"{source.name}: {layer} has values beyond half floats")
        channels |= {
            f"{layer}.{c}": np.ascontiguousarray(values[..., k]) for k, c in enumerate("RGB")
        }
    header = {name: str(value) for name, value in image.attributes.items()}
    header |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(target))


if __name__ == "__main__":
    main()
