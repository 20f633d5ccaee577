# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the launcher `./airlight` makes its environment once, repairs a broken one, and says what to type.

A Python, a pip and an apt-get that only say what they were asked stand for the machine's. The real installation takes a
minute and a network; it happens wherever `./airlight test` runs on a fresh clone.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LOCKS = ("requirements.lock", "requirements-sweep.lock", "requirements-test.lock")

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="the launcher is a script for POSIX shells"),
    pytest.mark.claim("launcher"),
]

# Stands for every Python of the machine and, through a symbolic link, of the environment. It logs what it is asked
# and fails on request: a file `no-ensurepip` or `pip-fails` beside it says which.
_PYTHON = """#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
case "$*" in
    *"print("*) echo 3.11 ;;
    *"import ensurepip"*) [ ! -e "$here/no-ensurepip" ] ;;
    "-m venv "*) echo venv >>"$here/log"; mkdir -p "$3/bin" && ln -s "$(readlink -f "$0")" "$3/bin/python" &&
        ln -s "$here/uv" "$3/bin/uv" ;;
    "-m pip "*) echo pip >>"$here/log"; [ ! -e "$here/pip-fails" ] ;;
    *"-m airlight.reports.machine.doctor") cat "$here/missing" 2>/dev/null || echo ;;
    -c*) true ;;
    *) printf 'ran'; for word; do printf ' <%s>' "$word"; done; echo ;;
esac
"""
_UV = """#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
echo uv >>"$here/log"; [ ! -e "$here/uv-fails" ]
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
    shutil.copy(ROOT / "airlight", project)
    for name in (*LOCKS, "pyproject.toml"):
        (project / name).write_text(f"{name}\n")
    _program(programs / "python3.11", _PYTHON)
    _program(programs / "uv", _UV)
    for name in ["sh", "cksum", "dirname", "basename", "readlink", "mkdir", "ln", "rm", "cat", "sed", "tee", "flock"]:
        if found := shutil.which(name):
            (programs / name).symlink_to(found)
    _program(programs / "id", "#!/bin/sh\necho 1000\n")
    return tmp_path


def _program(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(0o755)


def _start(machine: Path, *arguments: str, launcher: Path | None = None, **variables: str):
    environment = {"PATH": str(machine / "programs"), "HOME": str(machine), **variables}
    command = [launcher or machine / "a project" / "airlight", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True)


def _log(machine: Path) -> list[str]:
    """Return what the machine's programs were asked since the last look."""
    path = machine / "programs" / "log"
    lines = path.read_text().splitlines() if path.exists() else []
    path.unlink(missing_ok=True)
    return lines


def test_the_first_start_installs_and_later_starts_do_not(machine):
    first = _start(machine, "report", "--scenes", "a b,c", "*")
    assert (first.returncode, first.stdout) == (0, "ran <-P> <-m> <airlight> <report> <--scenes> <a b,c> <*>\n")
    assert _log(machine) == ["venv", "pip", "uv", "uv"]
    assert first.stderr.count("\n") == 1
    (machine / "link").symlink_to(machine / "a project" / "airlight")
    second = _start(machine, "--version", launcher=machine / "link")
    assert (second.returncode, second.stdout, second.stderr) == (0, "ran <-P> <-m> <airlight> <--version>\n", "")
    assert _log(machine) == []


def test_new_versions_are_installed_on_top(machine):
    _start(machine)
    _log(machine)
    (machine / "a project" / "requirements.lock").write_text("other\n")
    assert "updating" in _start(machine).stderr
    assert _log(machine) == ["uv", "uv"]


def test_pip_installs_where_uv_cannot(machine):
    (machine / "programs" / "uv-fails").touch()
    assert _start(machine).returncode == 0
    assert _log(machine) == ["venv", "pip", "uv", "pip", "uv", "pip"]


@pytest.mark.parametrize("command", ["sweep", "test"])
def test_the_packages_of_a_command_wait_for_its_first_start(machine, command):
    _start(machine, "list")
    assert _log(machine) == ["venv", "pip", "uv", "uv"]
    assert "updating" in _start(machine, command, "-q").stderr
    assert _log(machine) == ["uv", "uv"]
    assert _start(machine, command).stderr == _start(machine, "list").stderr == ""
    assert _log(machine) == []
    (machine / "a project" / f"requirements-{command}.lock").write_text("other\n")
    _start(machine, command)
    assert _log(machine) == ["uv", "uv"]


