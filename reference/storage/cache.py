# SPDX-License-Identifier: BSD-3-Clause
"""Arrays on disk under a name, written whole or not at all.

A killed run loses nothing that was finished and leaves nothing half-written. Each file holds a digest of its own
content and name: one that was damaged, edited or renamed counts as none. `reference.storage.scene_digest` names
references by what decides their numbers, `reference.storage.cache_size` keeps the cache from growing without bound.
"""

import hashlib
import os
import time
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from reference.storage.files import write_bytes

#: Raise this when the meaning or the accuracy of a cached number changes.
GENERATION = 4

_DIGEST = "digest"  # the name of the digest among the arrays
_STALE = 3600.0  # seconds after which a half-written file belongs to nobody


def cache_folder() -> Path:
    """Return the folder of the cache: AIRLIGHT_CACHE_DIR, or `airlight` in the user's cache folder."""
    own = os.environ.get("AIRLIGHT_CACHE_DIR")
    if own:
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "airlight"


def load_arrays(key: str) -> dict[str, Any] | None:
    """Return the arrays kept under a key, or None where there are none or the file is damaged."""
    arrays = _read(key)
    written = arrays.pop(_DIGEST, None)
    if written is None or str(written) != _content_digest(key, arrays):
        return None
    # What was used longest ago is dropped first; in a folder that cannot be written nothing is dropped at all.
    with suppress(OSError):
        os.utime(_path(key))
    return arrays


def peek_array(key: str, name: str) -> Any | None:
    """Return one array kept under a key, read alone and unchecked; None where there is none or it cannot be read."""
    return _read(key, (name,)).get(name)


def _read(key: str, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Return some arrays of a file, all by default; none where it is not ours or cut short by a full disk."""
    try:
        # Opened here, since `np.load` leaves a file that it cannot read open.
        with open(_path(key), "rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in (stored.files if names is None else names)}
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile, zlib.error):
        return {}


def is_kept(key: str) -> bool:
    """Return whether there is a file under a key, damaged or not."""
    return _path(key).exists()


def store_arrays(key: str, arrays: Mapping[str, Any]) -> None:
    """Keep arrays under a key, replacing what is there; a key may name a folder, as in 'volpath-0a1b/000017'."""
    content: dict[str, Any] = {name: np.asarray(value) for name, value in arrays.items()}
    buffer = BytesIO()
    np.savez(buffer, **(content | {_DIGEST: np.asarray(_content_digest(key, content))}))
    try:
        write_bytes(_path(key), buffer.getvalue())
    except FileNotFoundError:  # the folder was empty, and another process has just dropped it
        write_bytes(_path(key), buffer.getvalue())


def drop_arrays(key: str) -> None:
    """Forget what is kept under a key."""
    _path(key).unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove what a killed run left half-written in a folder: hidden files older than an hour."""
    for path in folder.glob(".*.npz"):
        with suppress(OSError):  # another run may have removed it
            if time.time() - path.stat().st_mtime > _STALE:
                path.unlink()


def _path(key: str) -> Path:
    return cache_folder() / f"{key}.npz"


def _content_digest(key: str, arrays: Mapping[str, Any]) -> str:
    """Return a digest of the name and of every array: its name, kind, shape and bytes."""
    digest = hashlib.blake2b(key.encode(), digest_size=16)
    for name in sorted(arrays):
        value = np.ascontiguousarray(arrays[name])
        digest.update(f"|{name} {value.dtype.str} {np.shape(arrays[name])}|".encode())
        digest.update(value.data if value.size and value.dtype.kind in "biufc" else value.tobytes())
    return digest.hexdigest()
