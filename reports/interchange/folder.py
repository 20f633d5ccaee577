# SPDX-License-Identifier: BSD-3-Clause
"""What becomes of each scene file of a folder: taken, or refused with which words."""

from dataclasses import dataclass
from pathlib import Path

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from reports.interchange.scene import describe_scene
from reports.machine.mitsuba_log import collected_notes
from reports.tables.record import Said
from reports.tables.table import table, words
from validation.columns import plain
from validation.scenes.loading import load_scene


@dataclass(frozen=True)
class FileOutcome:
    """What became of a file."""

    file: str  #: within the folder
    outcome: str  #: 'taken', 'refused', or 'failed' where the program did not see why
    words: str  #: notes of a file that was taken, else what stands in the way


def describe_folder(folder: Path) -> Said:
    """Return what `describe` makes of each XML file in a folder and its folders."""
    files = sorted(folder.rglob("*.xml"))
    if not files:
        raise InputError(f"scene: the folder {folder} holds no .xml file; wanted Mitsuba scene files")
    log = [_outcome(path, folder) for path in files]
    counts = {word: sum(each.outcome == word for each in log) for word in ("taken", "refused", "failed")}
    summed = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    columns = (*words("file", "outcome"), *words(words="notes, or what stands in the way", how={"long": True}))
    shown = table(f"{len(log)} scene files: {summed}", columns, map(vars, log))
    return Said(name=str(folder), data={"folder": str(folder), "files": plain(log)}, tables=(shown,), of=log)


def _outcome(path: Path, folder: Path) -> FileOutcome:
    name = path.relative_to(folder).as_posix()
    try:
        with collected_notes() as notes:
            notes += describe_scene(load_scene(str(path)))["notes"]
        return FileOutcome(name, "taken", "; ".join(dict.fromkeys(notes)))
    except (InputError, RealtimeInputError) as reason:
        return FileOutcome(name, "refused", str(reason).replace(str(path), path.name))
    except Exception as error:  # a fault of the program, which a log of many files shall show and outlive
        return FileOutcome(name, "failed", f"{type(error).__name__}: {' '.join(str(error).split())}")