def test_commands_by_turns_install_their_packages_once(machine):
    for command in ("list", "sweep", "test"):
        _start(machine, command)
    _log(machine)
    for command in ("sweep", "test", "list", "sweep"):
        assert _start(machine, command).stderr == ""
    assert _log(machine) == []


@pytest.mark.parametrize("line", [["sweep", "--help"], ["test", "-h"]])
def test_help_installs_no_packages_of_a_command(machine, line):
    _start(machine, "list")
    _log(machine)
    assert _start(machine, *line).stderr == ""
    assert _log(machine) == []


def test_an_interrupted_first_start_is_repaired(machine):
    (machine / "programs" / "pip-fails").touch()
    (machine / "programs" / "uv-fails").touch()
    failed = _start(machine)
    assert (failed.returncode, failed.stdout) == (3, "")
    assert "start again" in failed.stderr
    (machine / "programs" / "pip-fails").unlink()
    (machine / "programs" / "uv-fails").unlink()
    _log(machine)
    assert _start(machine).returncode == 0
    assert _log(machine) == ["venv", "pip", "uv", "uv"]


def test_starts_at_the_same_time_install_once(machine):
    if shutil.which("flock") is None:
        pytest.skip("there is no flock, by which starts wait for one another")
    launcher = machine / "a project" / "airlight"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = {"PATH": str(machine / "programs")}
    started = [subprocess.Popen([launcher, str(n)], env=environment, **pipes) for n in range(3)]
    answers = [process.communicate()[0] for process in started]
    assert [answer.split()[-1] for answer in answers] == ["<0>", "<1>", "<2>"]
    assert _log(machine) == ["venv", "pip", "uv", "uv"]


def test_a_copied_folder_and_a_python_that_has_gone_are_rebuilt(machine):
    _start(machine)
    shutil.copytree(machine / "a project", machine / "copy", symlinks=True)
    assert "making" in _start(machine, launcher=machine / "copy" / "airlight").stderr
    python = machine / "a project" / ".venv" / "bin" / "python"
    python.unlink()
    python.symlink_to(machine / "gone")
    assert "making" in _start(machine).stderr


def test_airlight_python_chooses_the_interpreter(machine):
    other = machine / "my python"
    _program(other, _PYTHON.replace("echo 3.11", "echo 3.12"))
    _start(machine)
    assert "3.12" in _start(machine, AIRLIGHT_PYTHON=str(other)).stderr
    assert _start(machine, AIRLIGHT_PYTHON=str(other)).stderr == ""
    assert _start(machine).stderr == ""  # without the variable what there is stays
    refused = _start(machine, AIRLIGHT_PYTHON="no-such-python")
    assert (refused.returncode, refused.stderr.count("\n")) == (3, 1)
    assert "AIRLIGHT_PYTHON" in refused.stderr


def test_what_is_missing_is_said_in_one_line(machine):
    _program(machine / "programs" / "python3.11", "#!/bin/sh\nexit 1\n")  # too old
    refused = _start(machine)
    assert (refused.returncode, refused.stdout) == (3, "")
    assert "Python 3.11 or newer is needed" in refused.stderr
    _program(machine / "programs" / "python3.11", _PYTHON)
    (machine / "programs" / "no-ensurepip").touch()
    refused = _start(machine)
    assert (refused.returncode, refused.stdout) == (3, "")
    assert refused.stderr.endswith("apt-get install -y python3.11-venv\n")


def test_libraries_are_installed_for_root_and_named_for_others(machine):
    (machine / "programs" / "missing").write_text("libllvm19 libatomic1\n")
    _program(machine / "programs" / "apt-get", _APT)
    first = _start(machine, "doctor")
    assert first.returncode == 0
    assert "missing: sudo apt-get install -y libllvm19 libatomic1; other" in first.stderr.splitlines()[-1]
    _log(machine)
    shutil.rmtree(machine / "a project" / ".venv")
    _program(machine / "programs" / "id", "#!/bin/sh\necho 0\n")
    assert _start(machine, "report").returncode == 0
    (asked,) = [line for line in _log(machine) if "install" in line]
    assert asked.endswith("libllvm19 libatomic1")
