# SPDX-License-Identifier: BSD-3-Clause
"""`airlight merge A.exr B.exr... -o OUT.exr`: the batches of several machines as one reference."""

from pathlib import Path
from typing import Annotated

import typer


def merge(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="A.exr B.exr...", help="References of one scene by one estimator.", show_default=False),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The EXR file to write.")] = Path(
        "merged.exr"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Merge the samples of several machines as one reference.

    The files are Monte Carlo references of one scene, computed with different seeds. Means and standard errors are
    those of all batches together, computed from the files' single precision.
    """
    from reference.storage.exr import read_exr, write_exr
    from reference.storage.files import ensure_writable
    from reports.tables.terminal import print_json
    from validation.estimates.merge import merged_references

    ensure_writable(output)
    image = merged_references([(str(path), read_exr(path)) for path in files])
    write_exr(output, image)
    names = ("scene", "estimator", "spp", "batch_spp", "batches", "seeds")
    summary = {"output": str(output)} | {name: image.attributes[f"airlight:{name}"] for name in names}
    if json:
        print_json(summary)
    else:
        print(f"{output}: {summary['scene']} by {summary['estimator']}")
        print(f"  {summary['spp']} samples a pixel in {summary['batches']} batches, seeds {summary['seeds']}")
