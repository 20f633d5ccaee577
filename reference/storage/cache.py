# SPDX-License-Identifier: BSD-3-Clause
"""Arrays on disk under a key: whole or not there, and together no larger than a limit.

A killed run loses nothing that was finished and leaves nothing half-written. Each file holds a
digest of its content and its key: a file that was damaged, edited or renamed counts as missing.
`reference.storage.store` says which key arrays have.

Only files `KIND-DIGEST.npz`, and those in a folder `KIND-DIGEST`, are ever removed: a folder given
by mistake loses nothing.
"""

import hashlib
import logging
import math
import os
import random
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import DAMAGED, InputError
from airlight.reference.storage.files import NO_SPACE, sweep_hidden, write_bytes

Arrays: TypeAlias = dict[str, np.ndarray]  #: arrays of any shape and type, by name

DEFAULT_LIMIT = 4 * 2**30  #: bytes

_DIGEST = "digest"  # the name of the digest among the arrays
_KIND = re.compile(r"([a-z]+(?:-[a-z]+)*)-[0-9a-f]{32}")
_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?)(i?)b?", flags=re.IGNORECASE)


@dataclass(frozen=True)
class Entry:
    """One file of the cache."""

    path: Path
    kind: str  #: "quadrature", "volpath", ..: the words before the digest
    size: int  #: [bytes]
    used: float  #: when it was last written or read [s since 1970]


def cache_folder() -> Path:
    """Return the folder of the cache: AIRLIGHT_CACHE_DIR, or `airlight` in
    the user's cache folder.

    Raises InputError for a user without a home folder who names none.
    """
    chosen = os.environ.get("AIRLIGHT_CACHE_DIR")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "airlight"
    except RuntimeError:
        raise InputError(
            "there is no home folder for the cache; expected AIRLIGHT_CACHE_DIR to name a folder"
        ) from None


def cache_limit() -> int:
    """Return how large the cache may become [bytes]: `AIRLIGHT_CACHE_SIZE`, or `DEFAULT_LIMIT`.

    Raises InputError if the variable holds no size.
    """
    text = os.environ.get("AIRLIGHT_CACHE_SIZE", "").strip()
    if not text:
        return DEFAULT_LIMIT
    if size := _SIZE.fullmatch(text):
        number, prefix, binary = size.groups()
        unit = (1024 if binary else 1000) ** " kmgt".index(prefix.lower() or " ")
        if math.isfinite(limit := float(number) * unit):
            return int(limit)
    given = text if len(text) < 40 else f"{text[:40]}.."
    raise InputError(
        f"AIRLIGHT_CACHE_SIZE: got {given!r}, expected a size such as 500MB, 4GiB or a number of "
        "bytes"
    )


