# SPDX-License-Identifier: BSD-3-Clause
"""The full run of all tests: what continuous integration runs, and what takes too long for it.

`./airlight test --all` runs the parts one after the other, each in a process of its own, and writes its record for the
page of verification when all have ended. A run that was interrupted leaves the record of the last one.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from reports.docs.verification import RECORD, duration, redraw


@dataclass(frozen=True)
class Counts:
    """Counts of a part of the run."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    remark: str = ""  #: what failed, or is expected to fail


@dataclass(frozen=True)
class Part:
    """A run of pytest, whose counts are in the file that its last argument names."""

    name: str
    command: Sequence[str]  #: arguments of Python


@dataclass(frozen=True)
class Outcome:
    """A part that has ended."""

    name: str
    passed: int
    failed: int
    skipped: int
    remark: str
    seconds: float


def all_parts(workers: Sequence[str]) -> tuple[Part, ...]:
    """Return the parts of a full run; `workers` are pytest's arguments for tests that other processes may disturb."""
    tests = ["-m", "pytest"]
    return (
        Part("unit", _pytest(tests, workers, "not statistical and not slow")),
        Part("statistical", _pytest(tests, workers, "statistical and not slow")),
        # Some of the slow tests compare times, so nothing else runs beside them.
        Part("slow", _pytest(tests, (), "slow")),
    )


def _pytest(command: Sequence[str], workers: Sequence[str], tier: str) -> list[str]:
    return [*command, *workers, "-m", tier, "--junit-xml"]


def count_tests(content: bytes) -> Counts:
    """Count the tests in what pytest writes for `--junit-xml`."""
    suites = list(ElementTree.fromstring(content).iter("testsuite"))
    tests, failures, errors, skipped = (
        sum(int(suite.get(name, 0)) for suite in suites) for name in ("tests", "failures", "errors", "skipped")
    )
    return Counts(tests - failures - errors - skipped, failures + errors, skipped)


def run_part(part: Part, root: Path) -> Outcome:
    """Run one part; it has failed if its command does not write its file."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result"
        command = [sys.executable, *part.command]
        status = subprocess.run([*command, str(path)], cwd=root, check=False).returncode
        try:
            counts = count_tests(path.read_bytes())
        except (OSError, ValueError, ElementTree.ParseError):
            counts = Counts(failed=1, remark=f"ended with status {status} and no result")
    if status and not counts.failed:
        counts = Counts(counts.passed, 1, counts.skipped, f"ended with status {status}")
    return Outcome(part.name, **asdict(counts), seconds=round(time.monotonic() - start, 1))


def run_all(parts: Sequence[Part], root: Path, *, machine: str) -> bool:
    """Run all parts, print what they found, write the record, and return whether none failed.

    Parameters
    ----------
    parts
        What to run.
    root
        The checkout.
    machine
        Processor, threads and variant in words.
    """
    date, commit, changed = time.strftime("%Y-%m-%d %H:%M:%S %z"), *_commit(root)
    start = time.monotonic()
    outcomes = []
    for part in parts:
        print(f"--- {part.name}", flush=True)
        outcomes.append(run_part(part, root))
    seconds = round(time.monotonic() - start, 1)
    print("--- all parts")
    for outcome in outcomes:
        counts = f"{outcome.passed} passed, {outcome.failed} failed, {outcome.skipped} skipped"
        remark = f" ({outcome.remark})" if outcome.remark else ""
        print(f"{outcome.name}: {counts}, {duration(outcome.seconds)}{remark}")
    record = {"date": date, "machine": machine, "commit": commit, "changed": changed, "seconds": seconds}
    _write_record(root, record | {"parts": [asdict(outcome) for outcome in outcomes]})
    return not any(outcome.failed for outcome in outcomes)


def _write_record(root: Path, record: dict[str, Any]) -> None:
    from reference.storage.files import write_text

    write_text(root / RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    print(f"written: {root / RECORD}, {redraw(root)}")


def _commit(root: Path) -> tuple[str, bool]:
    """Return the short name of the commit, and whether files were changed since, those of this run left out."""
    try:
        name = _git(root, "rev-parse", "--short", "HEAD")
        changed = _git(root, "status", "--porcelain", "--", ".", f":!{RECORD}", ":!docs/verification.md")
    except (OSError, subprocess.CalledProcessError):
        return "unknown", False
    return name, bool(changed)


def _git(root: Path, *arguments: str) -> str:
    ran = subprocess.run(["git", *arguments], cwd=root, check=True, capture_output=True, text=True)
    return ran.stdout.strip()
