# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures shared by all tests."""

import gc
import math
import os
import re
import signal
from pathlib import Path

import pytest

from tests.helpers.clock import Clock

# A process that a shell starts in the background ignores Ctrl-C, and so would the
# commands that tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Child processes run functions of tests too, and find `tests` from here.
_ROOT = Path(__file__).resolve().parents[1]
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(_ROOT), os.environ.get("PYTHONPATH")]))


def pytest_addoption(parser):
    words = "a file of regular expressions: a skip for any other reason fails the run"
    parser.addoption("--allowed-skips", type=Path, help=words)


@pytest.hookimpl(trylast=True)  # what pytest found comes first
def pytest_sessionfinish(session):
    """Fail a run in which a test was skipped for a reason that is not allowed."""
    allowed, reporter = (
        session.config.option.allowed_skips,
        session.config.pluginmanager.get_plugin("terminalreporter"),
    )
    if allowed is None or reporter is None:  # a worker: the process that started it sees all skips
        return
    lines = allowed.read_text(encoding="utf-8").splitlines()
    reasons = [line for line in lines if line and not line.startswith("#")]
    for skip in reporter.stats.get("skipped", []):
        why = skip.longrepr[2]
        if not any(re.search(reason, why) for reason in reasons):
            reporter.write_line(f"not allowed by {allowed}: {skip.nodeid}: {why}", red=True)
            session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of certified values."""
    from airlight.validation.certified.files import FOLDER

    return FOLDER


@pytest.fixture(scope="session")
def variant() -> str:
    """The best Mitsuba variant that works on this machine, made current."""
    from airlight.reports.machine.environment import LEAST_THREADS, activate

    chosen = activate()
    # Workers have a core each: more threads would wait for one another.
    # `tests/realtime/frame/test_threads.py` has all.
    if "PYTEST_XDIST_WORKER_COUNT" in os.environ:
        import drjit as dr

        cores = len(os.sched_getaffinity(0)) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        dr.set_thread_count(max(LEAST_THREADS, cores))
    # Imported modules stay: `_nothing_left_behind` need not look through them after every module.
    gc.collect()
    gc.freeze()
    return chosen


@pytest.fixture(autouse=True)
def _no_lines_of_progress(monkeypatch):
    """Print no lines of progress: how many there are depends on how busy the machine is."""
    from airlight.reports.machine import progress

    monkeypatch.setattr(progress, "_PATIENCE", math.inf)


@pytest.fixture(autouse=True)
def _shared_cache(tmp_path_factory, monkeypatch):
    """Keep the tests away from the user's cache, and let them share one of their own,
    with all workers of the run.
    """
    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(folder / "airlight-cache"))


@pytest.fixture
def own_cache(monkeypatch, tmp_path) -> Path:
    """An empty cache that this test shares with no other; where its folder will be."""
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def clock(variant, monkeypatch) -> Clock:
    """The clock of all times in this process, which goes on only where a test says so."""
    clock = Clock()
    monkeypatch.setattr("airlight.analytic.clock.time", clock)
    return clock


@pytest.fixture(autouse=True, scope="module")
def _nothing_left_behind():
    """Free the scenes of a module before the next one: Dr.Jit's virtual calls go over
    all objects that are alive.
    """
    yield
    gc.collect()
