# SPDX-License-Identifier: BSD-3-Clause
"""Small repositories for tests of what git is asked."""

import os
import subprocess
from pathlib import Path

#: A world with a name for commits, and without the settings of who runs the tests.
WORLD = (
    {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    | {
        "GIT_CONFIG_GLOBAL": os.devnull,
        "GIT_CONFIG_NOSYSTEM": "1",
    }
    | {
        f"GIT_{who}_{what}": "tester@example.org"
        for who in ("AUTHOR", "COMMITTER")
        for what in ("NAME", "EMAIL")
    }
)


def git(root: Path, *words: str) -> str:
    """Return what git prints."""
    ran = subprocess.run(
        ["git", *words], cwd=root, env=WORLD, capture_output=True, text=True, check=True
    )
    return ran.stdout.strip()


def write(root: Path, files: dict[str, str]) -> None:
    """Write files, and the folders that they need."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8", newline="\n")


def commit(root: Path, message: str) -> str:
    """Commit all files, in a repository that is made if there is none, and return the commit."""
    if not (root / ".git").exists():
        git(root, "init", "--quiet", "--initial-branch=main")
    git(root, "add", "--all")
    git(root, "commit", "--quiet", "--message", message)
    return git(root, "rev-parse", "HEAD")
