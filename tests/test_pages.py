# SPDX-License-Identifier: BSD-3-Clause
"""Every folder opens with a page: what it is for, in which order to read it, what it may import; and it is true.

No folder and no file is part of a circle of imports.
"""

import ast
import re
from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter

import pytest

from tests.helpers.imports import FOLDERS, ROOT, folder_graph, import_graph, inside, modules

MODULES = modules()
GRAPH = import_graph({name: path.read_text() for name, path in MODULES.items()})
PAGES = sorted(
    {path.parent for name in FOLDERS for path in (ROOT / name).rglob("*.py") if path.name != "__init__.py"}
    | {ROOT / name for name in FOLDERS}
)
#: What a page may hold besides its words.
HELD = {"reports": ["__version__"]}


def parse_page(words: str) -> tuple[list[str], list[str]]:
    """Return the files that a page names in its order of reading, and the packages of ours that it allows."""
    assert words.count("Read in this order:") == 1, "wanted one line `Read in this order:`"
    assert words.count("May import:") == 1, "wanted one line that begins with `May import:`"
    order, allowed = words.split("Read in this order:")[1].split("May import:")
    lines = re.findall(r"^- ((?:`[\w./]+`(?:, |,\n  | and )?)+): \S", order, flags=re.MULTILINE)
    files = [name for line in lines for name in re.findall(r"`([\w./]+)`", line)]
    packages = re.findall(r"`([\w.]+)`", allowed)
    assert packages or "nothing of ours" in allowed, "wanted packages, or `nothing of ours`"
    return files, packages


@pytest.mark.parametrize("folder", PAGES, ids=lambda folder: folder.relative_to(ROOT).as_posix())
def test_a_folder_opens_with_its_page(folder):
    path = folder / "__init__.py"
    assert path.is_file()
    words = ast.get_docstring(ast.parse(path.read_text()))
    assert words
    held = [file.name for file in folder.glob("*.py") if file.name != "__init__.py"]
    # A folder of folders alone may leave order and imports to these.
    files, packages = parse_page(words) if held or "May import:" in words else ([], [])
    assert sorted(name for name in files if name.endswith(".py") and "/" not in name) == sorted(held)
    for name in files:
        assert (folder / name).exists(), name
    for package in packages:
        assert any(inside(name, package) for name in MODULES), package
    for module in (name for name, file in MODULES.items() if file.parent == folder):
        others = {
            other for other in GRAPH[module] if MODULES[other].name != "__init__.py" and MODULES[other].parent != folder
        }
        assert {other for other in others if not any(inside(other, package) for package in packages)} == set(), module


@pytest.mark.parametrize(
    "path", [path for path in MODULES.values() if path.name == "__init__.py"], ids=lambda path: path.parent.name
)
def test_a_page_holds_words_alone(path):
    """A name that `__init__` imports would hide where it lives, from readers and from the copies of the mutations."""
    body = ast.parse(path.read_text()).body
    names = [ast.unparse(node.targets[0]) if isinstance(node, ast.Assign) else ast.unparse(node) for node in body[1:]]
    assert ast.get_docstring(ast.parse(path.read_text()))
    assert names == HELD.get(path.parent.relative_to(ROOT).as_posix(), [])


def circle(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """Return one circle of a graph, nothing where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_circles_between_files():
    assert circle(GRAPH) == []


def test_no_circles_between_folders():
    assert circle(folder_graph(GRAPH, MODULES)) == []


def test_a_page_is_read_as_it_is_meant():
    words = "A room.\n\nRead in this order:\n\n- `first.py`: one;\n- `b.py`, `c.py`: two.\n\n"
    words += "May import: `analytic`,\n`a.b`.\n"
    assert parse_page(words) == (["first.py", "b.py", "c.py"], ["analytic", "a.b"])
    assert parse_page(words.replace("`analytic`,\n`a.b`", "nothing of ours"))[1] == []
    for wrong in (words.replace("Read in", "Look at"), words.replace("`analytic`,\n`a.b`", "all")):
        with pytest.raises(AssertionError, match="wanted"):
            parse_page(wrong)
