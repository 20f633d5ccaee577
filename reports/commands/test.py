# SPDX-License-Identifier: BSD-3-Clause
"""`airlight test [PYTEST ARGUMENTS]`: the tests of this checkout."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

RECORD = "docs/data/full_run.json"  #: of the last run of all tiers, in the checkout
WORKER_MEMORY = 4e9  #: [bytes]: the largest worker of a run of all tiers held 3.1 GB


def run_tests(*arguments: str, all_: bool = False) -> int:
    """Run the fast tests of the source checkout, or all tests.

    The fast tests compile kernels quickly, unless AIRLIGHT_COMPILATION=full asks for what
    everything else runs. Images are the same bit for bit.

    `--all` without arguments for pytest writes the date, the machine, how kernels were compiled and
    the counts into docs/data/full_run.json. It fails if a test was skipped for a reason that
    .ci/skips does not allow. Exit status 1 if anything failed.

    Parameters
    ----------
    arguments
        For pytest, its options too; paths are relative to the checkout. As many processes share the
        tests as there are cores, as far as the memory goes; -n 0 is this one.
    all_
        Also the slow and the statistical tests, injected faults and baselines.
    """
    from airlight.reports.machine import quick_compilation
    from airlight.reports.machine.environment import MissingError, prepare, require

    root = Path(__file__).resolve().parents[2]
    if not (root / "tests").is_dir():
        raise MissingError(
            f"there are no tests in {root}, they come with the source only: clone it and run "
            "`./airlight test` there"
        )
    # The machine is checked first: thousands of tests would otherwise fail for one missing library.
    require("pytest", "test", "a test")
    variant = prepare().variant
    workers = _workers()
    # pytest-xdist, whose workers take tests from one another near the end.
    sharing = ["-n", str(workers), "--dist", "worksteal"] if workers > 1 else []
    os.chdir(root)
    if not all_ and variant == "llvm_ad_rgb" and quick_compilation.VARIABLE not in os.environ:
        os.environ.update(quick_compilation.settings())  # of processes that have not begun
    # Markers leave the slow tiers out; --all runs every one.
    tiers = [] if all_ else ["-m", "not statistical and not slow"]
    command = [sys.executable, "-m", "pytest", *sharing, *tiers, *arguments]
    sys.stdout.flush()
    # Only a run of everything may write the record. Any other replaces this process, so that
    # signals and the status are pytest's.
    if all_ and not arguments:
        return _recorded(command, root, variant)
    os.execv(sys.executable, command)


def _workers() -> int:
    """Return how many processes share the tests: a core each, and the
    memory that a worker needs.
    """
    from airlight.reports.machine.environment import threads

    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(1, min(threads(), int(memory / WORKER_MEMORY)))


def _recorded(command: list[str], root: Path, variant: str) -> int:
    """Run all tests, write the record, and return the exit status."""
    from xml.etree import ElementTree

    from airlight.analytic.clock import stopwatch
    from airlight.reference.storage.build import build
    from airlight.reference.storage.files import temporary_folder, write_text
    from airlight.reports.machine import quick_compilation
    from airlight.reports.machine.environment import describe_environment, machine_in_words

    # The commit is read before the tests, which may take an hour.
    took, made = stopwatch(), build()
    with temporary_folder() as folder:
        results = folder / "tests.xml"
        asked = [f"--junit-xml={results}", "--allowed-skips=.ci/skips", "--durations=40"]
        status = subprocess.run([*command, *asked], check=False).returncode
        # pytest ends with 0 or 1 where it ran every test. A record of a run that was interrupted, or
        # that counted none, would claim that no test failed.
        if status not in (0, 1) or not results.is_file():
            print(
                f"airlight: error: pytest ended with {status} before all tests ran: no record",
                file=sys.stderr,
            )
            return 1
        # The junit file counts what ended in which way, in one element.
        suite = next(ElementTree.parse(results).iter("testsuite"))
    tests, failed, errors, skipped = (
        int(suite.get(key, 0)) for key in ("tests", "failures", "errors", "skipped")
    )
    record = {
        "date": time.strftime("%Y-%m-%d %H:%M:%S %z"),
        "machine": machine_in_words(describe_environment() | {"variant": variant}),
        "compilation": "quick" if quick_compilation.is_asked_for() else "full",
        "commit": made.commit,
        "changed": made.changed,
        "seconds": round(took().seconds),
        "passed": tests - failed - errors - skipped,
        "failed": failed + errors,
        "skipped": skipped,
    }
    write_text(root / RECORD, json.dumps(record, indent=1) + "\n")
    print(f"written: {root / RECORD}")
    return int(status != 0)
