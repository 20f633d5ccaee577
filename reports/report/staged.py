# SPDX-License-Identifier: BSD-3-Clause
"""A folder of results that is out of sight until it is whole."""

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from airlight.errors import InputError
from airlight.reference.storage.files import NO_SPACE, alone

_PREFIX = ".airlight-report-"
_LAST = (".json", ".html")  #: name all others


@contextmanager
def staged(target: Path, named: Callable[[Path], Iterable[str]]) -> Iterator[Path]:
    """Give a hidden folder in `target` whose files move there when the block
    ends without an exception.

    Files of the same name are replaced one by one, the page and its data last; images that only the
    results before named go, all else stays: `named` returns their names from a folder. Any
    exception, a KeyboardInterrupt too, leaves the target as it was; that of a full disk names the
    target. Raises InputError if another process is writing a report there.
    """
    # A killed run leaves its hidden folder behind; it is removed after a day, as a younger one may
    # belong to a run that is still at work.
    for left in target.glob(f"{_PREFIX}*"):
        with suppress(FileNotFoundError):  # another report has ended since
            if time.time() - left.stat().st_mtime > 86400:
                shutil.rmtree(left, ignore_errors=True)
    hidden = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=target))
    try:
        with alone(target):
            yield hidden
            _move(hidden, target, named)
    except OSError as error:
        if error.errno in NO_SPACE:  # what was being written is a name that nobody knows
            raise OSError(error.errno, error.strerror, str(target)) from error
        raise
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _move(hidden: Path, target: Path, named: Callable[[Path], Iterable[str]]) -> None:
    """Move the files of a hidden folder into the target, and remove the images that only
    the results before named.
    """
    # The names of the old results, before their data are replaced.
    files, before = [path for path in hidden.rglob("*") if path.is_file()], set[Path]()
    with suppress(InputError):  # there was none, or of another version
        before = {target / name for name in named(target)}
    # Images first, page and data last: a reader who opens the page meanwhile finds every image that
    # it names.
    for path in sorted(files, key=lambda file: (file.suffix in _LAST, file)):
        place = target / path.relative_to(hidden)
        place.parent.mkdir(parents=True, exist_ok=True)
        os.replace(path, place)
        before.discard(place)
    # Images of the old results that the new ones have not.
    for path in before:
        path.unlink(missing_ok=True)
