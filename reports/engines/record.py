# SPDX-License-Identifier: BSD-3-Clause
"""The data of a report on engines, engines.json: a cell for each engine and scene."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from airlight.reports.data.records import Environment, Size, read_versioned
from airlight.validation.engine.model_errors import ModelErrors, PartError

SCHEMA = "airlight-engines/1"
FILE, PAGE, STRIP = "engines.json", "engines.html", "strip.png"  #: in the folder of the report

JUDGED: Final = "judged"
CANNOT: Final = "cannot"  #: the engine refuses the scene
MISSING: Final = "missing"  #: a program is not on the machine, or an image not in the folder
FAILED: Final = "failed"
Status = Literal["judged", "cannot", "missing", "failed"]
UNKNOWN: Final = "unknown"  #: of the equation in the header of a capture
#: Words before the reason of a cell without an image.
STATUS_WORDS = {CANNOT: "cannot have it", MISSING: "not run", FAILED: "failed"}


@dataclass(frozen=True)
class Captured:
    """The engine's own words on its image."""

    engine: str
    version: str
    device: str  #: that drew the image
    pixel: str  #: of what the values are: 'centre' or 'area'
    settings: Mapping[str, Any]  #: by the engine's names
    edits: tuple[str, ...]  #: changes of its shaders
    told: bool = True  #: whether it says which equation its settings mean; else physics judges it


@dataclass(frozen=True)
class LayerErrors:
    """The errors of a layer of an image."""

    layer: str  #: 'airlight' or 'surface'
    errors: ModelErrors  #: of the equation, of the algorithm, and of both
    noise: float | None  #: error of block means that the scatter of single pixels alone makes [1]
    right: bool  #: whether the image is right by its own equation
    verdict: str  #: the same in words
    place: str = ""  #: where most of the error against it lies, in words

    @property
    def parts(self) -> dict[str, PartError | None]:
        """The three errors by their names in tables."""
        errors = self.errors
        return {
            "equation": errors.against_physics,
            "algorithm": errors.image,
            "total": errors.total,
        }

    @property
    def blocks(self) -> dict[str, float | None]:
        """The three errors over blocks of pixels [1]."""
        return {name: part.blocks if part else None for name, part in self.parts.items()}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """An engine in a scene."""

    scene: str
    engine: str  #: the name of its adapter
    status: Status
    reason: str = ""  #: why there is no image
    captured: Captured | None = None
    layers: tuple[LayerErrors, ...] = ()
    headline: str = ""  #: what the diagnosis says of the image against physics; empty: not asked
    files: Mapping[str, str] = field(default_factory=dict)  #: relative to the folder, by kind

    @property
    def title(self) -> str:
        """The engine with its version."""
        return f"{self.captured.engine} {self.captured.version}" if self.captured else self.engine

    @property
    def told(self) -> bool:
        """Whether the engine says which equation it solves."""
        return self.captured is not None and self.captured.told

    def layer(self, name: str) -> LayerErrors | None:
        """Return the errors of a layer; None where it was not judged."""
        return next((each for each in self.layers if each.layer == name), None)


@dataclass(frozen=True, kw_only=True)
class EngineScene:
    """A scene of the report."""

    name: str
    source: str  #: as commands name it
    purpose: str
    size: Size  #: width and height [pixels]
    exposure: float  #: of its pictures
    files: Mapping[str, str]  #: relative to the folder, by kind


@dataclass(frozen=True, kw_only=True)
class Engines:
    """The content of engines.json."""

    schema: str
    created: str
    command: str
    environment: Environment
    engines: tuple[str, ...]  #: names of adapters, in their order
    scenes: tuple[EngineScene, ...]
    cells: tuple[Cell, ...]

    @property
    def shown_best(self) -> str:
        """The scene of which most layers were judged; empty where none was."""
        counts = {
            scene.name: sum(len(cell.layers) for cell in self.of_scene(scene.name))
            for scene in self.scenes
        }
        name = max(counts, key=counts.__getitem__, default="")
        return name if counts.get(name) else ""

    def title_of(self, engine: str) -> str:
        """Return an engine with its version; its adapter's name where it has no image."""
        titles = [cell.title for cell in self.cells if cell.engine == engine and cell.captured]
        return titles[0] if titles else engine

    def of_scene(self, scene: str) -> list[Cell]:
        """Return the cells of a scene, in the order of the engines."""
        return [cell for cell in self.cells if cell.scene == scene]


def engines_text(data: Engines) -> str:
    """Return the content of engines.json."""
    return json.dumps(asdict(data), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def engines_file(path: Path | str) -> Path | None:
    """Return the file of a report on engines that a path means, or its folder; None where it means
    none.
    """
    place = Path(path)
    if place.is_dir():
        place = place / FILE
    return place if place.name == FILE and place.is_file() else None


def read_engines(file: Path) -> Engines:
    """Return the content of a file engines.json."""
    wanted = f"{FILE} of `airlight report --engines`"
    return read_versioned(file, Engines, SCHEMA, wanted, "make it again")


def named_files(data: Engines) -> Iterator[str]:
    """Yield the names of all files that a report consists of besides its page and its data."""
    for files in (*(scene.files for scene in data.scenes), *(cell.files for cell in data.cells)):
        yield from files.values()
