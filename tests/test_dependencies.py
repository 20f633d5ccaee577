# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what is imported at run time is declared, what is declared is imported, and every range has an end."""

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OURS = {"airlight", "analytic", "realtime", "reference", "validation", "reports", "tests"}
PRODUCT = ("airlight.py", "analytic", "realtime", "reference", "validation", "reports")
#: Declared for what they do when another program runs, and imported by nobody.
TOOLS = {"pytest-xdist": "tests in several processes", "ruff": "style", "mypy": "types", "setuptools": "wheels"}
_IMPORT = re.compile(r"^ *import (\w+)$", flags=re.MULTILINE)


def declared(*extras):
    """Return the requirements of the package, or of some of its extras, by the names of the distributions."""
    lines = [line for extra in extras for line in PROJECT["optional-dependencies"][extra]] or PROJECT["dependencies"]
    return {canonicalize_name(Requirement(line).name): Requirement(line) for line in lines}


@cache
def imported(*folders):
    """Return the distributions that files import, also in functions and in programs for a child, with one of the files.

    A test that is skipped where a package is missing names it in `importorskip`.
    """
    distributions = packages_distributions()
    imported = {}
    for folder in folders:
        path = ROOT / folder
        for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                    modules = [node.module]
                if folder in PRODUCT and isinstance(node, ast.Constant) and isinstance(node.value, str):
                    modules = _IMPORT.findall(node.value)
                if isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.importorskip":
                    modules = [ast.literal_eval(node.args[0])]
                for top in {module.partition(".")[0] for module in modules} - OURS - set(sys.stdlib_module_names):
                    for name in distributions.get(top, [top]):
                        imported.setdefault(canonicalize_name(name), file.relative_to(ROOT).as_posix())
    return imported


def test_what_the_product_imports_is_declared():
    undeclared = {name: file for name, file in imported(*PRODUCT).items() if name not in declared()}
    # What an extra is for, in the folder that does it, and nowhere else.
    folders = {"view": ["reports/view/"], "test": ["reports/docs/"], "sweep": ["validation/sweep/", "reports/cluster/"]}
    folders["sweep"] += ["reports/sweep/"]
    for folder, extra in ((folder, extra) for extra, places in folders.items() for folder in places):
        extras = declared(extra)
        undeclared = {n: file for n, file in undeclared.items() if not (n in extras and file.startswith(folder))}
    assert not undeclared


def test_what_is_declared_is_imported():
    assert set(declared()) <= set(imported(*PRODUCT))
    assert set(declared("test")) <= set(imported("tests")) | set(TOOLS)
    extensions = (ROOT / "docs/conf.py").read_text(encoding="utf-8")
    named = {name for name in declared("docs") if f'"{name.replace("-", "_")}"' in extensions}
    assert set(declared("docs")) <= set(imported("docs/_ext")) | named


def test_what_only_tests_and_pages_import_is_declared_for_them():
    own = {path.stem for path in (ROOT / "docs/_ext").glob("*.py")}
    assert set(imported("docs/conf.py", "docs/_ext")) - own <= set(declared()) | set(declared("docs"))
    assert set(imported("tests")) - own <= set(declared()) | set(declared("test", "docs", "view", "sweep"))


@pytest.mark.parametrize("name", sorted(declared()))
def test_every_dependency_has_an_upper_bound(name):
    """The next major version may take away what is used: inner parts of Typer are, and arguments change."""
    bounds = [specifier.operator for specifier in declared()[name].specifier]
    assert any(operator in ("==", "<", "<=", "~=") for operator in bounds)
