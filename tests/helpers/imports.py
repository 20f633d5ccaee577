# SPDX-License-Identifier: BSD-3-Clause
"""Who imports whom: the modules of the project and the graph of their imports, read as text."""

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("analytic", "realtime", "reference", "validation", "reports")


def modules() -> dict[str, Path]:
    """Return the files of all modules by their names."""
    paths = [ROOT / "airlight.py", *(path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))]
    return {module_name(path): path for path in paths}


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def imported(source: str) -> set[str]:
    """Return every name that a source imports with its module, also inside functions."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide who imports whom"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def import_graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """Return by module which of the others it imports: itself, or a name of it."""
    graph = {}
    for module, source in sources.items():
        names = imported(source)
        candidates = {name if name in sources else name.rpartition(".")[0] for name in names}
        graph[module] = {name for name in candidates if name in sources and name != module}
    return graph


def reached(graph: Mapping[str, Iterable[str]], starts: Iterable[str]) -> set[str]:
    """Return all modules to which the imports of some lead, these included."""
    known: set[str] = set()
    waiting = list(starts)
    while waiting:
        module = waiting.pop()
        if module not in known:
            known.add(module)
            waiting += graph[module]
    return known


def folder_graph(graph: Mapping[str, Iterable[str]], files: Mapping[str, Path]) -> dict[str, set[str]]:
    """Return by folder which other folders its modules import from."""
    folders = {module: path.parent.relative_to(ROOT).as_posix() for module, path in files.items()}
    imported_folders: dict[str, set[str]] = {folder: set() for folder in folders.values()}
    for module, others in graph.items():
        imported_folders[folders[module]] |= {folders[other] for other in others} - {folders[module]}
    return imported_folders


def inside(module: str, folder: str) -> bool:
    """Return whether a module is a package or lies in it."""
    return module == folder or module.startswith(f"{folder}.")
