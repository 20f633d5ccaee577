# SPDX-License-Identifier: BSD-3-Clause
"""`airlight test` and the start of a command: what pytest is asked, and what is
written of a run of all tiers.

No suite runs within the suite: a stub stands in the place of pytest.
"""

import json
import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from airlight.reference.storage import build as identity
from airlight.reports.commands import main as cli
from airlight.reports.commands import start
from airlight.reports.commands import test as command
from airlight.reports.machine.quick_compilation import CACHE_VARIABLE, VARIABLE

ROOT = Path(__file__).resolve().parents[3]
PYTEST = [sys.executable, "-m", "pytest"]
SHARED = ["-n", "2", "--dist", "worksteal"]
DEFAULT = ["-m", "not statistical and not slow"]
SUITE = '<testsuites><testsuite tests="9" failures="1" errors="2" skipped="3"/></testsuites>'


class Replaced(Exception):
    """The process would have become another one; its arguments are the command."""


@pytest.fixture(autouse=True)
def _own_environment(variant, monkeypatch, tmp_path):
    """Four cores, memory for two workers, an environment in which nothing is set,
    and another current folder.
    """

    def replaced(program, words):
        assert program == sys.executable
        raise Replaced(*words)

    memory = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": int(2.5 * command.WORKER_MEMORY) // 4096}
    monkeypatch.setattr(
        os, "environ", {name: os.environ[name] for name in os.environ if name != VARIABLE}
    )
    monkeypatch.setattr(os, "sysconf", memory.__getitem__)
    monkeypatch.setattr(os, "execv", replaced)
    monkeypatch.setattr("airlight.reports.machine.environment.threads", lambda: 4)
    monkeypatch.chdir(tmp_path)


def asked(*words):
    """Return what the process becomes."""
    with pytest.raises(Replaced) as raised:
        cli.run(["test", *words])
    return list(raised.value.args)


def test_the_default_tier_is_shared_by_as_many_processes_as_have_memory_and_compiles_quickly(
    variant,
):
    assert asked("tests/reports", "-k", "fog") == [
        *PYTEST,
        *SHARED,
        *DEFAULT,
        "tests/reports",
        "-k",
        "fog",
    ]
    assert Path.cwd() == ROOT  # the checkout, which paths are relative to
    quick = variant == "llvm_ad_rgb"  # CUDA compiles by other means
    assert (os.environ.get(VARIABLE) == "quick") is quick
    assert (Path(os.environ.get(CACHE_VARIABLE, "")).name == "quick") is quick


def test_one_core_is_one_process_and_full_compilation_stays_as_it_was_asked_for(monkeypatch):
    monkeypatch.setattr("airlight.reports.machine.environment.threads", lambda: 1)
    os.environ[VARIABLE] = "full"
    assert asked() == [*PYTEST, *DEFAULT]
    assert os.environ[VARIABLE] == "full"


def test_some_tests_of_all_tiers_write_no_record(monkeypatch):
    monkeypatch.setattr(command, "subprocess", None)  # a record would need it
    assert asked("--all", "tests/docs") == [*PYTEST, *SHARED, "tests/docs"]
    assert VARIABLE not in os.environ  # what everything else runs


def test_help_is_that_of_the_command_and_what_is_behind_two_dashes_is_pytests(capsys):
    assert cli.run(["test", "--help"]) == 0
    assert "Usage: airlight test" in capsys.readouterr().out
    assert asked("--", "--help") == [*PYTEST, *SHARED, *DEFAULT, "--help"]


@pytest.mark.parametrize(
    ("status", "commit", "changed"),
    [(0, "1a2b3c4", False), (1, "1a2b3c4", True), (1, "unknown", None)],
    ids=["of a commit", "of changed files", "without git"],
)
def test_a_run_of_all_tiers_is_recorded_with_its_commit_and_counts(
    monkeypatch, tmp_path, capsys, clock, status, commit, changed
):
    def run(words, **how):
        assert words[: len(PYTEST + SHARED)] == PYTEST + SHARED
        assert "--allowed-skips=.ci/skips" in words
        (results,) = (
            word.removeprefix("--junit-xml=") for word in words if word.startswith("--junit-xml=")
        )
        Path(results).write_text(SUITE)
        clock.now += 61.2
        return SimpleNamespace(returncode=status)

    monkeypatch.setattr(command, "subprocess", SimpleNamespace(run=run))
    monkeypatch.setattr(identity, "build", lambda: identity.Build("0.9", commit, changed, "ab"))
    monkeypatch.setattr(command, "RECORD", str(tmp_path / "record.json"))
    monkeypatch.setenv(VARIABLE, "quick")
    assert cli.run(["test", "--all"]) == status
    record = json.loads((tmp_path / "record.json").read_text())
    assert {
        name: record[name] for name in ("commit", "changed", "passed", "failed", "skipped")
    } == {
        "commit": commit,
        "changed": changed,
        "passed": 3,
        "failed": 3,
        "skipped": 3,
    }
    assert record["seconds"] == 61
    assert record["compilation"] == "quick"
    assert "4 threads" in record["machine"]
    assert capsys.readouterr().out == f"written: {tmp_path / 'record.json'}\n"


@pytest.mark.parametrize("status", [-9, 2, 4], ids=["killed", "interrupted", "wrong arguments"])
def test_a_run_that_did_not_end_leaves_the_record_and_fails(monkeypatch, tmp_path, capsys, status):
    """An interrupted pytest writes its results so far, which have no failure."""
    record = tmp_path / "record.json"
    record.write_text("the run before")

    def ended(words, **how):
        (results,) = (word for word in words if word.startswith("--junit-xml="))
        if status == 2:
            Path(results.removeprefix("--junit-xml=")).write_text(SUITE)
        return SimpleNamespace(returncode=status)

    monkeypatch.setattr(command, "RECORD", str(record))
    monkeypatch.setattr(command, "subprocess", SimpleNamespace(run=ended))
    assert cli.run(["test", "--all"]) == 1
    assert record.read_text() == "the run before"
    assert (
        capsys.readouterr().err
        == f"airlight: error: pytest ended with {status} before all tests ran: no record\n"
    )


def test_an_installed_package_has_no_tests_and_says_where_they_are(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(command, "__file__", str(tmp_path / "reports" / "commands" / "test.py"))
    assert cli.run(["test"]) == 3
    assert (
        f"there are no tests in {tmp_path}, they come with the source only"
        in capsys.readouterr().err
    )


def test_a_command_begins_with_signals_of_the_system_and_ends_with_its_status(monkeypatch, capsys):
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.setattr(sys, "argv", ["airlight", "list", "nowhere"])
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with pytest.raises(SystemExit) as ended:
            start.main()
        assert {signal.getsignal(number) for number in before} == {signal.SIG_DFL}
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert ended.value.code == 2
    assert 'Invalid value "nowhere"' in capsys.readouterr().err
