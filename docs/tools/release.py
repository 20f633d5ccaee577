# SPDX-License-Identifier: BSD-3-Clause
"""A release is a commit: `python docs/tools/release.py` makes it, its tag and its files.

The number is that of the stamp, `__version__` in `src/airlight/__init__.py`, without `.dev0`;
another number is another stamp, in a commit of its own. In a worktree beside the checkout the tool
commits the release (the stamp, the heading of `CHANGELOG.md`, `CITATION.cff`) and the stamp of the
next version, and makes in `dist/NUMBER` of the release alone:

- the source distribution and the wheel, which say of which commit they are;
- `airlight-NUMBER-docs.tar.gz`, the site, and `airlight-NUMBER-certified.tar.gz`, the
  certified scenes and values;
- `airlight-NUMBER.md`, the section of the changelog, and `SHA256SUMS`.

When all files are there, the branch gets the two commits and the first one the tag `vNUMBER`; `git
push --follow-tags` publishes them. `--dry-run` makes the files and leaves branch and tags alone.

It refuses changed files, a number that was released, an empty `[Unreleased]`, a run of all tests
that failed or is of other code than this, and an error that moved since the last release where no
entry names its scene or its method.
"""

import argparse
import gzip
import hashlib
import io
import json
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
STAMP, CHANGELOG, CITATION = "src/airlight/__init__.py", "CHANGELOG.md", "CITATION.cff"
RECORD = "docs/data/full_run.json"
#: The files that all tests are a test of: where one changes, they must run again. Pages and
#: their data are none of it.
CODE = (
    *("analytic", "realtime", "reference", "validation", "reports", "src", "tests"),
    *("airlight", "setup.py", "pyproject.toml", ":(glob)*.lock"),
)
#: Errors that are kept, by scene and configuration; and certified values, a row each.
ERRORS = ("tests/evidence/baselines", "docs/data/replicate.json")
CERTIFIED = "validation/certified"
_ERRORS_WITHIN = ("error", "airlight", "surface", "surface_error")  # keys that hold errors
_VERSION = re.compile(r'^__version__ = "(\d+)\.(\d+)\.(\d+)(\.dev0)?"', flags=re.MULTILINE)
_UNRELEASED = "## [Unreleased]\n"


class RefusedError(Exception):
    """The reasons why there is no release, a sentence a line."""


# Questions to a checkout --------------------------------------------------------------------------


def git(root: Path, *words: str) -> str:
    """Return what git prints; raises RefusedError in its words where it fails."""
    ran = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise RefusedError(f"git {words[0]}: {ran.stderr.strip() or ran.stdout.strip()}")
    return ran.stdout


def _holds(root: Path, *words: str) -> bool:
    """Return whether git says yes; no git, and no repository, do not."""
    with suppress(FileNotFoundError):
        return (
            subprocess.run(["git", *words], cwd=root, capture_output=True, check=False).returncode
            == 0
        )
    return False


def stamped_number(root: Path) -> tuple[str, bool]:
    """Return the number of the stamp, and whether it is still to be released."""
    found = _VERSION.search((root / STAMP).read_text(encoding="utf-8"))
    if found is None:
        raise RefusedError(f'{STAMP}: expected __version__ = "X.Y.Z" or "X.Y.Z.dev0"')
    return ".".join(found.groups()[:3]), found[4] is not None


def unreleased(root: Path) -> str:
    """Return the entries of the changelog that no release has."""
    text = (root / CHANGELOG).read_text(encoding="utf-8")
    if _UNRELEASED not in text:
        raise RefusedError(f"{CHANGELOG} has no heading {_UNRELEASED.strip()!r}")
    return text.split(_UNRELEASED, 1)[1].split("\n## ", 1)[0].strip()


