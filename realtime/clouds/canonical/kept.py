# SPDX-License-Identifier: BSD-3-Clause
"""Tables kept on disk, whole or not at all, in the folder and under the names that `airlight cache` lists.

The folder is that of `reference/storage/cache.py`, which this side does not import: AIRLIGHT_CACHE_DIR, or `airlight`
in the user's cache folder. A file that is damaged or from elsewhere counts as none. With AIRLIGHT_CACHE_SIZE=0 nothing
is kept.
"""

import os
import uuid
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

_CHECK = "checksum"


def kept_path(digest: str) -> Path:
    """Return where tables lie."""
    own = os.environ.get("AIRLIGHT_CACHE_DIR")
    base = os.environ.get("XDG_CACHE_HOME")
    folder = Path(own) if own else (Path(base) if base else Path.home() / ".cache") / "airlight"
    return folder / f"canonical-{digest}.npz"


def load_kept(digest: str) -> dict[str, Any] | None:
    """Return the arrays under a digest, None where there are none or the file is damaged."""
    path = kept_path(digest)
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    if int(arrays.pop(_CHECK, -1)) != _checksum(arrays):
        return None
    with suppress(OSError):
        os.utime(path)  # what was used longest ago is dropped first
    return arrays


def keep(digest: str, arrays: Mapping[str, Any]) -> None:
    """Write arrays under a digest; where the folder cannot be written, nothing is kept."""
    if os.environ.get("AIRLIGHT_CACHE_SIZE", "").strip() == "0":
        return
    buffer = BytesIO()
    np.savez(buffer, **{**arrays, _CHECK: np.int64(_checksum(arrays))})
    path = kept_path(digest)
    temporary = path.with_name(f".{path.stem}-{uuid.uuid4().hex}.npz")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(buffer.getvalue())
        os.replace(temporary, path)
    except OSError:
        with suppress(OSError):
            temporary.unlink()


def _checksum(arrays: Mapping[str, Any]) -> int:
    check = 0
    for name in sorted(arrays):
        check = zlib.crc32(np.ascontiguousarray(arrays[name]).tobytes(), zlib.crc32(name.encode(), check))
    return check
