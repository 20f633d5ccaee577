# SPDX-License-Identifier: BSD-3-Clause
"""Results that are cached between runs: references, batches, rays, parts of reports.

A frozen record of inputs is the only key of a result: a digest of each of its fields, and of the
code that computes (`reference.storage.code`). No field can be left out, and a field without content
that is the same in every process, such as a set, a function or an object of a library, is a
TypeError. A record may hold another one: the key of a row holds that of its reference. Arguments
that change no value (a progress, other processes, patience) go to the function that computes and
are no fields.

The time of a result is the time to compute it from nothing: when a result is loaded, its original
time is added to the time of the result that is being computed from it.

A value is made of numbers, words, arrays, lists, dictionaries and records of these, as a type says.
Work that goes on where it was stopped keeps its parts by `store` and `load` under keys inside that
of the whole: batches of a Monte Carlo estimator, of which eight become one file of a quarter the
size, and images of area lights. Rows of a study lie in one database by the same keys
(`validation/study/rows.py`): a study may have millions, and a row takes 0.5 ms of the processor and
1.4 kB there, where a file of its own takes 1.5 ms.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Generic, TypeAlias, TypeVar

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from airlight.analytic.clock import Spent, stopwatch
from airlight.reference.storage.cache import (
    Arrays,
    drop_arrays,
    drop_parts,
    is_stored,
    load_arrays,
    store_arrays,
)
from airlight.reference.storage.code import source_digest

# results that are older count as missing [s since 1970]; child processes inherit it
_FRESH = "AIRLIGHT_FRESH"
_ABOUT = ("seconds", "processor", "made")  # what is stored beside the arrays of a result
# the array of the JSON of a value, and what stands there for an array
_DATA, _ARRAY = "data", "array number"

T = TypeVar("T")
#: what JSON can hold
Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"


# --- keys -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Content:
    """A digest of an input that is no number, word or array: a scene, a file, the user's code."""

    #: None if the input has none: then results that depend on it are not cached
    digest: str | None


@dataclass(frozen=True)
class Inputs:
    """The inputs of a result: a subclass has a field for each, and they alone are its key."""

    kind: ClassVar[str]  #: one or more words with dashes: names of files begin with it
    modules: ClassVar[tuple[str, ...]] = ()  #: that compute it, by default the module of the class

    @cached_property
    def key(self) -> str | None:
        """The name under which the result is cached; None if an input has no digest."""
        # The format of keys and of stored results: with another number everything is computed
        # again.
        form = 2
        try:
            content = json.dumps([form, _encoded(self)], sort_keys=True)
        except _NoDigestError:
            return None
        return f"{self.kind}-{hashlib.sha256(content.encode()).hexdigest()[:32]}"


class _NoDigestError(Exception):
    """Raised for a `Content` without a digest."""


def _encoded(value: object) -> Json:
    """Return an input as JSON: equal inputs, and these alone, have equal texts."""
    if isinstance(value, Enum):
        return [type(value).__qualname__, value.name]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Content) and value.digest is None:
        raise _NoDigestError
    if is_dataclass(value) and not isinstance(value, type):
        # `Inputs` count with the code that computes their result, other records with their fields
        # alone.
        code: list[Json] = []
        if isinstance(value, Inputs):
            code = [source_digest(*(value.modules or (type(value).__module__,)))]
        return [
            type(value).__qualname__,
            *code,
            {each.name: _encoded(getattr(value, each.name)) for each in fields(value)},
        ]
    if isinstance(value, tuple):
        return [_encoded(each) for each in value]
    if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
        return {name: _encoded(each) for name, each in value.items()}
    # A file counts by its name and its content.
    if isinstance(value, Path):
        return [value.name, hashlib.sha256(value.read_bytes()).hexdigest()]
    if isinstance(value, np.generic | np.ndarray) and value.dtype.kind in "biufcSU":
        # Type and shape count too: equal bytes may be other numbers.
        data = np.ascontiguousarray(value).tobytes()
        return [value.dtype.str, value.shape, hashlib.sha256(data).hexdigest()]
    raise TypeError(
        f"{type(value).__name__} cannot be part of a key: expected numbers, words, arrays or "
        "frozen records"
    )


# --- results --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kept(Generic[T]):
    """A result, and what it took to compute it from nothing."""

    value: T
    spent: Spent
    made: float  #: when [s since 1970]
    loaded: bool  #: whether it was cached already

    @property
    def seconds(self) -> float:
        """Wall-clock time [s]."""
        return round(self.spent.seconds, 3)

    @property
    def measured(self) -> str:
        """Date and time of the computation."""
        return date(self.made)


def stored(
    inputs: Inputs,
    compute: Callable[[], T],
    kind: type[T],
    worth: Callable[[T], bool] = lambda value: True,
) -> Kept[T]:
    """Return the result of some inputs, from the cache or computed now and cached.

    Parameters
    ----------
    inputs:
        All that decides the result.
    compute:
        Computes it; called if it is not cached.
    kind:
        The type of the result.
    worth:
        Says whether a result is to be cached.
    """
    cached = load(inputs.key)
    if cached is not None:
        return _result(cached, kind)
    # The ledger adds up the time that passes and the original times of loaded parts.
    with counted() as ledger:
        value = compute()
        spent = ledger.spent()
    return keep(inputs, value, spent, kind, worth)


