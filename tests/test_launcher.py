# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the launcher `./airlight` makes its environment once, repairs a broken
one, and says what to type.

A Python and an apt-get that only say what they were asked stand for the machine's.
`reports/machine/test_install.py` tests what installs the packages. The real installation needs a
network; it happens wherever `./airlight test` runs on a fresh clone.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="the launcher is a script for POSIX shells"),
    pytest.mark.claim("launcher"),
]

# Stands for every Python of the machine and, through a symbolic link, of the environment. It logs
# what it is asked and fails on request: a file `no-ensurepip` or `install-fails` beside it says
# which.
_PYTHON = """#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
case "$*" in
    *"print("*) echo 3.11 ;;
    *"import ensurepip"*) [ ! -e "$here/no-ensurepip" ] ;;
    "-m venv "*) echo venv >>"$here/log"; mkdir -p "$3/bin" && ln -s "$(readlink -f "$0")" "$3/bin/python" ;;
    "-I "*install.py*) shift 2; echo install "$@" >>"$here/log"; [ ! -e "$here/install-fails" ] ;;
    *"-m airlight.reports.machine.doctor") cat "$here/missing" 2>/dev/null || echo ;;
    -c*) true ;;
    *) printf 'ran'; for word; do printf ' <%s>' "$word"; done; echo " with$AIRLIGHT_EXTRAS" ;;
esac
"""
_APT = """#!/bin/sh
echo "apt-get $*" >>"$(dirname "$0")/log"
"""


@pytest.fixture
def machine(tmp_path):
    """A folder of programs that stand for the machine's, and a copy of the
    launcher in a project beside it.
    """
    project, programs = tmp_path / "a project", tmp_path / "programs"
    project.mkdir()
    programs.mkdir()
    shutil.copy(ROOT / "airlight", project)
    for name in ("uv.lock", "pyproject.toml"):
        (project / name).write_text(f"{name}\n")
    _program(programs / "python3.11", _PYTHON)
    for name in [
        "sh",
        "cksum",
        "dirname",
        "basename",
        "readlink",
        "mkdir",
        "ln",
        "rm",
        "cat",
        "flock",
    ]:
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
    assert (first.returncode, first.stdout) == (
        0,
        "ran <-P> <-m> <airlight> <report> <--scenes> <a b,c> <*> with\n",
    )
    assert _log(machine) == ["venv", "install"]
    assert first.stderr.count("\n") == 1
    (machine / "link").symlink_to(machine / "a project" / "airlight")
    second = _start(machine, "--version", launcher=machine / "link")
    assert (second.returncode, second.stdout, second.stderr) == (
        0,
        "ran <-P> <-m> <airlight> <--version> with\n",
        "",
    )
    assert _log(machine) == []


def test_new_versions_are_installed_on_top_with_all_extras_that_were_added(machine):
    _start(machine, AIRLIGHT_EXTRAS="sweep")
    _log(machine)
    (machine / "a project" / "uv.lock").write_text("other\n")
    assert "adding packages to .venv: new versions" in _start(machine).stderr
    assert _log(machine) == ["install sweep"]
    assert _start(machine).stderr == ""


def test_an_extra_is_added_once_to_what_is_there(machine):
    """The command that needs it starts the launcher again, and is told what was
    added: it does not ask twice.
    """
    _start(machine, "list")
    assert _log(machine) == ["venv", "install"]
    added = _start(machine, "sweep", "x.toml", AIRLIGHT_EXTRAS="sweep")
    assert added.stderr == "airlight: adding packages to .venv: sweep\n"
    assert added.stdout.endswith("<sweep> <x.toml> withsweep\n")
    assert _log(machine) == ["install sweep"]
    assert _start(machine, "sweep", "x.toml").stderr == _start(machine, "list").stderr == ""
    assert _start(machine, "test", AIRLIGHT_EXTRAS="test").returncode == 0
    assert _log(machine) == ["install sweep test"]  # removes nothing
    for command in ("sweep", "test", "list", "sweep"):
        assert _start(machine, command).stderr == ""
    assert _log(machine) == []


def test_an_extra_that_could_not_be_added_is_not_taken_for_there(machine):
    _start(machine)
    (machine / "programs" / "install-fails").touch()
    assert _start(machine, AIRLIGHT_EXTRAS="sweep").returncode == 3
    (machine / "programs" / "install-fails").unlink()
    _log(machine)
    (machine / "a project" / "uv.lock").write_text("other\n")
    _start(machine)
    assert _log(machine) == ["install"]


def test_an_interrupted_first_start_is_repaired(machine):
    (machine / "programs" / "install-fails").touch()
    failed = _start(machine)
    assert (failed.returncode, failed.stdout) == (3, "")
    assert "start again" in failed.stderr
    (machine / "programs" / "install-fails").unlink()
    _log(machine)
    assert _start(machine).returncode == 0
    assert _log(machine) == ["venv", "install"]


def test_starts_at_the_same_time_install_once(machine):
    if shutil.which("flock") is None:
        pytest.skip("there is no flock, by which starts wait for one another")
    launcher = machine / "a project" / "airlight"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = {"PATH": str(machine / "programs")}
    started = [subprocess.Popen([launcher, str(n)], env=environment, **pipes) for n in range(3)]
    answers = [process.communicate()[0] for process in started]
    assert [answer.split()[-2] for answer in answers] == ["<0>", "<1>", "<2>"]
    assert _log(machine) == ["venv", "install"]


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
    assert (
        "missing: sudo apt-get install -y libllvm19 libatomic1; other"
        in first.stderr.splitlines()[-1]
    )
    _log(machine)
    shutil.rmtree(machine / "a project" / ".venv")
    _program(machine / "programs" / "id", "#!/bin/sh\necho 0\n")
    assert _start(machine, "report").returncode == 0
    (asked,) = [line for line in _log(machine) if line.startswith("apt-get -y")]
    assert asked.endswith("libllvm19 libatomic1")
