# SPDX-License-Identifier: BSD-3-Clause
"""The first rows of the challenge: built-in methods as entries, scored.

    .venv/bin/python docs/tools/challenge_rows.py      # writes docs/data/challenge.json, in minutes

Each method renders all scenes of the seed `SEED` with its default settings, and is scored as
anybody's entry is. A method that refuses a scene has no entry, as an entry must be whole; the file
says which scene it refused and why. The seed is public, so that the rows are no proof of methods:
they say what the numbers of well known ones are. The same methods with further seeds say how much
the number depends on the scenes.
"""

import argparse
import json
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import airlight
from airlight.reference.storage.files import write_text
from airlight.reports.challenge.draw import DrawnScene, draw_scenes, load_drawn
from airlight.reports.challenge.record import Score, score_text
from airlight.reports.challenge.seed import seed_words

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "docs/data/challenge.json"
SEED = "2026"
#: Further seeds, which only say how far numbers of one method lie apart.
OTHERS = ("1", "2", "3", "4")
METHODS = (
    "shadow-planes",
    "froxel-fog",
    "ray-march",
    "unshadowed",
    "light-volumes",
    "min-max",
)


@dataclass(frozen=True)
class Refused:
    """A method that has no entry."""

    method: str
    scene: str
    reason: str


def entry_of(method: str, seed: str, scenes: tuple[DrawnScene, ...]) -> Score | Refused:
    """Render an entry by a built-in method, and score it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        said = f'method = "{method}"\nauthors = "airlight"\nseed = "{seed}"\n'
        (folder / "entry.toml").write_text(f'{said}settings = "default"\n', encoding="utf-8")
        for scene in scenes:
            loaded = load_drawn(folder / "scenes", scene)
            try:
                frame = airlight.render(loaded, method)
            except airlight.InputError as error:
                return Refused(method, scene.name, str(error))
            airlight.write_exr(folder / f"{scene.name}.exr", frame.image)
        return airlight.challenge_score(folder).score


def main() -> None:
    """Write the data file."""
    parser = argparse.ArgumentParser(description="Score built-in methods.")
    parser.add_argument("--output", type=Path, default=FILE)
    output = parser.parse_args().output
    airlight.activate()
    scored, refused, spread = list[Score](), list[Refused](), dict[str, dict[str, float]]()
    began = time.process_time()
    for seed in (SEED, *OTHERS):
        scenes = draw_scenes(seed_words(seed))
        for method in METHODS:
            found = entry_of(method, seed, scenes)
            if isinstance(found, Refused):
                refused.append(found)
                continue
            scored += [found] if seed == SEED else []
            spread.setdefault(method, {})[seed] = found.number
            print(f"{seed} {method}: {found.number:g}", flush=True)
            # After each entry: a run that is stopped has what it measured.
            data = {
                "made": f"{time.strftime('%Y-%m-%d')}, `python docs/tools/challenge_rows.py`",
                "processor_seconds": round(time.process_time() - began),
                "scores": [json.loads(score_text(score)) for score in scored],
                "refused": [asdict(each) for each in refused],
                "spread": spread,
            }
            write_text(output, json.dumps(data, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
