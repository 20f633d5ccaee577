# SPDX-License-Identifier: BSD-3-Clause
"""The rules of the project as a whole: style, types, who may import whom, what a wheel holds."""

import ast
import subprocess
import sys
import tomllib
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import PackageNotFoundError, version
from itertools import permutations
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.helpers.imports import FOLDERS, folder_graph, import_graph, inside, modules, reached

ROOT = Path(__file__).resolve().parents[1]
MODULES = sorted(modules().values())

# The design's table: whom each may import. What a folder holds may import itself.
ALLOWED = {
    "analytic": set(),
    "realtime": set(),
    "reference": {"analytic"},
    "validation": {"analytic", "realtime", "reference"},
    "reports": {"analytic", "realtime", "reference", "validation"},
    "airlight": set(FOLDERS),
}
# Methods are compared with one another. (The estimators of the truth: tests/test_independence.py.)
METHODS = tuple(
    f"realtime.methods.{name}"
    for name in (
        "unshadowed",
        "ray_march",
        "shadow_planes",
        "light_volumes",
        "epipolar",
        "froxel_fog",
        "soft_shafts",
        "cloud_octaves",
        "cloud_collectors",
    )
)


def _python(*arguments: str, **options) -> subprocess.CompletedProcess:
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, **options)


@pytest.mark.parametrize("arguments", [("ruff", "check"), ("ruff", "format", "--check"), ("mypy",)], ids=" ".join)
def test_style_and_types(arguments):
    ran = _python("-m", *arguments)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.fixture(scope="module")
def graph():
    return import_graph({name: path.read_text() for name, path in modules().items()})


@pytest.mark.claim("methods-share-nothing-with-the-truth")
@pytest.mark.parametrize("owner", ALLOWED)
def test_who_may_import_whom(graph, owner):
    """To the end: also what a module imports by way of others belongs to a folder that its own may import."""
    allowed = ALLOWED[owner] | {owner}
    modules_of_owner = [module for module in graph if inside(module, owner)]
    assert modules_of_owner
    for module in modules_of_owner:
        assert {name for name in reached(graph, [module]) if name.split(".")[0] not in allowed} == set(), module


def test_imports_of_a_method_lead_to_no_other(graph):
    for method, other in permutations(METHODS, 2):
        start = [module for module in graph if inside(module, method)]
        assert start, method
        assert {module for module in reached(graph, start) if inside(module, other)} == set(), (method, other)


def test_every_method_is_kept_apart():
    """Whoever adds a method adds it to the list of those that import none of one another."""
    folder = modules()["realtime.methods.registry"].parent
    names = {path.stem for path in folder.iterdir() if path.name[0] not in "._"}
    shared = {"registry", "interface", "user_method", "user_result"}
    assert {f"realtime.methods.{name}" for name in names - shared} == set(METHODS)


def test_the_walk_over_imports_finds_what_is_forbidden():
    sources = {
        "analytic.phase": "",
        "reference.read": "def f():\n    from analytic.phase import PhaseFunction\n    import numpy\n",
        "realtime.deep": "import reference.read\n",
        "realtime.method": "from realtime import deep\n",
    }
    graph = import_graph(sources)
    assert graph["reference.read"] == {"analytic.phase"}
    assert reached(graph, ["realtime.method"]) == set(sources)
    with pytest.raises(CycleError):
        TopologicalSorter(import_graph(sources | {"analytic.phase": "from realtime.method import f"})).prepare()
    files = {name: ROOT / f"{name.replace('.', '/')}.py" for name in sources}
    assert folder_graph(graph, files) == {
        "analytic": set(),
        "reference": {"analytic"},
        "realtime": {"reference"},
    }


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_modules_are_licensed(path):
    assert path.read_text().splitlines()[0] == "# SPDX-License-Identifier: BSD-3-Clause"


def test_numerics_are_imported_at_the_top():
    """Where a reader looks for them; only `reports` is lazy, so that `--help` answers at once."""
    late = [
        f"{path.relative_to(ROOT)}, line {node.lineno}"
        for path in MODULES
        if path.relative_to(ROOT).parts[0] in ("analytic", "realtime", "reference", "validation")
        for function in ast.walk(ast.parse(path.read_text()))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names])
        if name.split(".")[0] in ("drjit", "mitsuba", "numpy")
    ]
    assert late == []


def test_only_one_place_sets_the_mitsuba_variant():
    setters = {
        str(path.relative_to(ROOT))
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and node.attr in ("set_variant", "scoped_set_variant", "variant_context")
    }
    assert setters == {"reports/machine/environment.py"}


def test_no_test_sets_a_variant_that_another_runs_in():
    """The fixture `variant` chooses it, once for all tests of a process; the scalar one is put back or runs apart."""
    from reports.machine.environment import VARIANTS

    setters = {
        (path.name, argument.value)
        for path in (ROOT / "tests").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "set_variant"
        for argument in node.args
        if isinstance(argument, ast.Constant)
    }
    assert not {(name, given) for name, given in setters if given in VARIANTS}


def _asserts(node: ast.AST, helpers: set[str]) -> bool:
    for inner in ast.walk(node):
        if isinstance(inner, ast.Assert):
            return True
        if isinstance(inner, ast.Call):
            name = ast.unparse(inner.func)
            if name.startswith(("pytest.raises", "pytest.warns", "np.testing.assert_")) or name in helpers:
                return True
    return False


