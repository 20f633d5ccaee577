# SPDX-License-Identifier: BSD-3-Clause
"""Claims: any two commits, changed files and copies without git are told apart; nobody else's
commit is taken for ours.

A toy checkout stands for that of airlight: a package of which a link leads to a folder beside it.
"""

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from airlight.reference.storage.build import (
    COMMIT,
    Build,
    build,
    build_of,
    commit_line,
    package_digest,
)
from tests.helpers.git import commit, git, write

pytestmark = pytest.mark.claim("build-named")

ROOT = Path(__file__).resolve().parents[3]
FILES = {
    "analytic/panels.py": "NODES = 21\n",
    "src/airlight/__init__.py": "",
    f"src/airlight/{COMMIT}": "$Format:%H$\n",
    ".gitattributes": f"src/airlight/{COMMIT} export-subst\n",
    "README.md": "airlight\n",
}


@pytest.fixture
def checkout(tmp_path):
    """The folder of a committed checkout."""
    root = tmp_path / "checkout"
    write(root, FILES)
    (root / "src/airlight/analytic").symlink_to("../../analytic")
    commit(root, "first")
    return root


def seen(root: Path) -> Build:
    return build_of(root / "src/airlight", "0.9")


def installed(root: Path, place: Path) -> Path:
    """Return a copy of the package as a wheel of the checkout installs it."""
    shutil.copytree(root / "src/airlight", place / "airlight")
    (place / "airlight" / COMMIT).write_text(commit_line(root / "src/airlight") + "\n")
    return place / "airlight"


def test_a_checkout_names_its_commit_and_whether_its_code_was_changed(checkout):
    first = seen(checkout)
    assert (first.commit, first.changed) == (git(checkout, "rev-parse", "HEAD"), False)
    write(checkout, {"README.md": "fog\n", "out.exr": "an image of the user's"})
    assert seen(checkout) == first  # no code
    write(checkout, {"analytic/panels.py": "NODES = 15\n"})
    edited = seen(checkout)
    assert (edited.commit, edited.changed) == (first.commit, True)
    assert edited.digest != first.digest
    assert "with changes" in edited.words
    git(checkout, "checkout", "--quiet", "analytic")
    write(checkout, {"analytic/mine.py": ""})
    assert seen(checkout).changed, "a module that git does not know can be imported"


def test_commits_of_one_version_print_different_words(checkout):
    first = seen(checkout)
    write(checkout, {"README.md": "a commit of no code\n"})
    commit(checkout, "second")
    second = seen(checkout)
    assert first.words != second.words
    assert first.digest == second.digest


def test_an_installed_copy_names_the_commit_that_it_was_built_of_and_is_seen_to_change(
    checkout, tmp_path
):
    package, of = installed(checkout, tmp_path / "site"), seen(checkout)
    assert build_of(package, "0.9") == of
    (package / "analytic/panels.py").write_text("NODES = 15\n")
    assert build_of(package, "0.9").changed is True
    write(checkout, {"analytic/panels.py": "NODES = 7\n"})
    assert build_of(installed(checkout, tmp_path / "dirty"), "0.9").changed is True


def test_the_commit_of_a_repository_around_a_copy_is_not_ours(checkout, tmp_path, monkeypatch):
    write(tmp_path, {"notes.txt": "a repository of the user's"})
    (tmp_path / "site").mkdir()
    commit(tmp_path, "user's")
    (checkout / "src/airlight" / COMMIT).write_text("$Format:%H$\n")
    copy = tmp_path / "copy"
    shutil.copytree(checkout, copy, symlinks=True, ignore=shutil.ignore_patterns(".git"))
    assert (seen(copy).commit, seen(copy).changed) == ("unknown", None)
    monkeypatch.setenv("GIT_DIR", str(tmp_path / ".git"))  # as in a hook of that repository
    assert seen(checkout).commit == git(checkout, "rev-parse", "HEAD")


def test_an_archive_of_git_names_its_commit(checkout, tmp_path):
    git(checkout, "archive", "--output", str(tmp_path / "archive.tar"), "HEAD")
    with tarfile.open(tmp_path / "archive.tar") as archive:
        archive.extractall(tmp_path / "archive", filter="tar")
    found, of = seen(tmp_path / "archive"), seen(checkout)
    assert (found.commit, found.changed, found.digest) == (of.commit, None, of.digest)


@pytest.mark.parametrize("fault", ["no git", "no commit", "broken"])
def test_without_an_answer_of_git_the_commit_is_unknown(checkout, monkeypatch, fault):
    if fault == "no git":
        monkeypatch.setenv("PATH", "")
    else:
        shutil.rmtree(checkout / ".git")
        git(checkout, "init", "--quiet") if fault == "no commit" else (
            checkout / ".git"
        ).write_text("gitdir: gone\n")
    found = seen(checkout)
    assert (found.commit, found.changed) == ("unknown", None)
    assert found.words == f"0.9, commit unknown, files {found.digest[:12]}"


def test_the_digest_is_of_names_and_bytes_whatever_the_system_and_the_python(checkout):
    package = checkout / "src/airlight"
    before = package_digest(package)
    (checkout / "analytic/panels.py").write_bytes(b"NODES = 21\r\n")  # as git writes it on Windows
    (checkout / "analytic/__pycache__").mkdir()
    (checkout / "analytic/__pycache__/panels.cpython-311.pyc").write_bytes(b"\0")
    (checkout / "analytic/.panels.py.swp").write_bytes(b"\0")
    assert package_digest(package) == before
    (checkout / "analytic/panels.py").rename(checkout / "analytic/nodes.py")
    assert package_digest(package) != before


def test_git_is_asked_when_somebody_wants_to_know_and_not_by_an_import():
    code = (
        "import airlight.reports.commands.main as main\n"
        "from airlight.reference.storage.build import build\n"
        "main.run(['list', 'methods'])\n"
        "assert build.cache_info().misses == 0\n"
        "main.run(['--version'])\n"
        "assert build.cache_info().misses == 1\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=os.environ, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[-1] == f"airlight {build().words}"
