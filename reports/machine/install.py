# SPDX-License-Identifier: BSD-3-Clause
"""Installs airlight, what it needs and the packages of some extras into the environment of
the Python that runs it.

    .venv/bin/python -I reports/machine/install.py sweep view

The launcher runs this where nothing is installed but pip. Versions and checksums are those of
uv.lock: uv and pip, from any index, install these files or nothing.
"""

import os
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).resolve().parents[2]


def requirements(extras: Iterable[str], root: Path = _ROOT) -> list[str]:
    """Return a line with version and checksums for every package that airlight with some
    extras needs in this Python.

    Raises
    ------
    KeyError
        For an extra that is not declared.
    """
    from pip._vendor.packaging.markers import Marker

    packages = tomllib.loads((root / "uv.lock").read_text(encoding="utf-8"))["package"]
    (own,) = (each for each in packages if each["name"] == "airlight")
    # The lock is a graph: from the project's own needs on, every package that they need, each once
    # for each set of extras.
    waiting = [*_needs(own, extras), *own["dev-dependencies"]["launcher"]]
    lines, done = set(), set()
    while waiting:
        # A marker says for which Pythons and systems a package is needed.
        wanted = waiting.pop()
        name, inner = wanted["name"], wanted.get("extra", [])
        if (name, *inner) in done or (
            "marker" in wanted and not Marker(wanted["marker"]).evaluate()
        ):
            continue
        done.add((name, *inner))
        # Where Pythons need several versions of a package, the requirement names one.
        several = [each for each in packages if each["name"] == name]
        package = next(
            each for each in several if each["version"] == wanted.get("version", each["version"])
        )
        # The checksums of all files of the version: pip takes the one that fits the machine, and
        # refuses any other.
        files = [*package.get("wheels", []), *([package["sdist"]] if "sdist" in package else [])]
        lines.add(
            " ".join(
                [f"{name}=={package['version']}", *(f"--hash={file['hash']}" for file in files)]
            )
        )
        waiting += _needs(package, inner)
    return sorted(lines)


def _needs(package: dict[str, Any], extras: Iterable[str]) -> Iterator[dict[str, Any]]:
    yield from package.get("dependencies", [])
    for extra in extras:
        yield from package["optional-dependencies"][extra]


def install(
    extras: Sequence[str], root: Path = _ROOT, environment: Path = Path(sys.prefix)
) -> bool:
    """Install by uv, which takes a tenth of pip's time, or by pip, which knows
    the user's index and proxy.
    """
    listed, lines = environment / "airlight-packages.txt", requirements(extras, root)
    uv, pip = environment / "bin" / "uv", [sys.executable, "-m", "pip"]
    by_uv = [str(uv), "pip", "install", "--quiet", "--no-deps", "--python", sys.executable]
    by_pip = [*pip, "--disable-pip-version-check", "--no-input", "-qq", "install", "--no-deps"]
    # Both installers read one list.
    locked = ["--require-hashes", "-r", str(listed)]

    # Its own line of the lock brings uv.
    if not uv.exists():
        _write(listed, [line for line in lines if line.startswith("uv==")])
        _run(by_pip + locked, quiet=True)
    _write(listed, lines)
    # uv may fail where pip does not, behind a proxy for instance: its words are hidden, and pip's
    # are shown.
    installer = by_uv if _run(by_uv + locked, quiet=True) else by_pip
    if installer is by_pip:
        print(
            "airlight: uv cannot install here: pip installs the same versions, which takes longer",
            file=sys.stderr,
        )
        _write(listed, [line for line in lines if not line.startswith("uv==")])
        if not _run(by_pip + locked):
            return False

    # The project itself is links to the checkout: it is installed again only where its
    # declaration has changed.
    declared, installed = (
        (root / "pyproject.toml").read_bytes(),
        environment / "airlight-pyproject.toml",
    )
    if installed.exists() and installed.read_bytes() == declared:
        return True
    if not _run([*installer, "--no-build-isolation", "-e", str(root)]):
        return False
    installed.write_bytes(declared)
    return True


def _write(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _run(command: Sequence[str], *, quiet: bool = False) -> bool:
    """Return whether a command succeeded; settings of the user cannot turn
    it to another environment.
    """
    environment = {
        name: value for name, value in os.environ.items() if name != "UV_SYSTEM_PYTHON"
    } | {"PIP_USER": "0"}
    try:
        return (
            subprocess.run(
                command, env=environment, stderr=subprocess.DEVNULL if quiet else None
            ).returncode
            == 0
        )
    except OSError:
        return False


if __name__ == "__main__":
    try:
        sys.exit(not install(sys.argv[1:]))
    except KeyError as error:
        sys.exit(f"airlight: uv.lock has no extra {error}")
