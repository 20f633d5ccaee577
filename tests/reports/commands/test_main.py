# SPDX-License-Identifier: BSD-3-Clause
"""The command line's own duties: help, usage, exit statuses, one line for each mistake."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import airlight
from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from reports import __version__
from reports.commands import main as cli
from reports.machine.environment import MissingError

ROOT = Path(__file__).resolve().parents[3]


def _raising(error):
    def scenes():
        raise error

    return scenes


@pytest.fixture
def command_that_raises(monkeypatch):
    """Return a function that makes `airlight scenes` raise an exception."""

    def arrange(error):
        entry = next(command for command in cli.app.registered_commands if command.callback.__name__ == "scenes")
        monkeypatch.setattr(entry, "callback", _raising(error))

    return arrange


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (InputError("albedo: got 2,\n  wanted at most 1"), 2, "airlight: error: albedo: got 2, wanted at most 1"),
        (RealtimeInputError("no light"), 2, "airlight: error: no light"),
        (MissingError("no libLLVM"), 3, "airlight: error: no libLLVM"),
        (FileNotFoundError(2, "No such file or directory", "a.exr"), 2, "error: a.exr: No such file or directory"),
        (PermissionError(13, "Permission denied", "out"), 2, "error: out: Permission denied"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_expected_failures_give_one_line(error, status, words, command_that_raises, capfd, monkeypatch):
    monkeypatch.setattr(cli, "_drop_output", lambda status: status)  # it would silence pytest's own output
    command_that_raises(error)
    assert cli.run(["scenes"]) == status
    captured = capfd.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize("error", [RuntimeError("a bug"), KeyError("x"), ValueError("not an InputError")])
def test_faults_of_the_program_keep_their_traceback(error, command_that_raises):
    command_that_raises(error)
    with pytest.raises(type(error)):
        cli.run(["scenes"])


def test_a_library_missing_at_import_is_named(command_that_raises, capfd, monkeypatch):
    command_that_raises(NameError("name '_drjit_ext' is not defined"))
    monkeypatch.setattr(cli, "missing_packages", lambda: ["libatomic1"])
    assert cli.run(["scenes"]) == 3
    assert "libatomic" in capfd.readouterr().err
    monkeypatch.setattr(cli, "missing_packages", lambda: [])
    with pytest.raises(NameError):
        cli.run(["scenes"])


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["rendr"], ["rendr", "'render'", "airlight --help"]),
        (["render"], ["scene", "airlight render --help"]),
        (["compare", "--layr", "x", "a", "b"], ["--layr", "--layer"]),
        (["--variant", "llvm_rgb", "scenes"], ["'llvm_rgb'", "llvm_ad_rgb"]),
    ],
)
def test_wrong_usage_names_what_is_near(arguments, words, capfd):
    assert cli.run(arguments) == 2
    captured = capfd.readouterr()
    assert captured.err.count("\n") == 1
    for word in words:
        assert word in captured.err


def test_no_command_shows_the_help(capfd):
    assert cli.run([]) == 2
    assert "doctor" in capfd.readouterr().out


@pytest.mark.claim("documented-commands")
@pytest.mark.parametrize("command", [None, *(entry.callback.__name__ for entry in cli.app.registered_commands)])
def test_every_command_has_help(command, capfd):
    name = {"run_tests": "test"}.get(command, command)
    assert cli.run([*filter(None, [name]), "--help"]) == 0
    printed = capfd.readouterr().out
    assert "Usage: airlight" in printed
    assert "`" not in printed  # code is drawn as code


def test_version(capfd):
    assert cli.run(["--version"]) == 0
    assert capfd.readouterr().out == f"airlight {__version__}\n"


@pytest.mark.claim("variant")
def test_variant_reaches_activate(monkeypatch):
    monkeypatch.setenv("AIRLIGHT_VARIANT", "")
    assert cli.run(["--variant", "llvm_ad_rgb", "scenes"]) == 0
    assert os.environ["AIRLIGHT_VARIANT"] == "llvm_ad_rgb"


def test_a_closed_pipe_and_a_full_disk_are_quiet():
    program = [sys.executable, str(ROOT / "airlight.py"), "scenes", "--json"]
    process = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    process.wait(timeout=60)
    process.stderr.close()
    if Path("/dev/full").exists():
        with open("/dev/full", "w") as full:
            ran = subprocess.run(program, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
        assert (ran.returncode, ran.stderr.count("\n")) == (2, 1)


def test_tests_without_a_checkout_say_so(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("reports.commands.test.__file__", str(tmp_path / "reports" / "commands" / "test.py"))
    assert cli.run(["test"]) == 3
    assert "clone it" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["-x"], ["-n", "2", "--dist", "worksteal", "-m", "not statistical and not slow", "-x"]),
        (["--workers", "0"], ["-m", "not statistical and not slow"]),
        (["--all", "--workers", "0", "-x"], ["-x"]),
        (
            ["--all", "--workers", "3", "tests/test_x.py", "-k", "wheel"],
            ["-n", "3", "--dist", "worksteal", "tests/test_x.py", "-k", "wheel"],
        ),
    ],
)
def test_tests_run_pytest_with_what_is_left(arguments, expected, monkeypatch, tmp_path):
    monkeypatch.setattr("reports.machine.environment.threads", lambda: 8)
    asked = {}
    monkeypatch.setattr(os, "execv", lambda program, command: asked.update(command=command))
    monkeypatch.chdir(tmp_path)
    assert cli.run(["test", *arguments]) == 0
    assert asked["command"] == [sys.executable, "-m", "pytest", *expected]
    assert Path.cwd() == ROOT


def test_one_core_has_no_workers(monkeypatch, tmp_path):
    monkeypatch.setattr("reports.machine.environment.threads", lambda: 1)
    asked = {}
    monkeypatch.setattr(os, "execv", lambda program, command: asked.update(command=command))
    monkeypatch.chdir(tmp_path)
    assert cli.run(["test"]) == 0
    assert asked["command"] == [sys.executable, "-m", "pytest", "-m", "not statistical and not slow"]


def test_every_public_name_can_be_imported(variant):
    for name in airlight.__all__:
        assert getattr(airlight, name) is not None
    assert set(airlight.__all__) <= set(dir(airlight))
    with pytest.raises(AttributeError, match="no_such_name"):
        airlight.no_such_name  # noqa: B018 - to look it up is the test


def test_a_deleted_working_folder_is_one_line(tmp_path):
    """Dr.Jit ends the process over it."""
    (tmp_path / "gone").mkdir()
    program = f"cd {tmp_path}/gone && rmdir {tmp_path}/gone && {sys.executable} {ROOT / 'airlight.py'} scenes"
    ran = subprocess.run(["sh", "-c", program], capture_output=True, text=True, timeout=60)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("airlight: error: the current folder was deleted: change into another")
    assert ran.stderr.count("\n") == 1
