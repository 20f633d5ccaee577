# SPDX-License-Identifier: BSD-3-Clause
"""Keys of rows, and what workers that compute them must agree in."""

import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version

from reference.storage.kept import key_of, source_digest
from validation.properties.properties import scene_properties
from validation.scenes.loading import scene_identity
from validation.scenes.random.design import is_random
from validation.scenes.registry import SCENES
from validation.study.configuration import user_code
from validation.study.reference import cell_reference
from validation.study.run import run
from validation.study.study import Cell

_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy")


@dataclass(frozen=True)
class Made:
    """The software that computes rows: two workers of one study must agree in all of it."""

    airlight: str  #: version
    source: str  #: digest of the source code
    packages: tuple[tuple[str, str], ...]  #: name and version of those that make the numbers
    variant: str  #: Mitsuba's
    python: str  #: version

    def differences(self, other: "Made") -> list[str]:
        """Return in words what differs in `other`; the last number of Python's version may."""
        mine, theirs = self._words(), other._words()
        return [
            f"{name} {theirs.get(name, 'missing')}, not {mine[name]}" for name in mine if mine[name] != theirs[name]
        ]

    def _words(self) -> dict[str, str]:
        python = self.python.rpartition(".")[0]  # the digest is of the code as this version compiles it
        words = {"airlight": self.airlight, "Python": python, "source code": self.source[:12], "variant": self.variant}
        return words | dict(self.packages)


def made_here(airlight: str, variant: str) -> Made:
    """Return the software that computes rows in this process; `airlight`: its version, `variant` the current one."""
    packages = tuple((name, version(name)) for name in _PACKAGES)
    return Made(airlight, row_source(), packages, variant, platform.python_version())


def row_source() -> str:
    """Return a digest of the source code that computes rows, the same wherever it is installed."""
    return source_digest(run, cell_reference, scene_properties)


def cell_key(cell: Cell, made: Made, scenes: Mapping[str, str] | None = None) -> str:
    """Return the key of the row of a cell that these versions compute.

    `scenes` are digests of scenes that were read before, by name: anyone who has many cells of a file reads it once.
    """
    key = key_of(
        "row",
        scene=(scenes or {}).get(cell.scene) or scene_identity(cell.scene),
        size=cell.size,
        medium=cell.medium,
        method=[cell.chosen.method, cell.chosen.kernel, sorted(cell.chosen.parameters), user_code(cell.chosen)],
        measure=cell.measure,
        made=[made.airlight, made.source, made.packages, made.variant],
    )
    assert key is not None, "the identity of a scene is a word"
    return key


def scene_identities(scenes: Iterable[str]) -> dict[str, str]:
    """Return the digests of those scenes that are files, by name."""
    return {name: scene_identity(name) for name in scenes if not (name in SCENES or is_random(name))}
