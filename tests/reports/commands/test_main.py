# SPDX-License-Identifier: BSD-3-Clause
"""The command line's own duties: help, usage, exit statuses, one line for each mistake."""

import json
import os
import re
import subprocess
import sys
from contextlib import suppress
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import typer

import airlight
from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from reports.commands import main as cli
from reports.machine.environment import MissingError

ROOT = Path(__file__).resolve().parents[3]


_GROUP = typer.main.get_command(cli.app)
_COMMANDS = list(_GROUP.commands)


def _raising(error):
    def doctor():
        raise error

    return doctor


@pytest.fixture
def command_that_raises(monkeypatch):
    """Return a function that makes `airlight doctor` raise an exception."""

    def arrange(error):
        entry = next(command for command in cli.app.registered_commands if command.callback.__name__ == "doctor")
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
    ],
    ids=lambda value: type(value).__name__,
)
def test_expected_failures_give_one_line(error, status, words, command_that_raises, capfd, monkeypatch):
    monkeypatch.setattr(cli, "_drop_output", lambda status: status)  # it would silence pytest's own output
    command_that_raises(error)
    assert cli.run(["doctor"]) == status
    captured = capfd.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert captured.err.count("\n") == 1


def test_faults_of_the_program_keep_their_traceback(command_that_raises):
    command_that_raises(ValueError("not an InputError"))
    with pytest.raises(ValueError, match="not an InputError"):
        cli.run(["doctor"])


def test_a_library_missing_at_import_is_named(command_that_raises, capfd, monkeypatch):
    command_that_raises(NameError("name '_drjit_ext' is not defined"))
    monkeypatch.setattr(cli, "missing_packages", lambda: ["libatomic1"])
    assert cli.run(["doctor"]) == 3
    assert "libatomic" in capfd.readouterr().err
    monkeypatch.setattr(cli, "missing_packages", lambda: [])
    with pytest.raises(NameError):
        cli.run(["doctor"])


def test_no_command_shows_the_help(capfd):
    assert cli.run([]) == 2
    assert "doctor" in capfd.readouterr().out


@pytest.mark.claim("documented-commands")
@pytest.mark.parametrize("command", [None, *_COMMANDS])
def test_every_command_has_help_that_fits_80_columns(command, capfd, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.run([*filter(None, [command]), "--help"]) == 0
    printed = capfd.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    assert not re.search(r"<\w+>|\[\[|…", printed)  # no types of Python, nothing in brackets twice, nothing cut off
    assert "Usage: airlight" in printed
    assert "`" not in printed  # code is drawn as code


@pytest.mark.claim("no-color")
def test_no_color_leaves_letters_alone_on_a_terminal():
    """On a pseudo-terminal, as `script` gives it: with NO_COLOR there is no escape sequence, without it there is."""
    pty = pytest.importorskip("pty")

    def printed(**variables):
        try:
            ours, theirs = pty.openpty()
        except OSError as error:
            pytest.skip(f"this machine has no pseudo-terminals: {error}")
        own = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")}
        environment = own | {"TERM": "xterm-256color", **variables}
        command = [sys.executable, str(ROOT / "airlight.py"), "list", "kernels"]
        process = subprocess.Popen(command, stdout=theirs, stderr=theirs, stdin=subprocess.DEVNULL, env=environment)
        os.close(theirs)
        pieces = []
        with suppress(OSError):  # the end of a terminal is an error
            while piece := os.read(ours, 65536):
                pieces.append(piece)
        os.close(ours)
        assert process.wait(timeout=60) == 0
        return b"".join(pieces).decode()

    assert "\x1b[" in printed()
    assert "\x1b" not in printed(NO_COLOR="1")


def test_lists_have_one_command(capfd):
    assert cli.run(["list", "--json"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert list(data) == ["scenes", "methods", "kernels"]
    for name, rows in data.items():
        assert cli.run(["list", name, "--json"]) == 0
        assert json.loads(capfd.readouterr().out) == rows
    assert cli.run(["list"]) == 0
    printed = capfd.readouterr().out
    assert all(f"{name.capitalize()}\n" in printed for name in data)
    assert cli.run(["list", "scene"]) == 2
    assert "did you mean 'scenes'" in capfd.readouterr().err


@pytest.mark.claim("variant")
def test_variant_reaches_activate(monkeypatch):
    monkeypatch.setenv("AIRLIGHT_VARIANT", "")
    assert cli.run(["--variant", "llvm_ad_rgb", "list"]) == 0
    assert os.environ["AIRLIGHT_VARIANT"] == "llvm_ad_rgb"


def test_a_closed_pipe_and_a_full_disk_are_quiet():
    program = [sys.executable, str(ROOT / "airlight.py"), "list", "scenes", "--json"]
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
    ("arguments", "cores", "expected"),
    [
        (["-x"], 8, ["-n", "2", "--dist", "worksteal", "-m", "not statistical and not slow", "-x"]),
        ([], 1, ["-m", "not statistical and not slow"]),
        (["--all", "--workers", "0", "-x"], 8, ["-x"]),
    ],
)
def test_tests_run_pytest_with_what_is_left(arguments, cores, expected, monkeypatch, tmp_path):
    for name in ("AIRLIGHT_COMPILATION", "DRJIT_CACHE_DIR"):
        monkeypatch.setenv(name, os.environ.get(name, ""))  # as it was after the test: the command sets both
    monkeypatch.setattr("reports.machine.environment.threads", lambda: cores)
    asked = {}
    monkeypatch.setattr(os, "execv", lambda program, command: asked.update(command=command))
    monkeypatch.chdir(tmp_path)
    assert cli.run(["test", *arguments]) == 0
    assert asked["command"] == [sys.executable, "-m", "pytest", *expected]
    assert Path.cwd() == ROOT


def test_every_public_name_can_be_imported(variant):
    for name in airlight.__all__:
        assert getattr(airlight, name) is not None
    assert set(airlight.__all__) <= set(dir(airlight))
    with pytest.raises(AttributeError, match="no_such_name"):
        airlight.no_such_name  # noqa: B018 - to look it up is the test


def test_a_deleted_working_folder_is_one_line(tmp_path):
    """Dr.Jit ends the process over it."""
    (tmp_path / "gone").mkdir()
    program = f"cd {tmp_path}/gone && rmdir {tmp_path}/gone && {sys.executable} {ROOT / 'airlight.py'} list"
    ran = subprocess.run(["sh", "-c", program], capture_output=True, text=True, timeout=60)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("airlight: error: the current folder was deleted: change into another")
    assert ran.stderr.count("\n") == 1


@pytest.mark.claim("help-is-light", tolerance="300 modules; it imports 220")
def test_help_imports_nothing_heavy():
    """What it imports and not how long that takes: processors differ, and so does what else runs on them."""
    # As the launcher starts it.
    command = [sys.executable, "-S", "-X", "importtime", str(ROOT / "airlight.py"), "--help"]
    ran = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    modules = [line.rsplit("|", 1)[1].strip() for line in ran.stderr.splitlines()[1:]]
    installed = {name.partition(".")[0] for name in packages_distributions()}
    ours = {folder.name for folder in ROOT.iterdir() if (folder / "__init__.py").exists()}
    imported = {name.partition(".")[0] for name in modules} & installed - ours
    assert "typer" in imported
    assert imported <= {"_distutils_hack", "annotated_doc", "click", "shellingham", "typer", "typing_extensions"}
    assert len(modules) < 300
