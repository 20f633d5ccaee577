# SPDX-License-Identifier: BSD-3-Clause
"""The launcher `./airlight`, with a Python, a pip and an apt-get that only say what they were asked.

The real installation takes a minute and a network; it happens wherever `./airlight test` runs on a fresh clone.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the launcher is a script for POSIX shells")

# Stands for every Python of the machine and, through a symbolic link, of the environment. It logs what it is asked
# and fails on request: a file `no-ensurepip` or `pip-fails` beside it says which.
_PYTHON = """#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
case "$*" in
    *version_info*) echo "3.11 $here/$(basename "$0")" ;;
    *"import ensurepip"*) [ ! -e "$here/no-ensurepip" ] ;;
    *"import virtualenv"*) false ;;
    "-m venv "*) echo venv >>"$here/log"; mkdir -p "$3/bin" && ln -s "$(readlink -f "$0")" "$3/bin/python" ;;
    "-m pip "*)
        echo "pip" >>"$here/log"
        [ ! -e "$here/pip-is-slow" ] || sleep 1
        [ ! -e "$here/pip-fails" ] ;;
    *"doctor --missing") cat "$here/missing" 2>/dev/null || printf '\\n\\n' ;;
    -c*) true ;;
    *) printf 'ran'; for word; do printf ' <%s>' "$word"; done; echo ;;
esac
"""
_APT = """#!/bin/sh
echo "apt-get $*" >>"$(dirname "$0")/log"
"""


@pytest.fixture
def machine(tmp_path):
    """A folder of programs that stand for the machine's, and a copy of the launcher in a project beside it."""
    project, programs = tmp_path / "a project", tmp_path / "programs"
    project.mkdir()
    programs.mkdir()
    # The folders in which libraries are looked for become one that the test fills.
    launcher = (ROOT / "airlight").read_text()
    line = next(line for line in launcher.splitlines() if line.startswith("library_folders="))
    launcher = launcher.replace(line, f"library_folders={tmp_path}/libraries")
    _program(project / "airlight", launcher)
    for name in ("requirements.lock", "pyproject.toml", "airlight.py"):
        (project / name).write_text(f"{name}\n")
    _program(programs / "python3.11", _PYTHON)
    for name in ("sh", "cksum", "dirname", "basename", "readlink", "mkdir", "ln", "rm", "mv", "cat", "sleep", "grep"):
        (programs / name).symlink_to(shutil.which(name))
    _user(programs, 1000)
    (tmp_path / "libraries").mkdir()
    for name in ("libLLVM.so.19.1", "libatomic.so.1"):
        (tmp_path / "libraries" / name).touch()
    return tmp_path


def _program(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(0o755)


def _user(programs: Path, number: int) -> None:
    _program(programs / "id", f"#!/bin/sh\necho {number}\n")


def _start(machine: Path, *arguments: str, launcher: str | None = None, cwd: Path | None = None, **variables: str):
    environment = {"PATH": str(machine / "programs"), "HOME": str(machine), **variables}
    command = [launcher or str(machine / "a project" / "airlight"), *arguments]
    return subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, timeout=60)


def _log(machine: Path) -> list[str]:
    """Return what the machine's programs were asked since the last look."""
    path = machine / "programs" / "log"
    lines = path.read_text().splitlines() if path.exists() else []
    path.unlink(missing_ok=True)
    return lines


def _left_over(machine: Path) -> set[str]:
    names = {path.name for path in (machine / "a project").iterdir()}
    return names - {"airlight", "airlight.py", "requirements.lock", "pyproject.toml", ".venv"}


@pytest.mark.claim("launcher")
def test_first_start_installs_and_later_starts_do_not(machine):
    first = _start(machine, "report", "--scenes", "a b,c", "*")
    script = machine / "a project" / "airlight.py"
    assert (first.returncode, first.stdout) == (0, f"ran <-S> <{script}> <report> <--scenes> <a b,c> <*>\n")
    assert _log(machine) == ["venv", "pip", "pip"]
    assert first.stderr.count("\n") == 1
    second = _start(machine, "--version")
    assert (second.returncode, second.stdout, second.stderr) == (0, f"ran <-S> <{script}> <--version>\n", "")
    assert _log(machine) == []
    assert not _left_over(machine)


def test_runs_through_symbolic_links_and_from_any_folder(machine):
    _start(machine)
    (machine / "bin").mkdir()
    (machine / "bin" / "once").symlink_to(machine / "a project" / "airlight")
    (machine / "bin" / "twice").symlink_to("once")
    (machine / "other").symlink_to("a project")
    script = machine / "a project" / "airlight.py"
    cases = [
        (str(machine / "bin" / "twice"), machine),
        ("../bin/twice", machine / "bin"),
        ("./airlight", machine / "a project"),
        (str(machine / "other" / "airlight"), Path("/")),
    ]
    for launcher, cwd in cases:
        ran = _start(machine, "x", launcher=launcher, cwd=cwd)
        assert (ran.stdout, ran.stderr) == (f"ran <-S> <{script}> <x>\n", ""), launcher
    assert _log(machine).count("venv") == 1


