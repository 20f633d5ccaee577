# SPDX-License-Identifier: BSD-3-Clause
"""Which airlight this is: its version, its commit, and a digest of all its files.

A version names what was released, and all commits between two releases have one. Whatever is
printed or written names the commit and the digest beside it: they tell two commits apart, and a
changed file from the commit.

A checkout asks git once in a process, when the answer is first needed. A copy without git has
its commit in `src/airlight/commit.txt`: `git archive` fills it in, as `.gitattributes` says, and
`setup.py` does in wheels and source distributions, with the digest of the files then. A file that
was changed afterwards is noticed by that digest.

The digest is of bytes, comments too. The digests of `code.py`, which decide what is computed again,
leave comments out; this one takes a twentieth of a second in place of two, and is the same for
every version of Python. Nothing of ours is imported at the top, as `setup.py` runs this file where
no package is installed, and nothing that `airlight --help` would wait for.
"""

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

UNKNOWN = "unknown"
COMMIT = "commit.txt"  #: in the package
# that git sets for hooks of any project
_ELSEWHERE = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR")


@dataclass(frozen=True)
class Build:
    """The identity of this airlight."""

    airlight: str  #: version
    commit: str  #: 'unknown' where neither git nor the builder of the copy tells
    #: whether its files differ from those of the commit; None where nobody knows
    changed: bool | None
    digest: str  #: SHA-256 of the names and the bytes of all its files

    @property
    def words(self) -> str:
        """The version, the commit and the digest, as they are printed."""
        changes = " with changes" if self.changed else ""
        # Twelve digits of a commit or a digest are printed.
        return f"{self.airlight}, commit {self.commit[:12]}{changes}, files {self.digest[:12]}"


@cache  # the code that this process runs stays what it was when it was imported
def build() -> Build:
    """Return which airlight this process runs."""
    import airlight

    return build_of(Path(str(airlight.__file__)).parent, airlight.__version__)


def build_of(package: Path, version: str) -> Build:
    """Return which airlight a folder `airlight` with all its modules is."""
    digest, (first, *second) = package_digest(package), _written(package) or [UNKNOWN]
    if second:  # a wheel, or what was a source distribution
        return Build(version, first, second != [digest], digest)
    commit, changed = _asked(package) or (first, None)
    return Build(version, commit, changed, digest)


def commit_line(package: Path) -> str:
    """Return the content of `commit.txt` in a copy of a folder that has no git."""
    built = build_of(package, "")
    return " ".join(
        [
            built.commit,
            *([] if built.changed is None else ["changed" if built.changed else built.digest]),
        ]
    )


def package_digest(package: Path) -> str:
    """Return a digest of the files of the package, the same in a checkout and
    installed, on every system.
    """
    import hashlib

    paths = [
        Path(folder, name)
        for folder, _, names in os.walk(package, followlinks=True)
        for name in names
        if not (name.startswith(".") or name.endswith((".pyc", ".pyo")))
    ]
    # Line ends of Windows count as line feeds, so that a checkout has one digest everywhere.
    digest = hashlib.sha256()
    for name, path in sorted((path.relative_to(package).as_posix(), path) for path in paths):
        if name != COMMIT:
            content = hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()
            digest.update(f"{content}  {name}\n".encode())
    return digest.hexdigest()


def _written(package: Path) -> list[str]:
    """Return the words that a builder of a copy, or `git archive`, has left: a commit, and
    the digest of its files.
    """
    try:
        words = (package / COMMIT).read_text(encoding="utf-8").split()
    except OSError:
        return []
    return [] if words[:1] == ["$Format:%H$"] else words


def _asked(package: Path) -> tuple[str, bool] | None:
    """Ask git for the commit of a checkout, and whether files of the package differ; None
    where there is no answer.
    """
    import subprocess

    root = package.parents[1].resolve()
    # `.git` is a file in worktrees. The repository around an installed copy is not ours.
    if not (root / ".git").exists():
        return None
    # Only folders of the package count: a changed test or page does not change what is computed.
    folders = {
        str(each.resolve().relative_to(root))
        for each in (package, *package.iterdir())
        if each.is_dir()
    }
    command = [
        "git",
        "--no-optional-locks",
        "status",
        "--porcelain=v2",
        "--branch",
        "--",
        *sorted(folders),
    ]
    world = {name: value for name, value in os.environ.items() if name not in _ELSEWHERE}
    try:
        ran = subprocess.run(
            command,
            cwd=root,
            env=world,
            capture_output=True,
            text=True,
            timeout=30.0,  # [s]; a file system may be far away
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    lines = ran.stdout.splitlines()
    # A repository without a commit has the word (initial) in its place; lines without # name
    # changed files.
    commit = next(
        (line.split()[2] for line in lines if line.startswith("# branch.oid ")), "(initial)"
    )
    return (
        None if commit == "(initial)" else (commit, any(not line.startswith("#") for line in lines))
    )
