# SPDX-License-Identifier: BSD-3-Clause
"""Claims: the lock pins all that is needed, an import sets nothing, help is light, and a
wheel holds the packages.

Who may import whom, style and types are checked by `.ci/lint`.
"""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from airlight.reports.machine.install import requirements

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("analytic", "realtime", "reference", "validation", "reports")


def _python(code: str, cwd: Path = ROOT) -> str:
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=cwd, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def _uv(*words: str) -> str:
    uv = Path(sys.prefix) / "bin" / "uv"
    if not uv.exists():
        pytest.skip("uv cannot be had here")
    command = [uv, *words, "--offline", "--project", ROOT]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.mark.claim("locked-dependencies")
def test_the_lock_pins_what_the_project_declares_with_files_of_the_public_index():
    _uv("lock", "--check")
    packages = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    files = [
        file
        for each in packages
        for file in (*each.get("wheels", ()), *filter(None, [each.get("sdist")]))
    ]
    assert {each["source"].get("registry") for each in packages} == {
        None,
        "https://pypi.org/simple",
    }
    assert all(
        file["url"].startswith("https://files.pythonhosted.org/") and file["hash"] for file in files
    )


@pytest.mark.claim("locked-dependencies")
@pytest.mark.parametrize("extras", [(), ("sweep",), ("view", "shaders"), ("test",)], ids=" ".join)
def test_the_launcher_installs_what_the_lock_says_and_nothing_else(extras):
    words = [word for extra in extras for word in ("--extra", extra)]
    plain = ["--frozen", "--no-emit-project", "--no-header", "--no-annotate", "--group", "launcher"]
    expected = set()
    for line in _uv("export", *plain, *words).replace("\\\n", "").splitlines():
        package, *checksums = line.split("--hash=")
        wanted = Requirement(package)
        if wanted.marker is None or wanted.marker.evaluate():
            expected.add(
                (wanted.name, str(wanted.specifier), frozenset(each.strip() for each in checksums))
            )
    found = [line.split(" --hash=") for line in requirements(extras)]
    assert {(*each.partition("==")[::2], frozenset(files)) for each, *files in found} == {
        (name, version.removeprefix("=="), files) for name, version, files in expected
    }


def test_importing_everything_sets_no_variant_and_fails_nowhere():
    paths = [path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
    parts = [path.relative_to(ROOT).with_suffix("").parts for path in paths]
    names = [
        "airlight",
        *(".".join(("airlight", *each)).removesuffix(".__init__") for each in parts),
    ]
    code = f"import importlib\nfor name in {names!r}: importlib.import_module(name)\n"
    _python(code + "import mitsuba; assert mitsuba.variant() is None, mitsuba.variant()")


@pytest.mark.claim("help-is-light")
def test_help_imports_nothing_heavy():
    heavy = (
        "mitsuba",
        "drjit",
        "numpy",
        "scipy",
        "mpmath",
        "matplotlib",
        "colour",
        "OpenEXR",
        "jinja2",
    )
    code = (
        "import sys, airlight\n"
        "from airlight.reports.commands.start import main\n"
        "sys.argv = ['airlight', '--help']\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        f"loaded = [name for name in {heavy!r} if name in sys.modules]\n"
        "assert not loaded, loaded"
    )
    assert "report" in _python(code)


@pytest.fixture
def hostile(tmp_path):
    """A folder of a user's own, with names that airlight has inside."""
    for name in ("reports", "reference"):  # a folder without a file of Python, and a package
        (tmp_path / name).mkdir()
    (tmp_path / "reference" / "__init__.py").touch()
    (tmp_path / "validation.py").write_text("raise SystemExit('a module of the user')\n")
    (tmp_path / "script.py").write_text(
        "import reference, airlight\nprint(airlight.SCENES['open-fog'].name)\n"
    )
    return tmp_path


def test_packages_of_the_same_names_beside_a_script_are_not_taken_for_ours(hostile):
    for command in (["script.py"], ["-m", "airlight", "list", "papers"]):
        ran = subprocess.run(
            [sys.executable, *command], cwd=hostile, capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stderr


def test_a_function_of_the_name_of_a_folder_stays_a_function():
    code = "import airlight.reference.scene.read, airlight; print(callable(airlight.reference))"
    assert _python(code) == "True\n"
    code = "from airlight import reference; import airlight.reference.storage.exr; print(callable(reference))"
    assert _python(code) == "True\n"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """A wheel built from what git tracks, in a copy; and the files that git tracks."""
    ran = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if ran.returncode:
        pytest.skip("this is no git checkout, so what belongs to the project is unknown")
    folder = tmp_path_factory.mktemp("source")
    tracked = [name for name in ran.stdout.split("\0") if name and os.path.lexists(ROOT / name)]
    for name in tracked:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
    build = "import sys, setuptools.build_meta as backend; print(backend.build_wheel(sys.argv[1]))"
    command = [sys.executable, "-c", build, str(folder / "dist")]
    ran = subprocess.run(
        command, cwd=folder, env=os.environ | {"PYTHONPATH": ""}, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    return next((folder / "dist").glob("*.whl")), tracked


@pytest.mark.slow
@pytest.mark.claim("wheel-holds-the-packages")
def test_a_wheel_holds_every_file_of_the_packages_and_nothing_else(wheel):
    """Templates, schemas and data are not forgotten, tests are not taken, and
    `airlight` is the only name.
    """
    path, tracked = wheel
    with zipfile.ZipFile(path) as archive:
        held = {
            name
            for name in archive.namelist()
            if not name.endswith("/") and ".dist-info/" not in name
        }
    own = {
        name.removeprefix("src/")
        for name in tracked
        if name.startswith("src/") and (ROOT / name).is_file()
    }
    assert held == own | {f"airlight/{name}" for name in tracked if name.split("/")[0] in PACKAGES}


@pytest.mark.slow
@pytest.mark.claim("wheel-holds-the-packages")
def test_an_installed_wheel_does_its_work_beside_folders_of_its_names(wheel, hostile):
    """In a new environment that shares the packages of this one, without the checkout."""
    path, _ = wheel
    site, home = hostile / "site", hostile / "home"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(site)
    assert {each.name for each in site.iterdir() if not each.name.endswith(".dist-info")} == {
        "airlight"
    }
    (hostile / "mine.py").write_text("def fog(view):\n    return 0.01 + 0 * view.direction.x\n")
    # -S and the folders of packages: what an editable installation has put into this
    # environment is not there.
    packages = [place for place in sys.path if place.endswith(("site-packages", "dist-packages"))]
    world = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "AIRLIGHT"))
    }
    world |= {
        "PYTHONPATH": os.pathsep.join([str(site), *packages]),
        "AIRLIGHT_CACHE_DIR": str(home),
    }
    small = ["--size", "16x12"]
    for words in (
        ["list"],
        ["render", "open-fog", *small],
        ["render", "open-fog", *small, "--method", "mine.py:fog"],
        ["report", "open-fog", "--quick", "--method", "unshadowed", "-o", "out"],
    ):
        command = [sys.executable, "-S", "-m", "airlight", *words]
        ran = subprocess.run(command, cwd=hostile, env=world, capture_output=True, text=True)
        assert ran.returncode == 0, ran.stderr
    code = "import airlight; print(airlight.__file__); airlight.render('open-fog', 'unshadowed', size=(4, 3))"
    ran = subprocess.run(
        [sys.executable, "-S", "-c", code], cwd=hostile, env=world, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(str(site))
