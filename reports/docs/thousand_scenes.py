# SPDX-License-Identifier: BSD-3-Clause
"""The page of the thousand scenes: the digest of the rows that are kept in `validation/baselines/thousand`.

A test fails where the page is not what `python -m reports.docs.thousand_scenes` makes it. With `--properties` the rows
first get the properties of scenes that they lack, because the source that swept them did not know these.
"""

import argparse
from pathlib import Path

from reports.docs.marked import with_part

ROOT = Path(__file__).resolve().parents[2]
PAGE, ROWS = "docs/thousand-scenes.md", "validation/baselines/thousand"


def current_page(root: Path = ROOT) -> str:
    """Return what the page should hold: what stands outside of the marked part is kept."""
    from reports.sweep.digest import digest
    from reports.sweep.read import read_sweep
    from reports.sweep.summary import summary_of

    said = digest(summary_of(read_sweep(root / ROWS)))
    return with_part((root / PAGE).read_text(encoding="utf-8"), "digest", f"\n{said}\n")


def redraw(root: Path = ROOT) -> Path:
    """Write the page anew, and return its path."""
    from reference.storage.files import write_text

    write_text(root / PAGE, current_page(root))
    return root / PAGE


def add_properties(path: Path) -> list[str]:
    """Write the properties that rows lack into their Parquet, and return their names. What is there stays."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from realtime.scene.read_scene import read_scene
    from reference.storage.files import atomic_path
    from reports.machine.environment import activate
    from validation.properties.properties import scene_properties
    from validation.scenes.loading import load_scene

    activate("llvm_ad_rgb")
    table = pq.read_table(path)
    images = list(zip(*(table[name].to_pylist() for name in ("scene", "width", "height")), strict=True))
    found = {
        (scene, width, height): scene_properties(read_scene(load_scene(scene, (width, height)).scene))
        for scene, width, height in dict.fromkeys(images)
    }
    names = [name for name in next(iter(found.values())) if f"property.{name}" not in table.column_names]
    for name in names:
        table = table.append_column(f"property.{name}", pa.array([found[image][name] for image in images]))
    with atomic_path(path) as part:
        pq.write_table(table, part, compression="zstd", write_page_checksum=True)
    return names


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m reports.docs.thousand_scenes", description=__doc__)
    parser.add_argument("--properties", action="store_true", help="first write the properties that the rows lack")
    if parser.parse_args().properties:
        print(*add_properties(ROOT / ROWS / "sweep.parquet"), sep="\n")
    print(redraw())
