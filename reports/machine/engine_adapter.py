# SPDX-License-Identifier: BSD-3-Clause
"""The adapters of engines: programs of which nothing is known here but their contract, which
`docs/adapters/README.md` tells.

The first line of an adapter says what runs it; its exit status is one of ours; one line of JSON
says what it did.
"""

import json
import os
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from airlight.errors import InputError, nearest
from airlight.reports.machine.environment import MissingError, install_line

_WRONG, _MISSING = 2, 3  # exit statuses of an adapter, which are ours
#: Debian's packages of the programs that run adapters, where they are called otherwise.
_PACKAGES = {"node": ["nodejs", "npm"]}


class CannotError(InputError):
    """The engine cannot have the scene or the setting: its adapter refused."""


@dataclass(frozen=True)
class Told:
    """The line that an adapter prints."""

    engine: str
    version: str
    settings: dict[str, Any]
    seconds: float
    problems: tuple[str, ...]
    device: str = ""  #: that drew the image
    model: str | None = None  #: the equation that the settings mean; None where it is not known
    pixel: Literal["centre", "area"] | None = None  #: of what the values of pixels are
    #: what the layers `airlight`, `surface` or `total` are called in its file, if otherwise
    layers: dict[str, str] = field(default_factory=dict)


def adapter_command(engine: str, adapters: Any = None) -> list[str]:
    """Return the words that run the adapter of an engine, from a folder or from the clone.

    Raises InputError for an engine without an adapter, and MissingError where there are none, or
    what runs the adapter is missing.
    """
    folder, found = _adapters(adapters)
    if engine not in found:
        raise InputError(
            f"engine: got {engine!r}, expected one with an adapter in {folder}: "
            f"{', '.join(found) or 'there is none'}{nearest(engine, found)}"
        )
    program, *more = _runner(found[engine])
    runner = shutil.which(program)
    if runner is None:
        packages = _PACKAGES.get(program, [Path(program).name])
        raise MissingError(
            f"{engine}: its adapter runs by {program}, which is missing. To install it: "
            f"{install_line(packages)}"
        )
    return [runner, *more, str(found[engine].resolve())]


def adapter_names(adapters: Any = None) -> list[str]:
    """Return the names of the adapters in a folder, or in the clone, as of `adapter_command`."""
    folder, found = _adapters(adapters)
    if not found:
        raise InputError(f"adapters: {folder} has none; see docs/adapters/README.md")
    return list(found)


def _adapters(adapters: Any) -> tuple[Path, dict[str, Path]]:
    """Return a folder and the adapters in it by their names."""
    clone = Path(__file__).resolve().parents[2] / "docs" / "adapters"
    folder = clone if adapters is None else Path(adapters)
    if not folder.is_dir():
        if adapters is not None:
            raise InputError(f"adapters: {folder} is no folder; expected one with adapters")
        raise MissingError(
            "the adapters of engines lie in docs/adapters of a clone of airlight, and not in an "
            "installed package; name their folder by --adapters"
        )
    return folder, {path.stem: path for path in sorted(folder.iterdir()) if _runner(path)}


def _runner(path: Path) -> list[str]:
    """Return the words that run a file, by its first line; none for a file that is no program."""
    if not path.is_file() or path.name.startswith("."):
        return []
    with path.open("rb") as stream:
        first = stream.readline(1000).decode("utf-8", errors="replace")
    try:
        words = shlex.split(first[2:]) if first.startswith("#!") else []
    except ValueError:  # a quote without an end
        return []
    # `env` looks the program up in PATH, and so does the caller; its -S takes several words.
    if words and Path(words[0]).name == "env":
        return words[2:] if words[1:2] == ["-S"] else words[1:]
    return words


def run_adapter(engine: str, command: Sequence[str], *, limit: float, folder: Path) -> Told:
    """Run an adapter for at most `limit` [s], and return what it says; temporary files of browsers
    lie in `folder`, and go with it.

    Raises CannotError for what the engine cannot have, InputError where the adapter fails or is too
    slow, and MissingError where it misses a program.
    """
    import msgspec

    from airlight.realtime.child_process import EndedError
    from airlight.reference.storage.cache import cache_folder
    from airlight.reports.machine.own_program import run_program
    from airlight.validation.columns import record_of

    environment = os.environ | {
        "AIRLIGHT_LIMIT": f"{limit:g}",
        "AIRLIGHT_CACHE_DIR": str(cache_folder().absolute()),
        "TMPDIR": str(folder),
    }
    try:
        ended = run_program(command, name=engine, limit=limit, environment=environment)
    except EndedError as error:
        raise InputError(f"{error}; --limit {2 * limit:g} allows more") from error
    if ended.status:
        words = _last(ended.errors) or "it said nothing"
        if ended.status == _WRONG:
            raise CannotError(words)
        if ended.status == _MISSING:
            raise MissingError(words)
        raise InputError(f"{engine}: its adapter failed with the status {ended.status}: {words}")
    line = _last(ended.output)
    try:
        return record_of(json.loads(line), Told)
    except (ValueError, msgspec.ValidationError) as error:
        raise InputError(
            f"{engine}: its adapter printed {line[:100]!r}, expected one line of JSON with engine, "
            f"version, settings, seconds and problems ({error})"
        ) from error


def _last(text: str) -> str:
    """Return the last line that says something, without those that node and traces add."""
    lines = [line.rstrip() for line in text.splitlines() if line.strip()]
    said = [line for line in lines if not line.startswith((" ", "\t", "Node.js v"))]
    return said[-1][:2000] if said else ""
