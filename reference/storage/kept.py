# SPDX-License-Identifier: BSD-3-Clause
"""Results that are kept between runs: references, batches, rays, parts of reports, rows of sweeps.

One rule names them all. The key of a result is a digest of

* the arguments of the function that computes it,
* the source code of that function's module and of all modules of ours that this imports, directly or not,
* the versions of Mitsuba, Dr.Jit, NumPy and SciPy.

Source code counts as Python compiles it, without comments, docstrings and line numbers: rewording one throws nothing
away. What a result took is the time to compute it from nothing: when a result is loaded, the time that it once took is
added to that of the result which is being computed from it.
"""

import hashlib
import inspect
import json
import marshal
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, is_dataclass
from functools import lru_cache, partial
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import numpy as np

from reference.storage.cache import is_stored, load_arrays, store_arrays

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("analytic", "realtime", "reference", "validation", "reports")
_VERSIONS = ("mitsuba", "drjit", "numpy", "scipy")
_FRESH = "AIRLIGHT_FRESH"  # results that are older count as missing [s since 1970]; child processes inherit it
_ABOUT = ("seconds", "processor", "made")  # what is stored beside the arrays of a result
_loaded = [0.0, 0.0]  # what the results took that this process has loaded, as `Spent`


class Spent(NamedTuple):
    """What a computation took."""

    seconds: float  #: [s]
    processor: float  #: of all threads of the process [s]


@dataclass(frozen=True)
class Kept:
    """A result, and what it took to compute it from nothing."""

    arrays: Mapping[str, Any]
    spent: Spent
    made: float  #: when [s since 1970]
    loaded: bool  #: whether it was kept already


def key_of(kind: str, /, *functions: Any, **arguments: Any) -> str:
    """Return the key under which a result is kept.

    `kind`: one or more words with dashes: a file name begins with it; `functions`: the functions that compute it, or
    names of modules of ours; `arguments`: what the result depends on besides: numbers, words, arrays, paths, and
    tuples, dictionaries and data classes of these.
    """
    content = {"arguments": arguments, "code": source_digest(*functions)}
    return f"{kind}-{hashlib.sha256(json.dumps(content, sort_keys=True, default=_plain).encode()).hexdigest()[:32]}"


def kept(key: str, compute: Callable[[], Mapping[str, Any]]) -> Kept:
    """Return the result of a key, or compute and keep it."""
    result = load(key)
    if result is not None:
        return result
    spent = stopwatch()
    return store(key, compute(), spent())


def load(key: str) -> Kept | None:
    """Return the result of a key; None if it is missing, damaged or, in a fresh run, older than the run."""
    loading = stopwatch()
    arrays = load_arrays(key) if is_kept(key) else None
    if arrays is None:
        return None
    seconds, processor, made = (float(arrays.pop(name)) for name in _ABOUT)
    took = loading()
    add_spent(Spent(seconds - took.seconds, processor - took.processor))
    return Kept(arrays, Spent(seconds, processor), made, True)


def store(key: str, arrays: Mapping[str, Any], spent: Spent) -> Kept:
    """Keep a result, and what it took."""
    made = time.time()
    store_arrays(key, {**arrays, **dict(zip(_ABOUT, (*spent, made)))})
    return Kept(arrays, spent, made, False)


def is_kept(key: str) -> bool:
    """Return whether there is a result under a key that `load` may return; damage is not looked for."""
    found = load_arrays(key, ("made",))
    return found is not None and float(found["made"]) >= float(os.environ.get(_FRESH, 0))


def is_damaged(key: str) -> bool:
    """Return whether there is a file under a key that cannot be read, or is not what was written."""
    return is_stored(key) and load_arrays(key) is None


@contextmanager
def fresh_results(since: float | None) -> Iterator[None]:
    """Within the block, results older than `since` [s since 1970] count as missing; None changes nothing.

    Processes that start in the block do the same.
    """
    before = os.environ.get(_FRESH)
    if since is not None:
        os.environ[_FRESH] = repr(since)
    try:
        yield
    finally:
        os.environ.pop(_FRESH, None)
        os.environ.update({} if before is None else {_FRESH: before})


def fresh_since() -> float | None:
    """Return since when results count in this block, None for always."""
    return float(os.environ[_FRESH]) if _FRESH in os.environ else None


def stopwatch() -> Callable[[], Spent]:
    """Return a function that says what it takes to compute from nothing what is computed from now on."""
    start = Spent(time.perf_counter() + _loaded[0], time.process_time() + _loaded[1])
    return lambda: Spent(time.perf_counter() + _loaded[0] - start[0], time.process_time() + _loaded[1] - start[1])


