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

from reference.storage.cache import cache_folder, load_arrays, peek_array, store_arrays, sweep
from reference.storage.cache_size import make_room

#: Raise this number when kept results change their meaning without a change of the source code.
GENERATION = 1

_FOLDER = "report"  # within the folder of the cache
_ROOT = Path(__file__).resolve().parents[2]
_SIDES = ("analytic", "realtime", "reference", "validation")
_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy")
_FILE = "file-"  # prefix of the names of arrays that hold a file

Computed = tuple[dict[str, Any], Mapping[str, bytes]]  # data and files


@dataclass(frozen=True)
class ResultCache:
    """What all results of one run have in common."""

    fingerprint: Mapping[str, str]  #: of the source code and the versions
    machine: Mapping[str, str]  #: processor, threads, variant and compiler, on which times depend
    fresh: bool = False  #: whether to compute every result again


@dataclass(frozen=True)
class CacheEntry:
    """Where a result belongs, and what it must have been made from."""

    key: str  #: name in the cache: the digest of the identity
    fingerprint: str  #: digest of all that the numbers depend on
    made_by: str  #: digest of source and versions alone, without the scene
    fresh: bool = False  #: whether to compute it although it is kept


@dataclass(frozen=True)
class CachedResult:
    """A result, and whether it was there already."""

    data: dict[str, Any]  #: what JSON can hold
    files: Mapping[str, bytes] = field(repr=False)  #: contents by name
    measured: str  #: date and time of the computation
    seconds: float  #: that the computation took [s]
    cached: bool  #: whether it was there already


def result_cache(machine: Mapping[str, str], *, more: Sequence[Path] = (), fresh: bool = False) -> ResultCache:
    """Return what all results of a run have in common.

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
    return ResultCache({"source": source, "generation": str(GENERATION)} | versions, dict(machine), fresh)


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


def cache_entry(
    cache: ResultCache, kind: str, *, identity: Mapping[str, Any], fingerprint: Mapping[str, Any] | None = None
) -> CacheEntry:
    """Return where a result belongs.

    Parameters
    ----------
    cache
        Of the run.
    kind
        One word, such as 'method' or 'truth'.
    identity
        What tells this measurement from others: the scene's name, the configuration, the effort.
    fingerprint
        What else the numbers depend on, such as the content of the scene.
    """
    key = f"{_FOLDER}/{kind}-{_digest({**identity, 'machine': cache.machine})}"
    whole = _digest({**cache.fingerprint, **(fingerprint or {})})
    return CacheEntry(key, whole, _digest(cache.fingerprint), cache.fresh)


def load_result(entry: CacheEntry) -> CachedResult | None:
    """Return the result kept there; None where there is none, or it was made from something else, or is damaged."""
    arrays = None if entry.fresh else load_arrays(entry.key)
    if arrays is None or "about" not in arrays:
        return None
    about = json.loads(arrays.pop("about").tobytes())
    if about["fingerprint"] != entry.fingerprint:
        return None
    files = {name.removeprefix(_FILE): content.tobytes() for name, content in arrays.items()}
    return CachedResult(about["data"], files, about["measured"], about["seconds"], True)


def store_result(entry: CacheEntry, computed: Computed, seconds: float) -> CachedResult:
    """Keep what was computed in `seconds` [s], in place of what was there."""
    data, files = computed
    about = {"data": data, "measured": now(), "seconds": round(seconds, 3)}
    about |= {"fingerprint": entry.fingerprint, "made_by": entry.made_by}
    text = json.dumps(about, allow_nan=False)
    arrays = {_FILE + name: _bytes_array(content) for name, content in files.items()}
    make_room()
    store_arrays(entry.key, {"about": _bytes_array(text.encode())} | arrays)
    # What comes from the disk went through JSON: so does what does not, or two reports would differ in their types.
    about = json.loads(text)
    return CachedResult(about["data"], dict(files), about["measured"], about["seconds"], False)


def cached_result(entry: CacheEntry, compute: Callable[[], Computed]) -> CachedResult:
    """Return the result that is kept, or compute and keep it."""
    kept = load_result(entry)
    if kept is not None:
        return kept
    start = time.monotonic()
    computed = compute()
    return store_result(entry, computed, time.monotonic() - start)


def expected_seconds(entry: CacheEntry) -> float | None:
    """Return how long a result will take [s]: 0 where it is kept, else as long as the last time on this machine.

    Returns
    -------
    float or None
        None where this machine never computed it.
    """
    about = peek_array(entry.key, "about")
    if about is None:
        return None
    try:
        kept = json.loads(about.tobytes())
        return 0.0 if kept["made_by"] == entry.made_by and not entry.fresh else float(kept["seconds"])
    except (ValueError, KeyError, TypeError, AttributeError):  # damaged
        return None


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
