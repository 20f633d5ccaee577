# SPDX-License-Identifier: BSD-3-Clause
"""Results of a study on disk, so that what did not change is not computed again.

A result is a piece of data (what JSON holds) and files (bytes by name), as they stand in a report. It is found by its
*identity*, what a user would call the same measurement: the kind, the scene's name, the configuration, the effort, the
machine. It counts as long as its *fingerprint* is the same: the content of the scene, the versions of Mitsuba, Dr.Jit
and NumPy, and the bytes of the source code that computes it. So a change of the code replaces what it made before and
does not pile up beside it. Files are those of `reference.storage.cache`: written whole or not at all, with a digest of
their own content, and one that is damaged counts as none.
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

#: Raise this when the meaning of what is kept changes, but not its source.
GENERATION = 1

_FOLDER = "report"  # in the folder of the cache
_ROOT = Path(__file__).resolve().parents[2]
_SIDES = ("analytic", "realtime", "reference", "validation")
_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy")
_FILE = "file-"  # before the name of a file among the arrays

Computed = tuple[dict[str, Any], Mapping[str, bytes]]  # data and files


@dataclass(frozen=True)
class ResultCache:
    """What all results of one run have in common."""

    fingerprint: Mapping[str, str]  #: of source and versions
    machine: Mapping[str, str]  #: processor, threads, variant and compiler: times are those of a machine
    fresh: bool = False  #: whether to compute everything again


@dataclass(frozen=True)
class CacheEntry:
    """Where a result belongs, and what it must have been made from."""

    key: str
    fingerprint: str
    made_by: str  #: digest of source and versions alone, without the scene
    fresh: bool = False


@dataclass(frozen=True)
class CachedResult:
    """A result, and whether it was there already."""

    data: dict[str, Any]
    files: Mapping[str, bytes] = field(repr=False)
    measured: str  #: when it was computed
    seconds: float  #: that computing took
    cached: bool


def result_cache(machine: Mapping[str, str], *, more: Sequence[Path] = (), fresh: bool = False) -> ResultCache:
    """Return what all results of a run have in common.

    Parameters
    ----------
    machine
        What times depend on: processor, threads, variant, compiler.
    more
        Files of source code, besides the four sides, on which results depend.
    fresh
        Whether to compute everything again.
    """
    from importlib.metadata import version

    versions = {name: version(name) for name in _PACKAGES}
    source = source_digest([*own_sources(), *more])
    return ResultCache({"source": source, "generation": str(GENERATION)} | versions, dict(machine), fresh)


def own_sources() -> list[Path]:
    """Return the files of the code that computes: truth, methods and studies."""
    return [path for side in _SIDES for path in (_ROOT / side).rglob("*.py")]


def source_digest(paths: Sequence[Path]) -> str:
    """Return a digest of the bytes of some files; where they lie does not matter, their names do."""
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
        What it is, one word.
    identity
        What makes it another measurement: the scene's name, the configuration, what the effort asks of it.
    fingerprint
        What else its numbers depend on: the content of the scene.
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
    """Keep what was computed in so many seconds, in place of what was there."""
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
    """Return how long a result will take: none where it is kept, else as long as the last time on this machine.

    Returns
    -------
    float or None
        None where the machine never computed it [s].
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
    """Return date and time with the zone."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z")


def sweep_results() -> None:
    """Remove what a killed run left half-written."""
    sweep(cache_folder() / _FOLDER)


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _bytes_array(content: bytes) -> np.ndarray:
    return np.frombuffer(content, dtype=np.uint8)
