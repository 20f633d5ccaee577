# SPDX-License-Identifier: BSD-3-Clause
"""A release is one command: one number everywhere, two distributions of what git tracks, a wheel that works alone."""

import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest
from packaging.version import Version

from analytic.errors import InputError
from reports.docs.release import ROOT, built, main, numbered, tracked, wheel_files

FILES = {
    "CHANGELOG.md": "# Changelog\n\n moved. No version has been\nreleased yet.\n\n## [Unreleased]\n\n"
    "### Added\n\n- All.\n",
    "CITATION.cff": "cff-version: 1.2.0\nversion: 0.1.0\nlicense: BSD-3-Clause\n",
    "reports/__init__.py": '"""Reports."""\n\n__version__ = "0.1.0"\n',
}


@pytest.fixture
def project(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def _read(project: Path) -> dict[str, str]:
    return {name: (project / name).read_text() for name in FILES}


@pytest.mark.claim("release-is-one-command")
def test_one_number_is_written_everywhere(project):
    assert sorted(numbered("1.0.0", project, today="2026-12-01")) == sorted(FILES)
    texts = _read(project)
    assert texts["CHANGELOG.md"] == "# Changelog\n\n moved.\n\n## [1.0.0] - 2026-12-01\n\n### Added\n\n- All.\n"
    assert (
        texts["CITATION.cff"]
        == "cff-version: 1.2.0\nversion: 1.0.0\ndate-released: 2026-12-01\nlicense: BSD-3-Clause\n"
    )
    assert '__version__ = "1.0.0"\n' in texts["reports/__init__.py"]
    numbered("1.0.0", project, today="2026-12-02")  # once more, a day later: only the date moves
    assert _read(project) == {name: text.replace("12-01", "12-02") for name, text in texts.items()}


@pytest.mark.parametrize(
    ("given", "change", "words"),
    [
        ("1.0", {}, "release: got '1.0', wanted a version such as 1.0.0"),
        ("1.0.0", {"CHANGELOG.md": "# Changelog\n"}, "wanted a heading ## [Unreleased]"),
        ("1.0.0", {"CITATION.cff": "title: x\n"}, "CITATION.cff: wanted one line 'version: 1.0.0'"),
    ],
)
def test_nothing_is_written_where_something_is_wrong(project, given, change, words):
    for name, text in change.items():
        (project / name).write_text(text)
    before = _read(project)
    with pytest.raises(InputError) as refused:
        numbered(given, project, today="2026-12-01")
    assert words in str(refused.value)
    assert _read(project) == before


def test_the_files_of_the_project_can_take_a_number(tmp_path):
    """The headings and lines that a release looks for are in the real files."""
    for name in FILES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    numbered("9.8.7", tmp_path, today="2026-12-01")
    for name in FILES:
        assert "9.8.7" in (tmp_path / name).read_text(encoding="utf-8")


def test_the_command_says_what_it_wants(capsys):
    assert main([]) == 2
    assert "python -m reports.docs.release VERSION" in capsys.readouterr().err


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    if Version(version("setuptools")) < Version("77"):
        pytest.skip("needs setuptools 77 or newer, which understands the licence field")
    names = _tracked()
    return names, built(ROOT, tmp_path_factory.mktemp("dist"), names)


def _tracked() -> list[str]:
    try:
        return tracked()
    except InputError as error:
        pytest.skip(str(error))


@pytest.mark.slow
@pytest.mark.claim("release-is-one-command")
def test_the_distributions_hold_what_they_must_and_nothing_else(distributions):
    names, (sdist, wheel) = distributions
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if not name.endswith("/")}
        scripts = archive.read(next(name for name in held if name.endswith("entry_points.txt"))).decode()
    assert "airlight = reports.commands.start:main" in scripts
    assert {name for name in held if ".dist-info/" not in name} == wheel_files(names)
    assert not any(name.startswith(("tests/", "docs/")) or name.endswith(".png") for name in held)
    with tarfile.open(sdist) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    assert set(names) - sources <= {".gitignore"}


@pytest.mark.slow
@pytest.mark.claim("wheel-works-alone")
def test_the_wheel_runs_the_ten_lines_of_the_readme(distributions, tmp_path):
    """In an environment with nothing but the wheel and the libraries that it asks for, those of this environment."""
    _, (_, wheel) = distributions
    home = tmp_path / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True, timeout=300)
    scripts = home / ("Scripts" if os.name == "nt" else "bin")
    python = scripts / "python"
    install = ["--python", str(python), "install", "--no-deps", "--no-index", "-q", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", *install], check=True, timeout=300)
    packages = sysconfig.get_path("purelib", vars={"base": str(home), "platbase": str(home)})
    # As a line of a .pth file: its own .pth files, an editable airlight among them, are not read.
    (Path(packages) / "libraries.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
    (snippet,) = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), flags=re.DOTALL | re.MULTILINE)
    program = f"{snippet}\nfrom pathlib import Path\nprint(Path(airlight.__file__).resolve())\n"
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    folder = tmp_path / "empty"
    folder.mkdir()
    options = {"cwd": folder, "env": environment, "capture_output": True, "text": True, "timeout": 600}
    ran = subprocess.run([str(python), "-c", program], **options)
    assert ran.returncode == 0, ran.stderr
    numbers, place = ran.stdout.splitlines()
    assert float(re.fullmatch(r"relative RMSE (\S+), \S+ ms a frame", numbers)[1]) < 0.02
    assert Path(place).parent == Path(packages).resolve()
    ran = subprocess.run([str(scripts / "airlight"), "list", "scenes"], **options)
    assert (ran.returncode, "sphere-spot" in ran.stdout) == (0, True), ran.stderr
    ran = subprocess.run([str(scripts / "airlight"), "test"], **options)
    assert (ran.returncode, "clone it" in ran.stderr) == (3, True)
    assert not list(folder.iterdir())
