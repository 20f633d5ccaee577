# SPDX-License-Identifier: BSD-3-Clause
"""Keys of cells: a digest of everything that decides the numbers of a row, without loading the scene.

A built-in and a random scene are what their name and our source code say; a scene of a file is its bytes and those of
the files that it names. Source code counts by its bytes: a version number stays the same while somebody works.
"""

import hashlib
import json
import platform
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

from analytic.errors import InputError
from validation.scenes.random_scene import PREFIX, is_random
from validation.scenes.registry import SCENES
from validation.sweep.study import Cell

#: Raise this number when rows change their meaning without a change of the source code that `source_digest` covers.
GENERATION = 1

_ROOT = Path(__file__).resolve().parents[2]
#: What computes truths and images. The rest of `validation` studies what comes of it.
_SOURCES = (
    "analytic",
    "realtime",
    "reference",
    "validation/configurations",
    "validation/estimates",
    "validation/metrics",
    "validation/properties",
    "validation/random_scenes",
    "validation/scenes",
)
_FILES = tuple(f"validation/sweep/{name}.py" for name in ("bounds", "truth", "work"))
_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy")
_FILENAME = re.compile(rb"""value\s*=\s*["']([^"']+)["']""")


@dataclass(frozen=True)
class Made:
    """What computes rows: two workers of one study must agree in all of it."""

    airlight: str  #: version
    source: str  #: digest of the source code
    packages: tuple[tuple[str, str], ...]  #: name and version of those that make the numbers
    variant: str  #: Mitsuba's
    python: str  #: version

    def differences(self, other: "Made") -> list[str]:
        """Return in words what differs in `other`; Python's version may."""
        mine, theirs = self._words(), other._words()
        return [
            f"{name} {theirs.get(name, 'missing')}, not {mine[name]}" for name in mine if mine[name] != theirs[name]
        ]

    def _words(self) -> dict[str, str]:
        words = {"airlight": self.airlight, "source code": self.source[:12], "variant": self.variant}
        return words | dict(self.packages)


def made_here(airlight: str, variant: str) -> Made:
    """Return what computes rows in this process; `airlight` is its version, `variant` the current one."""
    packages = tuple((name, version(name)) for name in _PACKAGES)
    return Made(airlight, source_digest(), packages, variant, platform.python_version())


@lru_cache(maxsize=1)
def source_digest() -> str:
    """Return a digest of the source code that computes truths and images, the same wherever it is installed."""
    paths = [path for folder in _SOURCES for path in (_ROOT / folder).rglob("*.py")]
    digest = hashlib.sha256(str(GENERATION).encode())
    for path in sorted([*paths, *(_ROOT / name for name in _FILES)]):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(_ROOT).as_posix()} {len(content)}|".encode() + content)
    return digest.hexdigest()


def cell_key(cell: Cell, made: Made, scenes: Mapping[str, str] | None = None) -> str:
    """Return the key of a cell, 64 hexadecimal digits.

    Parameters
    ----------
    cell
        The cell.
    made
        What computes it.
    scenes
        Digests of scenes that were read before, by name: whoever has many cells of a file reads it once.
    """
    content = {
        "scene": (scenes or {}).get(cell.scene) or scene_identity(cell.scene),
        "size": cell.size,
        "medium": cell.medium,
        "method": [cell.chosen.method, cell.chosen.kernel, sorted(cell.chosen.parameters)],
        "flip": cell.flip,
        "times": cell.times,
        "made": [made.airlight, made.source, made.packages, made.variant],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def scene_identity(scene: str) -> str:
    """Return what a scene is: its name, or the digest of the file and of the files that it names.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    if scene in SCENES:
        return scene
    if is_random(scene):
        seed, _, options = scene.removeprefix(PREFIX).partition(":")
        return f"{PREFIX}{seed}" + (f":{_drawn_from(options)}" if options else "")
    path = Path(scene)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"scene {scene}: {error.strerror}; wanted a file that this machine can read") from error
    digest = hashlib.sha256(content)
    for name in sorted({match.decode("utf-8", "replace") for match in _FILENAME.findall(content)}):
        other = path.parent / name
        if len(name) < 4096 and other.is_file():
            digest.update(f"|{name} ".encode() + hashlib.sha256(other.read_bytes()).digest())
    return digest.hexdigest()


@lru_cache(maxsize=8)
def _drawn_from(options: str) -> str:
    """Return a digest of the files that the options of random scenes name: ranges, and meshes in the order of names."""
    digest = hashlib.sha256()
    for option in options.split(":"):
        kind, _, name = option.partition("=")
        place = Path(name)
        for path in sorted(place.iterdir()) if place.is_dir() else [place]:
            if path.is_file():
                digest.update(f"|{kind} {path.name} ".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def scene_identities(scenes: Iterable[str]) -> dict[str, str]:
    """Return the digests of those scenes that are files, by name."""
    return {name: scene_identity(name) for name in scenes if not (name in SCENES or is_random(name))}
