# SPDX-License-Identifier: BSD-3-Clause
"""Claim: any Dask scheduler will do, a worker of another version is refused by name."""

import os
import shutil
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from airlight import __version__
from airlight.errors import InputError
from airlight.reports.cluster.connect import connected, parse_place
from airlight.validation.study.keys import made_here

pytest.importorskip("distributed", reason="the extra `sweep` is not installed")

from airlight.reports.cluster import connect
from airlight.reports.cluster.run import Group, Task, run_groups
from tests.helpers import cluster_tasks as tasks

ROOT = Path(__file__).resolve().parents[3]


def test_places_by_their_words(tmp_path):
    file = tmp_path / "scheduler.json"
    file.write_text("{}")
    assert parse_place("local:3") == 3
    assert parse_place(None) == parse_place("local") >= 1
    assert parse_place("tcp://10.1.2.3:8786") == "tcp://10.1.2.3:8786"
    assert parse_place(str(file)) == str(file)


def test_where_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr(connect, "_PATIENCE", 1.0)
    message = r"no scheduler answers at tcp://127\.0\.0\.1:9 .*start `dask scheduler`"
    with pytest.raises(InputError, match=message), connected("tcp://127.0.0.1:9"):
        pass


def test_a_time_limit_of_the_work_is_not_taken_for_a_scheduler_without_workers(monkeypatch):
    monkeypatch.setattr("distributed.Client", lambda **how: MagicMock())
    with pytest.raises(TimeoutError, match="of the work"), connected("tcp://127.0.0.1:9"):
        raise TimeoutError("of the work")


def _dask(*words, root=ROOT):
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *words],
        # its tests, and its package
        env=os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{root / 'src'}"},
        cwd=root,  # which stands first among the places of modules
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _kill(process):
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def _scheduler(port):
    return _dask("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")


def _worker(address, root=ROOT):
    return _dask("worker", address, "--nthreads", "1", "--no-dashboard", root=root)


@contextmanager
def _ended(*processes):
    running = list(processes)
    try:
        yield running
    finally:
        for process in running:
            _kill(process)


def other_version(tmp_path):
    """Return a copy of the package whose code has one more statement: comments do
    not make another version.
    """
    other = tmp_path / "other"
    for name in ("analytic", "realtime", "reference", "validation", "reports", "tests"):
        shutil.copytree(
            ROOT / name, other / name, ignore=shutil.ignore_patterns("__pycache__", "data")
        )
    shutil.copytree(ROOT / "src" / "airlight", other / "src" / "airlight", symlinks=True)
    changed = other / "realtime" / "scene" / "read_scene.py"
    changed.write_text(changed.read_text() + "\nOTHER_VERSION = True\n")
    return other


@pytest.mark.slow
@pytest.mark.claim("workers-of-one-version", tolerance="none")
def test_a_worker_of_another_version_that_joins_a_run_is_refused_by_name(
    tmp_path, monkeypatch, variant
):
    monkeypatch.setattr(connect, "_PATIENCE", 120.0)  # of a busy machine
    port = _free_port()
    address = f"tcp://127.0.0.1:{port}"
    made = made_here(__version__, variant)
    with _ended(_scheduler(port), _worker(address)) as running, connected(address) as cluster:
        running.append(_worker(address, other_version(tmp_path)))
        groups = (Group((Task(f"{g}", tasks.square, (g, 0.3)),)) for g in range(1000))
        said = r"worker tcp://127.* has source code \w{12}, not \w{12}: install the same airlight there"
        with pytest.raises(InputError, match=said):
            list(run_groups(cluster, groups, made=made))


@pytest.mark.slow
def test_a_script_without_a_guard_is_told_what_it_lacks(tmp_path):
    """Each process imports the script again, which would start processes for ever."""
    script = tmp_path / "script.py"
    script.write_text("import airlight\nairlight.sweep(1, cluster='local:1', output='rows')\n")
    ran = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert ran.returncode == 1
    assert 'put what it does under `if __name__ == "__main__":`' in ran.stderr.splitlines()[-1]
