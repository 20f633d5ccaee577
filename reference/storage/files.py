# SPDX-License-Identifier: BSD-3-Clause
"""Files written whole or not at all.

A file is first written under a hidden name in the folder where it belongs, flushed to the disk, and
then moved over its final name, which POSIX and Windows both do in one step. A process that is
killed half-way leaves the old file as it was, and the hidden file beside it, which is removed when
it is an hour old and something is written there again.
"""

import errno
import fcntl
import os
import re
import shutil
import stat
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from airlight.errors import InputError

#: Errors of the system when a disk is full, a quota used up, or a file larger than allowed.
NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

_HIDDEN = re.compile(r"\..*-[0-9a-f]{32}(\.\w+)?")  # the names of unfinished files
_FOLDER = ".airlight-unfinished-"  # the first letters of temporary folders
_STALE = 3600.0  # seconds after which an unfinished file belongs to nobody


def ensure_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder with its parents, and prove that files can be written into it.

    Call this before any work is done: it costs one empty temporary file. Permission bits would say
    nothing about a read-only or full disk, nor about the superuser.

    `path`: the folder; it may exist already. Returns Path: the folder. Raises InputError if the
    path is not a folder, or the folder cannot be made or written.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(
            f"the output folder {folder} cannot be made: {_obstacle(folder)} is not a folder; give "
            "another place"
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"cannot write into the folder {folder}: {reason}; give a folder that can be written"
        ) from error
    return folder


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Let no other process write its results into a folder before the block ends.

    The lock is the system's, on the folder itself: it leaves no file, and goes with a process that
    is killed. Raises InputError if another process is writing there.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some network file systems know no locks
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    f"output: another run is writing into {folder}; wait until it has ended, or "
                    "give another folder"
                ) from None
        yield
    finally:
        os.close(handle)


def ensure_writable(path: str | os.PathLike[str]) -> Path:
    """Prove before any work is done that a file can be written there; make its folder.

    Raises InputError if `path` is a folder or a device, or its folder cannot be written.
    """
    target = Path(path)
    try:
        # The path is resolved, so that a symbolic link keeps pointing to the file that it names.
        target = target.resolve()
        mode = target.stat().st_mode if target.exists() else stat.S_IFREG
    except (OSError, ValueError) as error:
        raise InputError(f"cannot write the file {path!r}: {error}; give another name") from error
    # If the superuser moves a file over a device such as /dev/null, the device is replaced.
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        raise InputError(f"cannot write the file {path}: it is {kind}; give the name of a file")
    ensure_folder(target.parent)
    return target


@contextmanager
def atomic_path(path: str | os.PathLike[str], *, flush: bool = True) -> Iterator[Path]:
    """Give the name of a temporary file that becomes `path` when the block
    ends without an exception.

    The temporary file lies in the same folder, so that the move is one step, and has the same
    suffix, so that a writer that picks the format by the suffix works. Any exception, a
    KeyboardInterrupt too, removes it and leaves `path` as it was.

    `path`: the file to write; its folder is made if needed; `flush`: wait for the disk, so that the
    file is whole after a loss of power too. The block writes the file that is yielded. Raises
    InputError if `path` cannot be written, and OSError, which names `path`, if the disk is full.
    """
    target = ensure_writable(path)
    sweep_hidden(target.parent)
    # Files of `tempfile` would stay readable by their owner alone. Systems limit the bytes of a
    # name, and a letter has up to four bytes.
    stem = os.fsdecode(os.fsencode(target.stem)[:100])
    temporary = target.with_name(f".{stem}-{uuid.uuid4().hex}{target.suffix}")
    try:
        yield temporary
        if flush:
            _flush(temporary)
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.errno in NO_SPACE:
            # A failed write names no file of its own, and a failed flush the temporary one.
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Give a folder that is removed when the block ends; folders that killed processes
    left a day ago go first.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{_FOLDER}*"):
        if _age(folder) > 24 * _STALE:
            shutil.rmtree(folder, ignore_errors=True)
    # A program that was ended may still write there: a later call removes what is left.
    with tempfile.TemporaryDirectory(prefix=_FOLDER, ignore_cleanup_errors=True) as name:
        yield Path(name)


def sweep_hidden(folder: Path) -> None:
    """Remove the unfinished files that killed processes left in a folder an hour ago."""
    for path in folder.glob(".*"):
        if _HIDDEN.fullmatch(path.name) and _age(path) > _STALE:
            with suppress(OSError):  # another process has just removed it
                path.unlink()


def _age(path: Path) -> float:
    try:
        return time.time() - path.lstat().st_mtime
    except OSError:  # another process has just removed it
        return 0.0


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8 with line feeds, whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], data: bytes, *, flush: bool = True) -> None:
    """Write a file, whole or not at all; `flush` as of `atomic_path`."""
    with atomic_path(path, flush=flush) as temporary:
        temporary.write_bytes(data)


def _flush(path: Path) -> None:
    """Wait until the content is on the disk: the move must not overtake it."""
    with open(path, "rb+") as stream:
        os.fsync(stream.fileno())


def _obstacle(folder: Path) -> Path:
    """Return the part of the path that exists and is no folder."""
    for part in (*reversed(folder.parents), folder):
        if part.exists() and not part.is_dir():
            return part
    return folder
