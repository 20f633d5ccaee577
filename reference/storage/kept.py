# SPDX-License-Identifier: BSD-3-Clause
"""Results that are kept between runs: references, batches, rays, parts of reports.

`kept` is a decorator: a function that has it is computed once. The key of a result is a digest of

* the arguments of the function, but not of those that can only be given by name: they say how, not what
  (a progress, a process, what was loaded before);
* the source code of that function's module and of all modules of ours that this imports, directly or not;
* the versions of Mitsuba, Dr.Jit, NumPy and SciPy.

Source code counts as Python compiles it, without comments, docstrings and line numbers: rewording one throws nothing
away. The time of a result is the time to compute it from nothing: when a result is loaded, its original time is added
to the time of the result that is being computed from it.

A value is made of numbers, words, arrays, lists, dictionaries and data classes of these, as its function's annotation
says. Work that goes on where it was stopped keeps its parts by `store` and `load` under keys inside that of the whole:
batches of a Monte Carlo estimator, of which eight become one file of a quarter the size, and images of area lights.
Rows of a study lie in one database by the same keys (`validation/study/rows.py`): a study may have millions, and a row
takes 0.5 ms of the processor and 1.4 kB there, where a file of its own takes 1.5 ms.
"""

import hashlib
import inspect
import json
import marshal
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache, partial, update_wrapper
from pathlib import Path
from types import CodeType
from typing import Any, Generic, ParamSpec, TypeVar

import msgspec
import numpy as np

from analytic.clock import Spent, stopwatch
from reference.storage.cache import drop_arrays, drop_parts, is_stored, load_arrays, store_arrays

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("analytic", "realtime", "reference", "validation", "reports")
_VERSIONS = ("mitsuba", "drjit", "numpy", "scipy")
_ONLY_BY_NAME = inspect.Parameter.KEYWORD_ONLY
_FRESH = "AIRLIGHT_FRESH"  # results that are older count as missing [s since 1970]; child processes inherit it
_ABOUT = ("seconds", "processor", "made")  # what is stored beside the arrays of a result
_DATA, _ARRAY = "data", "array number"  # the array of the JSON of a value, and what stands there for an array
_loaded = [Spent()]  # what the results took that this process has loaded

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class Kept(Generic[T]):
    """A result, and what it took to compute it from nothing."""

    value: T
    spent: Spent
    made: float  #: when [s since 1970]
    loaded: bool  #: whether it was kept already

    @property
    def seconds(self) -> float:
        """Wall-clock time [s]."""
        return round(self.spent.seconds, 3)

    @property
    def measured(self) -> str:
        """Date and time of the computation."""
        return date(self.made)


class KeptFunction(Generic[P, T]):
    """A function whose results are kept, as `kept` makes it."""

    def __init__(self, function: Callable[P, T], kind: str, code: Sequence[Any], worth: Callable[[T], bool]) -> None:
        update_wrapper(self, function)
        self._function, self._kind, self._code, self._worth = function, kind, code or (function,), worth
        self._signature, self._type = inspect.signature(function), function.__annotations__["return"]

    def __call__(self, *given: P.args, **others: P.kwargs) -> T:
        """Return the value."""
        return self.result(*given, **others).value

    def result(self, *given: P.args, **others: P.kwargs) -> Kept[T]:
        """Return the value, and what it took, from the disk or computed now."""
        key = self.key(*given, **others)
        found = load(key)
        if found is not None:
            return self._result(found)
        spent = stopwatch_from_nothing()
        return self._store(key, self._function(*given, **others), spent())

    def keep(self, value: T, spent: Spent, *given: Any, **others: Any) -> None:
        """Keep a value that another process computed, and what it took, for this one to find."""
        self._store(self.key(*given, **others), value, spent)

    def is_kept(self, *given: Any, **others: Any) -> bool:
        """Return whether the value is kept already."""
        return is_kept(self.key(*given, **others))

    def key(self, *given: Any, **others: Any) -> str | None:
        """Return the key of the value, None if it cannot be kept; what decides nothing may be missing."""
        bound = self._signature.bind_partial(*given, **others)
        bound.apply_defaults()
        kinds = self._signature.parameters
        decides = {name: each for name, each in bound.arguments.items() if kinds[name].kind != _ONLY_BY_NAME}
        return key_of(self._kind, *self._code, **decides)

    def _store(self, key: str | None, value: T, spent: Spent) -> Kept[T]:
        arrays = _packed(value)
        kept = store(key if self._worth(value) else None, arrays, spent)
        if key is not None:
            drop_parts(key)
        return self._result(kept)  # as it will come from the disk

    def _result(self, kept: "Kept[dict[str, Any]]") -> Kept[T]:
        return Kept(_unpacked(kept.value, self._type), kept.spent, kept.made, kept.loaded)


def kept(
    kind: str, *code: Any, worth: Callable[[Any], bool] = lambda value: True
) -> Callable[[Callable[P, T]], KeptFunction[P, T]]:
    """Return a decorator that keeps the values of a function.

    `kind`: as for `key_of`; `code`: the functions or names of modules whose code decides the value, by default the
    function itself; `worth`: says whether a value is kept.
    """
    return lambda function: KeptFunction(function, kind, code, worth)


def _packed(value: Any) -> dict[str, Any]:
    """Return a value as arrays, of which one is JSON."""
    arrays: dict[str, Any] = {}

    def plain(each: Any) -> Any:
        if isinstance(each, np.generic):
            return each.item()
        if not isinstance(each, np.ndarray):
            raise TypeError(f"{type(each)} cannot be kept")
        arrays[str(len(arrays))] = each
        return {_ARRAY: str(len(arrays) - 1)}

    text = json.dumps(msgspec.to_builtins(value, str_keys=True, enc_hook=plain))
    return {**arrays, _DATA: np.frombuffer(text.encode(), dtype=np.uint8)}


