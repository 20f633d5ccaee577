# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of slabs kept on disk, whole or not at all, in the folder and under the names that
`airlight doctor` lists.

The folder is the one of `reference/storage/cache.py`, which this side does not import:
AIRLIGHT_CACHE_DIR, or `airlight` in the user's cache folder. A damaged file, which the checksums of
its archive tell, and a file from elsewhere count as none. With AIRLIGHT_CACHE_SIZE=0 nothing is
kept, and nothing read.

The name of a file tells how numbers were made, and of which medium: by the moments of its phase
function and its albedo, to the last bit. If numbers of a medium that is nearly the same were taken,
an image would depend on earlier ones.
"""

import os
import re
import uuid
from collections.abc import Mapping
from contextlib import suppress
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.errors import DAMAGED
from airlight.realtime.clouds.slab_orders.phases import SlabPhase

Array = NDArray[Any]


def _folder() -> Path:
    named = os.environ.get("AIRLIGHT_CACHE_DIR")
    base = os.environ.get("XDG_CACHE_HOME")
    return Path(named) if named else (Path(base) if base else Path.home() / ".cache") / "airlight"


def medium_numbers(phase: SlabPhase, albedo: float) -> Array:
    """Return the key of a medium: moments of its phase function, and its albedo."""
    # As many moments as the quadrature of `AnglePhase` resolves tell phase functions apart.
    count = 300
    return np.append(phase.moments(count), albedo)


def load_kept(digest: str, medium: Array) -> dict[str, Any] | None:
    """Return the arrays under a digest of a medium, None where there are
    none or the file is damaged.

    `digest`: of how numbers were made; `medium`: from `medium_numbers`.
    """
    if not _keeps():
        return None
    path = _path(digest, medium)
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except DAMAGED:
        return None
    with suppress(OSError):
        os.utime(path)  # what was used longest ago is dropped first
    return arrays


def _keeps() -> bool:
    # '0', and 0 of any unit, such as '0MB'.
    size = os.environ.get("AIRLIGHT_CACHE_SIZE", "").strip().lower()
    return re.fullmatch(r"[0.]+\s*[a-z]*", size) is None


def _path(digest: str, medium: Array) -> Path:
    # One digest of 32 digits: the names of the cache have that form, and others are never removed.
    name = blake2b(digest.encode() + medium.tobytes(), digest_size=16).hexdigest()
    return _folder() / f"canonical-{name}.npz"


def keep(digest: str, medium: Array, arrays: Mapping[str, Any]) -> None:
    """Write arrays under a digest of a medium; where the folder cannot be
    written, nothing is kept.
    """
    if not _keeps():
        return
    buffer = BytesIO()
    np.savez(buffer, **arrays)
    path = _path(digest, medium)
    # The archive is written beside its place and then moved there, so that nobody reads half of it;
    # two processes that compute the same numbers have files of their own until then.
    temporary = path.with_name(f".{path.stem}-{uuid.uuid4().hex}.npz")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(buffer.getvalue())
        os.replace(temporary, path)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
