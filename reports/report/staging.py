# SPDX-License-Identifier: BSD-3-Clause
"""A folder in which a report grows, out of sight until it is whole."""

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from reference.storage.files import NO_SPACE

_PREFIX = ".airlight-report-"
_STALE = 86400.0  # seconds after which the remains of a killed run are removed


@contextmanager
def staged(target: Path) -> Iterator[Path]:
    """Give a hidden folder in `target` whose files move there when the block ends without an exception.

    Files of the same name are replaced one by one, the page and its data last; others stay. Any exception, a
    KeyboardInterrupt too, leaves the target as it was; that of a full disk names the target.
    """
    for left in target.glob(f"{_PREFIX}*"):
        if time.time() - left.stat().st_mtime > _STALE:
            shutil.rmtree(left, ignore_errors=True)
    hidden = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target))
    try:
        yield hidden
        files = [path for path in hidden.rglob("*") if path.is_file()]
        for path in sorted(files, key=lambda file: (file.parent == hidden, file)):
            place = target / path.relative_to(hidden)
            place.parent.mkdir(parents=True, exist_ok=True)
            os.replace(path, place)
    except OSError as error:
        if error.errno in NO_SPACE:  # what was being written is a name that nobody knows
            raise OSError(error.errno, error.strerror, str(target)) from error
        raise
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