def keep(
    inputs: Inputs,
    value: T,
    spent: Spent,
    kind: type[T],
    worth: Callable[[T], bool] = lambda value: True,
) -> Kept[T]:
    """Cache a result that was computed, here or elsewhere, and return it as it will be loaded."""
    result = store(inputs.key if worth(value) else None, _packed(value), spent)
    # The whole is cached: parts of the work are not needed any more.
    if inputs.key is not None:
        drop_parts(inputs.key)
    return _result(result, kind)


def _result(packed: Kept[Arrays], kind: type[T]) -> Kept[T]:
    return Kept(_unpacked(packed.value, kind), packed.spent, packed.made, packed.loaded)


def _packed(value: object) -> Arrays:
    """Return a value as arrays, one of them JSON."""
    arrays: Arrays = {}

    def plain(each: object) -> Json:
        if isinstance(each, np.generic):
            return each.item()
        if not isinstance(each, np.ndarray):
            raise TypeError(f"{type(each)} cannot be cached")
        # An array lies beside the JSON, which has its number in its place.
        arrays[str(len(arrays))] = each
        return {_ARRAY: str(len(arrays) - 1)}

    text = json.dumps(msgspec.to_builtins(value, str_keys=True, enc_hook=plain))
    return {**arrays, _DATA: np.frombuffer(text.encode(), dtype=np.uint8)}


def _unpacked(arrays: Arrays, kind: type[T]) -> T:
    """Return the value of a type that was packed."""
    text = np.asarray(arrays[_DATA]).tobytes()
    tree = json.loads(
        text, object_hook=lambda each: arrays[each[_ARRAY]] if each.keys() == {_ARRAY} else each
    )
    return msgspec.convert(tree, kind, dec_hook=lambda _, each: each)


# --- arrays under a key, None for none ------------------------------------------------------------


def load(key: str | None) -> Kept[Arrays] | None:
    """Return the arrays of a key; None if they are missing, damaged or, in a fresh run, older than
    the run.
    """
    loading = stopwatch()
    arrays = load_arrays(key) if key is not None and is_kept(key) else None
    if arrays is None:
        return None
    # The time that loading takes counts already in the running measurement: only the rest of the
    # original time is added.
    seconds, processor, made = (float(arrays.pop(name)) for name in _ABOUT)
    spent = Spent(seconds, processor)
    add_spent(spent - loading())
    return Kept(arrays, spent, made, True)


def store(key: str | None, arrays: Mapping[str, ArrayLike], spent: Spent) -> Kept[Arrays]:
    """Cache arrays, and the time that they took; without a key nothing is cached."""
    made = time.time()
    if key is not None:
        about = dict(zip(_ABOUT, (spent.seconds, spent.processor, made), strict=True))
        store_arrays(key, {**arrays, **about})
    return Kept({name: np.asarray(each) for name, each in arrays.items()}, spent, made, False)


def is_kept(key: str | None) -> bool:
    """Return whether there is a result under a key that is not too old; it may be damaged."""
    about = None if key is None else load_arrays(key, ("made",))
    return about is not None and float(about["made"]) >= float(os.environ.get(_FRESH, 0))


def is_damaged(key: str | None) -> bool:
    """Return whether there is a file under a key that cannot be read, or was changed."""
    return key is not None and is_stored(key) and load_arrays(key) is None


def drop(key: str | None) -> None:
    """Remove the file of a key."""
    if key is not None:
        drop_arrays(key)


# --- times ----------------------------------------------------------------------------------------


class Ledger:
    """The cost of computing from nothing: the time since now, and the original times of
    results that are loaded.
    """

    def __init__(self) -> None:
        self._took, self.loaded = stopwatch(), Spent()

    def spent(self) -> Spent:
        """Return the time until now."""
        return self._took() + self.loaded


#: The ledger of the result that is being computed; each thread has its own.
_LEDGER: ContextVar[Ledger | None] = ContextVar("ledger", default=None)


@contextmanager
def counted() -> Iterator[Ledger]:
    """Count in a ledger the times of the results that are computed or loaded in the block."""
    outer, ledger = _LEDGER.get(), Ledger()
    token = _LEDGER.set(ledger)
    try:
        yield ledger
    finally:
        _LEDGER.reset(token)
        if outer is not None:
            # A result that is computed from others passes their original times on.
            outer.loaded += ledger.loaded


def add_spent(spent: Spent) -> None:
    """Count the time that another process spent, or the original time of a loaded result."""
    ledger = _LEDGER.get()
    if ledger is not None:
        ledger.loaded += spent


@contextmanager
def fresh_results(since: float | None) -> Iterator[None]:
    """Let results older than `since` [s since 1970] count as missing within the block, also in
    processes that start there; None changes nothing.
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
