# SPDX-License-Identifier: BSD-3-Clause
"""How large the cache is, and how it is kept from growing without bound.

An entry is what is dropped as a whole: a file `KIND-DIGEST.npz`, or a folder `KIND-DIGEST` with the batches of one
estimate. Only names of this form are ever removed, so that a folder given by mistake loses nothing. An entry was last
used when one of its files was last written or read (`load_arrays` sets that time).
"""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from analytic.errors import InputError
from reference.storage.cache import cache_folder, sweep

DEFAULT_LIMIT = 4 * 2**30  #: bytes

_NAME = re.compile(r"([a-z]+(?:-[a-z]+)*)-[0-9a-f]{32}(?:-[\d.e+-]+)?(?:\.npz)?")
_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(i?)b?", flags=re.IGNORECASE)


@dataclass(frozen=True)
class Entry:
    """One entry of the cache."""

    path: Path  #: a file, or a folder of files
    kind: str  #: "quadrature", "volpath", ..: the words before the digest
    files: tuple[Path, ...]
    size: int  #: of its files [bytes]
    used: float  #: when it was last written or read [s since 1970]


def cache_limit() -> int:
    """Return how large the cache may become [bytes]: `AIRLIGHT_CACHE_SIZE`, or `DEFAULT_LIMIT`.

    Raises
    ------
    InputError
        If the variable holds no size.
    """
    text = os.environ.get("AIRLIGHT_CACHE_SIZE", "").strip()
    if not text:
        return DEFAULT_LIMIT
    size = _SIZE.fullmatch(text)
    if size is None:
        raise InputError(f"AIRLIGHT_CACHE_SIZE: got {text!r}, wanted a size such as 500MB, 4GiB or a number of bytes")
    number, prefix, binary = size.groups()
    return int(float(number) * (1024 if binary else 1000) ** " kmgt".index(prefix.lower() or " "))


def cache_entries() -> list[Entry]:
    """Return what is in the cache, the least recently used entry first."""
    root = cache_folder()
    entries = [entry for folder in (root, *_folders(root)) for entry in _entries_in(folder)]
    return sorted(entries, key=lambda entry: (entry.used, entry.path))


def make_room() -> int:
    """Drop the least recently used entries until the cache is no larger than `cache_limit`.

    Whoever is about to add an entry calls this, so that the cache exceeds its limit by that entry at most. What another
    process has dropped meanwhile, or what cannot be removed, is passed over.

    Returns
    -------
    int
        Bytes that were freed.
    """
    limit, entries = cache_limit(), cache_entries()
    excess = sum(entry.size for entry in entries) - limit
    freed = 0
    for entry in entries:
        if freed >= excess:
            break
        freed += _drop(entry)
    return freed


def clear_cache() -> tuple[int, int]:
    """Drop every entry; return how many were dropped whole, and the bytes that were freed."""
    entries = cache_entries()
    freed = [_drop(entry) for entry in entries]
    for folder in (cache_folder(), *_folders(cache_folder())):
        sweep(folder)
    return sum(size == entry.size for size, entry in zip(freed, entries)), sum(freed)


def _folders(root: Path) -> list[Path]:
    """Return the folders in the cache that are no entries but hold some."""
    if not root.is_dir():
        return []
    folders = (path for path in root.iterdir() if path.is_dir() and not path.is_symlink())
    return [path for path in folders if not _NAME.fullmatch(path.name)]


def _entries_in(folder: Path) -> Iterator[Entry]:
    for path in folder.iterdir() if folder.is_dir() else ():
        name = _NAME.fullmatch(path.name)
        if name is None or path.is_symlink():
            continue
        # What another process has half written begins with a dot.
        files = tuple(path.glob("[!.]*.npz")) if path.is_dir() else (path,)
        states = []
        for file in files:
            with suppress(OSError):  # another process has just dropped it
                states.append(file.stat())
        if states:
            used = max(state.st_mtime for state in states)
            yield Entry(path, name[1], files, sum(state.st_size for state in states), used)


def _drop(entry: Entry) -> int:
    """Remove the files of an entry and return the bytes that this freed."""
    freed = 0
    for file in entry.files:
        with suppress(OSError):
            size = file.stat().st_size
            file.unlink()
            freed += size
    if entry.path.is_dir():
        with suppress(OSError):  # a batch was added meanwhile
            entry.path.rmdir()
    return freed
