# SPDX-License-Identifier: BSD-3-Clause
"""The documents name only what exists: files, folders, modules, what is in them, environment variables.

That commands, options and links exist is tested in `test_readme.py`.
"""

import importlib
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = sorted(path.relative_to(ROOT) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
PACKAGES = ("analytic", "realtime", "reference", "validation", "reports", "tests")
#: Files that a reader of the documents writes, or might.
THE_READERS = {"fog.py", "twelve.py", "file.py", "path/to/file.py", "docs/NAME.md"}


def missing_files(text: str, folder: Path) -> list[str]:
    """Return the Python files and the paths in the project that a document names and that do not exist."""
    named = set(re.findall(r"[\w./-]+\.py\b", text))
    named |= {path.rstrip(".") for path in re.findall(rf"(?<![\w/.-])(?:{'|'.join(PACKAGES)}|docs)/[\w./*-]*", text)}
    named -= THE_READERS
    known = {path.name for path in ROOT.glob("*.py")} | {path.name for name in PACKAGES for path in _sources(name)}
    return sorted(
        name
        for name in named
        if not (any(ROOT.glob(name)) or (folder / name).exists() or ("/" not in name and name in known))
    )


@cache
def _sources(package: str) -> list[Path]:
    return list((ROOT / package).rglob("*.py"))


def missing_names(text: str) -> list[str]:
    """Return what a document names as `package.module.name` or `name` (`file.py`) and that does not exist."""
    dotted = set(re.findall(rf"(?<![\w./-])(?:{'|'.join(PACKAGES[:-1])})(?:\.[A-Za-z_]\w*)+", text))
    dotted = {name for name in dotted if not name.endswith((".md", ".html"))}
    dotted |= {
        f"{path.removesuffix('.py').replace('/', '.')}.{name}"
        for name, path in re.findall(r"`(\w+)`\s+\(`([\w/]+/\w+\.py)`\)", text)
    }
    return sorted(name for name in dotted if not _exists(name))


def _exists(name: str) -> bool:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        module, _, attribute = name.rpartition(".")
        return bool(module) and _exists(module) and hasattr(importlib.import_module(module), attribute)
    return True


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_files_and_folders_that_documents_name_exist(document):
    assert missing_files((ROOT / document).read_text(encoding="utf-8"), (ROOT / document).parent) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_modules_and_names_in_them_that_documents_name_exist(document):
    assert missing_names((ROOT / document).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_environment_variables_that_documents_name_are_read(document):
    sources = [ROOT / "airlight", *(path for name in PACKAGES for path in _sources(name))]
    read = set().union(*(re.findall(r"\bAIRLIGHT_[A-Z_]+", path.read_text(encoding="utf-8")) for path in sources))
    assert set(re.findall(r"\bAIRLIGHT_[A-Z_]+", (ROOT / document).read_text(encoding="utf-8"))) <= read


def test_what_does_not_exist_is_found():
    text = (
        "`realtime/frame/renderer.py`, [`renderer.py`](../realtime/frame/renderer.py), `analytic/`, `fog.py`, "
        "`realtime/nowhere/`, `reports/figures/*.py`, `realtime/frame.py`, `nothing.py`, "
        "[it](../reference/lit_balls.py)"
    )
    wanted = ["../reference/lit_balls.py", "nothing.py", "realtime/frame.py", "realtime/nowhere/"]
    assert missing_files(text, ROOT / "docs") == wanted
    text = (
        "`realtime.kernels.registry.KERNELS`, `realtime.plan`, `realtime.kernels.registry.PLANS`, [x](api-other.md)\n"
        "`KERNELS`\n(`realtime/kernels/registry.py`), `NONE` (`realtime/kernels/registry.py`)"
    )
    wanted = ["realtime.kernels.registry.NONE", "realtime.kernels.registry.PLANS", "realtime.plan"]
    assert missing_names(text) == wanted