def stamp_problems(root: Path) -> Iterator[str]:
    """Yield what contradicts the stamp: in the changelog, in the citation, or in code
    behind the tag of its number.
    """
    number, open_ = stamped_number(root)
    released = re.findall(
        r"^## \[(\d[^\]]*)\]", (root / CHANGELOG).read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    if open_ and number in released:
        yield f"{STAMP} says {number}.dev0, and {CHANGELOG} has a section [{number}]: that number was released"
    if not open_ and released[:1] != [number]:
        yield f"{STAMP} says {number}, expected .dev0 behind it or [{number}] as the newest section of {CHANGELOG}"
    if not open_ and unreleased(root):
        yield f"{STAMP} says {number}, and {CHANGELOG} has entries in [Unreleased]: the next stamp is due"
    cited = re.search(
        r"^version: (\S+)$", (root / CITATION).read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    expected = released[0] if released else f"{number}.dev0"
    if cited is None or cited[1] != expected:
        yield f"{CITATION} has the version {cited and cited[1]}, expected {expected}"
    tag = f"v{number}"
    tagged = _holds(root, "rev-parse", "--verify", "--quiet", f"refs/tags/{tag}")
    if tagged and (open_ or not _holds(root, "diff", "--quiet", tag, "--", *CODE)):
        yield f"the tag {tag} is of other code than this: the next stamp is due"


def problems(root: Path) -> Iterator[str]:
    """Yield what stands in the way of a release, a sentence each."""
    if git(root, "rev-parse", "--is-shallow-repository").strip() == "true":
        raise RefusedError(
            "a shallow clone does not know what was released: git fetch --unshallow --tags"
        )
    if changed := git(root, "status", "--porcelain").splitlines():
        yield f"{len(changed)} files are not as they were committed, such as {changed[0][3:]}: commit or remove them"
    if not stamped_number(root)[1]:
        yield f"{STAMP} has no .dev0: the number of its stamp was released; write the next one"
    yield from stamp_problems(root)
    if not unreleased(root):
        yield f"{CHANGELOG} has nothing in [Unreleased]: there is nothing to release"
    yield from _run_problems(root)
    yield from _unnamed(root)


def _run_problems(root: Path) -> Iterator[str]:
    """Yield why the record of all tests is none of this code, or no good one."""
    again = "run `./airlight test --all` and commit its record"
    try:
        run = json.loads((root / RECORD).read_text(encoding="utf-8"))
        commit, changed = str(run["commit"]), run.get("changed")
        failed, passed, compilation = int(run["failed"]), int(run["passed"]), run.get("compilation")
    except (OSError, ValueError, KeyError, TypeError) as error:
        yield f"{RECORD} is no record of a run of all tests ({error!r}): {again}"
        return
    if failed or not passed:
        yield f"{RECORD}: {failed} tests failed, {passed} passed; {again} when all pass"
    if compilation != "full":
        yield f"{RECORD}: kernels were compiled {compilation}, expected full; {again}"
    if changed is not False:
        yield f"{RECORD}: it is not known to be of the files of its commit; {again} in a clean checkout"
    if not _holds(root, "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}"):
        yield f"{RECORD}: its commit {commit} is not in this repository; {again}"
    elif since := git(root, "diff", "--name-only", commit, "HEAD", "--", *CODE).splitlines():
        yield f"{RECORD} is old: {len(since)} files of code changed since {commit[:12]}, such as {since[0]}; {again}"


# Numbers that moved -------------------------------------------------------------------------------


def last_release(root: Path) -> str | None:
    """Return the tag of the last release, None before the first."""
    asked = ("describe", "--tags", "--abbrev=0", "--match", "v[0-9]*")
    return git(root, *asked).strip() if _holds(root, *asked) else None


def _unnamed(root: Path) -> Iterator[str]:
    """Yield each error that moved since the last release and that no entry names by
    its scene or its method.

    Before the first release nobody has a number that could have moved.
    """
    tag = last_release(root)
    if tag is None:
        return
    named = set(re.findall(r"`([\w.-]+)", unreleased(root)))
    moved: dict[str, set[str]] = {}
    for name in git(
        root, "ls-tree", "-r", "--name-only", tag, "--", *ERRORS, CERTIFIED
    ).splitlines():
        before, path = git(root, "show", f"{tag}:{name}"), root / name
        after = path.read_text(encoding="utf-8") if path.is_file() else ""
        if name.startswith(CERTIFIED):
            if (
                set(before.splitlines()) - set(after.splitlines())
                and not {path.name, path.stem} & named
            ):
                yield f"values of {path.name} moved since {tag}: an entry of {CHANGELOG} must name the file"
        elif after:
            for scene, label in _moves(path.stem, json.loads(before), json.loads(after)):
                if not {scene, label.split(" ")[0]} & named:
                    moved.setdefault(label, set()).add(scene)
    for label, scenes in moved.items():
        where = ", ".join(sorted(scenes))
        yield f"errors of {label} moved since {tag} in {where}: an entry of {CHANGELOG} must name method or scene"


def _moves(stem: str, before: Any, after: Any) -> Iterator[tuple[str, str]]:
    """Yield the scenes and configurations of which an error moved by more than its band,
    in a baseline or a report.
    """
    from airlight.validation.statistics.noise import FLOORS, error_band

    now = dict(_numbers(after))
    for keys, old in _numbers(before):
        new, name = now.get(keys), keys[-1]
        if new is None or "times" in keys or not set(keys) & set(_ERRORS_WITHIN):
            continue
        if name in (*FLOORS, "nonfinite") and abs(new - old) > error_band(name, old):
            # scenes, SCENE, methods, LABEL; in a baseline configurations, LABEL
            of_report = keys[0] == "scenes"
            yield (keys[1], keys[3]) if of_report and len(keys) > 4 else (stem, keys[1])


def _numbers(data: Any, *keys: str) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield the numbers of JSON by their keys; an entry of a list has its
    label or its name as one.
    """
    if isinstance(data, list):
        labels = (
            each.get("label", each.get("name")) if isinstance(each, dict) else None for each in data
        )
        data = {str(label or place): each for place, (label, each) in enumerate(zip(labels, data))}
    if isinstance(data, dict):
        for key, each in data.items():
            yield from _numbers(each, *keys, key)
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield keys, float(data)


# The release --------------------------------------------------------------------------------------


def release(root: Path, target: Path, *, dry_run: bool, site: bool = True) -> list[Path]:
    """Make the release of a checkout and return its files; raises RefusedError with
    all that stands in the way.
    """
    if found := list(problems(root)):
        raise RefusedError("\n".join(found))
    (number, _), section = stamped_number(root), unreleased(root)
    folder = target / number
    if folder.exists():
        raise RefusedError(f"{folder} is there already: remove it, or name another folder by -o")
    with tempfile.TemporaryDirectory(dir=_made(target)) as place:
        tree, files = Path(place, "tree"), _made(Path(place, "files"))
        with worktree(root, tree):
            # The release, and its files of nothing but it.
            date = datetime.now(UTC)
            commit = _release_commit(tree, number, date)
            (files / f"airlight-{number}.md").write_text(section + "\n", encoding="utf-8")
            _distributions(tree, files)
            _certified(tree, files / f"airlight-{number}-certified.tar.gz", date)
            if site:
                _site(tree, Path(place, "site"), files / f"airlight-{number}-docs.tar.gz", date)
            made = sorted(files.iterdir())
            sums = [
                f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in made
            ]
            (files / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
            after = _next_commit(tree, number)
        if not dry_run:
            git(root, "merge", "--quiet", "--ff-only", after)
            git(
                root,
                "tag",
                "--annotate",
                f"v{number}",
                commit,
                "--message",
                f"airlight {number}\n\n{section}",
            )
        files.rename(folder)
    return sorted(folder.iterdir())


@contextmanager
def worktree(root: Path, tree: Path) -> Iterator[None]:
    """Check the current commit out into another folder, for as long as the block takes."""
    git(root, "worktree", "add", "--quiet", "--detach", str(tree))
    try:
        yield
    finally:
        git(root, "worktree", "remove", "--force", str(tree))


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _edit(path: Path, pattern: str, text: str) -> None:
    """Replace the one place of a file that a pattern finds."""
    whole, count = re.subn(
        pattern, lambda _: text, path.read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    if count != 1:
        raise RefusedError(f"{path.name} has {count} places like {pattern}, expected one")
    path.write_text(whole, encoding="utf-8", newline="\n")


def _release_commit(tree: Path, number: str, date: datetime) -> str:
    """Commit the number of a release and return the commit."""
    day = f"{date:%Y-%m-%d}"
    _edit(tree / STAMP, _VERSION.pattern, f'__version__ = "{number}"')
    _edit(tree / CHANGELOG, f"^{re.escape(_UNRELEASED)}", f"{_UNRELEASED}\n## [{number}] - {day}\n")
    _edit(
        tree / CITATION,
        r"^version: .*\n(date-released: .*\n)?",
        f'version: {number}\ndate-released: "{day}"\n',
    )
    git(tree, "commit", "--quiet", "--all", "--message", f"airlight {number}")
    return git(tree, "rev-parse", "HEAD").strip()


def _next_commit(tree: Path, number: str) -> str:
    """Commit the stamp of the version behind a release and return the commit."""
    major, minor, patch = number.split(".")
    following = f"{major}.{minor}.{int(patch) + 1}.dev0"
    _edit(tree / STAMP, _VERSION.pattern, f'__version__ = "{following}"')
    git(
        tree,
        "commit",
        "--quiet",
        "--all",
        "--message",
        f"{following}: what follows the release of {number}",
    )
    return git(tree, "rev-parse", "HEAD").strip()


def _run(tree: Path, what: str, *words: str) -> None:
    """Run Python in a tree; what it prints is shown where it fails."""
    ran = subprocess.run(
        [sys.executable, *words], cwd=tree, capture_output=True, text=True, check=False
    )
    if ran.returncode:
        raise RefusedError(f"{what} could not be made:\n{ran.stdout}{ran.stderr}")


def _distributions(tree: Path, files: Path) -> None:
    """Write the source distribution and the wheel."""
    for kind in ("sdist", "wheel"):
        code = f"import sys, setuptools.build_meta as backend; backend.build_{kind}(sys.argv[1])"
        _run(tree, f"the {kind}", "-c", code, str(files))


def _certified(tree: Path, path: Path, date: datetime) -> None:
    """Write the archive of the certified scenes and values, with the page
    that says what they are.
    """
    data = git(tree, "ls-files", "--", f"{CERTIFIED}/*.csv", f"{CERTIFIED}/*.json").splitlines()
    names = (*data, "LICENSE", CITATION, "docs/formats.md")
    _pack(path, [(tree / name, Path(name).name) for name in names], date)


def _site(tree: Path, pages: Path, path: Path, date: datetime) -> None:
    """Build the documentation, and pack it."""
    options = ["-W", "--keep-going", "-q", "-b", "html"]
    _run(tree, "the site", "-m", "sphinx", *options, "-d", f"{pages}-trees", "docs", str(pages))
    built = (each for each in pages.rglob("*") if each.is_file() and each.name != ".buildinfo")
    _pack(path, [(each, each.relative_to(pages).as_posix()) for each in built], date)


def _pack(path: Path, files: Sequence[tuple[Path, str]], date: datetime) -> None:
    """Write an archive whose one folder has its name; the same files give the same bytes."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as archive:
        for file, name in sorted(files, key=lambda pair: pair[1]):
            entry = tarfile.TarInfo(f"{path.name.removesuffix('.tar.gz')}/{name}")
            content = file.read_bytes()
            entry.size, entry.mtime, entry.mode = len(content), int(date.timestamp()), 0o644
            archive.addfile(entry, io.BytesIO(content))
    path.write_bytes(gzip.compress(packed.getvalue(), mtime=int(date.timestamp())))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="make all files, and neither commit nor tag"
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "dist", help="the folder of dist/NUMBER"
    )
    asked = parser.parse_args()
    try:
        for written in release(ROOT, asked.output.resolve(), dry_run=asked.dry_run):
            print(written)
    except RefusedError as refused:
        sys.exit("\n".join(f"release: {line}" for line in str(refused).splitlines()))
