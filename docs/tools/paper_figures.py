# SPDX-License-Identifier: BSD-3-Clause
"""The inputs of the paper's figures, by a digest: `python docs/tools/paper_figures.py
[--keep] FOLDER`.

`./replicate` makes the figures in the folder and calls this. It writes `figures.md` there, with a
digest of the inputs under each figure, and says whether the paper has the same. `--keep` makes the
figures of the folder those of the paper.
"""

import argparse
import hashlib
import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from airlight.reference.storage.build import build
from airlight.reference.storage.files import write_text
from airlight.reports.data.records import read_json
from airlight.reports.machine.environment import activate

DOCS = Path(__file__).resolve().parents[1]
KEPT = DOCS / "data" / "paper-figures.json"


@dataclass(frozen=True)
class Figure:
    """A figure of the paper."""

    made: str  #: its file in the folder of `./replicate`
    kept: str  #: its file in `docs`
    report: str  #: the report that it is drawn from, in the folder
    inputs: str = ""  #: files of `docs/data` that it is made of, beside the scenes


FIGURES = {
    "speed": Figure("frame-speed.png", "paper/speed.png", "report.json"),
    "engines": Figure("engines/strip.png", "paper/engines.png", "engines/engines.json", "captures"),
}


def digest_of(figure: Figure, folder: Path) -> str:
    """Return a digest of the scenes and files of a figure, and of the command that made it."""
    from airlight.validation.scenes.loading import scene_identity

    report = read_json(folder / figure.report, "a report of ./replicate")
    named = report.get("scenes") or report["settings"]["scenes"]
    scenes = sorted({each["name"] if isinstance(each, dict) else each for each in named})
    digest = hashlib.sha256(report["command"].encode())
    for scene in scenes:
        digest.update(f"|{scene} {scene_identity(scene)}".encode())
    # Files by name and content: captures of another version of an engine are other inputs.
    for path in sorted((DOCS / "data" / figure.inputs).glob("*.exr")) if figure.inputs else ():
        digest.update(f"|{path.name} ".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def main() -> None:
    """Write the digests of a folder, and say whether they are those of the paper."""
    parser = argparse.ArgumentParser(description="The inputs of the paper's figures, by a digest.")
    parser.add_argument("folder", type=Path, help="the folder that ./replicate wrote")
    parser.add_argument("--keep", action="store_true", help="make these the figures of the paper")
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    activate()
    digests = {name: digest_of(figure, folder) for name, figure in FIGURES.items()}
    shown = (f"![{name}]({FIGURES[name].made})\n\ninputs {digests[name]}" for name in FIGURES)
    write_text(folder / "figures.md", "\n\n".join(shown) + f"\n\nairlight {build().words}\n")
    if arguments.keep:
        for figure in FIGURES.values():
            shutil.copyfile(folder / figure.made, DOCS / figure.kept)
        shutil.copyfile(folder / FIGURES["speed"].report, DOCS / "data" / "replicate.json")
        record = {"airlight": build().words, "inputs": digests}
        write_text(KEPT, json.dumps(record, indent=1) + "\n")
    # Another scene or capture than the paper's makes another figure, and its errors may differ.
    kept = read_json(KEPT, "the inputs of the paper's figures")["inputs"]
    for name, digest in digests.items():
        same = "those of the paper" if digest == kept[name] else f"the paper has {kept[name]}"
        print(f"{folder / FIGURES[name].made}: inputs {digest}, {same}")
    sys.exit(digests != kept)


if __name__ == "__main__":
    main()
