# SPDX-License-Identifier: BSD-3-Clause
"""Digests of code: the code that computes a result is an input of it.

A module counts with all modules of ours that it imports, directly or not, as Python compiles them,
without comments, docstrings and line numbers: a new wording of these makes no result old. Data
count with the code that may read them: the files in the folders of these modules (tables of scenes,
certified values, claims), and the files beside a module of the user's, or in folders there, that
the module names. The versions of Mitsuba, Dr.Jit, NumPy and SciPy count too.
"""

import hashlib
import marshal
import os
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from types import CodeType

_ROOT = Path(__file__).resolve().parents[2]
# of the package `airlight`
_FOLDERS = ("analytic", "realtime", "reference", "validation", "reports")
_VERSIONS = ("mitsuba", "drjit", "numpy", "scipy")
_CODE = (".py", ".pyc")


@lru_cache(maxsize=256)  # the code that this process runs stays what it was when it was imported
def source_digest(*modules: str) -> str:
    """Return a digest of modules by name, of what they import and of the versions of packages."""
    files = [_modules().get(name) or Path(str(sys.modules[name].__file__)) for name in modules]
    versions = repr([(name, version(name)) for name in _VERSIONS])
    return hashlib.sha256(f"{versions} {code_digest(files)}".encode()).hexdigest()


def code_digest(starts: Iterable[Path]) -> str:
    """Return a digest of the code of some files and of all code of ours or the user's that they
    import.

    A file of the user's may lie anywhere; it may import the modules beside it and those of its
    package.
    """
    # Follow imports from file to file.
    paths = [path.resolve() for path in starts]
    digests: dict[Path, bytes] = {}
    data: set[Path] = set()
    while paths:
        path = paths.pop()
        if path not in digests:
            digests[path], names = _compiled(path, path.stat().st_mtime_ns)
            paths += _imported(path, names)
            data |= set(_data(path.parent) if _is_ours(path) else _named_data(path.parent, names))
    digests |= {path: hashlib.sha256(_source(path)).digest() for path in data}

    # Not the whole paths: the same code has the same digest wherever it is installed.
    digest = hashlib.sha256()
    for path in sorted(digests):
        place = path.relative_to(_ROOT).as_posix() if _is_ours(path) else path.name
        digest.update(f"|{place} ".encode() + digests[path])
    return digest.hexdigest()


@lru_cache(maxsize=1024)
def _compiled(path: Path, changed: int) -> tuple[bytes, frozenset[str]]:
    """Return a digest of the code of a file, and the names and words in it, among which are the
    names of the modules that it imports.
    """
    names: set[str] = set()
    try:
        code = _bare(
            compile(_source(path), path.name, "exec", dont_inherit=True, optimize=2), names
        )
    except (SyntaxError, ValueError):  # a file of the user's: what runs it says so
        return hashlib.sha256(_source(path)).digest(), frozenset()
    # Version 2 of the format has no references, which depend on what else is in memory.
    return hashlib.sha256(marshal.dumps(code, 2)).digest(), frozenset(names)


def _bare(code: CodeType, names: set[str]) -> CodeType:
    """Return code without its places in the file, and add its names and words to `names`."""
    names.update(code.co_names, _words(code.co_consts))
    constants = tuple(
        _bare(each, names) if isinstance(each, CodeType) else each for each in code.co_consts
    )
    return code.replace(co_consts=constants, co_filename="", co_firstlineno=1, co_linetable=b"")


def _words(constants: Iterable[object]) -> Iterator[str]:
    """Yield the words among constants, also those in tuples and sets: a registry may name modules
    by them.
    """
    for each in constants:
        if isinstance(each, str):
            yield each
        elif isinstance(each, tuple | frozenset):
            yield from _words(each)


def _imported(path: Path, names: Iterable[str]) -> Iterator[Path]:
    """Yield the files of the modules that a file may import, by the names that it mentions."""
    if _is_ours(path):
        ours = _modules()
        for name in ours.keys() & names:
            yield ours[name]
            if ours[name].name == "__init__.py":
                yield from (ours[inside] for part in names if (inside := f"{name}.{part}") in ours)
        return
    # A module of the user's: its own folder, and the folders of the packages around it.
    folders = [path.parent]
    while (folders[-1] / "__init__.py").exists():
        folders.append(folders[-1].parent)
    words = [name for name in names if name.replace(".", "").isidentifier()]
    for folder in folders:
        if folder.name in ("site-packages", "dist-packages"):
            continue
        for place in (folder.joinpath(*name.split(".")) for name in words):
            # A name that is mentioned may be a module, a package, or a module in a package.
            package = place / "__init__.py"
            parts = [place / f"{part}.py" for part in words] if package.is_file() else []
            yield from filter(Path.is_file, (place.with_name(f"{place.name}.py"), package, *parts))


def _data(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder of ours that are no modules, also those in folders below it that
    have no modules.
    """
    for path in folder.iterdir():
        if path.is_dir() and path.name != "__pycache__" and not any(path.glob("*.py")):
            yield from _data(path)
        elif path.is_file() and path.suffix not in _CODE:
            yield path


def _named_data(folder: Path, names: Iterable[str]) -> Iterator[Path]:
    """Yield the files beside a module of the user's, or in a folder there, that it names and that
    are no modules.
    """
    # A path may stand in one word, 'tables/a.csv', or in two, a folder and a name.
    words = [name for name in names if name and not os.path.isabs(name) and ".." not in name]
    folders = [folder, *(folder / name for name in words if os.path.isdir(folder / name))]
    for path in {place / name for place in folders for name in words}:
        if path.suffix not in _CODE and os.path.isfile(path):  # False for words that are no path
            yield path


def _source(path: Path) -> bytes:
    return path.read_bytes()


@lru_cache(maxsize=1)
def _modules() -> dict[str, Path]:
    """Return the files of our modules and packages by name."""
    paths = [path for folder in _FOLDERS for path in (_ROOT / folder).rglob("*.py")]
    parts = {path: path.relative_to(_ROOT).with_suffix("").parts for path in paths}
    return {
        ".".join(["airlight", *names]).removesuffix(".__init__"): path
        for path, names in parts.items()
    }


def _is_ours(path: Path) -> bool:
    return path.is_relative_to(_ROOT) and path.relative_to(_ROOT).parts[0] in _FOLDERS
