# SPDX-License-Identifier: BSD-3-Clause
"""The command line's own duties: help, usage, exit statuses, one line for each mistake."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import airlight
from airlight.errors import InputError
from airlight.reports.commands import main as cli
from airlight.reports.machine.environment import MissingError
from airlight.reports.machine.process_start import EXTRAS
from airlight.reports.studies.registry import STUDIES

ROOT = Path(__file__).resolve().parents[3]
_COMMANDS = [["study"], *(["study", name] for name in STUDIES)]
_COMMANDS += [
    cli._NAMES.get(each, each.__name__).split()
    for several in cli._PANELS.values()
    for each in several
]


@pytest.fixture
def command_that_raises(monkeypatch):
    """Return a function that makes `airlight list` raise an exception."""

    def arrange(error):
        def raising(what=None):
            raise error

        monkeypatch.setitem(cli._PANELS, "Start", (raising,))
        monkeypatch.setitem(cli._NAMES, raising, "list")

    return arrange


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (
            InputError("albedo: got 2,\n  expected at most 1"),
            2,
            "airlight: error: albedo: got 2, expected at most 1",
        ),
        (MissingError("no libLLVM"), 3, "airlight: error: no libLLVM"),
        (
            FileNotFoundError(2, "No such file or directory", "a.exr"),
            2,
            "error: a.exr: No such file or directory",
        ),
        (PermissionError(13, "Permission denied", "out"), 2, "error: out: Permission denied"),
        (OSError(28, "No space left on device"), 2, "error: output: No space left on device"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_expected_failures_give_one_line(
    error, status, words, command_that_raises, capfd, monkeypatch
):
    # it would silence pytest's own output
    monkeypatch.setattr(cli, "_drop_output", lambda status: status)
    command_that_raises(error)
    assert cli.run(["list"]) == status
    captured = capfd.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    "error",
    [ValueError("a fault"), OSError(5, "a fault"), ImportError("a fault"), NameError("a fault")],
    ids=lambda error: type(error).__name__,
)
def test_faults_of_the_program_keep_their_traceback(error, command_that_raises, monkeypatch):
    monkeypatch.setattr(cli, "missing_packages", list)
    command_that_raises(error)
    with pytest.raises(type(error), match="a fault"):
        cli.run(["list"])


@pytest.mark.claim("exit-status")
@pytest.mark.parametrize(
    "error", [ImportError("libLLVM.so"), NameError("drjit_ext")], ids=lambda e: type(e).__name__
)
def test_a_system_library_that_is_missing_is_named_with_how_to_install_it(
    error, command_that_raises, monkeypatch, capsys
):
    monkeypatch.setattr(cli, "missing_packages", lambda: ["libllvm19", "libatomic1"])
    command_that_raises(error)
    assert cli.run(["list"]) == 3
    said = capsys.readouterr().err
    assert "system libraries are missing. To install them: `" in said
    assert "apt-get install -y libllvm19 libatomic1` on Debian" in said


@pytest.mark.claim("exit-status")
@pytest.mark.claim("extras-when-needed")
def test_a_command_that_lacks_an_extra_has_the_launcher_add_it_once(
    command_that_raises, monkeypatch, capsys
):
    started = []
    monkeypatch.setattr(
        os, "execve", lambda path, words, world: started.append((path, words[1:], world[EXTRAS]))
    )
    monkeypatch.setattr(sys, "argv", ["airlight", "list"])
    error = MissingError("no pyarrow")
    error.extra = "sweep"
    command_that_raises(error)
    assert cli.run(["list"]) == 3  # from Python or a wheel, without the launcher
    assert cli.run(["list"], extras="test sweep") == 3  # it has added it, and could not
    assert not started
    assert capsys.readouterr().err == 2 * "airlight: error: no pyarrow\n"
    cli.run(["list"], extras="test")
    assert started == [(ROOT / "airlight", ["list"], "test sweep")]


@pytest.mark.claim("extras-when-needed")
@pytest.mark.parametrize(
    ("words", "package"),
    [("view", "websockets"), ("sweep", "pyarrow"), ("test", "pytest"), ("render", "moderngl")],
)
def test_help_asks_for_no_extra(words, package, monkeypatch, capfd):
    monkeypatch.setattr(os, "execve", lambda *given: pytest.fail(f"it starts again: {given}"))
    monkeypatch.setitem(sys.modules, package, None)
    assert cli.run([words, "--help"], extras="") == 0


def test_ctrl_c_ends_with_the_status_of_a_shell(command_that_raises, capsys):
    command_that_raises(KeyboardInterrupt())
    assert cli.run(["list"]) == 130
    assert capsys.readouterr() == ("", "")


@pytest.mark.claim("exit-status")
def test_without_a_command_the_help_is_printed_and_the_use_is_wrong(capsys):
    assert cli.run([]) == 2
    assert "Usage: airlight" in capsys.readouterr().out


@pytest.mark.claim("exit-status")
def test_a_folder_that_was_deleted_is_said_before_any_work(tmp_path, monkeypatch, capsys):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert cli.run(["list"]) == 2
    assert capsys.readouterr().err == (
        "airlight: error: the current folder was deleted: change into another folder, then run "
        "this again\n"
    )


@pytest.mark.parametrize(
    ("closed", "status"), [(True, 1), (False, 2)], ids=["reader left", "disk full"]
)
def test_an_output_that_cannot_be_written_is_written_no_more(closed, status, monkeypatch, capsys):
    """Text that is still in the buffer would fail when Python ends."""
    if closed:
        read, write = os.pipe()
        os.close(read)
    else:
        write = os.open("/dev/full", os.O_WRONLY)
    with os.fdopen(write, "w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        assert cli.run(["list", "kernels"]) == status
        output.write("more")
        output.flush()
    said = capsys.readouterr().err
    assert said == ("" if closed else "airlight: error: output: No space left on device\n")


@pytest.mark.claim("documented-commands")
@pytest.mark.parametrize("command", [[], *_COMMANDS], ids=" ".join)
def test_every_command_has_help_that_fits_80_columns(command, capfd, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.run([*command, "--help"]) == 0
    printed = capfd.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    # No types of Python, nothing cut off.
    assert not re.search(r"<\w+>|\[\[|…|from Python|PATHLIKE|[A-Z]\|[A-Z]", printed)
    assert "Usage: airlight" in printed
    assert "`" not in printed  # code is drawn as code


@pytest.mark.claim("documented-commands")
@pytest.mark.parametrize("words", cli.command_names(), ids=" ".join)
def test_every_argument_and_option_has_help(words):
    arguments = [
        each for each in cli.find_command(words).assemble_argument_collection() if each.parse
    ]
    assert [each.name for each in arguments if not each.parameter.help] == []
    assert arguments or words == ("doctor",)


def test_a_path_may_begin_at_home(tmp_path, monkeypatch, capfd):
    """A ~ that the shell has not expanded: in quotes, or behind an option's equals sign."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for words in (["-o", "~/one.glsl"], ["--output=~/two.glsl"]):
        assert cli.run(["export", *words]) == 0
    assert sorted(path.name for path in tmp_path.glob("*.glsl")) == ["one.glsl", "two.glsl"]
    assert cli.run(["diff", "~/old", "~/new"]) == 2
    assert f"{tmp_path}/old" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["compare", "open-fog", "a.exr", "--margin", "0,5"], "write 0.5"),
        (["render", "open-fog", "--change", "medium.sigma_t=0,5"], "such as 0.5"),
        (
            ["render", "open-fog", "--method", "cloud-collectors", "--set", "stride=0,5"],
            "such as 0.5",
        ),
    ],
)
def test_decimal_commas_are_refused_with_how_to_write_the_number(variant, words, hint, capfd):
    assert cli.run(words) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert hint in line