def load_arrays(key: str, names: Sequence[str] | None = None) -> Arrays | None:
    """Return the arrays under a key, or None if the file is missing or damaged, or the
    limit of the cache is 0.

    With `names` it returns these arrays alone, without a check of the digest: they may be a small
    part of a large file.
    """
    if cache_limit() == 0:
        return None
    try:
        # Opened here, since `np.load` leaves a file that it cannot read open.
        with open(_path(key), "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in (names or stored.files)}
    except DAMAGED:
        return None
    if names:
        return arrays
    written = arrays.pop(_DIGEST, None)
    if written is None or str(written) != _content_digest(key, arrays):
        return None
    with suppress(OSError):  # in a folder that cannot be written nothing is removed either
        os.utime(_path(key))  # files that were used longest ago are removed first
    return arrays


def store_arrays(key: str, arrays: Mapping[str, ArrayLike]) -> None:
    """Write arrays under a key in place of the file that is there; a key may name a folder, as in
    'volpath-0a1b/000017'.

    Then the files that were used longest ago are removed until the cache is no larger than its
    limit. The size of the cache is looked at by chance, the more often the larger the file is. With
    a limit of 0 nothing is written. If the folder cannot be written, a note on the error stream
    says so, and the program goes on. Raises OSError if the disk is full.
    """
    limit = cache_limit()
    if limit == 0:
        return
    content: Arrays = {name: np.asarray(value) for name, value in arrays.items()}
    # NumPy takes the arrays as keywords, beside a keyword of another type.
    named: dict[str, Any] = {**content, _DIGEST: np.asarray(_content_digest(key, content))}
    buffer = BytesIO()
    np.savez(buffer, **named)
    try:
        _write(_path(key), buffer.getvalue())
    except (InputError, OSError) as error:
        if getattr(error, "errno", None) in NO_SPACE:
            raise
        _note_unwritable(cache_folder())
        return
    # To look at all files takes time: it is done 100 times, on average, while a whole limit is
    # written.
    if random.random() < 100 * len(buffer.getvalue()) / limit:
        remove_oldest(limit)


def _write(path: Path, data: bytes) -> None:
    # The file is not flushed, which would take half the time of a small file: a file that a loss of
    # power damages counts as missing.
    try:
        write_bytes(path, data, flush=False)
    except FileNotFoundError:  # the folder was empty, and another process has just removed it
        write_bytes(path, data, flush=False)


@cache  # once for each folder
def _note_unwritable(folder: Path) -> None:
    logging.getLogger("airlight").warning(
        "airlight: note: the cache folder %s cannot be written, so nothing is cached: name one "
        "that can be written by AIRLIGHT_CACHE_DIR, or set AIRLIGHT_CACHE_SIZE=0",
        folder,
    )


def is_stored(key: str) -> bool:
    """Return whether there is a file under a key, damaged or not; False if the limit of the cache
    is 0.
    """
    return cache_limit() > 0 and _path(key).exists()


def drop_arrays(key: str) -> None:
    """Remove the file of a key."""
    _path(key).unlink(missing_ok=True)


def drop_parts(key: str) -> None:
    """Remove the files of the keys inside a key."""
    folder = _path(key).with_suffix("")
    for path in _listed(folder):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # there was none, or another process works in it
        folder.rmdir()


def cache_entries() -> list[Entry]:
    """Return the files of the cache, the least recently used first."""
    root, entries = cache_folder(), []
    folders = [root, *(path for path in _listed(root) if path.is_dir())]
    for path in (each for folder in folders for each in _listed(folder) if each.match("[!.]*.npz")):
        # A part lies in the folder of its result, whose name then says the kind.
        owner = path.parent if path.parent != root else path
        kind = _KIND.fullmatch(owner.name.removesuffix(".npz"))
        if kind is None or owner.is_symlink():
            continue
        with suppress(OSError):  # another process has just removed it
            state = path.stat()
            entries.append(Entry(path, kind[1], state.st_size, state.st_mtime))
    return sorted(entries, key=lambda entry: (entry.used, entry.path))


def _listed(folder: Path) -> list[Path]:
    """Return the contents of a folder; none if another process has removed it, for which
    `Path.glob` of Python 3.11 raises.
    """
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def remove_oldest(limit: int) -> tuple[int, int]:
    """Remove the files that were used longest ago until the others take at most `limit` bytes;
    return how many files were removed, and their bytes.
    """
    entries = cache_entries()
    excess, files, freed = sum(entry.size for entry in entries) - limit, 0, 0
    for entry in entries:
        if freed >= excess:
            break
        with suppress(OSError):  # what another process has removed, or nobody can
            entry.path.unlink()
            files, freed = files + 1, freed + entry.size
        if entry.path.parent != cache_folder():
            with suppress(OSError):  # it holds other files
                entry.path.parent.rmdir()
    return files, freed


def clear_cache() -> tuple[int, int]:
    """Remove every file; return how many there were, and their bytes."""
    for folder in {cache_folder(), *(entry.path.parent for entry in cache_entries())}:
        sweep_hidden(folder)
    return remove_oldest(0)


def _path(key: str) -> Path:
    return cache_folder() / f"{key}.npz"


def _content_digest(key: str, arrays: Arrays) -> str:
    """Return a digest of the key and of every array: its name, type, shape and bytes."""
    digest = hashlib.blake2b(key.encode(), digest_size=16)
    for name in sorted(arrays):
        value = np.ascontiguousarray(arrays[name])
        digest.update(f"|{name} {value.dtype.str} {arrays[name].shape}|".encode())
        digest.update(value.data if value.size and value.dtype.kind in "biufc" else value.tobytes())
    return digest.hexdigest()
