# SPDX-License-Identifier: BSD-3-Clause
"""Builds the documentation with Sphinx in a process of its own, which imports every package to read its docstrings."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

from reports.machine.environment import MissingError
from reports.machine.progress import progress_bar

_NEEDED = {"sphinx": "sphinx", "myst_parser": "myst-parser", "furo": "furo"}
_PARTS = {"reading sources": (0.0, 0.6), "writing output": (0.6, 0.4)}
_PROGRESS = re.compile(r"(" + "|".join(_PARTS) + r")\.\.\. \[\s*(\d+)%\] (\S+)")


def source_folder() -> Path:
    """Return the folder of the documentation's sources.

    Raises
    ------
    MissingError
        If this is no source checkout.
    """
    folder = Path(__file__).resolve().parents[2] / "docs"
    if not (folder / "conf.py").is_file():
        raise MissingError(
            f"there is no documentation in {folder}, its sources come with the checkout only: clone the repository and "
            "run `./airlight docs` there"
        )
    return folder


def build_docs(source: Path, output: Path) -> str:
    """Build the pages and return the warnings of Sphinx.

    Parameters
    ----------
    source
        The folder of the sources, with `conf.py`.
    output
        Where the pages go.

    Raises
    ------
    MissingError
        If Sphinx or one of its extensions is not installed.
    analytic.errors.InputError
        If the folder cannot be written.
    """
    from reference.storage.files import ensure_folder, temporary_folder

    missing = [package for module, package in _NEEDED.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise MissingError(
            f"the documentation is built with {', '.join(missing)}, not installed here: run "
            f"`{sys.executable} -m pip install 'airlight[docs]'`, in a checkout `pip install -r requirements.lock`"
        )
    ensure_folder(output)
    with temporary_folder() as kept, progress_bar("docs") as progress:
        complaints = kept / "complaints.txt"
        command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "--no-color", "-b", "html"]
        command += ["-d", str(kept / "doctrees"), str(source), str(output)]
        with (
            complaints.open("w", encoding="utf-8") as stream,
            subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=stream, text=True, encoding="utf-8", errors="replace"
            ) as process,
        ):
            assert process.stdout is not None
            for line in process.stdout:
                told = _PROGRESS.search(line)
                if told:
                    begin, length = _PARTS[told[1]]
                    progress(begin + length * int(told[2]) / 100, told[3])
        status = process.returncode
        return complaints.read_text(encoding="utf-8").strip() or f"Sphinx ended with {status}" if status else ""
