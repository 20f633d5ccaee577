# SPDX-License-Identifier: BSD-3-Clause
"""`airlight gallery`: the pictures of README and documentation."""

from pathlib import Path
from typing import Annotated

import typer


def gallery(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME", help="Pictures, scenes or methods; all by default.", show_default=False),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of the pictures.")] = Path(
        "gallery"
    ),
) -> None:
    """Make the pictures of README and documentation.

    They show scenes, what methods render, their errors, and how they work.

    Pictures of scenes have 16 rays a pixel and a tone curve; error maps are of pixel centres. `gallery.json` says what
    each shows and which command makes it. In a checkout `-o docs/gallery` brings those of the documentation up to date.
    """
    from reports.gallery.make import chosen_pictures, make
    from reports.machine.environment import activate
    from reports.machine.progress import progress_bar

    activate()
    wanted = chosen_pictures(names or [])
    with progress_bar(f"gallery: {len(wanted)} pictures") as progress:
        files = make(wanted, output, progress)
    print("\n".join(map(str, files)))
