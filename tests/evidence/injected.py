# SPDX-License-Identifier: BSD-3-Clause
"""How a fault is injected into running code, and taken out again: hooks around functions, and
patterns of expressions.

A hook wraps a function at the place of its definition and in every module that imported it. A
pattern is an expression in Python, looked for in all functions of a package or module, whatever its
format and its place: a name that ends with an underscore stands for any expression, the same one
wherever it occurs. The code of the function that holds the expression is replaced, so every
reference to the function sees the fault.

The target of a hook or a pattern must exist, and a pattern must match exactly as often as it says:
a fault cannot vanish when code moves.
"""

import ast
import importlib
import inspect
import pkgutil
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

PACKAGES = ("analytic", "reference")


@dataclass(frozen=True)
class Wrap:
    """Call `around(function, *arguments, **named)` in the place of a
    function, method or property.
    """

    where: str  # module:function or module:Class.method
    around: Callable[..., Any]


@dataclass(frozen=True)
class Put:
    """Another value of a constant of a module."""

    where: str  # module:NAME
    value: Any


@dataclass(frozen=True)
class Rewrite:
    """Another expression in the place of those that match a pattern."""

    where: str  # a package or module
    old: str
    new: str
    times: int = 1


Change = Wrap | Put | Rewrite


@contextmanager
def injected(*changes: Change) -> Iterator[None]:
    """Inject changes, and take them out at the end."""
    with ExitStack() as stack:
        for change in changes:
            if isinstance(change, Rewrite):
                for function, code in rewritten(change):
                    stack.callback(setattr, function, "__code__", function.__code__)
                    function.__code__ = code
            else:
                for owner, name, value in replacements(change):
                    stack.callback(setattr, owner, name, vars(owner)[name])
                    setattr(owner, name, value)
        yield


def replacements(change: Wrap | Put) -> list[tuple[Any, str, Any]]:
    """Return what a hook sets: owner, name and value."""
    module, _, path = change.where.partition(":")
    owner: Any = importlib.import_module(module)
    *classes, name = path.split(".")
    for each in classes:
        owner = getattr(owner, each)
    before = vars(owner)[name]  # a KeyError names what is gone
    if isinstance(change, Put):
        return [(owner, name, change.value)]
    if isinstance(before, property):
        return [(owner, name, property(_around(before.fget, change.around)))]
    after = _around(before, change.around)
    users = [] if classes else [user for user in _loaded(PACKAGES) if user is not owner]
    others = [
        (user, key, after) for user in users for key, value in vars(user).items() if value is before
    ]
    return [(owner, name, after), *others]


def _around(function: Any, around: Callable[..., Any]) -> Any:
    @wraps(function)
    def wrapped(*arguments: Any, **named: Any) -> Any:
        return around(function, *arguments, **named)

    return wrapped


def rewritten(change: Rewrite) -> list[tuple[FunctionType, Any]]:
    """Return the functions that hold a pattern, with their changed code."""
    old, new = (ast.parse(text, mode="eval").body for text in (change.old, change.new))
    found: list[tuple[FunctionType, Any]] = []
    places = 0
    for module in _modules(change.where):
        tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
        for owner, definition in _definitions(module, tree):
            replacer = _Replacer(old, new)
            changed = replacer.visit(definition)
            if replacer.count:
                places += replacer.count
                found.append((_function(owner, definition.name), _code(module, changed)))
    if places != change.times:
        raise LookupError(
            f"{change.where} holds {change.old!r} {places} times; expected {change.times}"
        )
    return found


class _Replacer(ast.NodeTransformer):
    """Replaces expressions that match a pattern, and counts them."""

    def __init__(self, old: ast.expr, new: ast.expr):
        self._old, self._new, self.count = old, new, 0

    def visit(self, node: ast.AST) -> Any:
        bound: dict[str, ast.AST] = {}
        if isinstance(node, type(self._old)) and _matches(self._old, node, bound):
            self.count += 1
            # Parsed again: a tree must not hold one node twice.
            return (
                ast.parse(
                    ast.unparse(
                        _Filler(bound).visit(ast.parse(ast.unparse(self._new), mode="eval")).body
                    )
                )
                .body[0]
                .value
            )
        return self.generic_visit(node)


class _Filler(ast.NodeTransformer):
    def __init__(self, bound: dict[str, ast.AST]):
        self._bound = bound

    def visit_Name(self, node: ast.Name) -> Any:
        return self._bound.get(node.id, node)


def _matches(pattern: Any, node: Any, bound: dict[str, ast.AST]) -> bool:
    if isinstance(pattern, ast.Name) and pattern.id.endswith("_"):
        known = bound.setdefault(pattern.id, node)
        return ast.dump(known) == ast.dump(node)
    if isinstance(pattern, ast.AST):
        if type(pattern) is not type(node):
            return False
        return all(
            _matches(getattr(pattern, name), getattr(node, name), bound) for name in pattern._fields
        )
    if isinstance(pattern, list):
        return len(pattern) == len(node) and all(
            _matches(a, b, bound) for a, b in zip(pattern, node)
        )
    return bool(pattern == node)


def _definitions(module: ModuleType, tree: ast.Module) -> Iterator[tuple[Any, ast.FunctionDef]]:
    """Yield the functions of a module and the methods of its classes, with what they belong to."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            yield module, node
        elif isinstance(node, ast.ClassDef):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef):
                    yield getattr(module, node.name), inner


def _function(owner: Any, name: str) -> FunctionType:
    found = vars(owner)[name]
    return inspect.unwrap(found.fget if isinstance(found, property) else found)


def _code(module: ModuleType, definition: ast.FunctionDef) -> Any:
    definition.decorator_list = []
    tree = ast.fix_missing_locations(ast.Module([definition], []))
    local: dict[str, Any] = {}
    exec(compile(tree, str(module.__file__), "exec"), vars(module), local)
    return local[definition.name].__code__


def _modules(where: str) -> list[ModuleType]:
    """Return a module, or all modules of a package."""
    top = importlib.import_module(where)
    if not hasattr(top, "__path__"):
        return [top]
    names = [found.name for found in pkgutil.walk_packages(top.__path__, f"{where}.")]
    return [
        module for module in map(importlib.import_module, names) if not hasattr(module, "__path__")
    ]


def _loaded(rooms: tuple[str, ...]) -> list[ModuleType]:
    places = tuple(f"airlight.{room}." for room in rooms)
    return [module for name, module in list(sys.modules.items()) if name.startswith(places)]
