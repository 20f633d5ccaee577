# SPDX-License-Identifier: BSD-3-Clause
"""`airlight test --all`: what each part counts, the record, and what becomes of it when a run is interrupted."""

import json
import shutil
import subprocess

import pytest

from reports.commands import main as cli
from reports.docs import full_run
from reports.docs.full_run import Part, all_parts, run_all, run_part
from reports.docs.verification import RECORD, ROOT

XML = '<testsuites><testsuite tests="{}" failures="{}" errors="0" skipped="1"/></testsuites>'
WRITES = "import sys; open(sys.argv[1], 'w').write({!r})"


def pytest_part(name="unit", *, tests=5, failures=0):
    code = WRITES.format(XML.format(tests, failures)) + f"; sys.exit({int(failures > 0)})"
    return Part(name, ["-c", code])


@pytest.fixture
def checkout(tmp_path):
    """A checkout with a page of verification and one test."""
    for name in ("docs/claims.toml", "docs/verification.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / "tests").mkdir()
    for command in (["init", "-q"], ["add", "."], [*_AUTHOR, "commit", "-qm", "x"]):
        subprocess.run(["git", *command], cwd=tmp_path, check=True, capture_output=True)
    return tmp_path


_AUTHOR = ["-c", "user.name=x", "-c", "user.email=x"]


def test_a_run_is_recorded_and_shown(checkout, capfd):
    assert run_all([pytest_part(), pytest_part("slow", tests=3)], checkout, machine="a processor")
    record = json.loads((checkout / RECORD).read_text())
    assert record["machine"] == "a processor"
    assert record["changed"] is False
    assert [(part["name"], part["passed"], part["failed"], part["skipped"]) for part in record["parts"]] == [
        ("unit", 4, 0, 1),
        ("slow", 2, 0, 1),
    ]
    page = (checkout / "docs/verification.md").read_text()
    assert f"a processor, commit {record['commit']}: " in page
    assert "| slow | 2 | 0 | 1 | 0 s |" in page
    assert "slow: 2 passed, 0 failed, 1 skipped" in capfd.readouterr().out
    # A second run does not take the first one's record for a change, but what else has changed.
    assert run_all([pytest_part()], checkout, machine="a processor")
    assert json.loads((checkout / RECORD).read_text())["changed"] is False
    (checkout / "new.py").touch()
    assert run_all([pytest_part()], checkout, machine="a processor")
    assert json.loads((checkout / RECORD).read_text())["changed"] is True


def test_one_failure_fails_the_run_and_the_other_parts_still_run(checkout):
    assert not run_all([pytest_part(failures=2), pytest_part("slow")], checkout, machine="")
    parts = json.loads((checkout / RECORD).read_text())["parts"]
    assert [(part["passed"], part["failed"]) for part in parts] == [(2, 2), (4, 0)]


@pytest.mark.parametrize(
    ("code", "failed", "remark"),
    [
        ("import sys; sys.exit(4)", 1, "ended with status 4 and no result"),
        (WRITES.format("<no") + "; sys.exit(3)", 1, "ended with status 3 and no result"),
        (WRITES.format(XML.format(5, 0)) + "; sys.exit(3)", 1, "ended with status 3"),
    ],
)
def test_a_part_that_dies_has_failed(tmp_path, code, failed, remark):
    outcome = run_part(Part("unit", ["-c", code]), tmp_path)
    assert (outcome.failed, outcome.remark) == (failed, remark)


def test_the_command_runs_every_part_and_its_status_is_theirs(checkout, monkeypatch):
    monkeypatch.setattr("reports.commands.test.__file__", str(checkout / "reports/commands/test.py"))
    monkeypatch.chdir(checkout)
    for failures, status in ((0, 0), (1, 1)):
        parts = [pytest_part(failures=failures)]
        monkeypatch.setattr(full_run, "all_parts", lambda sharing, parts=parts: parts)
        assert cli.run(["test", "--all"]) == status
        assert "threads" in json.loads((checkout / RECORD).read_text())["machine"]


def test_ctrl_c_leaves_the_record_of_the_last_run(checkout, monkeypatch, capfd):
    run_all([pytest_part()], checkout, machine="the last run")
    kept = (checkout / RECORD).read_text(), (checkout / "docs/verification.md").read_text()

    def interrupted(part, root):
        raise KeyboardInterrupt

    monkeypatch.setattr(full_run, "run_part", interrupted)
    monkeypatch.setattr("reports.commands.test.__file__", str(checkout / "reports/commands/test.py"))
    monkeypatch.chdir(checkout)
    monkeypatch.setattr(full_run, "all_parts", lambda sharing: [pytest_part()])
    assert cli.run(["test", "--all"]) == 130
    assert ((checkout / RECORD).read_text(), (checkout / "docs/verification.md").read_text()) == kept
    assert "interrupted" in capfd.readouterr().err


def test_parts_are_what_continuous_integration_runs_and_all_else():
    parts = {part.name: " ".join(part.command) for part in all_parts(["-n", "2"])}
    assert list(parts) == ["unit", "statistical", "slow"]
    assert "-n 2 -m not statistical and not slow" in parts["unit"]
    assert "-n 2 -m statistical and not slow" in parts["statistical"]
    assert "-m slow" in parts["slow"]
    assert "-n 2" not in parts["slow"]