def faults_of_tests(trees: dict[str, ast.Module]) -> list[str]:
    """Name tests without an assertion, tests that end by a return, and skips without a condition or a reason."""
    functions = [(name, node) for name, tree in trees.items() for node in ast.walk(tree)]
    functions = [(name, node) for name, node in functions if isinstance(node, ast.FunctionDef)]
    helpers: set[str] = set()
    while more := {node.name for _, node in functions if _asserts(node, helpers)} - helpers:
        helpers |= more
    faults = []
    for name, node in functions:
        if node.name.startswith("test_"):
            faults += [] if _asserts(node, helpers) else [f"{name}: {node.name} asserts nothing"]
            returns = [inner for inner in ast.walk(node) if isinstance(inner, ast.Return) and inner.value is None]
            faults += [f"{name}: {node.name} returns; `assume` or `pytest.skip` would say so"] if returns else []
        for statement in node.body:
            call = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(call, ast.Call) and ast.unparse(call.func) == "pytest.skip":
                faults.append(f"{name}: {node.name} is skipped without a condition")
    for name, tree in trees.items():
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            what, given = ast.unparse(call.func), {word.arg for word in call.keywords}
            if what == "pytest.mark.skip" or (what == "pytest.skip" and not call.args):
                faults.append(f"{name}: {what} without a condition or a reason")
            if what in ("pytest.mark.skipif", "pytest.mark.xfail", "pytest.importorskip") and "reason" not in given:
                faults.append(f"{name}: {what} without a reason")
    return faults


def test_tests_can_fail_and_say_why_they_are_skipped():
    paths = sorted((ROOT / "tests").rglob("*.py"))
    assert faults_of_tests({str(path.relative_to(ROOT)): ast.parse(path.read_text()) for path in paths}) == []


def test_faults_of_tests_are_found():
    source = (
        "def check(x):\n    assert x\n"
        "def test_good():\n    check(1)\n"
        "def test_empty():\n    print(1)\n"
        "def test_early(x):\n    if x: return\n    assert x\n"
        "def test_never():\n    pytest.skip('later')\n    assert 0\n"
        "@pytest.mark.skipif(True)\ndef test_silent():\n    assert 0\n"
    )
    assert faults_of_tests({"a": ast.parse(source)}) == [
        "a: test_empty asserts nothing",
        "a: test_early returns; `assume` or `pytest.skip` would say so",
        "a: test_never is skipped without a condition",
        "a: pytest.mark.skipif without a reason",
    ]


def test_importing_everything_sets_no_variant():
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in MODULES]
    code = f"import importlib\nfor name in {names!r}: importlib.import_module(name)\n"
    code += "import mitsuba; assert mitsuba.variant() is None, mitsuba.variant()"
    ran = _python("-W", "error", "-c", code)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.claim("help-is-light")
def test_the_front_door_and_help_import_nothing_heavy():
    heavy = ("mitsuba", "drjit", "numpy", "scipy", "mpmath", "matplotlib", "colour", "OpenEXR", "jinja2")
    code = (
        "import sys, airlight\n"
        "sys.argv = ['airlight', '--help']\n"
        "try: airlight.main()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        f"loaded = [name for name in {heavy!r} if name in sys.modules]\n"
        "assert not loaded, loaded"
    )
    ran = _python("-c", code)
    assert ran.returncode == 0, ran.stderr
    assert "report" in ran.stdout


def _locked() -> dict[str, str]:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    pinned = [Requirement(line) for line in lines if line and not line.startswith("#")]
    # What stands after a semicolon says on which machines.
    here = [wanted for wanted in pinned if wanted.marker is None or wanted.marker.evaluate()]
    return {canonicalize_name(wanted.name): str(wanted.specifier).removeprefix("==") for wanted in here}


def _project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.mark.claim("locked-dependencies")
def test_the_lock_pins_what_the_project_asks_for_and_all_that_it_needs():
    locked = _locked()
    project = _project()
    extras = project["optional-dependencies"]
    waiting = [Requirement(text) for text in project["dependencies"] + extras["test"] + extras["docs"] + extras["view"]]
    waiting += [Requirement(text) for text in extras["sweep"]]
    checked = set()
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        assert name in locked, f"{wanted} is not in requirements.lock"
        assert wanted.specifier.contains(locked[name], prereleases=True), f"{wanted}, locked is {locked[name]}"
        if name in checked:
            continue
        checked.add(name)
        try:
            needs = _requires(wanted.name)
        except PackageNotFoundError:
            pytest.skip(f"{wanted.name} is not installed here, so what it needs is unknown")
        waiting += [need for need in needs if need.marker is None or need.marker.evaluate({"extra": ""})]
    assert checked == set(locked), "requirements.lock holds what nothing needs"


def _requires(name: str) -> list[Requirement]:
    from importlib.metadata import requires

    return [Requirement(text) for text in requires(name) or []]


def test_citation_and_version_agree():
    from reports import __version__

    assert f"version: {__version__}\n" in (ROOT / "CITATION.cff").read_text()
    with suppress(PackageNotFoundError):  # not installed where it runs from the source
        assert version("airlight") == __version__
