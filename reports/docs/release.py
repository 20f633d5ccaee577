# SPDX-License-Identifier: BSD-3-Clause
"""A release: version, citation and changelog of one number, and a source distribution and a wheel of them.

`python -m reports.docs.release 1.0.0` writes the number into `reports/__init__.py`, `CITATION.cff` and `CHANGELOG.md`,
builds both distributions from the files that git tracks, and looks what they hold. Nothing is uploaded, nothing is
committed: it ends with the lines to type for that.
"""

import datetime
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

from analytic.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("analytic", "realtime", "reference", "validation", "reports")
_VERSION = re.compile(r"\d+\.\d+\.\d+(?:(?:a|b|rc)\d+)?")
_APART = ("reports/images/", "validation/baselines/thousand/")  #: pictures and rows of the pages, in no wheel


def tracked(root: Path = ROOT) -> list[str]:
    """Return the files that belong to the project, by git.

    Raises
    ------
    InputError
        If the folder is no checkout.
    """
    ran = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True)
    if ran.returncode:
        raise InputError(f"{root} is no git checkout, so what belongs to a release is unknown: clone the repository")
    return [name for name in ran.stdout.split("\0") if name and (root / name).is_file()]


def wheel_files(names: list[str]) -> set[str]:
    """Return what a wheel of these files must hold: the packages and `airlight.py`, nothing else."""
    packages = tuple(f"{name}/" for name in PACKAGES)
    return {
        name for name in names if name == "airlight.py" or (name.startswith(packages) and not name.startswith(_APART))
    }


def numbered(version: str, root: Path, *, today: str) -> list[str]:
    """Write the version into the files that state it; return their names.

    Raises
    ------
    InputError
        For what is no version, and where the changelog has nothing under *Unreleased*.
    """
    if not _VERSION.fullmatch(version):
        raise InputError(f"release: got {version!r}, wanted a version such as 1.0.0 or 1.0.0rc1")
    changelog = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    heading = f"## [{version}] - {today}"
    # Once more for a version that is there: the date moves, nothing else.
    written, found = re.subn(rf"^## \[{re.escape(version)}\].*$", heading, changelog, flags=re.MULTILINE)
    if not found:
        written, found = re.subn(r"^## \[Unreleased\]\s*?$", heading, changelog, count=1, flags=re.MULTILINE)
    if not found:
        raise InputError(f"CHANGELOG.md: wanted a heading ## [Unreleased] or ## [{version}]")
    written = written.replace(" No version has been\nreleased yet.", "")
    texts = {"CHANGELOG.md": written}
    for name, pattern, line in (
        ("reports/__init__.py", r'^__version__ = ".*"$', f'__version__ = "{version}"'),
        ("CITATION.cff", r"^version: .*(?:\ndate-released: .*)?$", f"version: {version}\ndate-released: {today}"),
    ):
        texts[name], found = re.subn(pattern, line, (root / name).read_text(encoding="utf-8"), flags=re.MULTILINE)
        if found != 1:
            raise InputError(f"{name}: wanted one line {line.splitlines()[0]!r}, found {found}")
    for name, text in texts.items():
        (root / name).write_text(text, encoding="utf-8", newline="\n")
    return list(texts)


def built(root: Path, target: Path, names: list[str]) -> list[Path]:
    """Build the source distribution and the wheel of it in a copy of the project; return both, checked.

    Raises
    ------
    InputError
        If building fails, or the wheel holds anything but the packages.
    """
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="airlight-release-") as folder:
        source, out = Path(folder, "source"), Path(folder, "out")
        for name in names:
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, source / name)
        sdist = _by_setuptools("build_sdist", source, out)
        with tarfile.open(sdist) as archive:
            archive.extractall(Path(folder, "unpacked"), filter="data")
        (unpacked,) = Path(folder, "unpacked").iterdir()
        wheel = _by_setuptools("build_wheel", unpacked, out)
        _check_wheel(wheel, wheel_files(names))
        return [Path(shutil.copy2(path, target / path.name)) for path in (sdist, wheel)]


def _by_setuptools(hook: str, source: Path, out: Path) -> Path:
    """Call a hook of the build backend in a process of its own, as pip and build do; return what it wrote."""
    out.mkdir(exist_ok=True)
    program = f"import sys, setuptools.build_meta as backend; print(backend.{hook}(sys.argv[1]))"
    environment = os.environ | {"PYTHONPATH": ""}
    command = [sys.executable, "-c", program, str(out)]
    ran = subprocess.run(command, cwd=source, env=environment, capture_output=True, text=True)
    if ran.returncode:
        raise InputError(f"release: {hook} failed: {(ran.stderr.strip() or 'without a word').splitlines()[-1]}")
    return out / ran.stdout.splitlines()[-1]


def _check_wheel(wheel: Path, expected: set[str]) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if not name.endswith("/") and ".dist-info/" not in name}
    if held != expected:
        strange = ", ".join(sorted(held ^ expected)[:5])
        raise InputError(f"release: the wheel does not hold the packages and nothing else: {strange}")


def main(arguments: list[str]) -> int:
    """Make a release; return the exit status."""
    if len(arguments) != 1:
        print("usage: python -m reports.docs.release VERSION, for example 1.0.0", file=sys.stderr)
        return 2
    version = arguments[0]
    try:
        names = tracked()
        changed = numbered(version, ROOT, today=datetime.date.today().isoformat())
        made = built(ROOT, ROOT / "dist", names)
    except InputError as error:
        print(f"airlight: error: {error}", file=sys.stderr)
        return 2
    for path in made:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e6:.1f} MB, sha256 {digest}")
    print("\nThe numbers are written. What is left, once the tests pass (./airlight test --all):\n")
    print(f"git commit -m 'Release {version}' {' '.join(changed)}")
    print(f"git tag -a v{version} -m 'airlight {version}'")
    print("git push --follow-tags")
    print(f"python -m pip install twine && python -m twine upload {' '.join(str(p.relative_to(ROOT)) for p in made)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
