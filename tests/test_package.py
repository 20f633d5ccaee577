# SPDX-License-Identifier: BSD-3-Clause
"""Claims: the lock pins all that is needed, an import sets nothing, help is light, and a wheel holds the packages.

Who may import whom, style and types are checked by `.ci/lint`.
"""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("analytic", "realtime", "reference", "validation", "reports")


def _python(code: str, cwd: Path = ROOT) -> str:
    ran = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=cwd, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.mark.claim("locked-dependencies")
def test_the_lock_pins_what_the_project_asks_for_and_all_that_it_needs():
    lines = (ROOT / "requirements-test.lock").read_text().splitlines()
    pinned = [line for line in lines if not line.startswith(" ")]
    assert sum("==" in line for line in lines) == len(pinned) <= sum("--hash=sha256:" in line for line in lines)
    for lock in ("requirements.lock", "requirements-sweep.lock"):
        assert set((ROOT / lock).read_text().splitlines()) < set(lines), f"{lock} has other versions"
    pinned = [Requirement(line.removesuffix(" \\")) for line in pinned]
    here = [wanted for wanted in pinned if wanted.marker is None or wanted.marker.evaluate()]
    locked = {canonicalize_name(wanted.name): str(wanted.specifier).removeprefix("==") for wanted in here}
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())
    project, groups = declared["project"], declared["dependency-groups"]
    extras = [text for extra in (project["optional-dependencies"] | groups).values() for text in extra]
    waiting = [Requirement(text) for text in project["dependencies"] + extras]
    checked = set()
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        assert name in locked, f"{wanted} is not locked"
        assert wanted.specifier.contains(locked[name], prereleases=True), f"{wanted}, locked is {locked[name]}"
        if name in checked:
            continue
        checked.add(name)
        try:
            needs = [Requirement(text) for text in requires(wanted.name) or []]
        except PackageNotFoundError:
            pytest.skip(f"{wanted.name} is not installed here, so what it needs is unknown")
        waiting += [need for need in needs if need.marker is None or need.marker.evaluate({"extra": ""})]
    assert checked == set(locked), "a lock holds what nothing needs"


def test_importing_everything_sets_no_variant_and_fails_nowhere():
    paths = [ROOT / "airlight.py", *(path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py")))]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths]
    code = f"import importlib\nfor name in {names!r}: importlib.import_module(name)\n"
    _python(code + "import mitsuba; assert mitsuba.variant() is None, mitsuba.variant()")


@pytest.mark.claim("help-is-light")
def test_help_imports_nothing_heavy():
    heavy = ("mitsuba", "drjit", "numpy", "scipy", "mpmath", "matplotlib", "colour", "OpenEXR", "jinja2")
    code = (
        "import sys, airlight\n"
        "from reports.commands.start import main\n"
        "sys.argv = ['airlight', '--help']\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        f"loaded = [name for name in {heavy!r} if name in sys.modules]\n"
        "assert not loaded, loaded"
    )
    assert "report" in _python(code)


def test_packages_of_the_same_names_beside_a_script_are_not_taken_for_ours(tmp_path):
    for name in ("reports", "analytic"):  # a package, and a folder without a file of Python
        (tmp_path / name).mkdir()
    (tmp_path / "reports" / "__init__.py").touch()
    (tmp_path / "validation.py").write_text("raise SystemExit('a module of the user')\n")
    (tmp_path / "script.py").write_text("import airlight\nprint(airlight.SCENES['open-fog'].name)\n")
    world = os.environ | {"PYTHONPATH": str(ROOT)}
    for command in (["script.py"], ["-m", "airlight", "list", "papers"]):
        ran = subprocess.run([sys.executable, *command], cwd=tmp_path, env=world, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
    code = "import reports, airlight"
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=world, capture_output=True, text=True)
    assert "import airlight first, or rename that one" in ran.stderr.splitlines()[-1]


@pytest.mark.slow
@pytest.mark.claim("wheel-holds-the-packages")
def test_a_wheel_holds_every_file_of_the_packages_and_nothing_else(tmp_path):
    """Built from what git tracks, in a copy: templates, schemas and data are not forgotten, tests are not taken."""
    ran = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if ran.returncode:
        pytest.skip("this is no git checkout, so what belongs to the project is unknown")
    tracked = [name for name in ran.stdout.split("\0") if name and (ROOT / name).is_file()]
    for name in tracked:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tmp_path / name)
    build = "import sys, setuptools.build_meta as backend; print(backend.build_wheel(sys.argv[1]))"
    command = [sys.executable, "-c", build, str(tmp_path / "dist")]
    ran = subprocess.run(command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": ""}, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    with zipfile.ZipFile(next((tmp_path / "dist").glob("*.whl"))) as archive:
        held = {name for name in archive.namelist() if not name.endswith("/") and ".dist-info/" not in name}
    assert held == {name for name in tracked if name == "airlight.py" or name.split("/")[0] in PACKAGES}