@pytest.mark.claim("no-color")
def test_no_color_leaves_letters_alone_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setattr(cli, "terminal_width", lambda: 80)
    for value, styled in (("", True), ("1", False)):
        monkeypatch.setenv("NO_COLOR", value)
        assert cli.run(["list", "kernels"]) == 0
        assert ("\x1b[" in capsys.readouterr().out) is styled


def test_lists_have_one_command(capfd):
    assert cli.run(["list", "--json"]) == 0
    data = json.loads(capfd.readouterr().out)["result"]
    assert list(data) == ["scenes", "methods", "kernels", "models", "studies", "papers"]
    for name, rows in data.items():
        assert cli.run(["list", name, "--json"]) == 0
        assert json.loads(capfd.readouterr().out)["result"] == {name: rows}
    assert cli.run(["list"]) == 0
    printed = capfd.readouterr().out
    assert all(f"{name.capitalize()}\n" in printed for name in data)
    assert cli.run(["list", "scene"]) == 2
    assert 'Did you mean "scenes"' in capfd.readouterr().err


def test_names_of_scenes_without_mitsuba_are_those_of_the_registry():
    from airlight.validation.scenes.names import scene_names
    from airlight.validation.scenes.registry import SCENES

    assert scene_names() == tuple(SCENES)


def test_every_public_name_can_be_imported(variant):
    for name in airlight.__all__:
        assert getattr(airlight, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        airlight.no_such_name  # noqa: B018 - to look it up is the test


def test_the_script_of_a_shell_completes_commands_studies_and_options(capfd, tmp_path):
    assert cli.run(["completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capfd.readouterr().out)

    def completed(*words):
        line = " ".join(words)
        code = f"""source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}
            COMP_LINE='{line}'; _airlight airlight '{words[-1]}' '{words[-2]}'
            echo "${{COMPREPLY[@]}}" """
        ran = subprocess.run(["bash", "-c", code], capture_output=True, text=True, check=True)
        return ran.stdout.split()

    assert completed("airlight", "ref") == ["reference"]
    assert completed("airlight", "study", "nois") == ["noise"]
    assert completed("airlight", "render", "--meth") == ["--method"]
    assert completed("airlight", "reference", "hall", "--estimator", "vol") == ["volpath"]
    for shell in ("zsh", "fish"):
        assert cli.run(["completion", shell]) == 0
        assert "--estimator" in capfd.readouterr().out.replace("-l estimator", "--estimator")
    assert cli.run(["completion", "tcsh"]) == 2
