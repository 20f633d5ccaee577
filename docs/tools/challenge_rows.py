# SPDX-License-Identifier: BSD-3-Clause
"""The first rows of the challenge: built-in methods and engines of others as entries, scored.

    .venv/bin/python docs/tools/challenge_rows.py              # the methods, in minutes
    .venv/bin/python docs/tools/challenge_rows.py --engines    # the engines of docs/adapters

Each renders all scenes of the seed `SEED` with one line of settings, and is scored as anybody's
entry is. A scene that it refuses is a line under `cannot` of its entry, with the words of the
refusal; one that refuses all scenes has no entry, and its reasons are kept. The seed is public, so
that the rows are no proof of methods: they say what the numbers of well known ones are. The same
methods with further seeds say how much the number depends on the scenes.

Rows are merged into docs/data/challenge.json by the names of methods and adapters, after each one,
so that both can be measured apart, and a run that is stopped has what it measured.
"""

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import airlight
from airlight.reference.storage.files import write_text
from airlight.reports.api.results import Rendering
from airlight.reports.challenge.draw import DrawnScene, draw_scenes, load_drawn
from airlight.reports.challenge.entry import ENTRY
from airlight.reports.challenge.record import CANNOT, Score, score_text
from airlight.reports.challenge.seed import seed_words
from airlight.reports.machine.engine_adapter import CannotError
from airlight.validation.columns import plain

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "docs/data/challenge.json"
SEED = "2026"
#: Further seeds, which only say how far numbers of one method lie apart.
OTHERS = ("1", "2", "3", "4")
#: All of single scattering: those for clouds have light of all orders.
METHODS = (
    "shadow-planes",
    "froxel-fog",
    "ray-march",
    "unshadowed",
    "light-volumes",
    "min-max",
    "equi-angular",
    "soft-shafts",
    "shadow-planes-2006",
    "light-volumes-2010",
)
#: By name, with the settings that differ from the defaults of their adapters.
ENGINES: Mapping[str, Mapping[str, Any]] = {
    "cycles": {"samples": 1024},  # 24 scenes take ten minutes of a processor
    "eevee": {},
    "playcanvas": {},
    "three": {},
    "bevy": {},
    "babylon": {},
}
_LIMIT = 1800.0  # of one image [s]: the clock of a busy machine must end no entry


@dataclass(frozen=True)
class Made:
    """Everything that is to be said of an image beside its pixels."""

    method: str
    machine: str = ""


Reasons = dict[str, str]  #: why there is no image, by the name of the scene
#: Writes the image of a scene, of a file, to a path; raises InputError for a scene that it cannot
#: have.
Render = Callable[[DrawnScene, Path, Path], Made]


def by_method(method: str) -> Render:
    """Return what renders by a built-in method."""

    def render(scene: DrawnScene, folder: Path, output: Path) -> Made:
        frame = airlight.render(load_drawn(folder, scene), method)
        assert isinstance(frame, Rendering)
        airlight.write_exr(output, frame.image)
        return Made(method)

    return render


def by_engine(engine: str, settings: Mapping[str, Any]) -> Render:
    """Return what renders by the adapter of an engine."""

    def render(scene: DrawnScene, folder: Path, output: Path) -> Made:
        load_drawn(folder, scene)
        got = airlight.capture(
            engine, str(folder / scene.file), output=output, settings=settings, limit=_LIMIT
        )
        # The challenge asks for values at pixel centres.
        if got.pixel == "area":
            raise RuntimeError(f"{engine}: the pixels of {scene.name} are means over areas")
        return Made(f"{got.engine} {got.version}", got.device)

    return render


def entry_of(
    render: Render,
    refusal: type[airlight.InputError],
    seed: str,
    settings: str,
    *,
    scenes: Sequence[DrawnScene],
    folder: Path,
) -> Score | Reasons:
    """Write an entry into a folder, and score it; any other exception than `refusal` is a fault.

    Returns the reasons alone where all scenes are refused.
    """
    made, cannot = list[Made](), Reasons()
    for scene in scenes:
        try:
            made.append(render(scene, folder / "scenes", folder / f"{scene.name}.exr"))
        except refusal as error:
            cannot[scene.name] = str(error)
    if not made:
        return cannot
    assert len(set(made)) == 1, made
    said = {"method": made[0].method, "authors": "airlight", "settings": settings, "seed": seed}
    said |= {"machine": made[0].machine} if made[0].machine else {}
    lines = [f"{name} = {_toml(words)}" for name, words in said.items()]
    lines += [f"[{CANNOT}]", *(f"{name} = {_toml(why)}" for name, why in cannot.items())]
    (folder / ENTRY).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return airlight.challenge_score(folder).score


