# SPDX-License-Identifier: BSD-3-Clause
"""Copies of our own modules in which one text is replaced, beside the originals and unknown to them.

A mutation of the physics must not leak: the copy of the changed module, and copies of all modules that use it, live in
no list of the interpreter. Their import statements are served by an `__import__` of their own, which hands out copies
where there are some and the originals otherwise.
"""

import ast
import builtins
import importlib
import linecache
from collections.abc import Mapping
from functools import cache
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

#: Packages whose modules are copied; `reference` may import no others of ours.
PACKAGES = ("analytic", "reference")

_NUMBERS = count()


def module_source(name: str) -> str:
    """Return the source text of one of our modules.

    Raises
    ------
    ValueError
        If the module has no file, as a folder without a page.
    """
    path = importlib.import_module(name).__file__
    if path is None:
        raise ValueError(f"{name} has no source file; wanted a module of {', '.join(PACKAGES)}")
    return Path(path).read_text(encoding="utf-8")


def replaced_once(name: str, old: str, new: str) -> str:
    """Return the source of a module with one text replaced.

    Raises
    ------
    ValueError
        If the text does not occur exactly once: the module was written anew, and the replacement must follow.
    """
    source = module_source(name)
    times = source.count(old)
    if times != 1:
        raise ValueError(f"{name} holds the text {old!r} {times} times; wanted exactly once")
    return source.replace(old, new)


@cache
def imported_modules(source: str) -> frozenset[str]:
    """Return the modules of `PACKAGES` that a source imports anywhere, in functions too."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
            # `from reference import visibility` names a module by its last word.
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return frozenset(name for name in names if name.split(".")[0] in PACKAGES and _exists(name))


def _exists(name: str) -> bool:
    from importlib.util import find_spec

    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # a class or function: its module is no package
        return False


def users_of(module: str, tops: tuple[str, ...]) -> set[str]:
    """Return the modules among `tops` and all that they import which lead to `module`, itself included."""
    imports: dict[str, frozenset[str]] = {}
    waiting = list(tops)
    while waiting:
        name = waiting.pop()
        if name not in imports:
            imports[name] = imported_modules(module_source(name))
            waiting += imports[name]
    users = {module}
    while True:
        more = {name for name, used in imports.items() if used & users} | users
        if more == users:
            return users
        users = more


class ModuleCopies(Mapping[str, ModuleType]):
    """Modules by name: copies of those that lead to a changed source, the originals of all others.

    Parameters
    ----------
    module
        Name of the module that is changed.
    source
        Its changed source.
    tops
        The modules that will be asked for.
    """

    def __init__(self, module: str, source: str, tops: tuple[str, ...]):
        self._module, self._source = module, source
        self._copied = users_of(module, tops) - set(PACKAGES)
        self._built: dict[str, ModuleType] = {}
        self._builtins = {**vars(builtins), "__import__": self._import}
        self._number = next(_NUMBERS)

    def __getitem__(self, name: str) -> ModuleType:
        if name not in self._copied:
            return importlib.import_module(name)
        if name not in self._built:
            self._built[name] = self._build(name)
        return self._built[name]

    def __iter__(self):
        return iter(self._copied)

    def __len__(self) -> int:
        return len(self._copied)

    def _build(self, name: str) -> ModuleType:
        source = self._source if name == self._module else module_source(name)
        private = f"{name}__copy{self._number}"
        module = ModuleType(private)
        module.__dict__["__builtins__"] = self._builtins
        filename = f"<{private}>"
        # Dr.Jit reads the source of functions again, to turn their loops into kernels.
        linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
        exec(compile(source, filename, "exec"), module.__dict__)
        return module

    def _import(self, name: str, namespace=None, local=None, fromlist: Any = (), level: int = 0):
        if not level and fromlist and name in self._copied:
            return self[name]
        own = [f"{name}.{word}" for word in fromlist or () if f"{name}.{word}" in self._copied]
        if own or name in self._copied:
            raise ImportError(f"a copied module imports {own or name} as a whole; write 'from {name} import ...'")
        return builtins.__import__(name, namespace, local, fromlist or (), level)