def _unpacked(arrays: Mapping[str, Any], kind: Any) -> Any:
    """Return the value of a type that was packed."""
    text = np.asarray(arrays[_DATA]).tobytes()
    tree = json.loads(text, object_hook=lambda each: arrays[each[_ARRAY]] if each.keys() == {_ARRAY} else each)
    return msgspec.convert(tree, kind, dec_hook=lambda _, each: each)


def key_of(kind: str, /, *functions: Any, **arguments: Any) -> str | None:
    """Return the key under which a result is kept; None for a scene that nobody can tell from another.

    `kind`: one or more words with dashes: a file name begins with it; `functions`: the functions that compute it, or
    names of modules of ours; `arguments`: what the result depends on besides: numbers, words, arrays, paths, Mitsuba
    scenes, and tuples, dictionaries and data classes of these.
    """
    try:
        content = {"arguments": _plain(arguments), "code": source_digest(*functions)}
    except _NoDigestError:
        return None
    return f"{kind}-{hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]}"


def load(key: str | None) -> Kept[dict[str, Any]] | None:
    """Return the arrays of a key; None if it is missing, damaged or, in a fresh run, older than the run."""
    loading = stopwatch()
    arrays = load_arrays(key) if key is not None and is_kept(key) else None
    if arrays is None:
        return None
    seconds, processor, made = (float(arrays.pop(name)) for name in _ABOUT)
    spent = Spent(seconds, processor)
    add_spent(spent - loading())
    return Kept(arrays, spent, made, True)


def store(key: str | None, arrays: Mapping[str, Any], spent: Spent) -> Kept[dict[str, Any]]:
    """Keep arrays, and what they took; without a key they are returned alone."""
    made = time.time()
    if key is not None:
        store_arrays(key, {**arrays, **dict(zip(_ABOUT, (spent.seconds, spent.processor, made)))})
    return Kept(dict(arrays), spent, made, False)


def is_kept(key: str | None) -> bool:
    """Return whether there is a result under a key that `load` may return; damage is not looked for."""
    found = None if key is None else load_arrays(key, ("made",))
    return found is not None and float(found["made"]) >= float(os.environ.get(_FRESH, 0))


def is_damaged(key: str | None) -> bool:
    """Return whether there is a file under a key that cannot be read, or is not what was written."""
    return key is not None and is_stored(key) and load_arrays(key) is None


def drop(key: str | None) -> None:
    """Remove what there is under a key."""
    if key is not None:
        drop_arrays(key)


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


def date(seconds: float | None = None) -> str:
    """Return date and time, now by default, as YYYY-MM-DD HH:MM:SS with the time zone."""
    return time.strftime("%Y-%m-%d %H:%M:%S %z", time.localtime(seconds))


def stopwatch_from_nothing() -> Callable[[], Spent]:
    """Return a function that says what it takes to compute from nothing what is computed, or loaded, from now on."""
    before, took = loaded_spent(), stopwatch()
    return lambda: took() + (loaded_spent() - before)


def add_spent(spent: Spent) -> None:
    """Count what another process spent, or what it once took to compute a result that was loaded."""
    _loaded[0] += spent


def loaded_spent() -> Spent:
    """Return the original time of all results that this process has loaded."""
    return _loaded[0]


def source_digest(*functions: Any) -> str:
    """Return a digest of the code that functions run: their modules, what these import, the versions of packages."""
    return _digest_of(tuple(sorted({path for function in functions if (path := _module(function)) is not None})))


def code_digest(starts: Iterable[Path]) -> str:
    """Return a digest of the code of some modules and of all that they import, as far as it is ours or the user's.

    Data count with the code that may read them: the files in the folders of our modules (tables of scenes, certified
    values, claims).
    From a file of the user's, which may lie anywhere, the modules beside it are followed, and those of its package.
    """
    waiting, seen = [path.resolve() for path in starts], dict[Path, bytes]()
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen[path], names = _compiled(path, path.stat().st_mtime_ns)
            waiting += _imported(path, names)
    for folder in {path.parent for path in seen if _is_ours(path)}:
        seen |= {path: hashlib.sha256(_source(path)).digest() for path in _data(folder)}
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


def _data(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder of ours that are no modules, those of folders without modules below it too."""
    for path in folder.iterdir():
        if path.is_dir() and path.name != "__pycache__" and not any(path.glob("*.py")):
            yield from _data(path)
        elif path.is_file() and path.suffix not in (".py", ".pyc"):
            yield path


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


class _NoDigestError(Exception):
    """Raised for a scene that has no digest."""


def _plain(value: Any) -> Any:
    """Return an argument as what JSON can hold; TypeError for what has no content that is the same in every process."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
        return {name: _plain(each) for name, each in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return [type(value).__name__, {each.name: _plain(getattr(value, each.name)) for each in fields(value)}]
    if isinstance(value, np.generic):
        return [value.dtype.str, value.item()]
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufcSU":
        return [value.dtype.str, value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, Path):
        return [value.name, hashlib.sha256(value.read_bytes()).hexdigest()]
    if type(value).__module__ == "mitsuba" and type(value).__name__ == "Scene":
        from reference.storage.scene_digest import scene_digest  # imports Mitsuba

        digest = scene_digest(value)
        if digest is None:
            raise _NoDigestError
        return digest
    raise TypeError(
        f"{type(value).__name__} cannot be part of a key: expected numbers, words, arrays or records of these"
    )