def test_new_versions_are_installed_on_top(machine):
    _start(machine)
    _log(machine)
    (machine / "a project" / "requirements.lock").write_text("other\n")
    assert "updating" in _start(machine).stderr
    assert _log(machine) == ["pip", "pip"]


def test_an_interrupted_first_start_is_repaired(machine):
    (machine / "programs" / "pip-fails").touch()
    failed = _start(machine)
    assert failed.returncode == 3
    assert "start again" in failed.stderr
    assert "ran" not in failed.stdout
    (machine / "programs" / "pip-fails").unlink()
    _log(machine)
    assert _start(machine).returncode == 0
    assert _log(machine) == ["venv", "pip", "pip"]
    assert not _left_over(machine)


def test_starts_at_the_same_time_install_once(machine):
    (machine / "programs" / "pip-is-slow").touch()
    environment = {"PATH": str(machine / "programs")}
    launcher = machine / "a project" / "airlight"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    started = [subprocess.Popen([launcher, str(n)], env=environment, **pipes) for n in range(3)]
    answers = [process.communicate(timeout=60)[0] for process in started]
    assert [answer.split()[-1] for answer in answers] == ["<0>", "<1>", "<2>"]
    assert _log(machine) == ["venv", "pip", "pip"]
    assert not _left_over(machine)


def test_a_copied_folder_and_a_python_that_has_gone_are_rebuilt(machine):
    _start(machine)
    shutil.copytree(machine / "a project", machine / "copy", symlinks=True)
    assert "making" in _start(machine, launcher=str(machine / "copy" / "airlight")).stderr
    python = machine / "a project" / ".venv" / "bin" / "python"
    python.unlink()
    python.symlink_to(machine / "gone")
    assert "making" in _start(machine).stderr
    assert "venv" in _log(machine)


def test_airlight_python_chooses_the_interpreter(machine):
    other = machine / "my python"
    _program(other, _PYTHON.replace("3.11 $here", "3.12 $here"))
    _start(machine)
    assert "3.12" in _start(machine, AIRLIGHT_PYTHON=str(other)).stderr
    assert _start(machine, AIRLIGHT_PYTHON=str(other)).stderr == ""
    assert _start(machine).stderr == ""  # without the variable what there is stays
    refused = _start(machine, AIRLIGHT_PYTHON="no-such-python")
    assert (refused.returncode, refused.stderr.count("\n")) == (3, 1)
    assert "AIRLIGHT_PYTHON" in refused.stderr


@pytest.mark.claim("launcher")
def test_a_python_that_is_too_old_is_refused_by_its_real_version(machine):
    old = machine / "programs" / "python3.11"
    _program(old, "#!/bin/sh\nexit 1\n")
    refused = _start(machine)
    assert (refused.returncode, refused.stdout) == (3, "")
    assert "Python 3.11 or newer is needed" in refused.stderr


@pytest.mark.claim("launcher")
def test_missing_ensurepip_gives_the_line_to_type(machine):
    (machine / "programs" / "no-ensurepip").touch()
    _program(machine / "programs" / "apt-get", _APT)
    refused = _start(machine)
    assert (refused.returncode, refused.stdout) == (3, "")
    assert "apt-get install -y python3.11-venv" in refused.stderr
    assert not _left_over(machine)


class TestLibraries:
    """What the launcher does about libLLVM and libatomic."""

    @pytest.fixture(autouse=True)
    def _only_llvm_14(self, machine):
        (machine / "libraries" / "libLLVM.so.19.1").rename(machine / "libraries" / "libLLVM-14.so.1")
        (machine / "programs" / "missing").write_text("libllvm19 libatomic1\nsudo install both\n")

    def test_a_user_is_told_once_what_to_type_and_python_decides(self, machine):
        first = _start(machine, "doctor")
        assert first.returncode == 0
        assert first.stderr.splitlines()[-1] == "airlight: system libraries are missing: sudo install both"
        assert "<doctor>" in first.stdout
        assert _start(machine, "report").stderr == ""

    def test_root_installs(self, machine):
        _program(machine / "programs" / "apt-get", _APT)
        _program(machine / "programs" / "apt-cache", "#!/bin/sh\n")
        _user(machine / "programs", 0)
        assert _start(machine, "report").returncode == 0
        asked = [line for line in _log(machine) if "install" in line]
        assert len(asked) == 1
        assert asked[0].endswith("libllvm19 libatomic1")

    def test_root_installs_what_went_missing_later_but_not_for_help(self, machine):
        _program(machine / "programs" / "apt-cache", "#!/bin/sh\n")
        _start(machine)
        _program(machine / "programs" / "apt-get", _APT)
        _user(machine / "programs", 0)
        _log(machine)
        for command in ("--help", "doctor", "scenes"):
            _start(machine, command)
        assert _log(machine) == []
        _start(machine, "report")
        assert any("libatomic1" in line for line in _log(machine))

    def test_the_version_counts_not_the_name(self, machine):
        for name, version in {"libLLVM-17.so.1": True, "libLLVM-15.so": False, "libLLVM.so.20.1": True}.items():
            file = machine / "libraries" / name
            file.touch()
            shutil.rmtree(machine / "a project" / ".venv", ignore_errors=True)
            assert ("missing" not in _start(machine).stderr) == version, name
            file.unlink()