def add_spent(spent: Spent) -> None:
    """Count what another process spent, or what it once took to compute a result that was loaded."""
    _loaded[:] = [before + more for before, more in zip(_loaded, spent)]


def loaded_spent() -> Spent:
    """Return what it once took to compute all that this process has loaded."""
    return Spent(*_loaded)


def source_digest(*functions: Any) -> str:
    """Return a digest of the code that functions run: their modules, what these import, the versions of packages."""
    return _digest_of(tuple(sorted({path for function in functions if (path := _module(function)) is not None})))


def code_digest(starts: Iterable[Path]) -> str:
    """Return a digest of the code of some modules and of all that they import, as far as it is ours or the user's.

    From a file of the user's, which may lie anywhere, the modules beside it are followed, and those of its package.
    """
    waiting, seen = [path.resolve() for path in starts], dict[Path, bytes]()
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen[path], names = _compiled(path, path.stat().st_mtime_ns)
            waiting += _imported(path, names)
    digest = hashlib.sha256()
    for path in sorted(seen):
        # Not the whole path: the same code has the same digest wherever it is installed.
        place = path.relative_to(_ROOT).as_posix() if _is_ours(path) else path.name
        digest.update(f"|{place} ".encode() + seen[path])
    return digest.hexdigest()


@lru_cache(maxsize=256)  # the code that this process runs stays what it was when it was imported
def _digest_of(starts: tuple[Path, ...]) -> str:
    from importlib.metadata import version

    versions = repr([(name, version(name)) for name in _VERSIONS])
    return hashlib.sha256(f"{versions} {code_digest(starts)}".encode()).hexdigest()


def _module(function: Any) -> Path | None:
    """Return the file of a function's module, or of a module of ours by name; None for what is built into Python."""
    if isinstance(function, str):
        return _modules()[function]
    while isinstance(function, partial):
        function = function.func
    file = getattr(sys.modules[inspect.unwrap(function).__module__], "__file__", None)
    return Path(file).resolve() if file else None


@lru_cache(maxsize=1024)
def _compiled(path: Path, changed: int) -> tuple[bytes, frozenset[str]]:
    """Return a digest of the code of a file, and the names that it mentions, those of modules among them."""
    names: set[str] = set()
    try:
        code = _bare(compile(_source(path), path.name, "exec", dont_inherit=True, optimize=2), names)
    except SyntaxError:  # a file of the user's: what runs it says so
        return hashlib.sha256(_source(path)).digest(), frozenset()
    # Version 2 of the format has no references, which depend on what else is in memory.
    return hashlib.sha256(marshal.dumps(code, 2)).digest(), frozenset(names)


def _source(path: Path) -> bytes:
    return path.read_bytes()


def _bare(code: CodeType, names: set[str]) -> CodeType:
    """Return code without its places in the file, and add the names that it mentions."""
    names.update(code.co_names)
    constants = tuple(_bare(each, names) if isinstance(each, CodeType) else each for each in code.co_consts)
    return code.replace(co_consts=constants, co_filename="", co_firstlineno=1, co_linetable=b"")


def _imported(path: Path, names: Iterable[str]) -> Iterator[Path]:
    """Yield the files of the modules that a file may import, by the names that it mentions."""
    if _is_ours(path):
        ours = _modules()
        for name in ours.keys() & names:
            yield ours[name]
            if ours[name].name == "__init__.py":
                yield from (ours[inside] for part in names if (inside := f"{name}.{part}") in ours)
        return
    folders = [path.parent]
    while (folders[-1] / "__init__.py").exists():
        folders.append(folders[-1].parent)
    for folder in folders:
        if folder.name in ("site-packages", "dist-packages"):
            continue
        for place in (folder.joinpath(*name.split(".")) for name in names):
            package = place / "__init__.py"
            parts = [place / f"{part}.py" for part in names] if package.is_file() else []
            yield from filter(Path.is_file, (place.with_name(f"{place.name}.py"), package, *parts))


@lru_cache(maxsize=1)
def _modules() -> dict[str, Path]:
    """Return the files of our modules by name, those of packages too."""
    paths = [path for package in _PACKAGES for path in (_ROOT / package).rglob("*.py")]
    return {".".join(path.relative_to(_ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


def _is_ours(path: Path) -> bool:
    return path.is_relative_to(_ROOT) and path.relative_to(_ROOT).parts[0] in _PACKAGES


def _plain(value: Any) -> Any:
    """Return an argument as what JSON can hold."""
    if isinstance(value, np.ndarray):
        return [value.dtype.str, value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return dict(value)
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else str(value)
