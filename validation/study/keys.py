# SPDX-License-Identifier: BSD-3-Clause
"""Keys of rows, and what workers that compute them must agree in."""

import platform
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version

from airlight.reference.storage.code import source_digest
from airlight.reference.storage.store import Content, Inputs
from airlight.validation.properties.properties import scene_properties
from airlight.validation.scenes.loading import scene_identity
from airlight.validation.scenes.names import is_random
from airlight.validation.scenes.registry import SCENES
from airlight.validation.study.configuration import Configuration, user_code
from airlight.validation.study.reference import cell_reference
from airlight.validation.study.run import run
from airlight.validation.study.study import Cell, Measure

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
            f"{name} {theirs.get(name, 'missing')}, not {mine[name]}"
            for name in mine
            if mine[name] != theirs[name]
        ]

    def _words(self) -> dict[str, str]:
        # the digest is of the code as this version compiles it
        python = self.python.rpartition(".")[0]
        words = {
            "airlight": self.airlight,
            "Python": python,
            "source code": self.source[:12],
            "variant": self.variant,
        }
        return words | dict(self.packages)


def made_here(airlight: str, variant: str) -> Made:
    """Return the software that computes rows in this process; `airlight`: its version,
    `variant` the current one.
    """
    packages = tuple((name, version(name)) for name in _PACKAGES)
    return Made(airlight, row_source(), packages, variant, platform.python_version())


def row_source() -> str:
    """Return a digest of the source code that computes rows, the same wherever it is installed."""
    return source_digest(
        *(function.__module__ for function in (run, cell_reference, scene_properties))
    )


@dataclass(frozen=True)
class CellReference:
    """The inputs of the reference of a cell, known before its scene is loaded; its
    code is in `Made.source`.
    """

    scene: str  #: see `scene_identity`
    size: tuple[int, int]  #: [pixels]
    medium: tuple[str, ...]


@dataclass(frozen=True)
class RowInputs(Inputs):
    """The inputs of a row of a sweep."""

    kind = "row"
    modules = ("airlight.validation.study.keys",)
    reference: CellReference
    chosen: Configuration
    code: tuple[Content, ...]  #: of the user's in the configuration
    measure: Measure
    source: str  #: see `row_source`; it changes with every version
    packages: tuple[tuple[str, str], ...]
    variant: str  #: Mitsuba's


def cell_key(cell: Cell, made: Made, scenes: Mapping[str, str] | None = None) -> str:
    """Return the key of the row of a cell that these versions compute; a key that is never found
    again where an input has no digest.

    `scenes` are digests of scenes that were read before, by name: anyone who has many cells
    of a file reads it once.
    """
    chosen = replace(cell.chosen, parameters=tuple(sorted(cell.chosen.parameters)))
    reference = CellReference(
        (scenes or {}).get(cell.scene) or scene_identity(cell.scene), cell.size, cell.medium
    )
    versions = made.source, made.packages, made.variant
    inputs = RowInputs(reference, chosen, user_code(cell.chosen), cell.measure, *versions)
    return inputs.key or f"row-{uuid.uuid4().hex}"


def scene_identities(scenes: Iterable[str]) -> dict[str, str]:
    """Return the digests of those scenes that are files, by name."""
    return {
        name: scene_identity(name) for name in scenes if not (name in SCENES or is_random(name))
    }
