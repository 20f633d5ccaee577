# SPDX-License-Identifier: BSD-3-Clause
"""Results of a study on disk, so that a report computes only what changed.

A result is data that JSON can hold, and files (bytes by name), as in a report. Its *identity* is what a user would call
the same measurement: the kind, the scene's name, the configuration, the effort, the machine. Its *fingerprint* covers
what the numbers depend on: the content of the scene, the versions of Mitsuba, Dr.Jit and NumPy, and the bytes of the
source code that computes it. A result is valid while its fingerprint is the same. A result with the same identity and
another fingerprint replaces the old one, so changes of the code do not fill the disk. `reference.storage.cache` stores
the results: it writes each file whole or not at all, with a digest, and ignores damaged files.
"""

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from reference.storage.cache import cache_folder, load_arrays, store_arrays, sweep

#: Raise this number when kept results change their meaning without a change of the source code.
GENERATION = 1

_FOLDER = "report"  # within the folder of the cache
_ROOT = Path(__file__).resolve().parents[2]
_SIDES = ("analytic", "realtime", "reference", "validation")
_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy")
_FILE = "file-"  # prefix of the names of arrays that hold a file

Computed = tuple[dict[str, Any], Mapping[str, bytes]]  # data and files


@dataclass(frozen=True)
class Keeper:
    """What all results of one run have in common."""

    fingerprint: Mapping[str, str]  #: of the source code and the versions
    machine: Mapping[str, str]  #: processor, threads, variant and compiler, on which times depend
    fresh: bool = False  #: whether to compute every result again


@dataclass(frozen=True)
class Kept:
    """A result, and whether it came from the disk."""

    data: dict[str, Any]
    files: Mapping[str, bytes] = field(repr=False)
    measured: str  #: date and time of the computation
    seconds: float  #: that the computation took
    cached: bool


def keeper(machine: Mapping[str, str], *, more: Sequence[Path] = (), fresh: bool = False) -> Keeper:
    """Return the common part of the fingerprints of a run.

    Parameters
    ----------
    machine
        Processor, threads, variant and compiler, on which times depend.
    more
        Further files of source code on which results depend, besides `own_sources`.
    fresh
        Whether to compute every result again.
    """
    from importlib.metadata import version

    versions = {name: version(name) for name in _PACKAGES}
    source = source_digest([*own_sources(), *more])
    return Keeper({"source": source, "generation": str(GENERATION)} | versions, dict(machine), fresh)


def own_sources() -> list[Path]:
    """Return the source files of truth, methods and studies, which compute the results."""
    return [path for side in _SIDES for path in (_ROOT / side).rglob("*.py")]


def source_digest(paths: Sequence[Path]) -> str:
    """Return a digest of files: of their bytes, their names and the names of their folders, not of their full paths."""
    digest = hashlib.sha256()
    for path in sorted(paths, key=lambda path: (path.parent.name, path.name, str(path))):
        content = path.read_bytes()
        digest.update(f"{path.parent.name}/{path.name} {len(content)}|".encode() + content)
    return digest.hexdigest()[:32]


@dataclass(frozen=True)
class Slot:
    """The place of a result in the cache, and the fingerprint that makes it valid."""

    key: str
    fingerprint: str
    fresh: bool = False


def slot(keeper: Keeper, kind: str, *, identity: Mapping[str, Any], fingerprint: Mapping[str, Any]) -> Slot:
    """Return the place of a result in the cache.

    Parameters
    ----------
    keeper
        Common part of the run.
    kind
        One word, such as 'method' or 'truth'.
    identity
        What tells this measurement from others: the scene's name, the configuration, the effort.
    fingerprint
        What else the numbers depend on, such as the content of the scene.
    """
    key = f"{_FOLDER}/{kind}-{_digest({**identity, 'machine': keeper.machine})}"
    return Slot(key, _digest({**keeper.fingerprint, **fingerprint}), keeper.fresh)


def find_kept(place: Slot) -> Kept | None:
    """Return the kept result, or None if there is none, its fingerprint differs or its file is damaged."""
    arrays = None if place.fresh else load_arrays(place.key)
    if arrays is None or "about" not in arrays:
        return None
    about = json.loads(arrays.pop("about").tobytes())
    if about["fingerprint"] != place.fingerprint:
        return None
    files = {name.removeprefix(_FILE): content.tobytes() for name, content in arrays.items()}
    return Kept(about["data"], files, about["measured"], about["seconds"], True)


def keep(place: Slot, computed: Computed, seconds: float) -> Kept:
    """Store a result that took `seconds` [s] to compute, in place of an older one, and return it."""
    data, files = computed
    about = {"data": data, "measured": now(), "seconds": round(seconds, 3), "fingerprint": place.fingerprint}
    text = json.dumps(about, allow_nan=False)
    arrays = {_FILE + name: _bytes_array(content) for name, content in files.items()}
    store_arrays(place.key, {"about": _bytes_array(text.encode())} | arrays)
    # A result from the disk went through JSON. A new one must too, or two reports would differ in their types.
    about = json.loads(text)
    return Kept(about["data"], dict(files), about["measured"], about["seconds"], False)


def kept_result(place: Slot, compute: Callable[[], Computed]) -> Kept:
    """Return the kept result, or compute and store it."""
    kept = find_kept(place)
    if kept is not None:
        return kept
    start = time.monotonic()
    computed = compute()
    return keep(place, computed, time.monotonic() - start)


def now() -> str:
    """Return date and time as YYYY-MM-DD HH:MM:SS with the time zone."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z")


def sweep_results() -> None:
    """Remove files that a killed run left unfinished."""
    sweep(cache_folder() / _FOLDER)


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _bytes_array(content: bytes) -> np.ndarray:
    return np.frombuffer(content, dtype=np.uint8)