def _toml(words: str) -> str:
    """Return words as TOML and JSON both quote them."""
    return json.dumps(words, ensure_ascii=False)


def measured(
    render: Render, refusal: type[airlight.InputError], seed: str, settings: str, keep: Path | None
) -> tuple[Score | Reasons, float]:
    """Return the score of an entry, or why it has none, and the seconds of processors that it took;
    `keep` is a folder for its images.
    """
    scenes, began = draw_scenes(seed_words(seed)), _processor()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) if keep is None else keep
        folder.mkdir(parents=True, exist_ok=True)
        found = entry_of(render, refusal, seed, settings, scenes=scenes, folder=folder)
    if isinstance(found, Score):
        print(f"{seed} {found.entry.method}: {found.number:g}, {found.had} scenes", flush=True)
    return found, _processor() - began


def _processor() -> float:
    """Return the seconds of processors of this program and of those that it started [s]."""
    times = os.times()
    return sum(times[:4])


def add_row(file: Path, name: str, found: Score | Reasons, command: str, seconds: float) -> None:
    """Add the row of a method or adapter to the data file, in place of the one before; rows are in
    the order of their numbers.
    """
    data = _data(file)
    rows = [each for each in data["rows"] if each["name"] != name]
    none = {each: reasons for each, reasons in data["none"].items() if each != name}
    if isinstance(found, Score):
        row = {
            "name": name,
            "made": time.strftime("%Y-%m-%d"),
            "command": command,
            "processor_seconds": round(seconds),
            "score": json.loads(score_text(found)),
        }
        rows = sorted([*rows, row], key=lambda each: (each["score"]["number"], each["name"]))
    else:
        none |= {name: found}
    _write(file, data | {"rows": rows, "none": none})


def add_spread(file: Path, name: str, numbers: Mapping[str, float]) -> None:
    """Add the numbers of a method by seed to the data file."""
    data = _data(file)
    _write(file, data | {"spread": data["spread"] | {name: numbers}})


def _data(file: Path) -> dict[str, Any]:
    """Return the rows, what has no entry, and numbers by seed, of a file or for a new one."""
    found = json.loads(file.read_text("utf-8")) if file.is_file() else {}
    return {"rows": [], "none": {}, "spread": {}} | found


def _write(file: Path, data: Mapping[str, Any]) -> None:
    write_text(file, json.dumps(plain(data), indent=1, ensure_ascii=False) + "\n")


def main() -> None:
    """Write the data file."""
    parser = argparse.ArgumentParser(description="Score built-in methods, or engines of others.")
    parser.add_argument("names", nargs="*", help="of methods or engines; all by default")
    parser.add_argument("--engines", action="store_true", help="engines in place of methods")
    parser.add_argument("--output", type=Path, default=FILE)
    parser.add_argument("--keep", type=Path, help="a folder for the entries, a folder each")
    asked = parser.parse_args()
    known = tuple(ENGINES) if asked.engines else METHODS
    if unknown := set(asked.names) - set(known):
        parser.error(f"got {', '.join(sorted(unknown))}, expected names of {', '.join(known)}")
    airlight.activate()
    for name in asked.names or known:
        keep = asked.keep / name if asked.keep else None
        if asked.engines:
            settings = ENGINES[name]
            words = ", ".join(f"{key}={value}" for key, value in settings.items())
            render, said = by_engine(name, settings), words or "default of the adapter"
            found, seconds = measured(render, CannotError, SEED, said, keep)
            add_row(asked.output, name, found, "challenge_rows.py --engines", seconds)
            continue
        render, numbers = by_method(name), dict[str, float]()
        for seed in (SEED, *OTHERS):
            own = keep if seed == SEED else None
            found, seconds = measured(render, airlight.InputError, seed, "default", own)
            if seed == SEED:
                add_row(asked.output, name, found, "challenge_rows.py", seconds)
            # A number that counts black images says less of how much scenes matter.
            if isinstance(found, Score) and not found.cannot:
                numbers[seed] = found.number
        if numbers:
            add_spread(asked.output, name, numbers)


if __name__ == "__main__":
    main()
