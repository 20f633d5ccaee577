# SPDX-License-Identifier: BSD-3-Clause
"""`airlight certify`: write the certified fog scenes."""

from pathlib import Path
from typing import Annotated

import typer


def certify(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")] = Path(
        "certified_fog.json"
    ),
) -> None:
    """Certify the airlight of small scenes of fog to 12 digits.

    Writes scenes, radiances and lit intervals of 12 scenes. See docs/certified-fog.md. Takes about ten minutes, and
    writes the same file every time.
    """
    from reference.storage.files import ensure_writable, write_text
    from reports.machine.progress import progress_bar
    from validation.certified.generate import certified_data, to_json

    ensure_writable(output)
    with progress_bar("certify") as progress:
        data = certified_data(progress=progress)
    write_text(output, to_json(data))
    print(f"{output}: {len(data['scenes'])} scenes, {sum(len(scene['pixels']) for scene in data['scenes'])} rays")
